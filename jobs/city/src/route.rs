//! Which way a vehicle takes through the city: lanes followed and changed by lot, as one smooth
//! path. Where ways part, it takes those that it drove along least often, and of these one that
//! leads as far as it wants to go.

use std::collections::BTreeMap;

use crate::random::Random;
use crate::reach::Reach;
use crate::world::{Lane, Point, World};

/// Distance between the points of a path, in metres.
pub(crate) const STEP_M: f64 = 1.0;
/// Chance to change the lane where there is a neighbour, and where on the lane (share of it).
const CHANGE: f64 = 0.3;
const CHANGE_AT: (f64, f64) = (0.15, 0.4);
/// Length of a lane change, and of the shortest lane on which one is made, in metres.
const CHANGE_M: f64 = 60.0;
const LEAST_M: f64 = 140.0;
/// Where no way is as long as is wanted, routes begin where at least so much lies ahead, in metres.
const LEAST_ENTRY_M: f64 = 60.0;
/// Points to either side over which a path is smoothed.
const SMOOTH: usize = 5;

/// A point of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Step {
    pub(crate) point: Point,
    /// The most that is driven here, in metres per second.
    pub(crate) speed_m_s: f64,
    /// The lane.
    pub(crate) lane: usize,
    /// Whether a junction begins at this point: where one may have to wait.
    pub(crate) is_mouth: bool,
}

/// The routes of one drive: what it has seen less often it drives along first.
pub(crate) struct Routes<'a> {
    world: &'a World,
    reach: &'a Reach,
    /// How often lanes were driven along.
    driven: BTreeMap<usize, u32>,
}

impl<'a> Routes<'a> {
    pub(crate) fn new(world: &'a World, reach: &'a Reach) -> Self {
        Self {
            world,
            reach,
            driven: BTreeMap::new(),
        }
    }

    /// A path of about `length_m`, from the begin of a lane drawn by lot; shorter where the map ends.
    pub(crate) fn draw(&mut self, length_m: f64, random: &mut Random) -> Vec<Step> {
        let starts = self.least_driven(&self.reach.starts(length_m, LEAST_ENTRY_M));
        let mut steps = Vec::new();
        let mut lane = starts.get(random.index(starts.len())).copied();
        while let Some(here) = lane {
            let last = self.follow(here, random, &mut steps);
            let left_m = length_m - steps.len() as f64 * STEP_M;
            lane = match left_m > 0.0 {
                true => self.turn(last, left_m, random),
                false => None,
            };
        }
        smooth(&mut steps);
        steps
    }

    /// The lane that a vehicle turns into, with `left_m` to go: one that leads so far, if any does.
    fn turn(&self, lane: usize, left_m: f64, random: &mut Random) -> Option<usize> {
        let mut ways = self.least_driven(&self.world.lanes[lane].next);
        if ways.iter().any(|&way| self.reach.ahead_m(way) >= left_m) {
            ways.retain(|&way| self.reach.ahead_m(way) >= left_m);
            return ways.get(random.index(ways.len())).copied();
        }
        // The farther a way leads, the more of those that could be driven are driven along it.
        let total_m: f64 = ways.iter().map(|&way| self.reach.ahead_m(way)).sum();
        let mut lot_m = random.unit() * total_m;
        let chosen = ways.iter().find(|&&way| {
            lot_m -= self.reach.ahead_m(way);
            lot_m < 0.0
        });
        chosen.or(ways.last()).copied()
    }

    /// Those of some lanes that this drive came along least often.
    fn least_driven(&self, lanes: &[usize]) -> Vec<usize> {
        let times = |lane: &usize| self.driven.get(lane).copied().unwrap_or(0);
        let least = lanes.iter().map(times).min();
        let is_least = |lane: &usize| Some(times(lane)) == least;
        lanes.iter().copied().filter(is_least).collect()
    }

    /// Drives along a lane, or over into its neighbour; returns the lane that the vehicle ends in.
    fn follow(&mut self, lane: usize, random: &mut Random, steps: &mut Vec<Step>) -> usize {
        let here = &self.world.lanes[lane];
        let path = resampled(here);
        let length_m = path.len() as f64 * STEP_M;
        let neighbours: Vec<usize> = here.left.into_iter().chain(here.right).collect();
        let (lot, at) = (random.unit(), random.between(CHANGE_AT.0, CHANGE_AT.1));
        let side = random.index(neighbours.len());
        let changes = lot < CHANGE && length_m > LEAST_M && !neighbours.is_empty();
        let target = changes.then(|| neighbours[side]);
        let beside = target.map(|target| resampled(&self.world.lanes[target]));
        let from = (at * path.len() as f64) as usize;
        for (index, &point) in path.iter().enumerate() {
            let over = ((index as f64 - from as f64) * STEP_M / CHANGE_M).clamp(0.0, 1.0);
            let over = over * over * (3.0 - 2.0 * over);
            let point = match &beside {
                Some(beside) if over > 0.0 => {
                    let other = beside[(index * beside.len() / path.len()).min(beside.len() - 1)];
                    [0, 1, 2].map(|axis| point[axis] + over * (other[axis] - point[axis]))
                }
                _ => point,
            };
            steps.push(Step {
                point,
                speed_m_s: here.speed_m_s,
                lane: if over > 0.5 {
                    target.unwrap_or(lane)
                } else {
                    lane
                },
                is_mouth: here.is_junction && index == 0,
            });
        }
        let last = target.unwrap_or(lane);
        *self.driven.entry(last).or_default() += 1;
        last
    }
}

/// The middle of a lane at every step, without its last point: the next lane begins there.
fn resampled(lane: &Lane) -> Vec<Point> {
    let mut path = Vec::new();
    let mut left_m = 0.0;
    for pair in lane.centre.windows(2) {
        let (east, north) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let length_m = east.hypot(north);
        while left_m < length_m {
            let share = left_m / length_m;
            path.push(
                [0, 1, 2].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis])),
            );
            left_m += STEP_M;
        }
        left_m -= length_m;
    }
    if path.is_empty() {
        path.extend(lane.centre.first());
    }
    path
}

/// A running mean rounds the corners that lanes leave.
fn smooth(steps: &mut [Step]) {
    for _ in 0..2 {
        let points: Vec<Point> = steps.iter().map(|step| step.point).collect();
        for (index, step) in steps.iter_mut().enumerate() {
            // As wide to either side as there are points: the ends stay where they are.
            let reach = SMOOTH.min(index).min(points.len() - 1 - index);
            let window = &points[index - reach..=index + reach];
            let mean = |axis: usize| {
                window.iter().map(|point| point[axis]).sum::<f64>() / window.len() as f64
            };
            step.point = [mean(0), mean(1), mean(2)];
        }
    }
}
