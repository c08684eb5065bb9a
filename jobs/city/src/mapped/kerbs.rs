//! Where the road surface ends: the borders that the map says are its edge, and the parts of those
//! that it says nothing of which no other lane covers.

use std::collections::HashMap;

use tilefold_formats::map::{Border, BorderKind};

use super::course::{Course, distance_m, line, resampled, steps};
use super::ground::Ground;
use super::places::{CELL_M, Places};
use crate::world::{Lane, Point};

/// How far inside another lane a border lies at least that is not the road's edge, in metres.
const INSIDE_M: f64 = 0.3;
/// Fewest points of an edge: shorter ones are gaps between lanes that meet askew.
const LEAST_POINTS: usize = 4;

/// The edges of the road surface, on the ground.
pub(super) fn kerbs(
    courses: &[Course<'_>],
    ground: &Ground,
    lanes: &[Lane],
    middles: &Places,
) -> Vec<Vec<Point>> {
    let ahead = || courses.iter().filter(|course| !course.is_reversed);
    let mut uses = HashMap::<Vec<i64>, usize>::new();
    for border in ahead().flat_map(|course| [&course.left, &course.right]) {
        *uses.entry(ways(border)).or_default() += 1;
    }
    let mut kerbs = Vec::new();
    for course in ahead() {
        for border in [&course.left, &course.right] {
            // Taken with the first of the lanelets that share it.
            let Some(uses) = uses.remove(&ways(border)) else {
                continue;
            };
            let line = line(border, ground);
            if border.ways.iter().all(|way| way.kind == BorderKind::Edge) {
                kerbs.push(line);
            } else if uses == 1
                && border
                    .ways
                    .iter()
                    .all(|way| way.kind != BorderKind::Virtual)
            {
                let is_covered = |place| is_covered(place, course, courses, lanes, middles);
                kerbs.extend(bare(&line, is_covered));
            }
        }
    }
    let lay = |line: Vec<[f64; 2]>| line.into_iter().map(|place| ground.lay(place)).collect();
    kerbs.into_iter().map(lay).collect()
}

/// The ways of a border, whichever way it runs.
fn ways(border: &Border) -> Vec<i64> {
    let mut ids: Vec<i64> = border.ways.iter().map(|way| way.id).collect();
    ids.sort_unstable();
    ids
}

/// The stretches of a line that are not covered.
fn bare(line: &[[f64; 2]], is_covered: impl Fn([f64; 2]) -> bool) -> Vec<Vec<[f64; 2]>> {
    let points = resampled(line, steps([line, line]));
    points
        .split(|&place| is_covered(place))
        .filter(|stretch| stretch.len() >= LEAST_POINTS)
        .map(<[_]>::to_vec)
        .collect()
}

/// Whether a place lies within a lane of another lanelet.
fn is_covered(
    place: [f64; 2],
    course: &Course<'_>,
    courses: &[Course<'_>],
    lanes: &[Lane],
    middles: &Places,
) -> bool {
    middles.near(place, CELL_M).any(|spot| {
        let is_other = !std::ptr::eq(courses[spot.lane].lanelet, course.lanelet);
        let reach_m = lanes[spot.lane].width_m / 2.0 - INSIDE_M;
        is_other && distance_m(spot.at, place) < reach_m
    })
}
