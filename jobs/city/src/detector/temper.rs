//! What is missed, mistaken and wavers: the moods of a detector, kept from frame to frame.

use std::collections::BTreeMap;

use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_schemas::log::Detection;

use super::{Seen, Sight, rounded};
use crate::noise::DetectorNoise;
use crate::random::Random;

/// The markings that are mistaken for each other.
const MARKINGS: [Marking; 3] = [Marking::Solid, Marking::Dashed, Marking::SolidSolid];
const ARROWS: [SignClass; 5] = [
    SignClass::StraightArrow,
    SignClass::LeftArrow,
    SignClass::RightArrow,
    SignClass::StraightLeftArrow,
    SignClass::StraightRightArrow,
];
/// A line is remembered for this many frames after it was last before the camera.
const FORGET_FRAMES: u64 = 100;

/// What is remembered of a line in one pass.
struct Memory {
    /// Lateral noise, in units of its spread.
    waver: f64,
    /// How well this line is seen in this pass: a probability.
    is_seen: f64,
    hidden_s: f64,
    /// What it is taken for throughout this pass; none: read anew in each frame.
    last_frame: u64,
}

/// The moods of one drive's detector.
pub(super) struct Temper {
    noise: DetectorNoise,
    random: Random,
    memories: BTreeMap<usize, Memory>,
    blind_s: f64,
    frame: u64,
}

impl Temper {
    pub(super) fn new(noise: &DetectorNoise, random: Random) -> Self {
        Self {
            noise: noise.clone(),
            random,
            memories: BTreeMap::new(),
            blind_s: 0.0,
            frame: 0,
        }
    }

    /// Whether nothing at all is seen in this frame.
    pub(super) fn is_blind(&mut self, period_s: f64) -> bool {
        self.frame += 1;
        if self.frame % FORGET_FRAMES == 0 {
            let oldest = self.frame.saturating_sub(FORGET_FRAMES);
            self.memories.retain(|_, memory| memory.last_frame >= oldest);
        }
        if self.random.chance(self.noise.blind_per_s * period_s) {
            self.blind_s = self.random.exponential(self.noise.blind_s);
        }
        self.blind_s -= period_s;
        self.blind_s > 0.0
    }

    /// What is said of a sight whose points are believed to be where `points` are.
    pub(super) fn tell(
        &mut self,
        sight: Sight,
        points: Vec<[f64; 2]>,
        period_s: f64,
    ) -> Option<Seen> {
        match sight.kind {
            ElementKind::LaneMarking => self.tell_line(sight, points, period_s),
            _ => self.tell_sign(sight, points),
        }
    }

    fn tell_line(
        &mut self,
        sight: Sight,
        mut points: Vec<[f64; 2]>,
        period_s: f64,
    ) -> Option<Seen> {
        let noise = &self.noise;
        let random = &mut self.random;
        let middle = points[points.len() / 2];
        let aside = (middle[1].abs() / noise.side_m).min(1.0);
        let memory = self.memories.entry(sight.key).or_insert_with(|| Memory {
            waver: random.normal(1.0),
            is_seen: random.beta((1.0 - noise.miss) * (1.0 - sight.wear), noise.concentration),
            hidden_s: 0.0,
            last_frame: 0,
        });
        memory.last_frame = self.frame;
        let kept = (-period_s / noise.lateral_kept_s).exp();
        memory.waver = kept * memory.waver + random.normal((1.0 - kept * kept).sqrt());
        if random.chance(noise.hidden_per_s * period_s) {
            memory.hidden_s = random.exponential(noise.hidden_s);
        }
        memory.hidden_s -= period_s;
        let hidden = memory.hidden_s > 0.0;
        let seen = memory.is_seen * (1.0 - noise.miss_at_side * aside * aside);
        let sigma_m = noise.lateral_m + (noise.lateral_at_side_m - noise.lateral_m) * aside;
        let (shift_m, slope) = (memory.waver * sigma_m, random.normal(noise.slope_rad));
        let is_told = random.chance(seen);
        // What is far is lost first.
        let reach_m = noise.far_m * (1.0 - noise.miss_at_far * random.unit());
        points.retain(|point| point[0] <= reach_m.max(noise.near_m + 4.0));
        for point in &mut points {
            let off_m = random.normal(noise.point_m + noise.point_per_m * point[0]);
            point[1] += shift_m + slope * (point[0] - noise.near_m) + off_m;
        }
        if hidden || !is_told || points.len() < 3 {
            return None;
        }
        let (marking, color) = self.read(&sight);
        let detection = Detection {
            kind: ElementKind::LaneMarking,
            marking,
            color,
            sign: SignClass::Unknown,
            score: self.score(seen),
            points: rounded(&points),
        };
        Some(Seen {
            detection,
            element: sight.element,
        })
    }

    /// A frame's reading of marking and colour.
    fn read(&mut self, sight: &Sight) -> (Marking, Color) {
        let lot = self.random.unit();
        let other = MARKINGS[self.random.index(MARKINGS.len())];
        let marking = match lot {
            lot if lot < self.noise.unrecognised => Marking::Unknown,
            lot if lot < self.noise.unrecognised + self.noise.mistaken => other,
            _ => sight.marking,
        };
        let color = match (self.random.chance(self.noise.color_mistaken), sight.color) {
            (true, Color::White) => Color::Yellow,
            (true, _) => Color::White,
            (false, color) => color,
        };
        (marking, color)
    }

    fn tell_sign(&mut self, sight: Sight, mut points: Vec<[f64; 2]>) -> Option<Seen> {
        let noise = &self.noise;
        let random = &mut self.random;
        let is_told = random.chance((1.0 - noise.sign_miss) * (1.0 - sight.wear));
        let range_m = points[0][0].max(1.0);
        let sigma_m = noise.sign_m * (range_m / noise.sign_far_m);
        let off_m = [random.normal(2.0 * sigma_m), random.normal(sigma_m)];
        for point in &mut points {
            point[0] += off_m[0];
            point[1] += off_m[1];
        }
        let other = ARROWS[random.index(ARROWS.len())];
        let is_mistaken = random.chance(noise.sign_mistaken) && ARROWS.contains(&sight.sign);
        let detection = Detection {
            kind: sight.kind,
            marking: Marking::Unknown,
            color: sight.color,
            sign: if is_mistaken { other } else { sight.sign },
            score: self.score(1.0),
            points: rounded(&points),
        };
        is_told.then_some(Seen {
            detection,
            element: sight.element,
        })
    }

    fn score(&mut self, seen: f64) -> f64 {
        let score = 0.5 + 0.5 * seen * self.random.between(0.6, 1.0);
        (score * 256.0).round() / 256.0
    }
}
