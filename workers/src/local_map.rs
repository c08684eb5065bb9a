//! The base map around one chunk, in the chunk's plane.

use std::f64::consts::TAU;

use rstar::{AABB, Envelope, RTree, RTreeObject};
use tilefold_schemas::ElementKind;
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::{MapIndex, MappedElement};
use tilefold_tiler::station::Polyline;

use crate::cuts::CutLine;
use crate::profile::{Profile, profiles};

/// Mean radius of the earth in metres; only for how far to look in degrees.
const EARTH_RADIUS_M: f64 = 6_371_000.0;

/// The index is asked for this much more to all sides, in metres, so that its answer serves the
/// frames that follow.
const ROUND_M: f64 = 10.0;

/// A linear element in the plane of the chunk.
#[derive(Debug)]
pub struct LocalLine<'a> {
    /// The element.
    pub mapped: &'a MappedElement,
    /// Its line; stations as the element itself counts them.
    pub line: Polyline,
}

/// A stretch of a line between two vertices, as the spatial index keeps it.
#[derive(Debug, Clone, Copy)]
struct Segment {
    line: usize,
    from: [f64; 2],
    to: [f64; 2],
    from_station_m: f64,
}

impl RTreeObject for Segment {
    type Envelope = AABB<[f64; 2]>;

    fn envelope(&self) -> Self::Envelope {
        AABB::from_corners(self.from, self.to)
    }
}

/// Lines around a chunk with a spatial index over their segments.
#[derive(Debug)]
pub struct LocalMap<'a> {
    /// Lane markings near the trajectory, by element id.
    pub lines: Vec<LocalLine<'a>>,
    segments: RTree<Segment>,
}

/// A segment near a place, in the plane of the chunk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearSegment {
    /// Index into [`LocalMap::lines`].
    pub line: usize,
    /// First end, metres.
    pub from: [f64; 2],
    /// Second end, metres.
    pub to: [f64; 2],
    /// Station of the first end.
    pub from_station_m: f64,
}

impl<'a> LocalMap<'a> {
    /// The profiles of cuts of its lines.
    #[must_use]
    pub fn profiles(&self, cuts: &[CutLine]) -> Vec<Profile> {
        profiles(cuts, |line| self.lines[line].mapped.element.marking)
    }

    /// The lane markings whose bounding box comes within `reach_m` of the box of `places` (east,
    /// north in `frame`).
    #[must_use]
    pub fn around(
        map: &'a MapIndex,
        frame: &LocalFrame,
        places: impl Iterator<Item = [f64; 2]>,
        reach_m: f64,
    ) -> Self {
        let (low, high) = degrees_around(frame, places, reach_m);
        let lines: Vec<LocalLine<'a>> = map
            .within(low, high)
            .into_iter()
            .filter(|mapped| mapped.element.kind == ElementKind::LaneMarking)
            .filter_map(|mapped| {
                // Elevation stays out: the road is worked on as a plane, and poses have none.
                let points = mapped.element.points.iter();
                let plane = points.map(|&[lon, lat, _]| frame.to_enu([lon, lat, 0.0]));
                let line = Polyline::new(plane).ok()?;
                Some(LocalLine { mapped, line })
            })
            .collect();
        let segments = lines
            .iter()
            .enumerate()
            .flat_map(|(index, local)| segments(index, &local.line))
            .collect();
        Self {
            lines,
            segments: RTree::bulk_load(segments),
        }
    }

    /// Finds the segments whose bounding box meets the given one, ordered by line and station.
    pub fn segments_within(&self, low: [f64; 2], high: [f64; 2], near: &mut Near) {
        let asked = AABB::from_corners(low, high);
        if !near.around.contains_envelope(&asked) {
            near.around = AABB::from_corners(
                low.map(|metres| metres - ROUND_M),
                high.map(|metres| metres + ROUND_M),
            );
            self.gather(near);
        }
        near.found.clear();
        let found = near.gathered.iter().filter(|segment| {
            let envelope = AABB::from_corners(segment.from, segment.to);
            asked.intersects(&envelope)
        });
        near.found.extend(found);
    }

    fn gather(&self, near: &mut Near) {
        near.gathered.clear();
        near.gathered.extend(
            self.segments
                .locate_in_envelope_intersecting(near.around)
                .map(|segment| NearSegment {
                    line: segment.line,
                    from: segment.from,
                    to: segment.to,
                    from_station_m: segment.from_station_m,
                }),
        );
        near.gathered.sort_unstable_by(|a, b| {
            (a.line.cmp(&b.line)).then(a.from_station_m.total_cmp(&b.from_station_m))
        });
    }
}

/// Segments that were found, and those around them: the next frame asks for nearly the same, so
/// the index is asked once for many frames. For one map.
#[derive(Debug)]
pub struct Near {
    around: AABB<[f64; 2]>,
    gathered: Vec<NearSegment>,
    found: Vec<NearSegment>,
}

impl Default for Near {
    fn default() -> Self {
        Self {
            around: AABB::new_empty(),
            gathered: Vec::new(),
            found: Vec::new(),
        }
    }
}

impl Near {
    /// What was last asked for.
    #[must_use]
    pub fn found(&self) -> &[NearSegment] {
        &self.found
    }
}

fn segments(line: usize, polyline: &Polyline) -> impl Iterator<Item = Segment> + '_ {
    let stations = polyline.stations_m();
    let pairs = polyline.points().windows(2).zip(stations);
    pairs.map(move |(pair, &from_station_m)| Segment {
        line,
        from: [pair[0][0], pair[0][1]],
        to: [pair[1][0], pair[1][1]],
        from_station_m,
    })
}

/// South-west and north-east corner, in degrees, of what is within `reach_m` of `places`.
pub(crate) fn degrees_around(
    frame: &LocalFrame,
    places: impl Iterator<Item = [f64; 2]>,
    reach_m: f64,
) -> ([f64; 2], [f64; 2]) {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for [east_m, north_m] in places {
        let [longitude_deg, latitude_deg, _] = frame.to_wgs84([east_m, north_m, 0.0]);
        low = [low[0].min(longitude_deg), low[1].min(latitude_deg)];
        high = [high[0].max(longitude_deg), high[1].max(latitude_deg)];
    }
    let reach_lat_deg = reach_m / (EARTH_RADIUS_M * TAU / 360.0);
    let shrink = high[1].abs().max(low[1].abs()).to_radians().cos().max(0.01);
    let reach_lon_deg = reach_lat_deg / shrink;
    (
        [low[0] - reach_lon_deg, low[1] - reach_lat_deg],
        [high[0] + reach_lon_deg, high[1] + reach_lat_deg],
    )
}
