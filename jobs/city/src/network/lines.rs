//! The lines of a road, cut into ways, and its kerbs.

use tilefold_schemas::element::{Color, ElementKind, Marking};

use super::plan::Road;
use super::section::{Heading, KERB_M, STOP_M};
use super::{Painter, Style, on_ground};
use crate::relief::Relief;
use crate::world::Point;

/// Length of a way and distance between its vertices, in metres.
const WAY_M: f64 = 80.0;
const VERTEX_M: f64 = 4.0;
/// Shorter pieces of line are not painted, in metres.
const LEAST_M: f64 = 15.0;
/// Length before a stop line on which lanes may not be changed: the dividers are solid, in metres.
const NO_CHANGE_M: f64 = 35.0;

const DASHED: Style = Style {
    marking: Marking::Dashed,
    color: Color::White,
};
const SOLID: Style = Style {
    marking: Marking::Solid,
    color: Color::White,
};

/// Paints all lines along a road, from its middle outwards.
pub(super) fn paint(road: &Road, painter: &mut Painter<'_>) {
    let section = &road.section;
    let span = section.painted(road.curve.length_m);
    ways(road, span, &|_| 0.0, section.middle, painter);
    for heading in Heading::BOTH {
        let lanes = section.side(heading).lanes;
        for lane in 1..lanes {
            let span = match lane + 1 == lanes {
                true => section.outer_divider(heading, road.curve.length_m),
                false => span,
            };
            let left_m = heading.sign() * lane as f64 * section.lane_width_m;
            divider(road, heading, span, left_m, painter);
        }
        let edge = |station_m| section.edge_m(heading, station_m);
        ways(road, span, &edge, section.edge, painter);
    }
}

/// A line between two lanes of a side: dashed, and solid before a stop line.
fn divider(
    road: &Road,
    heading: Heading,
    (from_m, to_m): (f64, f64),
    left_m: f64,
    painter: &mut Painter<'_>,
) {
    let offset = |_| left_m;
    let stop = road.section.has_stop[heading.exit()];
    let length_m = road.curve.length_m;
    let (dashed, solid) = match heading {
        _ if !stop => ((from_m, to_m), None),
        Heading::Along => {
            let cut_m = (length_m - STOP_M - NO_CHANGE_M).clamp(from_m, to_m);
            ((from_m, cut_m), Some((cut_m, to_m)))
        }
        Heading::Against => {
            let cut_m = (STOP_M + NO_CHANGE_M).clamp(from_m, to_m);
            ((cut_m, to_m), Some((from_m, cut_m)))
        }
    };
    ways(road, dashed, &offset, DASHED, painter);
    if let Some(solid) = solid {
        ways(road, solid, &offset, SOLID, painter);
    }
}

/// A line from one station to another, cut into ways.
fn ways(
    road: &Road,
    (from_m, to_m): (f64, f64),
    offset_m: &dyn Fn(f64) -> f64,
    style: Style,
    painter: &mut Painter<'_>,
) {
    let length_m = to_m - from_m;
    if length_m < LEAST_M {
        return;
    }
    let count = (length_m / WAY_M).round().max(1.0);
    for way in 0..count as usize {
        let cut = |way: usize| from_m + length_m * way as f64 / count;
        let points = trace(road, (cut(way), cut(way + 1)), offset_m);
        let phase_m = cut(way) - from_m;
        painter.line(ElementKind::LaneMarking, style, &points, phase_m);
    }
}

fn trace(road: &Road, (from_m, to_m): (f64, f64), offset_m: &dyn Fn(f64) -> f64) -> Vec<[f64; 2]> {
    let steps = ((to_m - from_m) / VERTEX_M).ceil().max(1.0) as usize;
    let station = |step: usize| from_m + (to_m - from_m) * step as f64 / steps as f64;
    let point = |step| road.point(station(step), offset_m(station(step)));
    (0..=steps).map(point).collect()
}

/// The two borders of a road's surface.
pub(super) fn kerbs(road: &Road, relief: &Relief) -> [Vec<Point>; 2] {
    Heading::BOTH.map(|heading| {
        let edge = |station_m| road.section.edge_m(heading, station_m) + heading.sign() * KERB_M;
        on_ground(relief, &trace(road, (0.0, road.curve.length_m), &edge))
    })
}
