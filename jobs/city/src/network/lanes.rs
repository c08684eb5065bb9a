//! The lanes of all roads and through all junctions, joined for driving.
//!
//! Where a side of a road loses or gains a lane, all of its lanes are cut: a lost lane leads into
//! its neighbour behind the cut, a gained one is reached from its neighbour before it.

use super::junction::{lanes_at, turns};
use super::on_ground;
use super::plan::{Plan, Road};
use super::section::{Heading, Taper};
use crate::curve::{Curve, Place};
use crate::relief::Relief;
use crate::world::Lane;

/// Distance between the points of a lane, in metres.
const POINT_M: f64 = 4.0;
/// Speed through a junction, in metres per second.
const TURN_SPEED_M_S: f64 = 7.0;

/// Joins all lanes.
pub(super) fn join(plan: &Plan, relief: &Relief) -> Vec<Lane> {
    let mut joining = Joining {
        relief,
        lanes: Vec::new(),
        mouths: vec![Default::default(); plan.roads.len()],
    };
    for (index, road) in plan.roads.iter().enumerate() {
        for heading in Heading::BOTH {
            joining.side(index, road, heading);
        }
    }
    for node in 0..plan.nodes.len() {
        joining.junction(plan, node);
    }
    joining.lanes
}

/// Lanes of one side, from the inside: where they come in and where they go out.
#[derive(Debug, Clone, Default)]
struct Mouths {
    first: Vec<usize>,
    last: Vec<usize>,
}

struct Joining<'a> {
    relief: &'a Relief,
    lanes: Vec<Lane>,
    /// By road, then by heading.
    mouths: Vec<[Mouths; 2]>,
}

/// A stretch of a side between two cuts, in the direction of travel.
#[derive(Clone, Copy)]
struct Stretch {
    from_m: f64,
    to_m: f64,
    lanes: usize,
}

impl Joining<'_> {
    fn side(&mut self, index: usize, road: &Road, heading: Heading) {
        let stretches = stretches(road, heading);
        let mut mouths = Mouths::default();
        for (order, stretch) in stretches.iter().enumerate() {
            let first = self.lanes.len();
            for lane in 0..stretch.lanes {
                let mut made = self.lane(road, heading, lane, *stretch);
                made.left = lane.checked_sub(1).map(|left| first + left);
                made.right = (lane + 1 < stretch.lanes).then_some(first + lane + 1);
                self.lanes.push(made);
            }
            let here: Vec<usize> = (first..self.lanes.len()).collect();
            if order == 0 {
                mouths.first.clone_from(&here);
            } else {
                self.continue_in(&mouths.last, &here);
            }
            mouths.last = here;
        }
        self.mouths[index][side_index(heading)] = mouths;
    }

    /// Joins the lanes before a cut with those behind it.
    fn continue_in(&mut self, before: &[usize], behind: &[usize]) {
        for lane in 0..before.len().max(behind.len()) {
            let from = before[lane.min(before.len() - 1)];
            let to = behind[lane.min(behind.len() - 1)];
            self.lanes[from].next.push(to);
        }
    }

    fn lane(&self, road: &Road, heading: Heading, lane: usize, stretch: Stretch) -> Lane {
        let Stretch { from_m, to_m, .. } = stretch;
        let steps = ((to_m - from_m).abs() / POINT_M).ceil().max(1.0) as usize;
        let point = |step: usize| {
            let station_m = from_m + (to_m - from_m) * step as f64 / steps as f64;
            road.point(station_m, road.section.lane_m(heading, lane, station_m))
        };
        let points: Vec<[f64; 2]> = (0..=steps).map(point).collect();
        Lane {
            centre: on_ground(self.relief, &points),
            width_m: road.section.lane_width_m,
            speed_m_s: road.section.speed_m_s,
            next: Vec::new(),
            left: None,
            right: None,
            is_junction: false,
        }
    }

    fn junction(&mut self, plan: &Plan, node: usize) {
        let arms = plan.nodes[node].arms;
        for (arm, end) in arms.iter().enumerate() {
            let Some(end) = end else { continue };
            let incoming = side_index(if end.is_begin {
                Heading::Against
            } else {
                Heading::Along
            });
            let lanes = self.mouths[end.road][incoming].last.clone();
            for (lane, &from) in lanes.iter().enumerate() {
                for turn in turns(&plan.nodes[node], arm, lane, lanes.len()) {
                    let Some(exit) = arms[turn.exit(arm)] else {
                        continue;
                    };
                    let outgoing = side_index(if exit.is_begin {
                        Heading::Along
                    } else {
                        Heading::Against
                    });
                    let targets = &self.mouths[exit.road][outgoing].first;
                    let to = targets[turn.lane(lane, targets.len())];
                    self.connect(from, to);
                }
            }
        }
    }

    /// A way through a junction from the end of a lane to the begin of another.
    fn connect(&mut self, from: usize, to: usize) {
        let (begin, end) = (end_of(&self.lanes[from]), begin_of(&self.lanes[to]));
        let curve = Curve::between(begin, end);
        let steps = (curve.length_m / (POINT_M / 2.0)).ceil().max(1.0) as usize;
        let points: Vec<[f64; 2]> = (0..=steps)
            .map(|step| curve.point(curve.length_m * step as f64 / steps as f64, 0.0))
            .collect();
        let is_straight = (begin.yaw_rad - end.yaw_rad).sin().abs() < 0.5;
        let speed_m_s = match is_straight {
            true => self.lanes[from].speed_m_s,
            false => TURN_SPEED_M_S,
        };
        let through = self.lanes.len();
        self.lanes[from].next.push(through);
        self.lanes.push(Lane {
            centre: on_ground(self.relief, &points),
            width_m: self.lanes[from].width_m,
            speed_m_s,
            next: vec![to],
            left: None,
            right: None,
            is_junction: true,
        });
    }
}

fn side_index(heading: Heading) -> usize {
    match heading {
        Heading::Along => 0,
        Heading::Against => 1,
    }
}

/// The stretches of a side between cuts, in the direction of travel.
fn stretches(road: &Road, heading: Heading) -> Vec<Stretch> {
    let length_m = road.curve.length_m;
    let (begin_m, end_m) = match heading {
        Heading::Along => (0.0, length_m),
        Heading::Against => (length_m, 0.0),
    };
    let side = road.section.side(heading);
    let stretch = |from_m, to_m, lanes| Stretch {
        from_m,
        to_m,
        lanes,
    };
    let (near_m, far_m) = match heading {
        Heading::Along => (side.taper_from_m, side.taper_to_m),
        Heading::Against => (side.taper_to_m, side.taper_from_m),
    };
    let (first, last) = (
        lanes_at(road, heading, begin_m),
        lanes_at(road, heading, end_m),
    );
    match side.taper {
        None => vec![stretch(begin_m, end_m, side.lanes)],
        Some(Taper::Drop) => vec![stretch(begin_m, far_m, first), stretch(far_m, end_m, last)],
        Some(Taper::Gain) => vec![
            stretch(begin_m, near_m, first),
            stretch(near_m, end_m, last),
        ],
    }
}

fn begin_of(lane: &Lane) -> Place {
    place(lane.centre[0], lane.centre[0], lane.centre[1])
}

fn end_of(lane: &Lane) -> Place {
    let last = lane.centre.len() - 1;
    place(lane.centre[last], lane.centre[last - 1], lane.centre[last])
}

/// A place at `at` that looks from one point to another.
fn place(at: [f64; 3], from: [f64; 3], to: [f64; 3]) -> Place {
    Place {
        east_m: at[0],
        north_m: at[1],
        yaw_rad: (to[1] - from[1]).atan2(to[0] - from[0]),
    }
}
