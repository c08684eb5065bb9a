//! The heading before the positions have had their say: what orientations, gyro and course over
//! ground give at the nodes of a trajectory, smooth, but for a slow bias.
//!
//! One unknown a node. Yaw acceleration is white noise; a gyro measures the turn between two nodes,
//! an orientation (where there is none: the course over ground) the yaw itself; who stands does not
//! turn. What is left of a mounting that is not straight, or of a heading that drifts, is found
//! later, by the direction in which the vehicle moves ([`crate::motion`]).

use tilefold_tiler::geodesy::wrap_angle;
use tilefold_tiler::recording::Recording;

use crate::banded::Banded;
use crate::frames::{FrameTree, yaw_rad};
use crate::median::median;
use crate::nodes::Nodes;
use crate::signal::Signal;

/// Power spectral density of yaw acceleration, rad^2/s^3: a turn is begun with 0.3 rad/s^2 within
/// a second.
const YAW_ACCELERATION_PSD: f64 = 0.1;
/// A car seldom turns faster, in rad/s; keeps a yaw finite that nothing measures.
const YAW_RATE_SIGMA: f64 = 0.5;
/// White noise of an orientation, and of a course over ground, in radians.
const ORIENTATION_SIGMA: f64 = 0.006;
const COURSE_SIGMA: f64 = 0.05;
/// White noise of a mean yaw rate between two nodes, in rad/s, with what is left of its bias.
const GYRO_SIGMA: f64 = 0.004;
/// A vehicle that stands turns no faster, in rad/s.
const STANDING_SIGMA: f64 = 0.001;
/// A gyro is believed if what it leaves of the turn rate is at most this share of it.
const MAX_UNEXPLAINED: f64 = 1.5;

/// Where the heading comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeadingSource {
    /// Orientations of an inertial sensor, a second antenna or a pose.
    Orientation,
    /// The course over ground, for want of orientations: unknown until the vehicle moves.
    Course,
}

/// What became of the gyro.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GyroUse {
    /// Its turns are part of the heading.
    Used,
    /// The log has no yaw rates.
    Missing,
    /// It contradicts the other headings, or never says anything but one value.
    Refused,
}

/// Yaws at the nodes.
pub(crate) struct Heading {
    /// Unwrapped, radians.
    pub(crate) yaws_rad: Vec<f64>,
    /// Variances of their white part.
    pub(crate) variances: Vec<f64>,
    pub(crate) source: HeadingSource,
    pub(crate) gyro: GyroUse,
}

/// What the heading is made from.
pub(crate) struct HeadingInputs<'a> {
    pub(crate) nodes: &'a Nodes,
    /// Orientations, unwrapped; empty for none.
    pub(crate) orientations: &'a [(i64, f64)],
    /// Course over ground at nodes where the vehicle moves, unwrapped.
    pub(crate) courses: &'a [(usize, f64)],
    pub(crate) gyro: &'a Signal,
    /// Whether the vehicle stands between a node and the next.
    pub(crate) stands: &'a [bool],
}

impl HeadingInputs<'_> {
    /// The heading; none if nothing measures it.
    pub(crate) fn solve(&self) -> Option<Heading> {
        let source = match self.orientations.len() {
            0 | 1 => HeadingSource::Course,
            _ => HeadingSource::Orientation,
        };
        let without = self.solve_with(source, None)?;
        let rates: Vec<Option<f64>> = (1..self.nodes.len())
            .map(|k| {
                self.gyro
                    .mean(self.nodes.stamp_ns(k - 1), self.nodes.stamp_ns(k))
            })
            .collect();
        let (gyro, yaws) = match self.unbiased(&rates, &without.0) {
            Ok(turns) => (GyroUse::Used, self.solve_with(source, Some(&turns))?),
            Err(why) => (why, without),
        };
        Some(Heading {
            yaws_rad: yaws.0,
            variances: yaws.1,
            source,
            gyro,
        })
    }

    /// Turn rates without their bias, which is the median of what they differ from the yaws.
    fn unbiased(
        &self,
        rates: &[Option<f64>],
        yaws_rad: &[f64],
    ) -> Result<Vec<Option<f64>>, GyroUse> {
        let seconds = Nodes::SPACING_S;
        let turns = |k: usize| (yaws_rad[k + 1] - yaws_rad[k]) / seconds;
        let differences: Vec<f64> = (rates.iter().enumerate())
            .filter_map(|(k, rate)| Some((*rate)? - turns(k)))
            .collect();
        if differences.is_empty() {
            return Err(GyroUse::Missing);
        }
        let bias = median(differences.clone());
        let left: f64 = differences.iter().map(|d| (d - bias).powi(2)).sum();
        let turned: f64 = (rates.iter().enumerate())
            .filter(|(_, rate)| rate.is_some())
            .map(|(k, _)| turns(k).powi(2))
            .sum();
        let floor = GYRO_SIGMA.powi(2) * differences.len() as f64;
        if self.gyro.is_flat() || left > MAX_UNEXPLAINED * (turned + floor) {
            return Err(GyroUse::Refused);
        }
        Ok(rates
            .iter()
            .map(|rate| rate.map(|rate| rate - bias))
            .collect())
    }

    /// Yaws and their variances; none if they are not determined.
    fn solve_with(
        &self,
        source: HeadingSource,
        turns: Option<&[Option<f64>]>,
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let mut system = System::new(self.nodes.len());
        let seconds = Nodes::SPACING_S;
        match source {
            HeadingSource::Orientation => {
                for &(stamp_ns, yaw) in self.orientations {
                    if let Some((k, share)) = self.nodes.between(stamp_ns) {
                        let entries = [(k, 1.0 - share), (k + 1, share)];
                        system.measure(&entries, yaw, ORIENTATION_SIGMA);
                    }
                }
            }
            HeadingSource::Course => {
                for &(k, yaw) in self.courses {
                    system.measure(&[(k, 1.0)], yaw, COURSE_SIGMA);
                }
            }
        }
        system.is_measured.then_some(())?;
        for k in 1..self.nodes.len() {
            let turn = [(k - 1, -1.0), (k, 1.0)];
            system.measure(&turn, 0.0, YAW_RATE_SIGMA * seconds);
            if let Some(rate) = turns.and_then(|turns| turns[k - 1]) {
                system.measure(&turn, rate * seconds, GYRO_SIGMA * seconds);
            }
            if self.stands[k - 1] {
                system.measure(&turn, 0.0, STANDING_SIGMA * seconds);
            }
        }
        for k in 2..self.nodes.len() {
            let bend = [(k - 2, 1.0), (k - 1, -2.0), (k, 1.0)];
            let sigma = (YAW_ACCELERATION_PSD * seconds).sqrt() * seconds;
            system.measure(&bend, 0.0, sigma);
        }
        system.solve()
    }
}

/// Weighted rows with their right side.
struct System {
    normal: Banded<3>,
    rhs: Vec<f64>,
    is_measured: bool,
}

impl System {
    fn new(size: usize) -> Self {
        Self {
            normal: Banded::zero(size),
            rhs: vec![0.0; size],
            is_measured: false,
        }
    }

    fn measure(&mut self, entries: &[(usize, f64)], value: f64, sigma: f64) {
        let weight = sigma.powi(-2);
        self.normal.add_row(entries, weight);
        for &(index, entry) in entries {
            self.rhs[index] += weight * entry * value;
        }
        self.is_measured = true;
    }

    fn solve(self) -> Option<(Vec<f64>, Vec<f64>)> {
        let size = self.rhs.len();
        let factor = self.normal.factorise()?;
        let inverse = factor.inverse();
        let variances = (0..size).map(|k| inverse.entry(k, k)).collect();
        Some((factor.solve(self.rhs), variances))
    }
}

/// Yaws of orientations in the vehicle's axes, unwrapped.
pub(crate) fn orientations(recording: &Recording, tree: &FrameTree) -> Vec<(i64, f64)> {
    let mut yaws: Vec<(i64, f64)> = Vec::with_capacity(recording.imu.len());
    for imu in &recording.imu {
        let mounted_yaw = tree.vehicle_from(&imu.frame_id).and_then(|mounting| {
            let q = mounting.rotation.coords;
            yaw_rad([q.x, q.y, q.z, q.w])
        });
        if let Some(yaw) = imu.value.orientation.and_then(yaw_rad) {
            push_unwrapped(&mut yaws, imu.stamp_ns, yaw - mounted_yaw.unwrap_or(0.0));
        }
    }
    yaws
}

/// Yaw rates about the vehicle's up axis: of the inertial sensor, else of the odometry.
pub(crate) fn yaw_rates(recording: &Recording, tree: &FrameTree) -> Signal {
    let inertial = recording.imu.iter().filter_map(|imu| {
        let rate = nalgebra::Vector3::from(imu.value.angular_velocity_rad_s?);
        let mounting = tree.vehicle_from(&imu.frame_id)?;
        Some((imu.stamp_ns, (mounting.rotation * rate).z))
    });
    let signal = Signal::new(inertial);
    if !signal.is_flat() {
        return signal;
    }
    let odometry = recording.odometry.iter();
    let turning = Signal::new(odometry.map(|o| (o.stamp_ns, o.value.angular_velocity_rad_s[2])));
    if turning.is_flat() { signal } else { turning }
}

/// Adds a yaw as the turn from the one before that is less than half a circle; later stamps only.
pub(crate) fn push_unwrapped<T: PartialOrd>(yaws: &mut Vec<(T, f64)>, at: T, yaw: f64) {
    let unwrapped = match yaws.last() {
        Some((last_at, _)) if *last_at >= at => return,
        Some((_, last)) => last + wrap_angle(yaw - last),
        None => yaw,
    };
    yaws.push((at, unwrapped));
}
