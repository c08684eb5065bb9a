//! What a lane detector on the vehicle sees of the paint, in the vehicle frame: with noise that
//! lasts, misses that grow with the distance to the side, lines hidden for a while, gaps in which
//! nothing is seen, and lines where there are none.

use std::collections::BTreeMap;

use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_schemas::log::Detection;

use crate::curve::Place;
use crate::random::Random;
use crate::road::{Line, Street};

/// Metres ahead within which paint is seen, and to either side.
const NEAR_M: f64 = 4.0;
const FAR_M: f64 = 12.0;
const SIDE_M: f64 = 6.0;
/// Distance between the points of a detection, and the fewest that make one.
const POINT_EVERY_M: f64 = 1.0;
const LEAST_POINTS: usize = 3;
/// Probability to miss a line ahead, and what is added to it at [`SIDE_M`] (growing as the square).
const MISS: f64 = 0.04;
const MISS_AT_SIDE: f64 = 0.35;
/// Probability per frame that a line is hidden by traffic, and for how many frames.
const HIDDEN: f64 = 0.004;
const HIDDEN_FRAMES: (f64, f64) = (5.0, 25.0);
/// Probability per frame that nothing at all is seen, and for how many frames.
const BLIND: f64 = 0.001;
const BLIND_FRAMES: (f64, f64) = (10.0, 30.0);
/// Lateral noise of a line ahead and at [`SIDE_M`], in metres, and how much of it stays from one
/// frame to the next.
const NOISE_M: (f64, f64) = (0.05, 0.15);
const NOISE_KEPT: f64 = 0.8;
/// Noise of a line's direction, in radians, and of each of its points, in metres.
const SLOPE_RAD: f64 = 0.004;
const POINT_M: f64 = 0.02;
/// Probabilities that the marking is mistaken, or not recognised.
const MISTAKEN: f64 = 0.05;
const UNRECOGNISED: f64 = 0.1;
/// Probability per frame of a line where there is none.
const CLUTTER: f64 = 0.015;
/// Points are given in steps of 1/1024 m.
const STEPS_PER_M: f64 = 1024.0;

/// What is remembered of a line from frame to frame.
#[derive(Default)]
struct Memory {
    /// Lateral noise, in units of its spread.
    noise: f64,
    hidden_frames: u32,
}

/// The detector of one drive.
pub(crate) struct Detector<'a> {
    street: &'a Street,
    random: Random,
    /// By road and line.
    memories: BTreeMap<(usize, usize), Memory>,
    blind_frames: u32,
}

impl<'a> Detector<'a> {
    pub(crate) fn new(street: &'a Street, random: Random) -> Self {
        Self {
            street,
            random,
            memories: BTreeMap::new(),
            blind_frames: 0,
        }
    }

    /// What is seen from `place`, which is at a station of the street; from right to left, clutter
    /// last.
    pub(crate) fn look(&mut self, place: &Place, station_m: f64) -> Vec<Detection> {
        let mut detections = Vec::new();
        let blind = self.is_blind();
        for (road_index, road) in self.street.roads.iter().enumerate() {
            let from_m = road.from_m.max(station_m);
            let to_m = road.to_m.min(station_m + FAR_M + 2.0);
            if from_m >= to_m {
                continue;
            }
            for (line_index, line) in road.lines.iter().enumerate() {
                let points = visible(self.street, place, line, from_m, to_m);
                let seen = self.see((road_index, line_index), line, points);
                detections.extend(seen.filter(|_| !blind));
            }
        }
        if !blind && self.random.chance(CLUTTER) {
            detections.push(self.clutter());
        }
        detections
    }

    fn is_blind(&mut self) -> bool {
        if self.blind_frames == 0 && self.random.chance(BLIND) {
            self.blind_frames = self.random.between(BLIND_FRAMES.0, BLIND_FRAMES.1) as u32;
        }
        self.blind_frames = self.blind_frames.saturating_sub(1);
        self.blind_frames > 0
    }

    fn see(
        &mut self,
        key: (usize, usize),
        line: &Line,
        points: Vec<[f64; 2]>,
    ) -> Option<Detection> {
        if points.len() < LEAST_POINTS {
            return None;
        }
        let middle_m = points[points.len() / 2][1];
        let aside = (middle_m.abs() / SIDE_M).min(1.0);
        let random = &mut self.random;
        let memory = self.memories.entry(key).or_default();
        memory.noise =
            NOISE_KEPT * memory.noise + random.normal((1.0 - NOISE_KEPT * NOISE_KEPT).sqrt());
        if random.chance(HIDDEN) {
            memory.hidden_frames = random.between(HIDDEN_FRAMES.0, HIDDEN_FRAMES.1) as u32;
        }
        memory.hidden_frames = memory.hidden_frames.saturating_sub(1);
        let missed = random.chance(MISS + MISS_AT_SIDE * aside * aside);
        let noise_m = memory.noise * (NOISE_M.0 + (NOISE_M.1 - NOISE_M.0) * aside);
        let slope = random.normal(SLOPE_RAD);
        let far_m = random.between(0.75, 1.0) * FAR_M;
        let marking = read_marking(line.marking, random);
        let score = 0.95 - 0.3 * aside - random.between(0.0, 0.1);
        if missed || memory.hidden_frames > 0 {
            return None;
        }
        let noisy = points.into_iter().filter(|[x_m, _]| *x_m <= far_m);
        let noisy = noisy.map(|[x_m, y_m]| {
            let y_m = y_m + noise_m + slope * (x_m - NEAR_M) + random.normal(POINT_M);
            [x_m, y_m]
        });
        let points: Vec<[f64; 2]> = noisy.collect();
        (points.len() >= LEAST_POINTS).then(|| detection(&points, marking, line.color, score))
    }

    /// A line where there is none: a seam, a shadow, a wet track.
    fn clutter(&mut self) -> Detection {
        let random = &mut self.random;
        let begin_m = random.between(NEAR_M, FAR_M - 4.0);
        let aside_m = random.between(-SIDE_M, SIDE_M) * 0.9;
        let slope = random.normal(0.05);
        let points: Vec<[f64; 2]> = (0..4)
            .map(|step| f64::from(step) * POINT_EVERY_M)
            .map(|along_m| [begin_m + along_m, aside_m + slope * along_m])
            .collect();
        let score = random.between(0.3, 0.7);
        detection(&points, Marking::Unknown, Color::Unknown, score)
    }
}

/// The points of a line between two stations that lie before the vehicle, in its frame.
fn visible(street: &Street, place: &Place, line: &Line, from_m: f64, to_m: f64) -> Vec<[f64; 2]> {
    let steps = ((to_m - from_m) / POINT_EVERY_M) as u32;
    (0..=steps)
        .map(|step| from_m + POINT_EVERY_M * f64::from(step))
        .map(|station_m| place.see(street.curve.point(station_m, line.offset_m)))
        .filter(|[x_m, y_m]| (NEAR_M..=FAR_M).contains(x_m) && y_m.abs() <= SIDE_M)
        .collect()
}

fn read_marking(marking: Marking, random: &mut Random) -> Marking {
    let lot = random.unit();
    if lot < UNRECOGNISED {
        return Marking::Unknown;
    }
    if lot < UNRECOGNISED + MISTAKEN {
        return match marking {
            Marking::Dashed => Marking::Solid,
            _ => Marking::Dashed,
        };
    }
    marking
}

fn detection(points: &[[f64; 2]], marking: Marking, color: Color, score: f64) -> Detection {
    let stepped = |metres: f64| (metres * STEPS_PER_M).round() / STEPS_PER_M;
    Detection {
        kind: ElementKind::LaneMarking,
        marking,
        color,
        sign: SignClass::Unknown,
        score: (score * 100.0).round() / 100.0,
        points: points
            .iter()
            .map(|&[x_m, y_m]| [stepped(x_m), stepped(y_m), 0.0])
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::CitySpec;

    #[test]
    fn lines_are_seen_where_they_are_and_less_to_the_side() {
        let street = Street::draw(&CitySpec::default());
        let road = &street.roads[0];
        let offset_m = road.lane_offset_m(0);
        let mut detector = Detector::new(&street, Random::new(1, "detector", 0));
        let mut seen = BTreeMap::new();
        for step in 0..4_000 {
            let station_m = road.from_m + 0.1 * f64::from(step);
            let middle = street.curve.at(station_m);
            let [east_m, north_m] = middle.left(offset_m);
            let place = Place {
                east_m,
                north_m,
                ..middle
            };
            for detection in detector.look(&place, station_m) {
                // Where the street was straight, its lines lie where the lanes say.
                let nearest = detection.points[0];
                let line = road
                    .lines
                    .iter()
                    .position(|line| (line.offset_m - offset_m - nearest[1]).abs() < 0.6);
                *seen.entry(line).or_insert(0) += 1;
            }
        }
        let share = |line: usize| f64::from(seen[&Some(line)]) / 4_000.0;
        assert!((0.85..0.97).contains(&share(0)), "{seen:?}");
        assert!((0.85..0.97).contains(&share(1)), "{seen:?}");
        assert!((0.5..0.85).contains(&share(2)), "{seen:?}");
        assert!(
            seen.get(&None).is_none_or(|&clutter| clutter < 100),
            "{seen:?}"
        );
    }
}
