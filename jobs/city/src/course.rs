//! How a vehicle moves along the street: its speed, its lanes, and how it wanders within them.

use std::f64::consts::TAU;

use crate::curve::Place;
use crate::random::Random;
use crate::road::{Road, Street};

/// Mean speed, and how far it swings around it, in metres per second.
const SPEED_M_S: (f64, f64) = (11.0, 16.0);
const SPEED_SWING_M_S: (f64, f64) = (0.5, 2.0);
/// Seconds of one swing.
const SWING_S: (f64, f64) = (25.0, 60.0);
/// Metres between chances to change the lane, the chance, and the metres that a change takes.
const CHANGE_EVERY_M: f64 = 150.0;
const CHANGE_CHANCE: f64 = 0.45;
const CHANGE_LENGTH_M: (f64, f64) = (50.0, 90.0);
/// Amplitude and length of the waves in which vehicles wander within their lane, in metres.
const WANDER_M: (f64, f64) = (0.05, 0.2);
const WANDER_LENGTH_M: (f64, f64) = (90.0, 250.0);

/// A wave over time or station.
#[derive(Debug, Clone, Copy)]
struct Wave {
    amplitude: f64,
    /// Radians per unit.
    rate: f64,
    phase_rad: f64,
}

impl Wave {
    fn draw(amplitude: (f64, f64), length: (f64, f64), random: &mut Random) -> Self {
        Self {
            amplitude: random.between(amplitude.0, amplitude.1),
            rate: TAU / random.between(length.0, length.1),
            phase_rad: random.between(0.0, TAU),
        }
    }

    fn at(&self, x: f64) -> f64 {
        self.amplitude * (self.rate * x + self.phase_rad).cos()
    }

    /// From 0 to `x`.
    fn integral(&self, x: f64) -> f64 {
        let sine = |x: f64| (self.rate * x + self.phase_rad).sin();
        self.amplitude / self.rate * (sine(x) - sine(0.0))
    }
}

/// A gentle step to the left (or right, if negative) from one station to another.
#[derive(Debug, Clone, Copy)]
struct Step {
    from_m: f64,
    length_m: f64,
    left_m: f64,
}

impl Step {
    fn at(&self, station_m: f64) -> f64 {
        let done = ((station_m - self.from_m) / self.length_m).clamp(0.0, 1.0);
        self.left_m * done * done * (3.0 - 2.0 * done)
    }
}

/// One drive's true motion, from the street's begin to its end.
pub(crate) struct Course<'a> {
    street: &'a Street,
    mean_speed_m_s: f64,
    speed: Wave,
    first_offset_m: f64,
    steps: Vec<Step>,
    wander: [Wave; 2],
}

impl<'a> Course<'a> {
    /// Draws a drive's motion.
    pub(crate) fn draw(street: &'a Street, random: &mut Random) -> Self {
        let mut lanes = Lanes::default();
        for road in &street.roads {
            lanes.drive(road, random);
        }
        Self {
            street,
            mean_speed_m_s: random.between(SPEED_M_S.0, SPEED_M_S.1),
            speed: Wave::draw(SPEED_SWING_M_S, SWING_S, random),
            first_offset_m: lanes.first_offset_m,
            steps: lanes.steps,
            wander: [0, 1].map(|_| Wave::draw(WANDER_M, WANDER_LENGTH_M, random)),
        }
    }

    /// Metres along the street, `seconds` after its begin.
    pub(crate) fn station_m(&self, seconds: f64) -> f64 {
        self.mean_speed_m_s * seconds + self.speed.integral(seconds)
    }

    /// Whole seconds until the street's end.
    pub(crate) fn seconds(&self) -> u32 {
        let mut seconds = 0;
        while self.station_m(f64::from(seconds)) < self.street.length_m {
            seconds += 1;
        }
        seconds
    }

    /// Where the vehicle is and where it points.
    pub(crate) fn place(&self, seconds: f64) -> Place {
        let station_m = self.station_m(seconds);
        let middle = self.street.curve.at(station_m);
        let [east_m, north_m] = middle.left(self.offset_m(station_m));
        let slope = (self.offset_m(station_m + 0.5) - self.offset_m(station_m - 0.5)).atan();
        Place {
            east_m,
            north_m,
            yaw_rad: middle.yaw_rad + slope,
        }
    }

    /// How fast it turns to the left, in radians per second.
    pub(crate) fn yaw_rate_rad_s(&self, seconds: f64) -> f64 {
        (self.place(seconds + 0.05).yaw_rad - self.place(seconds - 0.05).yaw_rad) / 0.1
    }

    fn offset_m(&self, station_m: f64) -> f64 {
        let steps = self.steps.iter().map(|step| step.at(station_m));
        let wander = self.wander.iter().map(|wave| wave.at(station_m));
        self.first_offset_m + steps.sum::<f64>() + wander.sum::<f64>()
    }
}

/// The lane of a vehicle while its drive is drawn.
#[derive(Default)]
struct Lanes {
    first_offset_m: f64,
    offset_m: f64,
    /// Lane, and the end of the road that it belongs to.
    last: Option<(usize, f64)>,
    steps: Vec<Step>,
}

impl Lanes {
    fn drive(&mut self, road: &Road, random: &mut Random) {
        let mut lane = self.enter(road, random);
        let mut station_m = road.from_m + random.between(0.2, 1.0) * CHANGE_EVERY_M;
        while station_m + CHANGE_LENGTH_M.1 < road.to_m {
            if random.chance(CHANGE_CHANCE) {
                lane = beside(lane, road.lanes(), random);
                let length_m = random.between(CHANGE_LENGTH_M.0, CHANGE_LENGTH_M.1);
                self.step(station_m, length_m, road.lane_offset_m(lane));
            }
            station_m += CHANGE_EVERY_M;
        }
        self.last = Some((lane, road.to_m));
    }

    /// The lane in which a road is entered; the junction before it is used to get there.
    fn enter(&mut self, road: &Road, random: &mut Random) -> usize {
        match self.last {
            None => {
                let lane = random.index(road.lanes());
                self.first_offset_m = road.lane_offset_m(lane);
                self.offset_m = self.first_offset_m;
                lane
            }
            Some((lane, junction_m)) => {
                let lane = lane.min(road.lanes() - 1);
                let length_m = road.from_m - junction_m;
                self.step(junction_m, length_m, road.lane_offset_m(lane));
                lane
            }
        }
    }

    fn step(&mut self, from_m: f64, length_m: f64, to_offset_m: f64) {
        self.steps.push(Step {
            from_m,
            length_m,
            left_m: to_offset_m - self.offset_m,
        });
        self.offset_m = to_offset_m;
    }
}

fn beside(lane: usize, lanes: usize, random: &mut Random) -> usize {
    if lane == 0 {
        return 1.min(lanes - 1);
    }
    if lane + 1 == lanes || random.chance(0.5) {
        return lane - 1;
    }
    lane + 1
}
