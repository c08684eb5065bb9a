//! Ground signs: arrows before stop lines, and what else is painted on lanes.

use tilefold_schemas::element::SignClass;

use super::Painter;
use super::junction::{Turn, lanes_at, turns};
use super::plan::{Plan, Road};
use super::section::{Heading, STOP_M};
use crate::random::Random;

/// From the lines' end to the front of each arrow, in metres.
const ARROWS_M: [f64; 2] = [8.0, 42.0];
/// Length and width of signs, in metres.
const ARROW_M: [f64; 2] = [5.0, 1.2];
const DIAMOND_M: [f64; 2] = [2.5, 1.2];
const SPEED_LIMIT_M: [f64; 2] = [2.4, 1.4];
const BUS_M: [f64; 2] = [4.0, 2.0];
const CYCLE_M: [f64; 2] = [2.2, 1.2];
const SLOW_M: [f64; 2] = [2.5, 2.0];
/// From a road's begin to the signs that greet those who enter it, in metres.
const GREETING_M: f64 = 45.0;
/// From the lines' end to the diamond that warns of a crosswalk, in metres.
const DIAMOND_AT_M: f64 = 60.0;
/// The shortest side that gets signs, in metres.
const LEAST_M: f64 = 150.0;

/// Paints the signs of a road.
pub(super) fn paint(plan: &Plan, road: &Road, random: &mut Random, painter: &mut Painter<'_>) {
    if road.curve.length_m < LEAST_M {
        return;
    }
    for heading in Heading::BOTH {
        let exit = heading.exit();
        if road.section.has_stop[exit] {
            arrows(plan, road, heading, painter);
        }
        if road.section.has_crosswalk[exit] {
            for lane in 0..lanes_at(road, heading, end_m(road, heading)) {
                sign(
                    road,
                    heading,
                    lane,
                    DIAMOND_AT_M,
                    SignClass::Diamond,
                    painter,
                );
            }
        }
        greetings(road, heading, random, painter);
    }
}

fn arrows(plan: &Plan, road: &Road, heading: Heading, painter: &mut Painter<'_>) {
    let (node, arm) = road.ends[heading.exit()];
    let lanes = lanes_at(road, heading, end_m(road, heading));
    for lane in 0..lanes {
        let Some(class) = arrow(&turns(&plan.nodes[node], arm, lane, lanes)) else {
            continue;
        };
        for before_m in ARROWS_M {
            sign(road, heading, lane, before_m, class, painter);
        }
    }
}

/// The arrow for a set of turns (in the order left, straight, right), if there is one.
fn arrow(turns: &[Turn]) -> Option<SignClass> {
    match turns {
        [Turn::Straight] => Some(SignClass::StraightArrow),
        [Turn::Left] => Some(SignClass::LeftArrow),
        [Turn::Right] => Some(SignClass::RightArrow),
        [Turn::Left, Turn::Straight] => Some(SignClass::StraightLeftArrow),
        [Turn::Straight, Turn::Right] => Some(SignClass::StraightRightArrow),
        _ => None,
    }
}

/// Signs on the first metres of a road.
fn greetings(road: &Road, heading: Heading, random: &mut Random, painter: &mut Painter<'_>) {
    let before_m = road.curve.length_m - STOP_M - GREETING_M;
    let outer = lanes_at(road, heading, begin_m(road, heading)) - 1;
    let lot = random.unit();
    let class = match lot {
        lot if lot < 0.15 => SignClass::SpeedLimit,
        lot if lot < 0.25 => SignClass::BusLane,
        lot if lot < 0.35 => SignClass::CycleLane,
        lot if lot < 0.45 => SignClass::Slow,
        _ => return,
    };
    sign(road, heading, outer, before_m, class, painter);
}

fn begin_m(road: &Road, heading: Heading) -> f64 {
    road.curve.length_m - end_m(road, heading)
}

/// The station at which a side's traffic leaves the road.
fn end_m(road: &Road, heading: Heading) -> f64 {
    match heading {
        Heading::Along => road.curve.length_m,
        Heading::Against => 0.0,
    }
}

/// A sign in the middle of a lane whose front is `before_m` before the lines' end.
fn sign(
    road: &Road,
    heading: Heading,
    lane: usize,
    before_m: f64,
    class: SignClass,
    painter: &mut Painter<'_>,
) {
    let [length_m, width_m] = size_m(class);
    let along = -heading.sign();
    let front_m = end_m(road, heading) - along * (STOP_M + before_m);
    let rear_m = front_m - along * length_m;
    let middle_m = road.section.lane_m(heading, lane, (front_m + rear_m) / 2.0);
    let right_m = middle_m - along * width_m / 2.0;
    let left_m = middle_m + along * width_m / 2.0;
    let corners = [
        road.point(rear_m, right_m),
        road.point(front_m, right_m),
        road.point(front_m, left_m),
        road.point(rear_m, left_m),
    ];
    painter.sign(class, &corners);
}

/// Length and width of a sign.
fn size_m(class: SignClass) -> [f64; 2] {
    match class {
        SignClass::Diamond => DIAMOND_M,
        SignClass::SpeedLimit => SPEED_LIMIT_M,
        SignClass::BusLane => BUS_M,
        SignClass::CycleLane => CYCLE_M,
        SignClass::Slow => SLOW_M,
        _ => ARROW_M,
    }
}
