//! Which lanes lead through a junction: those that the map says turn, those that branch off or meet
//! with another one, and those whose middle crosses that of another.

use super::course::Course;
use super::places::Places;
use crate::world::Lane;

/// Two middles cross if they come this near, in metres: points on them lie a metre apart.
const CROSSING_M: f64 = 1.0;
/// Points at the ends of a lane that may lie near any other.
const ENDS: usize = 2;

/// The lanes with their junctions marked.
pub(super) fn marked(mut lanes: Vec<Lane>, courses: &[Course<'_>], middles: &Places) -> Vec<Lane> {
    let branches = branches(&lanes);
    let is_junction = |lane: usize| {
        let tags = &courses[lane].lanelet.tags;
        tags.contains_key("turn_direction")
            || branches[lane]
            || crosses(lane, &lanes, courses, middles)
    };
    let marks: Vec<bool> = (0..lanes.len()).map(is_junction).collect();
    for (lane, mark) in lanes.iter_mut().zip(marks) {
        lane.is_junction = mark;
    }
    lanes
}

/// Whether another lane begins or ends where each lane does.
fn branches(lanes: &[Lane]) -> Vec<bool> {
    let mut before = vec![0; lanes.len()];
    for &next in lanes.iter().flat_map(|lane| &lane.next) {
        before[next] += 1;
    }
    let mut branches = vec![false; lanes.len()];
    for (index, lane) in lanes.iter().enumerate() {
        for &next in &lane.next {
            branches[next] |= lane.next.len() > 1;
            branches[index] |= before[next] > 1;
        }
    }
    branches
}

fn crosses(index: usize, lanes: &[Lane], courses: &[Course<'_>], middles: &Places) -> bool {
    let lane = &lanes[index];
    let is_other = |other: usize| {
        let is_joined = lane.next.contains(&other) || lanes[other].next.contains(&index);
        let is_beside = lane.left == Some(other) || lane.right == Some(other);
        let is_same = std::ptr::eq(courses[other].lanelet, courses[index].lanelet);
        !(is_joined || is_beside || is_same)
    };
    let inner = ENDS..lane.centre.len().saturating_sub(ENDS);
    let mut points = lane.centre.get(inner).unwrap_or_default().iter();
    points.any(|&[east_m, north_m, _]| {
        let mut near = middles.near([east_m, north_m], CROSSING_M);
        near.any(|spot| is_other(spot.lane))
    })
}
