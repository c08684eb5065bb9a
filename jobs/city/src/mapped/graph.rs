//! Lanes and how they join: behind each other where both borders go on, beside each other where they
//! share a border.

use std::collections::HashMap;

use tilefold_formats::map::{Border, Lanelet};

use super::course::{Course, distance_m};
use super::ground::Ground;
use super::places::{Places, Spot};
use crate::error::CityError;
use crate::world::Lane;

/// How far the ends of two borders may lie apart where one lanelet goes on in another. Maps whose
/// lanelets share nodes need none; this is for those that were drawn piece by piece.
const GAP_M: f64 = 0.3;
/// Speeds where the map says none, in metres per second: what German law allows.
const HIGHWAY_M_S: f64 = 130.0 / 3.6;
const RURAL_M_S: f64 = 100.0 / 3.6;
const URBAN_M_S: f64 = 50.0 / 3.6;
const WALKING_M_S: f64 = 7.0 / 3.6;

/// One lane per course, in the same order. Junctions are not marked yet.
pub(super) fn lanes(courses: &[Course<'_>], ground: &Ground) -> Result<Vec<Lane>, CityError> {
    let mut begins = Places::default();
    for (lane, course) in courses.iter().enumerate() {
        let spot = Spot {
            lane,
            point: 0,
            at: course.middle[0],
        };
        begins.insert(spot)?;
    }
    let by_left = by_border(courses, |course| &course.left);
    let by_right = by_border(courses, |course| &course.right);
    let lane = |(index, course): (usize, &Course<'_>)| Lane {
        centre: course
            .middle
            .iter()
            .map(|&place| ground.lay(place))
            .collect(),
        width_m: course.width_m,
        speed_m_s: speed_m_s(course.lanelet),
        next: next(index, courses, &begins),
        left: beside(&course.left, &by_right, |way| {
            way.crossing.map(|c| c.to_left)
        }),
        right: beside(&course.right, &by_left, |way| {
            way.crossing.map(|c| c.to_right)
        }),
        is_junction: false,
    };
    Ok(courses.iter().enumerate().map(lane).collect())
}

fn next(index: usize, courses: &[Course<'_>], begins: &Places) -> Vec<usize> {
    let course = &courses[index];
    let end = course.middle.last().copied().unwrap_or_default();
    let goes_on = |spot: &&Spot| {
        let other = &courses[spot.lane];
        let ends = course.end.iter().zip(&other.begin);
        // To turn on the spot is no way on.
        !std::ptr::eq(course.lanelet, other.lanelet)
            && ends
                .into_iter()
                .all(|(&end, &begin)| distance_m(end, begin) <= GAP_M)
    };
    let mut next: Vec<usize> = begins
        .near(end, GAP_M)
        .filter(goes_on)
        .map(|s| s.lane)
        .collect();
    next.sort_unstable();
    next
}

/// The ways of a border, each with its direction.
type Key = Vec<(i64, bool)>;

fn key(border: &Border) -> Key {
    border
        .ways
        .iter()
        .map(|way| (way.id, way.is_reversed))
        .collect()
}

/// The first course on each border.
fn by_border<'a>(
    courses: &'a [Course<'_>],
    of: impl Fn(&'a Course<'_>) -> &'a Border,
) -> HashMap<Key, usize> {
    let mut found = HashMap::new();
    for (index, course) in courses.iter().enumerate() {
        found.entry(key(of(course))).or_insert(index);
    }
    found
}

/// The lane on the other side of a border, if the border may be crossed all along, or the map does
/// not say whether it may.
fn beside(
    border: &Border,
    others: &HashMap<Key, usize>,
    may_cross: impl Fn(&tilefold_formats::map::BorderWay) -> Option<bool>,
) -> Option<usize> {
    let is_open = border.ways.iter().all(|way| may_cross(way).unwrap_or(true));
    others.get(&key(border)).copied().filter(|_| is_open)
}

fn speed_m_s(lanelet: &Lanelet) -> f64 {
    let location = lanelet.tags.get("location").map_or("", String::as_str);
    let usual_m_s = match (lanelet.subtype.as_str(), location) {
        ("highway", _) => HIGHWAY_M_S,
        ("play_street", _) => WALKING_M_S,
        (_, "nonurban") => RURAL_M_S,
        _ => URBAN_M_S,
    };
    lanelet.speed_limit_m_s.unwrap_or(usual_m_s)
}
