//! What a detector on the vehicle says of the paint, in the vehicle frame.
//!
//! It is a camera's detector: paint is projected with the camera's true attitude and back with the
//! believed one onto flat ground, so that errors grow with the distance; other vehicles hide it.
//! `look` says which stretches of paint can be seen -> `view` moves them as the believed attitude
//! does -> `temper` says what is missed, how lines waver and what they are taken for -> `phantom` are
//! lines where no paint is.

mod look;
mod phantom;
mod temper;
mod view;

use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_schemas::log::Detection;

use crate::city::City;
use crate::course::{Course, Motion};
use crate::mounting::{Body, Misalignment};
use crate::noise::{DetectorNoise, Noise};
use crate::random::Random;
use crate::traffic::Vehicle;
use look::Look;
use phantom::Phantoms;
use temper::Temper;
use view::View;

/// The fewest points that make a line.
const LEAST_POINTS: usize = 3;
/// Points are given in steps of 1/1024 m.
const STEPS_PER_M: f64 = 1024.0;
/// Paint is looked for this much further than can be seen, in metres.
const BEYOND_M: f64 = 5.0;

/// A detection, and the paint that it is of.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Seen {
    pub(crate) detection: Detection,
    pub(crate) parts: Vec<Part>,
}

/// A stretch of a detection that is of one element; of none, where nothing is painted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Part {
    pub(crate) element: Option<i64>,
    /// From where to where, by metres ahead: 0 where the detection is nearest, 1 where it is farthest.
    pub(crate) shares: [f64; 2],
}

impl Part {
    /// The whole of a detection.
    fn whole(element: Option<i64>) -> Self {
        Self {
            element,
            shares: [0.0, 1.0],
        }
    }
}

/// A line or outline in the vehicle frame before anything is missed or mistaken.
struct Sight {
    /// What memory is kept by.
    key: usize,
    /// Whose paint it is, in the order of the points.
    pieces: Vec<Piece>,
    kind: ElementKind,
    marking: Marking,
    color: Color,
    sign: SignClass,
    /// Share of the paint that is worn off.
    wear: f64,
    /// Metres forward and to the left.
    points: Vec<[f64; 2]>,
}

/// A stretch of a line that is one element's; no element's, where no paint is.
struct Piece {
    element: Option<i64>,
    points: usize,
}

impl Sight {
    /// For each point, of which piece it is.
    fn owners(&self) -> Vec<usize> {
        let pieces = self.pieces.iter().enumerate();
        pieces
            .flat_map(|(index, piece)| std::iter::repeat_n(index, piece.points))
            .collect()
    }

    /// Whose the points are that are told of, at `ahead_m` metres: stretches that would have been told
    /// of if there were nothing else, and else the longest.
    fn parts(&self, owners: &[usize], ahead_m: &[f64]) -> Vec<Part> {
        let mut runs: Vec<(usize, Vec<f64>)> = Vec::new();
        for (&owner, &at_m) in owners.iter().zip(ahead_m) {
            match runs.last_mut() {
                Some((last, run)) if *last == owner => run.push(at_m),
                _ => runs.push((owner, vec![at_m])),
            }
        }
        let most = runs.iter().map(|(_, run)| run.len()).max().unwrap_or(0);
        runs.retain(|(_, run)| run.len() >= LEAST_POINTS.min(most));
        let [low_m, high_m] = bounds(ahead_m);
        let part = |(owner, run): &(usize, Vec<f64>)| Part {
            element: self.pieces[*owner].element,
            shares: bounds(run).map(|at_m| (at_m - low_m) / (high_m - low_m).max(1e-9)),
        };
        runs.iter().map(part).collect()
    }
}

fn bounds(values: &[f64]) -> [f64; 2] {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    [
        low,
        values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    ]
}

/// The detector of one drive.
pub(crate) struct Detector<'a> {
    city: &'a City<'a>,
    noise: &'a DetectorNoise,
    body: Body,
    view: View,
    temper: Temper,
    phantoms: Phantoms,
}

/// Streams of lots: of the drive, and of its vehicle, which errs alike in all of its drives.
pub(crate) struct Lots<'a> {
    pub(crate) drive: &'a dyn Fn(&str) -> Random,
    pub(crate) vehicle: Random,
}

impl<'a> Detector<'a> {
    pub(crate) fn new(city: &'a City<'a>, noise: &'a Noise, course: &Course, lots: Lots) -> Self {
        let mut vehicle = lots.vehicle;
        let misalignment = Misalignment::draw(&noise.mounting, &mut vehicle);
        let phantoms = (lots.drive)("phantoms");
        Self {
            city,
            noise: &noise.detector,
            body: Body::draw(&noise.mounting, (lots.drive)("body")),
            view: View::draw(&noise.detector.lateral, misalignment, &mut vehicle),
            temper: Temper::new(&noise.detector, (lots.drive)("detector")),
            phantoms: Phantoms::draw(city, &noise.detector, course, phantoms),
        }
    }

    /// What is seen at a time from where the vehicle is, among other vehicles, `period_s` after the
    /// last look.
    pub(crate) fn look(
        &mut self,
        motion: &Motion,
        traffic: &[Vehicle],
        time_ns: i64,
        period_s: f64,
    ) -> Vec<Seen> {
        let [roll_rad, pitch_rad] = self.body.roll_pitch_rad(period_s);
        let leaning = [motion.roll_rad + roll_rad, motion.pitch_rad + pitch_rad];
        if self.temper.is_blind(period_s) {
            return Vec::new();
        }
        let look = Look::new(self.noise, motion, traffic);
        let ground = &self.city.ground;
        let place = [motion.place.east_m, motion.place.north_m];
        let reach_m = self.noise.view.far_m + BEYOND_M;
        let mut sights = look.paint(&ground.near(place, reach_m, time_ns));
        let ghosts = ground.gone(place, reach_m, time_ns);
        sights.extend(look.ghosts(&ghosts, &mut self.phantoms, self.city.world.paint.len()));
        sights.extend(self.phantoms.lines(&look, motion.station_m, self.noise));
        let mut seen = Vec::new();
        for sight in sights {
            let rises = |point| look.rise_m(point, &self.city.world.relief);
            let Some(believed) = self.view.believed(leaning, &sight, rises) else {
                continue;
            };
            let driven_m = motion.speed_m_s * period_s;
            seen.extend(self.temper.tell(&sight, believed, period_s, driven_m));
        }
        seen.extend(self.phantoms.flicker(self.noise));
        seen
    }
}

/// Points as detectors give them: on the ground, in round steps.
fn rounded(points: &[[f64; 2]]) -> Vec<[f64; 3]> {
    let round = |metres: f64| (metres * STEPS_PER_M).round() / STEPS_PER_M;
    points
        .iter()
        .map(|&[x_m, y_m]| [round(x_m), round(y_m), 0.0])
        .collect()
}
