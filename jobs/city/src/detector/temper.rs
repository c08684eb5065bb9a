//! What is missed, mistaken and wavers: the moods of a detector, kept from frame to frame.

use std::collections::BTreeMap;

use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_schemas::log::Detection;

use super::{LEAST_POINTS, Part, Piece, Seen, Sight, rounded};
use crate::noise::DetectorNoise;
use crate::random::Random;

/// The markings, signs and colours that are mistaken for each other.
const MARKINGS: [Marking; 3] = [Marking::Solid, Marking::Dashed, Marking::SolidSolid];
const ARROWS: [SignClass; 5] = [
    SignClass::StraightArrow,
    SignClass::LeftArrow,
    SignClass::RightArrow,
    SignClass::StraightLeftArrow,
    SignClass::StraightRightArrow,
];
/// A line is forgotten that was not before the camera for this many frames: a new pass begins.
const FORGET_FRAMES: u64 = 100;

/// What is remembered of a thing in one pass.
struct Memory {
    /// Lateral noise and direction, in units of their spread; and what stays for the pass.
    waver: f64,
    turn: f64,
    stays: f64,
    /// A quantile of how well this pass sees the thing, 0 to 1.
    luck: f64,
    is_missed: bool,
    hidden_m: f64,
    /// What the pass took it for at first.
    first: Reading,
    last_frame: u64,
}

/// What something is taken for.
#[derive(Clone, Copy)]
struct Reading {
    marking: Marking,
    color: Color,
    sign: SignClass,
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
        if self.frame.is_multiple_of(FORGET_FRAMES) {
            let oldest = self.frame.saturating_sub(FORGET_FRAMES);
            self.memories
                .retain(|_, memory| memory.last_frame >= oldest);
        }
        let view = &self.noise.view;
        if self.random.chance(view.blind_per_minute * period_s / 60.0) {
            self.blind_s = self
                .random
                .between(view.blind_seconds[0], view.blind_seconds[1]);
        }
        self.blind_s -= period_s;
        self.blind_s > 0.0
    }

    /// What is said of a sight whose points are believed to be where `points` are.
    pub(super) fn tell(
        &mut self,
        sight: &Sight,
        mut points: Vec<[f64; 2]>,
        period_s: f64,
        driven_m: f64,
    ) -> Option<Seen> {
        let aside_m = points.get(points.len() / 2)?[1].abs();
        self.remember(sight, aside_m);
        let is_told = self.is_told(sight, aside_m, period_s, driven_m);
        let mut owners = sight.owners();
        match sight.kind {
            ElementKind::LaneMarking => {
                self.waver(sight.key, (&mut points, &mut owners), aside_m, period_s);
            }
            _ => self.displace(&mut points),
        }
        let reading = self.read(sight);
        if !is_told || points.len() < LEAST_POINTS.min(sight.points.len()) {
            return None;
        }
        let detection = Detection {
            kind: sight.kind,
            marking: reading.marking,
            color: reading.color,
            sign: reading.sign,
            score: self.score(),
            points: rounded(&points),
        };
        let ahead_m: Vec<f64> = points.iter().map(|point| point[0]).collect();
        let parts = match sight.pieces[..] {
            [Piece { element, .. }] => vec![Part::whole(element)],
            _ => sight.parts(&owners, &ahead_m),
        };
        Some(Seen { detection, parts })
    }

    /// A pass begins with what it draws for its whole length.
    fn remember(&mut self, sight: &Sight, aside_m: f64) {
        let frame = self.frame;
        if let Some(memory) = self.memories.get_mut(&sight.key) {
            memory.last_frame = frame;
            return;
        }
        let first = self.read_anew(sight);
        let random = &mut self.random;
        let mean = miss(&self.noise, sight, aside_m);
        let memory = Memory {
            waver: random.normal(1.0),
            turn: random.normal(1.0),
            stays: random.normal(1.0),
            // How much more or less often than in the mean this pass misses it.
            luck: random.beta(mean, self.noise.miss.concentration) - mean,
            is_missed: false,
            hidden_m: 0.0,
            first,
            last_frame: frame,
        };
        self.memories.insert(sight.key, memory);
    }

    fn is_told(&mut self, sight: &Sight, aside_m: f64, period_s: f64, driven_m: f64) -> bool {
        let noise = &self.noise.miss;
        let mean = miss(&self.noise, sight, aside_m);
        let random = &mut self.random;
        let Some(memory) = self.memories.get_mut(&sight.key) else {
            return false;
        };
        if random.chance(noise.hidden_per_km * driven_m / 1_000.0) {
            memory.hidden_m = random.between(noise.hidden_m[0], noise.hidden_m[1]);
        }
        memory.hidden_m -= driven_m;
        // A miss lasts: it is drawn anew only now and then.
        let kept = (-period_s / noise.seconds.max(1e-3)).exp();
        if !random.chance(kept) {
            memory.is_missed = random.chance((mean + memory.luck).clamp(0.0, 1.0));
        }
        !memory.is_missed && memory.hidden_m <= 0.0
    }

    /// A line is given aside of where it is, turned, and only a stretch of it.
    fn waver(
        &mut self,
        key: usize,
        (points, owners): (&mut Vec<[f64; 2]>, &mut Vec<usize>),
        aside_m: f64,
        period_s: f64,
    ) {
        let (view, lateral) = (&self.noise.view, &self.noise.lateral);
        let random = &mut self.random;
        let Some(memory) = self.memories.get_mut(&key) else {
            return;
        };
        let kept = (-period_s / lateral.seconds).exp();
        let fresh = (1.0 - kept * kept).sqrt();
        memory.waver = kept * memory.waver + random.normal(fresh);
        memory.turn = kept * memory.turn + random.normal(fresh);
        let aside = (aside_m / view.side_m).min(1.0);
        let between = |ahead: f64, at_side: f64| ahead + aside * (at_side - ahead);
        let shift_m = memory.waver * between(lateral.ahead_m, lateral.aside_m)
            + memory.stays * between(lateral.pass_ahead_m, lateral.pass_aside_m);
        let slope = memory.turn * lateral.slope_deg.to_radians();
        let reach = random.unit();
        let is_told: Vec<bool> = (points.iter())
            .map(|[x_m, _]| view.reach.at(*x_m) >= reach)
            .collect();
        let mut told = is_told.iter();
        owners.retain(|_| told.next() == Some(&true));
        let mut told = is_told.iter();
        points.retain(|_| told.next() == Some(&true));
        let middle_m = points.get(points.len() / 2).map_or(0.0, |point| point[0]);
        let ranging = memory.waver * lateral.per_metre;
        for [x_m, y_m] in points {
            *y_m += shift_m + slope * (*x_m - middle_m) + ranging * *x_m;
            *y_m += random.normal(lateral.point_m);
        }
    }

    /// A sign is given beside its place, and turned.
    fn displace(&mut self, points: &mut [[f64; 2]]) {
        let (areas, random) = (&self.noise.areas, &mut self.random);
        let (dx_m, dy_m) = (random.normal(areas.along_m), random.normal(areas.across_m));
        let (sin, cos) = random.normal(areas.yaw_deg.to_radians()).sin_cos();
        let count = points.len() as f64;
        let mean = |axis: usize| points.iter().map(|point| point[axis]).sum::<f64>() / count;
        let [x_m, y_m] = [mean(0), mean(1)];
        for point in points {
            let [ahead_m, left_m] = [point[0] - x_m, point[1] - y_m];
            *point = [
                x_m + dx_m + ahead_m * cos - left_m * sin,
                y_m + dy_m + ahead_m * sin + left_m * cos,
            ];
        }
    }

    /// What a frame takes a thing for: at times what the pass took it for at first.
    fn read(&mut self, sight: &Sight) -> Reading {
        let anew = self.read_anew(sight);
        let is_kept = self.random.chance(self.noise.reading.kept);
        match self.memories.get(&sight.key) {
            Some(memory) if is_kept => memory.first,
            _ => anew,
        }
    }

    fn read_anew(&mut self, sight: &Sight) -> Reading {
        let reading = &self.noise.reading;
        let random = &mut self.random;
        let mut lot = |unknown: f64, mistaken: f64| {
            let (lot, other) = (random.unit(), random.unit());
            match lot {
                lot if lot < unknown => Taken::Unknown,
                lot if lot < unknown + mistaken => Taken::Other(other),
                _ => Taken::AsIs,
            }
        };
        let marking = lot(reading.marking_unknown, reading.marking_mistaken);
        let color = lot(reading.color_unknown, reading.color_mistaken);
        let sign = lot(reading.sign_unknown, reading.sign_mistaken);
        Reading {
            marking: match sight.kind {
                ElementKind::LaneMarking => marking.of(sight.marking, &MARKINGS, Marking::Unknown),
                _ => Marking::Unknown,
            },
            color: color.of(sight.color, &[Color::White, Color::Yellow], Color::Unknown),
            sign: match sight.kind {
                ElementKind::GroundSign => sign.of(sight.sign, &ARROWS, SignClass::Unknown),
                _ => SignClass::Unknown,
            },
        }
    }

    fn score(&mut self) -> f64 {
        (self.random.between(0.5, 1.0) * 256.0).round() / 256.0
    }
}

/// How something is read: as nothing, as another of its like, as what it is.
enum Taken {
    Unknown,
    /// Which other, 0 to 1.
    Other(f64),
    AsIs,
}

impl Taken {
    fn of<T: Copy + PartialEq>(&self, truth: T, likes: &[T], unknown: T) -> T {
        match *self {
            Self::Unknown => unknown,
            Self::AsIs => truth,
            Self::Other(lot) => {
                let others: Vec<T> = likes
                    .iter()
                    .copied()
                    .filter(|like| *like != truth)
                    .collect();
                let index = (lot * others.len() as f64) as usize;
                others.get(index).copied().unwrap_or(unknown)
            }
        }
    }
}

/// Mean probability to miss a thing in a frame.
fn miss(noise: &DetectorNoise, sight: &Sight, aside_m: f64) -> f64 {
    let fresh = match sight.kind {
        ElementKind::LaneMarking => noise.miss.aside.at(aside_m),
        ElementKind::GroundSign => noise.areas.sign_miss,
        ElementKind::StopLine => noise.areas.stop_line_miss,
        ElementKind::Crosswalk => noise.areas.crosswalk_miss,
    };
    (fresh + noise.miss.worn * sight.wear).min(1.0)
}
