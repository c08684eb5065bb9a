//! What a detector on the vehicle says of the paint, in the vehicle frame.
//!
//! It is a camera's detector: paint is projected with the camera's true attitude and back with the
//! believed one onto flat ground, so that errors grow with the distance; other vehicles hide it.
//! `look` says which stretches of paint can be seen -> `view` moves them as the believed attitude
//! does -> `temper` says what is missed and how lines waver -> `phantom` are lines where no paint is.

mod look;
mod phantom;
mod temper;
mod view;

use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_schemas::log::Detection;

use crate::course::{Course, Motion};
use crate::ground::Ground;
use crate::noise::{DetectorNoise, MountingNoise};
use crate::random::Random;
use crate::traffic::Vehicle;
use crate::world::World;
use look::Look;
use phantom::Phantoms;
use temper::Temper;
use view::View;

/// Points are given in steps of 1/1024 m.
const STEPS_PER_M: f64 = 1024.0;

/// A detection, and the paint that it is of; none for what is not there.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Seen {
    pub(crate) detection: Detection,
    pub(crate) element: Option<i64>,
}

/// A line or outline in the vehicle frame before anything is missed or mistaken.
struct Sight {
    /// What memory is kept by.
    key: usize,
    element: Option<i64>,
    kind: ElementKind,
    marking: Marking,
    color: Color,
    sign: SignClass,
    /// Share of the paint that is worn off.
    wear: f64,
    /// Metres forward and to the left.
    points: Vec<[f64; 2]>,
}

/// The detector of one drive.
pub(crate) struct Detector<'a> {
    world: &'a World,
    ground: &'a Ground<'a>,
    noise: &'a DetectorNoise,
    view: View,
    temper: Temper,
    phantoms: Phantoms,
}

/// Streams of lots of a drive and of its vehicle.
pub(crate) struct Lots {
    pub(crate) drive: [Random; 2],
    pub(crate) vehicle: Random,
}

impl<'a> Detector<'a> {
    pub(crate) fn new(
        world: &'a World,
        ground: &'a Ground<'a>,
        (noise, mounting): (&'a DetectorNoise, &MountingNoise),
        course: &Course,
        lots: Lots,
    ) -> Self {
        let [temper, phantoms] = lots.drive;
        let mut vehicle = lots.vehicle;
        Self {
            world,
            ground,
            noise,
            view: View::draw(noise, mounting, &mut vehicle),
            temper: Temper::new(noise, temper),
            phantoms: Phantoms::draw(noise, course, phantoms),
        }
    }

    /// What is seen at a time from where the vehicle is, among other vehicles.
    pub(crate) fn look(
        &mut self,
        motion: &Motion,
        traffic: &[Vehicle],
        time_ns: i64,
        period_s: f64,
    ) -> Vec<Seen> {
        if self.temper.is_blind(period_s) {
            return Vec::new();
        }
        let look = Look::new(self.noise, motion, traffic);
        let place = [motion.place.east_m, motion.place.north_m];
        let reach_m = self.noise.far_m.max(self.noise.sign_far_m) + 5.0;
        let mut sights = look.paint(&self.ground.near(place, reach_m, time_ns));
        let ghosts = self.ground.gone(place, reach_m, time_ns);
        sights.extend(look.ghosts(&ghosts, &mut self.phantoms, self.world.paint.len()));
        let kerbs = self.ground.kerbs(place, reach_m);
        let from = (motion.station_m, self.noise);
        sights.extend(self.phantoms.lines(&look, &kerbs, from));
        let mut seen = Vec::new();
        for sight in sights {
            let Some(believed) = self.view.believed(motion, &look, &self.world.relief, &sight) else {
                continue;
            };
            seen.extend(self.temper.tell(sight, believed, period_s));
        }
        seen.extend(self.phantoms.clutter(self.noise, period_s));
        seen
    }
}

/// Points as detectors give them: on the ground, in round steps.
fn rounded(points: &[[f64; 2]]) -> Vec<[f64; 3]> {
    let round = |metres: f64| (metres * STEPS_PER_M).round() / STEPS_PER_M;
    points.iter().map(|&[x_m, y_m]| [round(x_m), round(y_m), 0.0]).collect()
}
