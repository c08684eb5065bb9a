//! Junctions: who may turn where, and the paint at their mouths.

use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};

use super::plan::{ARMS, Node, Plan, Road};
use super::section::{Heading, STOP_M};
use super::{Painter, Style};
use crate::random::Random;

/// Stations of a crosswalk's near and far side, from the road's end, in metres.
const CROSSWALK_M: (f64, f64) = (4.6, 1.2);
/// From where lines end to the middle of the stop line, in metres.
const STOP_LINE_M: f64 = 0.4;
/// Chance of a box in the middle of a crossing, and half of its side in metres.
const BOX: f64 = 0.1;
const BOX_M: f64 = 7.0;

const WHITE: Style = Style {
    marking: Marking::Unknown,
    color: Color::White,
};

/// A way through a junction, as the driver sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Turn {
    Left,
    Straight,
    Right,
}

impl Turn {
    const ALL: [Self; 3] = [Self::Left, Self::Straight, Self::Right];

    /// The arm that is left by, for who comes in by `arm`; arms count counter-clockwise.
    pub(super) fn exit(self, arm: usize) -> usize {
        let quarters = match self {
            Self::Right => 1,
            Self::Straight => 2,
            Self::Left => 3,
        };
        (arm + quarters) % ARMS
    }

    /// The lane to end in, of `lanes`: turns keep to their side.
    pub(super) fn lane(self, lane: usize, lanes: usize) -> usize {
        match self {
            Self::Left => 0,
            Self::Straight => lane.min(lanes - 1),
            Self::Right => lanes - 1,
        }
    }
}

/// The turns allowed from a lane (counted from the inside) of `lanes` that comes in by `arm`.
pub(super) fn turns(node: &Node, arm: usize, lane: usize, lanes: usize) -> Vec<Turn> {
    let is_open = |turn: &Turn| node.arms[turn.exit(arm)].is_some();
    let is_allowed = |turn: &Turn| match turn {
        Turn::Left => lane == 0,
        Turn::Right => lane + 1 == lanes,
        Turn::Straight => lanes < 3 || lane > 0,
    };
    let open = || Turn::ALL.into_iter().filter(is_open);
    let allowed: Vec<Turn> = open().filter(is_allowed).collect();
    if !allowed.is_empty() {
        return allowed;
    }
    // A middle lane where one cannot go straight.
    open().take(1).collect()
}

/// Lanes of a side where its traffic leaves or enters the road.
pub(super) fn lanes_at(road: &Road, heading: Heading, station_m: f64) -> usize {
    let lanes = road.section.side(heading).lanes;
    let is_gone = road.section.outer_share(heading, station_m) < 0.5;
    lanes - usize::from(is_gone)
}

/// Paints what lies at the mouths and in the middle of a junction.
pub(super) fn paint(plan: &Plan, node: &Node, random: &mut Random, painter: &mut Painter<'_>) {
    for arm in node.arms.iter().flatten() {
        let road = &plan.roads[arm.road];
        let end = usize::from(!arm.is_begin);
        if road.section.has_stop[end] {
            stop_line(road, end, painter);
        }
        if road.section.has_crosswalk[end] {
            crosswalk(road, end, painter);
        }
    }
    if node.degree() == ARMS && random.chance(BOX) {
        let corner = |forward: f64, left: f64| node.place.point(forward * BOX_M, left * BOX_M);
        let corners = [
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ];
        painter.sign(SignClass::BoxJunction, &corners);
    }
}

/// The station that is `before_m` before a road's end (1) or behind its begin (0).
fn station_m(road: &Road, end: usize, before_m: f64) -> f64 {
    match end {
        0 => before_m,
        _ => road.curve.length_m - before_m,
    }
}

/// Across the lanes that lead into the junction, from the driver's right to the left.
fn stop_line(road: &Road, end: usize, painter: &mut Painter<'_>) {
    let heading = match end {
        0 => Heading::Against,
        _ => Heading::Along,
    };
    let station_m = station_m(road, end, STOP_M - STOP_LINE_M);
    let edge_m = road.section.edge_m(heading, station_m);
    let points = [
        road.point(station_m, edge_m),
        road.point(station_m, heading.sign() * 0.2),
    ];
    painter.line(ElementKind::StopLine, WHITE, &points, 0.0);
}

fn crosswalk(road: &Road, end: usize, painter: &mut Painter<'_>) {
    let mut stations =
        [CROSSWALK_M.0, CROSSWALK_M.1].map(|before_m| station_m(road, end, before_m));
    stations.sort_by(f64::total_cmp);
    let [rear_m, front_m] = stations;
    let right_m = road.section.edge_m(Heading::Along, rear_m);
    let left_m = road.section.edge_m(Heading::Against, rear_m);
    let corners = [
        road.point(rear_m, right_m),
        road.point(front_m, right_m),
        road.point(front_m, left_m),
        road.point(rear_m, left_m),
    ];
    painter.line(ElementKind::Crosswalk, WHITE, &corners, 0.0);
}
