//! Lines where there is no paint: kerbs and shadows taken for lines, traces of old paint, and what
//! flickers up for a frame.

use std::collections::BTreeMap;

use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_schemas::log::Detection;

use super::look::Look;
use super::{Seen, Sight, rounded};
use crate::course::Course;
use crate::noise::DetectorNoise;
use crate::random::Random;
use crate::world::Point;

/// Length of a shadow's edge, and how far aside of the vehicle's way it lies, in metres.
const SHADOW_M: (f64, f64) = (8.0, 30.0);
const ASIDE_M: f64 = 6.0;
/// Direction of a shadow against the road, in radians.
const SHADOW_TURN_RAD: f64 = 0.06;
/// Length of what flickers up, in metres.
const CLUTTER_M: (f64, f64) = (4.0, 9.0);
/// Keys of memories: kerbs and shadows come behind all paint.
const KERBS: usize = 1 << 40;
const SHADOWS: usize = 1 << 41;

/// What one drive's detector sees that is not there.
pub(super) struct Phantoms {
    random: Random,
    /// Lines in the city's plane, by where they begin along the way.
    shadows: Vec<(f64, Vec<Point>)>,
    /// Whether something that is no paint is taken for it in this pass, by its key.
    taken: BTreeMap<usize, bool>,
}

impl Phantoms {
    pub(super) fn draw(noise: &DetectorNoise, course: &Course, mut random: Random) -> Self {
        let count = noise.shadows_per_km * course.length_m() / 1_000.0;
        let mut shadows: Vec<(f64, Vec<Point>)> = (0..count.round() as usize)
            .map(|_| shadow(course, &mut random))
            .collect();
        shadows.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self {
            random,
            shadows,
            taken: BTreeMap::new(),
        }
    }

    /// Whether something is taken for paint in this pass, as happens with this probability.
    pub(super) fn haunts(&mut self, key: usize, probability: f64) -> bool {
        let random = &mut self.random;
        let taken = self.taken.entry(key);
        *taken.or_insert_with(|| random.chance(probability))
    }

    /// Kerbs and shadows that are taken for lines, from a station of the way.
    pub(super) fn lines(
        &mut self,
        look: &Look<'_>,
        kerbs: &[(usize, &[Point])],
        (station_m, noise): (f64, &DetectorNoise),
    ) -> Vec<Sight> {
        let mut sights = Vec::new();
        for &(kerb, points) in kerbs {
            if self.haunts(KERBS + kerb, noise.kerb) {
                sights.extend(phantom(KERBS + kerb, look.line(points)));
            }
        }
        let from = station_m - SHADOW_M.1;
        let first = self.shadows.partition_point(|(at_m, _)| *at_m < from);
        let ahead = self.shadows[first..].iter().enumerate();
        let ahead = ahead.take_while(|(_, (at_m, _))| *at_m < station_m + noise.far_m);
        for (number, (_, points)) in ahead {
            sights.extend(phantom(SHADOWS + first + number, look.line(points)));
        }
        sights
    }

    /// A line that flickers up for one frame.
    pub(super) fn clutter(&mut self, noise: &DetectorNoise, period_s: f64) -> Option<Seen> {
        let random = &mut self.random;
        if !random.chance(noise.clutter_per_s * period_s) {
            return None;
        }
        let length_m = random.between(CLUTTER_M.0, CLUTTER_M.1);
        let from_m = random.between(noise.near_m, noise.near_m + 8.0);
        let left_m = random.between(-ASIDE_M, ASIDE_M);
        let slope = random.normal(0.05);
        let points = [0.0, 0.5, 1.0].map(|share| {
            let along_m = share * length_m;
            [from_m + along_m, left_m + slope * along_m]
        });
        let detection = Detection {
            kind: ElementKind::LaneMarking,
            marking: Marking::Unknown,
            color: Color::White,
            sign: SignClass::Unknown,
            score: 0.5,
            points: rounded(&points),
        };
        Some(Seen {
            detection,
            element: None,
        })
    }
}

fn phantom(key: usize, points: Option<Vec<[f64; 2]>>) -> Option<Sight> {
    points.map(|points| Sight {
        key,
        element: None,
        kind: ElementKind::LaneMarking,
        marking: Marking::Solid,
        color: Color::White,
        sign: SignClass::Unknown,
        wear: 0.0,
        points,
    })
}

/// A line beside the vehicle's way that is there for this pass only.
fn shadow(course: &Course, random: &mut Random) -> (f64, Vec<Point>) {
    let station_m = random.between(0.0, course.length_m());
    let left_m = random.between(-ASIDE_M, ASIDE_M);
    let length_m = random.between(SHADOW_M.0, SHADOW_M.1);
    let turn = random.normal(SHADOW_TURN_RAD);
    let up_m = course.point(station_m)[2];
    let place = course.place(station_m);
    let points = [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| {
        let along_m = share * length_m;
        let [east_m, north_m] = place.point(along_m, left_m + turn * along_m);
        [east_m, north_m, up_m]
    });
    (station_m, points.to_vec())
}
