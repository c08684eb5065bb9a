//! A way as vertices with stations along it, in metres that agree with the stations of change
//! records to a hundred-thousandth.

/// Where a vertex comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Place {
    /// A node of the map.
    Node(i64),
    /// A position that no node has.
    New([f64; 3]),
}

/// A vertex of a way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Vertex {
    pub(super) place: Place,
    pub(super) point: [f64; 3],
    /// Metres along the way as it was mapped.
    pub(super) station_m: f64,
}

/// A cut this near a vertex goes through the vertex.
const SNAP_M: f64 = 0.2;

/// The vertices of a mapped way.
pub(super) fn vertices(points: &[(i64, [f64; 3])]) -> Vec<Vertex> {
    let mut station_m = 0.0;
    let mut before: Option<[f64; 3]> = None;
    points
        .iter()
        .map(|&(node, point)| {
            station_m += before.map_or(0.0, |before| distance_m(before, point));
            before = Some(point);
            Vertex {
                place: Place::Node(node),
                point,
                station_m,
            }
        })
        .collect()
}

/// The index of the vertex at a station, which is put in if there is none.
pub(super) fn cut(line: &mut Vec<Vertex>, station_m: f64) -> usize {
    let near = |vertex: &Vertex| (vertex.station_m - station_m).abs() <= SNAP_M;
    if let Some(index) = line.iter().position(near) {
        return index;
    }
    let after = line.partition_point(|vertex| vertex.station_m < station_m);
    let (Some(from), Some(to)) = (
        after.checked_sub(1).and_then(|index| line.get(index)),
        line.get(after),
    ) else {
        return after.min(line.len().saturating_sub(1));
    };
    let share = (station_m - from.station_m) / (to.station_m - from.station_m);
    let point =
        [0, 1, 2].map(|axis| from.point[axis] + share * (to.point[axis] - from.point[axis]));
    let vertex = Vertex {
        place: Place::New(point),
        point,
        station_m,
    };
    line.insert(after, vertex);
    after
}

/// Metres between two positions, on the plane that touches the ellipsoid between them.
pub(crate) fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [east_m, north_m] = offset_m(a, b);
    east_m.hypot(north_m)
}

/// Metres to the east and to the north, from `a` to `b`.
pub(crate) fn offset_m(a: [f64; 3], b: [f64; 3]) -> [f64; 2] {
    let [meridian_m, normal_m] = radii_m(a[1].midpoint(b[1]).to_radians());
    let latitude = a[1].midpoint(b[1]).to_radians();
    [
        (b[0] - a[0]).to_radians() * normal_m * latitude.cos(),
        (b[1] - a[1]).to_radians() * meridian_m,
    ]
}

/// Radii of curvature of WGS 84, along the meridian and across it.
fn radii_m(latitude_rad: f64) -> [f64; 2] {
    const SEMI_MAJOR_M: f64 = 6_378_137.0;
    const ECCENTRICITY2: f64 = 6.694_379_990_141_317e-3;
    let w2 = 1.0 - ECCENTRICITY2 * latitude_rad.sin().powi(2);
    let normal_m = SEMI_MAJOR_M / w2.sqrt();
    [normal_m * (1.0 - ECCENTRICITY2) / w2, normal_m]
}
