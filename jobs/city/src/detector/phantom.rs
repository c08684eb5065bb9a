//! Lines where there is no paint: kerbs and shadows taken for lines, second lines beside painted
//! ones, traces of old paint, what flickers up for a frame, and what a bad vehicle makes up.
//!
//! What can be taken for a line belongs to a lane, so that passes can be wrong alike: each lane has
//! its false lines, and each pass sees some of them.

use std::collections::BTreeMap;

use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_schemas::log::Detection;

use super::look::Look;
use super::{Part, Piece, Seen, Sight, rounded};
use crate::city::City;
use crate::course::Course;
use crate::curve::Place;
use crate::noise::{Clutter, DetectorNoise};
use crate::random::Random;
use crate::world::{Lane, Point};

/// How far from its lane's middle a false line lies, in metres.
const ASIDE_M: f64 = 6.0;
/// From a lane's border to the kerb, in metres.
const KERB_M: f64 = 0.6;
/// Direction of a shadow against the road, in radians.
const SHADOW_TURN_RAD: f64 = 0.05;
/// Direction of what flickers, in radians.
const FLICKER_TURN_RAD: f64 = 0.05;
/// Where what flickers begins, metres ahead of the nearest that is seen.
const FLICKER_AHEAD_M: f64 = 8.0;
/// Length of the lines that a bad vehicle makes up, in metres.
const MADE_UP_M: f64 = 12.0;
/// Least probability to see what another pass saw.
const LEAST_SHARED: f64 = 0.05;
/// Distance of a false line's points, in metres.
const POINT_M: f64 = 3.0;
/// Keys of memories: false lines come behind all paint.
const FALSE_LINES: usize = 1 << 40;

/// What one drive's detector sees that is not there.
pub(super) struct Phantoms {
    random: Random,
    /// Lines in the city's plane, by the station at which they are passed.
    lines: Vec<(f64, Vec<Point>)>,
    longest_m: f64,
    /// Whether old paint is still seen in this pass, by its key.
    haunted: BTreeMap<usize, bool>,
}

impl Phantoms {
    pub(super) fn draw(
        city: &City<'_>,
        noise: &DetectorNoise,
        course: &Course,
        mut random: Random,
    ) -> Self {
        let mut lines = Vec::new();
        for (lane, station_m) in course.lanes() {
            let mut of_lane = Random::new(city.spec.seed, "false lines", lane as u32);
            for (at_m, line) in false_lines(&city.world.lanes[lane], &noise.clutter, &mut of_lane) {
                if random.chance(noise.clutter.shared.max(LEAST_SHARED)) {
                    lines.push((station_m + at_m, line));
                }
            }
        }
        lines.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self {
            random,
            lines,
            longest_m: noise.clutter.length_m[1],
            haunted: BTreeMap::new(),
        }
    }

    /// Whether something is taken for paint in this pass, as happens with this probability.
    pub(super) fn haunts(&mut self, key: usize, probability: f64) -> bool {
        let random = &mut self.random;
        let haunted = self.haunted.entry(key);
        *haunted.or_insert_with(|| random.chance(probability))
    }

    /// False lines before the camera, from a station of the way.
    pub(super) fn lines(
        &self,
        look: &Look<'_>,
        station_m: f64,
        noise: &DetectorNoise,
    ) -> Vec<Sight> {
        let from = station_m - self.longest_m - ASIDE_M;
        let first = self.lines.partition_point(|(at_m, _)| *at_m < from);
        let ahead = self.lines[first..].iter().enumerate();
        ahead
            .take_while(|(_, (at_m, _))| *at_m < station_m + noise.view.far_m + ASIDE_M)
            .filter_map(|(number, (_, points))| {
                let key = FALSE_LINES + first + number;
                look.line(points).map(|points| sight(key, points))
            })
            .collect()
    }

    /// Lines that are there for one frame, and those that a bad vehicle makes up.
    pub(super) fn flicker(&mut self, noise: &DetectorNoise) -> Vec<Seen> {
        let clutter = &noise.clutter;
        let random = &mut self.random;
        let mut lines = Vec::new();
        for _ in 0..random.count(clutter.flicker_per_frame) {
            let length_m = random.between(clutter.flicker_m[0], clutter.flicker_m[1]);
            let from_m = noise.view.near_m + random.between(0.0, FLICKER_AHEAD_M);
            let left_m = random.between(-ASIDE_M, ASIDE_M);
            let slope = random.normal(FLICKER_TURN_RAD);
            lines.push(straight(from_m, length_m, left_m, slope));
        }
        if random.chance(clutter.phantom) {
            let made_up = clutter.phantom_aside_m.iter();
            lines
                .extend(made_up.map(|&left_m| straight(noise.view.near_m, MADE_UP_M, left_m, 0.0)));
        }
        lines.iter().map(|points| false_line(points)).collect()
    }
}

/// All that can be taken for a line along a lane: how far along it, and where.
fn false_lines(lane: &Lane, clutter: &Clutter, random: &mut Random) -> Vec<(f64, Vec<Point>)> {
    let length_m: f64 = lane
        .centre
        .windows(2)
        .map(|pair| step_m(pair[0], pair[1]))
        .sum();
    // Each pass sees a share of them: there are more of them than a pass sees.
    let per_m = length_m / 1_000.0 / clutter.shared.max(LEAST_SHARED);
    let half_m = lane.width_m / 2.0;
    let mut lines = Vec::new();
    let outermost = if lane.right.is_none() { 1.0 } else { 0.0 };
    for _ in 0..random.count(clutter.kerb_per_km * per_m * outermost) {
        let line = beside_lane(lane, length_m, clutter, -half_m - KERB_M, 0.0, random);
        lines.push(line);
    }
    for _ in 0..random.count(clutter.shadow_per_km * per_m) {
        let (left_m, turn) = (
            random.between(-ASIDE_M, ASIDE_M),
            random.normal(SHADOW_TURN_RAD),
        );
        lines.push(beside_lane(lane, length_m, clutter, left_m, turn, random));
    }
    for _ in 0..random.count(clutter.beside_per_km * per_m) {
        let beside_m = random.sign() * random.between(clutter.beside_m[0], clutter.beside_m[1]);
        let left_m = random.sign() * half_m + beside_m;
        lines.push(beside_lane(lane, length_m, clutter, left_m, 0.0, random));
    }
    lines
}

/// A line along a lane, `left_m` of its middle and turned against it.
fn beside_lane(
    lane: &Lane,
    lane_m: f64,
    clutter: &Clutter,
    left_m: f64,
    turn: f64,
    random: &mut Random,
) -> (f64, Vec<Point>) {
    let begin_m = random.between(0.0, lane_m);
    let length_m = random.between(clutter.length_m[0], clutter.length_m[1]);
    let steps = (length_m / POINT_M).ceil().max(1.0) as usize;
    let points = (0..=steps).map(|step| {
        let along_m = length_m * step as f64 / steps as f64;
        let (place, up_m) = place_on(lane, begin_m + along_m);
        let [east_m, north_m] = place.left(left_m + turn * along_m);
        [east_m, north_m, up_m]
    });
    (begin_m, points.collect())
}

/// A lane's middle at a length along it; beyond its end it goes straight on.
fn place_on(lane: &Lane, along_m: f64) -> (Place, f64) {
    let mut left_m = along_m;
    let mut pairs = lane.centre.windows(2).peekable();
    while let Some(pair) = pairs.next() {
        let length_m = step_m(pair[0], pair[1]);
        if left_m <= length_m || pairs.peek().is_none() {
            let place = Place {
                east_m: pair[0][0],
                north_m: pair[0][1],
                yaw_rad: (pair[1][1] - pair[0][1]).atan2(pair[1][0] - pair[0][0]),
            };
            return (place.ahead(left_m), pair[0][2]);
        }
        left_m -= length_m;
    }
    let [east_m, north_m, up_m] = lane.centre.first().copied().unwrap_or_default();
    let place = Place {
        east_m,
        north_m,
        yaw_rad: 0.0,
    };
    (place, up_m)
}

fn step_m(from: Point, to: Point) -> f64 {
    (to[0] - from[0]).hypot(to[1] - from[1])
}

fn straight(from_m: f64, length_m: f64, left_m: f64, slope: f64) -> [[f64; 2]; 3] {
    [0.0, 0.5, 1.0].map(|share| {
        let along_m = share * length_m;
        [from_m + along_m, left_m + slope * along_m]
    })
}

fn false_line(points: &[[f64; 2]]) -> Seen {
    let detection = Detection {
        kind: ElementKind::LaneMarking,
        marking: Marking::Unknown,
        color: Color::White,
        sign: SignClass::Unknown,
        score: 0.5,
        points: rounded(points),
    };
    Seen {
        detection,
        parts: vec![Part::whole(None)],
    }
}

fn sight(key: usize, points: Vec<[f64; 2]>) -> Sight {
    Sight {
        key,
        pieces: vec![Piece {
            element: None,
            points: points.len(),
        }],
        kind: ElementKind::LaneMarking,
        marking: Marking::Solid,
        color: Color::White,
        sign: SignClass::Unknown,
        wear: 0.0,
        points,
    }
}
