//! The surveyed map: the lines of every road, cut into ways of about 80 metres.

use tilefold_formats::map_write::lanelet2_tags;
use tilefold_schemas::element::{Element, ElementKind, SignClass};
use tilefold_schemas::id::ElementId;
use tilefold_tiler::geodesy::LocalFrame;

use crate::road::{Line, Road, Street};

/// Length of a way and distance between its vertices, in metres.
const WAY_M: f64 = 80.0;
const VERTEX_M: f64 = 5.0;
/// The id of the first way.
pub(crate) const FIRST_WAY: i64 = 1_000;

/// A stretch of one line: what becomes a way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    pub(crate) line: Line,
    pub(crate) from_m: f64,
    pub(crate) to_m: f64,
}

/// The stations at which the lines of a road are cut; a short rest stays with the last way.
pub(crate) fn cuts(road: &Road) -> Vec<f64> {
    let ways = ((road.to_m - road.from_m) / WAY_M).round().max(1.0) as u32;
    let mut cuts: Vec<f64> = (0..ways)
        .map(|way| road.from_m + WAY_M * f64::from(way))
        .collect();
    cuts.push(road.to_m);
    cuts
}

/// The true map: every piece of every line, numbered along the street and from right to left.
pub(crate) fn pieces(street: &Street) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for road in &street.roads {
        for cut in cuts(road).windows(2) {
            let stretch = road.lines.iter().map(|&line| Piece {
                line,
                from_m: cut[0],
                to_m: cut[1],
            });
            pieces.extend(stretch);
        }
    }
    pieces
}

/// Lays pieces on the earth.
pub(crate) struct Survey<'a> {
    pub(crate) street: &'a Street,
    pub(crate) frame: LocalFrame,
}

impl Survey<'_> {
    /// The element of a piece.
    pub(crate) fn element(&self, id: i64, piece: &Piece) -> Element {
        let Line { marking, color, .. } = piece.line;
        let kind = ElementKind::LaneMarking;
        Element {
            id: ElementId(id),
            kind,
            marking,
            color,
            sign: SignClass::Unknown,
            points: self.points(piece),
            tags: lanelet2_tags(kind, marking, color),
        }
    }

    /// A point of the plane on WGS 84. The city lies at one height: the plane leaves the ellipsoid
    /// by 8 cm at a kilometre, which is dropped.
    pub(crate) fn on_earth(&self, [east_m, north_m]: [f64; 2]) -> [f64; 3] {
        let [longitude_deg, latitude_deg, _] = self.frame.to_wgs84([east_m, north_m, 0.0]);
        [longitude_deg, latitude_deg, self.frame.anchor()[2]]
    }

    fn points(&self, piece: &Piece) -> Vec<[f64; 3]> {
        let length_m = piece.to_m - piece.from_m;
        let steps = (length_m / VERTEX_M).round().max(1.0) as u32;
        let stations =
            (0..=steps).map(|step| piece.from_m + length_m * f64::from(step) / f64::from(steps));
        stations
            .map(|station_m| self.on_earth(self.street.curve.point(station_m, piece.line.offset_m)))
            .collect()
    }
}
