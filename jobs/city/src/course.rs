//! How a vehicle moves along its route: when it is where, with which speed, and how its body leans.

use std::f64::consts::TAU;

use crate::curve::Place;
use crate::random::Random;
use crate::route::{STEP_M, Step};
use crate::world::Point;

/// Sideways and forward accelerations, in metres per second squared.
const LATERAL_M_S2: f64 = 1.8;
const SPEED_UP_M_S2: f64 = 1.4;
const SLOW_DOWN_M_S2: f64 = 1.9;
/// A driver's own share of the speed that a lane allows.
const TEMPER: (f64, f64) = (0.8, 1.05);
/// The least speed of a moving vehicle, in metres per second.
const CREEP_M_S: f64 = 1.0;
/// Chance to wait at a junction, and for how long, in seconds.
const WAIT: f64 = 0.35;
const WAIT_S: (f64, f64) = (3.0, 35.0);
/// Amplitude and length of the waves in which vehicles wander within their lane, in metres.
const WANDER_M: (f64, f64) = (0.05, 0.2);
const WANDER_LENGTH_M: (f64, f64) = (90.0, 250.0);
/// How the body leans: radians per metre per second squared of acceleration.
const PITCH_PER_M_S2: f64 = 0.004;
const ROLL_PER_M_S2: f64 = 0.005;

/// A wave over station.
#[derive(Debug, Clone, Copy)]
struct Wave {
    amplitude: f64,
    /// Radians per metre.
    rate: f64,
    phase_rad: f64,
}

impl Wave {
    fn draw(amplitude: (f64, f64), length_m: (f64, f64), random: &mut Random) -> Self {
        Self {
            amplitude: random.between(amplitude.0, amplitude.1),
            rate: TAU / random.between(length_m.0, length_m.1),
            phase_rad: random.between(0.0, TAU),
        }
    }

    fn at(&self, station_m: f64) -> f64 {
        self.amplitude * (self.rate * station_m + self.phase_rad).sin()
    }
}

/// Where a vehicle is, and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    /// On the ground below the vehicle's origin; the direction that it points in.
    pub(crate) place: Place,
    /// Height of the ground, in metres.
    pub(crate) up_m: f64,
    /// Nose down and right side down, as braking and curves lean the body, in radians (REP 103).
    pub(crate) pitch_rad: f64,
    pub(crate) roll_rad: f64,
    /// The road's own slope along the vehicle, upwards positive, in radians.
    pub(crate) slope_rad: f64,
    pub(crate) speed_m_s: f64,
    /// To the left.
    pub(crate) yaw_rate_rad_s: f64,
    /// Metres driven since the begin.
    pub(crate) station_m: f64,
    pub(crate) lane: usize,
}

/// One drive's true motion.
pub(crate) struct Course {
    steps: Vec<Step>,
    /// Per step: seconds since the begin at which it is passed.
    passed_s: Vec<f64>,
    /// Per step: speed.
    speed_m_s: Vec<f64>,
    /// Seconds that are waited at a step, by step.
    waits: Vec<(usize, f64)>,
    wander: [Wave; 2],
}

impl Course {
    /// Draws a drive's motion along a route.
    pub(crate) fn draw(steps: Vec<Step>, random: &mut Random) -> Self {
        let temper = random.between(TEMPER.0, TEMPER.1);
        let waits = draw_waits(&steps, random);
        let mut speed_m_s = limits(&steps, temper);
        for (step, _) in &waits {
            speed_m_s[*step] = 0.0;
        }
        accelerate(&mut speed_m_s);
        let mut course = Self {
            passed_s: vec![0.0; steps.len()],
            steps,
            speed_m_s,
            waits,
            wander: [0, 1].map(|_| Wave::draw(WANDER_M, WANDER_LENGTH_M, random)),
        };
        course.run();
        course
    }

    /// Sums up the time that every step takes.
    fn run(&mut self) {
        let mut waits = self.waits.iter().peekable();
        let mut now_s = 0.0;
        for step in 1..self.steps.len() {
            let mean = (self.speed_m_s[step - 1] + self.speed_m_s[step]) / 2.0;
            now_s += STEP_M / mean.max(CREEP_M_S / 2.0);
            self.passed_s[step] = now_s;
            if let Some((_, wait_s)) = waits.next_if(|(at, _)| *at == step) {
                now_s += wait_s;
            }
        }
    }

    /// Seconds until the end.
    pub(crate) fn seconds(&self) -> f64 {
        self.passed_s.last().copied().unwrap_or(0.0)
    }

    /// Metres driven after `seconds`.
    pub(crate) fn station_m(&self, seconds: f64) -> f64 {
        let after = self
            .passed_s
            .partition_point(|&passed_s| passed_s <= seconds);
        let before = after.saturating_sub(1);
        if after >= self.steps.len() {
            return (self.steps.len().saturating_sub(1)) as f64 * STEP_M;
        }
        // What is waited at a step is waited before the next is made for.
        let wait_s = self.waits.iter().find(|(at, _)| *at == before);
        let left_s = self.passed_s[before] + wait_s.map_or(0.0, |(_, wait_s)| *wait_s);
        let whole_s = (self.passed_s[after] - left_s).max(1e-9);
        let share = ((seconds - left_s) / whole_s).clamp(0.0, 1.0);
        (before as f64 + share) * STEP_M
    }

    /// The point of the path at a station, aside of it as far as the driver wanders.
    pub(crate) fn point(&self, station_m: f64) -> Point {
        let [east, north] = self.direction(station_m);
        let left_m: f64 = self.wander.iter().map(|wave| wave.at(station_m)).sum();
        let [east_m, north_m, up_m] = self.on_path(station_m);
        [east_m - left_m * north, north_m + left_m * east, up_m]
    }

    /// The lanes driven, each with the station at which it is entered.
    pub(crate) fn lanes(&self) -> Vec<(usize, f64)> {
        let mut lanes: Vec<(usize, f64)> = Vec::new();
        for (index, step) in self.steps.iter().enumerate() {
            if lanes.last().is_none_or(|(lane, _)| *lane != step.lane) {
                lanes.push((step.lane, index as f64 * STEP_M));
            }
        }
        lanes
    }

    /// Metres from the begin to the end.
    pub(crate) fn length_m(&self) -> f64 {
        self.steps.len().saturating_sub(1) as f64 * STEP_M
    }

    fn on_path(&self, station_m: f64) -> Point {
        let last = self.steps.len() - 1;
        let at = (station_m / STEP_M).clamp(0.0, last as f64);
        let before = (at as usize).min(last);
        let after = (before + 1).min(last);
        let share = at - before as f64;
        let (from, to) = (self.steps[before].point, self.steps[after].point);
        [0, 1, 2].map(|axis| from[axis] + share * (to[axis] - from[axis]))
    }

    /// The path's direction, a unit vector east and north.
    fn direction(&self, station_m: f64) -> [f64; 2] {
        let from = self.on_path((station_m - 1.5).max(0.0));
        let to = self.on_path((station_m + 1.5).min(self.length_m()));
        let (east, north) = (to[0] - from[0], to[1] - from[1]);
        let length = east.hypot(north).max(1e-9);
        [east / length, north / length]
    }

    /// The direction that a vehicle at a station points in.
    pub(crate) fn place(&self, station_m: f64) -> Place {
        let (from, to) = (self.point(station_m - 1.0), self.point(station_m + 1.0));
        let [east_m, north_m, _] = self.point(station_m);
        Place {
            east_m,
            north_m,
            yaw_rad: (to[1] - from[1]).atan2(to[0] - from[0]),
        }
    }

    /// Where the vehicle is after `seconds`, and how it moves.
    pub(crate) fn motion(&self, seconds: f64) -> Motion {
        let station_m = self.station_m(seconds);
        let step = ((station_m / STEP_M) as usize).min(self.steps.len() - 1);
        let (behind, ahead) = (self.place(station_m - 1.0), self.place(station_m + 1.0));
        let turn_rad = wrapped(ahead.yaw_rad - behind.yaw_rad);
        let speed_m_s = (self.station_m(seconds + 0.1) - self.station_m(seconds - 0.1)) / 0.2;
        let was_m_s = (self.station_m(seconds) - self.station_m(seconds - 0.2)) / 0.2;
        let gain_m_s2 = ((speed_m_s - was_m_s) / 0.1).clamp(-4.0, 4.0);
        let lateral_m_s2 = speed_m_s * speed_m_s * turn_rad / 2.0;
        let rise_m = self.on_path(station_m + 2.0)[2] - self.on_path(station_m - 2.0)[2];
        Motion {
            place: self.place(station_m),
            up_m: self.on_path(station_m)[2],
            pitch_rad: -PITCH_PER_M_S2 * gain_m_s2,
            roll_rad: ROLL_PER_M_S2 * lateral_m_s2,
            slope_rad: (rise_m / 4.0).atan(),
            speed_m_s,
            yaw_rate_rad_s: turn_rad / 2.0 * speed_m_s,
            station_m,
            lane: self.steps[step].lane,
        }
    }
}

/// The steps at which one waits, ascending, and for how long.
fn draw_waits(steps: &[Step], random: &mut Random) -> Vec<(usize, f64)> {
    let mouths = (1..steps.len()).filter(|&step| steps[step].is_mouth);
    let mut waits = Vec::new();
    for step in mouths {
        let wait_s = random.between(WAIT_S.0, WAIT_S.1);
        if random.chance(WAIT) {
            waits.push((step, wait_s));
        }
    }
    waits
}

/// The speed that lane and curve allow at every step.
fn limits(steps: &[Step], temper: f64) -> Vec<f64> {
    let limit = |index: usize| {
        let reach = 4.min(index).min(steps.len() - 1 - index);
        let curvature = match reach {
            0 => 0.0,
            _ => curvature(
                steps[index - reach].point,
                steps[index].point,
                steps[index + reach].point,
            ),
        };
        let in_curve = (LATERAL_M_S2 / curvature.max(1e-6)).sqrt();
        (temper * steps[index].speed_m_s)
            .min(in_curve)
            .max(CREEP_M_S)
    };
    (0..steps.len()).map(limit).collect()
}

/// 1/m of the circle through three points.
fn curvature(a: Point, b: Point, c: Point) -> f64 {
    let side = |p: Point, q: Point| (q[0] - p[0]).hypot(q[1] - p[1]);
    let twice_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    2.0 * twice_area.abs() / (side(a, b) * side(b, c) * side(a, c)).max(1e-9)
}

/// No step is left faster than the vehicle can have become, or can still brake.
fn accelerate(speed_m_s: &mut [f64]) {
    for step in 1..speed_m_s.len() {
        let most = speed_m_s[step - 1].powi(2) + 2.0 * SPEED_UP_M_S2 * STEP_M;
        speed_m_s[step] = speed_m_s[step].min(most.sqrt());
    }
    for step in (1..speed_m_s.len()).rev() {
        let most = speed_m_s[step].powi(2) + 2.0 * SLOW_DOWN_M_S2 * STEP_M;
        speed_m_s[step - 1] = speed_m_s[step - 1].min(most.sqrt());
    }
}

fn wrapped(angle_rad: f64) -> f64 {
    tilefold_tiler::geodesy::wrap_angle(angle_rad)
}
