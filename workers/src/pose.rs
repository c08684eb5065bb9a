//! Where the vehicle was: a smooth trajectory through noisy, jumping GNSS (method.md, section 2).
//!
//! East and north are estimated at the times of the fixes by minimising
//! `sum rho(|p_i - z_i|^2 / s^2) + sum |a_i|^2 dt / q`: robust distance to the fixes plus
//! white-noise acceleration. The normal equations are pentadiagonal, the same for both axes, and
//! are solved again with new weights until the jumps carry none. Slow GNSS error (which is most
//! of it) stays in the trajectory: registration against the map takes it out.

use tilefold_schemas::log::GnssFix;
use tilefold_tiler::geodesy::{LocalFrame, wrap_angle};
use tilefold_tiler::recording::{Recording, Series};

use crate::banded::Banded;
use crate::frames::{FrameTree, yaw_rad};

/// Power spectral density of acceleration, m^2/s^3: a car brakes or turns with about 2 m/s^2 for
/// about a second.
const ACCELERATION_PSD: f64 = 2.0;
/// Standard deviation of a fix whose receiver states none, in metres.
const DEFAULT_FIX_SIGMA_M: f64 = 1.5;
/// Bounds of a stated standard deviation that is believed, in metres.
const FIX_SIGMA_M: (f64, f64) = (0.05, 50.0);
/// Rounds of re-weighting; the weights settle in four or five.
const ROBUST_ROUNDS: usize = 8;
/// Scale below which residuals of neighbouring fixes are not jumps, in metres.
const JUMP_FLOOR_M: f64 = 0.1;
/// A pose is interpolated between fixes at most this far apart.
const MAX_FIX_GAP_NS: i64 = 2_000_000_000;
/// An orientation is interpolated between measurements at most this far apart.
const MAX_YAW_GAP_NS: i64 = 1_000_000_000;
/// The bias of a heading is taken over this much time to either side.
const BIAS_WINDOW_NS: i64 = 3_000_000_000;
/// Course over ground stands for the heading only above this speed, in m/s.
const MIN_COURSE_SPEED_M_S: f64 = 2.0;
/// No car is faster, in m/s: what would need more is a teleport.
const MAX_SPEED_M_S: f64 = 100.0;

/// Where the vehicle was at one instant, in the chunk's local frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// East of the anchor, in metres.
    pub east_m: f64,
    /// North of the anchor, in metres.
    pub north_m: f64,
    /// Counter-clockwise from east, in radians.
    pub yaw_rad: f64,
}

impl Pose {
    /// A point of the vehicle frame (x forward, y left, metres) in the local frame.
    #[must_use]
    pub fn local_from_vehicle(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        [
            self.east_m + cos * x - sin * y,
            self.north_m + sin * x + cos * y,
        ]
    }
}

/// Why a chunk has no trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PoseError {
    /// No usable position.
    #[error("it has no GNSS fix; record NavSatFix or foxglove.LocationFix beside the detections")]
    NoFix,
    /// Too few positions for a trajectory.
    #[error("it has {0} usable GNSS fixes; a trajectory takes at least 3")]
    TooFewFixes(usize),
}

/// A smooth trajectory with a heading.
#[derive(Debug, Clone)]
pub struct Trajectory {
    stamps_ns: Vec<i64>,
    positions_m: Vec<[f64; 2]>,
    /// Unwrapped, so that neighbours can be interpolated.
    yaws: Vec<(i64, f64)>,
    /// Fixes that could not be true.
    pub fixes_set_aside: u64,
}

impl Trajectory {
    /// The local frame that a chunk is worked on in: anchored at its first fix.
    ///
    /// # Errors
    /// There is no fix.
    pub fn anchor(recording: &Recording) -> Result<LocalFrame, PoseError> {
        let first = recording
            .fixes
            .iter()
            .find(|fix| fix.value.has_fix)
            .ok_or(PoseError::NoFix)?;
        Ok(LocalFrame::new([
            first.value.longitude_deg,
            first.value.latitude_deg,
            0.0,
        ]))
    }

    /// The trajectory of a recording in `frame`.
    ///
    /// # Errors
    /// There are fewer than three usable fixes.
    pub fn estimate(
        recording: &Recording,
        frame: &LocalFrame,
        tree: &FrameTree,
    ) -> Result<Self, PoseError> {
        let fixes = Fixes::new(&recording.fixes, frame);
        if fixes.stamps_ns.len() < 3 {
            return Err(PoseError::TooFewFixes(fixes.stamps_ns.len()));
        }
        let positions_m = smooth(&fixes);
        let yaws = match measured_yaws(recording, tree) {
            yaws if yaws.len() >= 2 => {
                without_bias(yaws, &course_over_ground(&fixes.stamps_ns, &positions_m))
            }
            _ => course_over_ground(&fixes.stamps_ns, &positions_m),
        };
        let mut trajectory = Self {
            stamps_ns: fixes.stamps_ns,
            positions_m,
            yaws,
            fixes_set_aside: fixes.set_aside,
        };
        trajectory.move_to_vehicle_origin(&recording.fixes, tree);
        Ok(trajectory)
    }

    /// Places along the trajectory: east, north in metres.
    pub fn places(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.positions_m.iter().copied()
    }

    /// The pose at a time; none where fixes or orientations are too far apart.
    #[must_use]
    pub fn at(&self, stamp_ns: i64) -> Option<Pose> {
        let (before, after, share) = bracket(&self.stamps_ns, stamp_ns, MAX_FIX_GAP_NS)?;
        let [a, b] = [self.positions_m[before], self.positions_m[after]];
        Some(Pose {
            stamp_ns,
            east_m: a[0] + share * (b[0] - a[0]),
            north_m: a[1] + share * (b[1] - a[1]),
            yaw_rad: self.yaw_at(stamp_ns)?,
        })
    }

    fn yaw_at(&self, stamp_ns: i64) -> Option<f64> {
        let after = self.yaws.partition_point(|&(at, _)| at < stamp_ns);
        let (after_ns, after_yaw) = *self.yaws.get(after).or_else(|| self.yaws.last())?;
        let (before_ns, before_yaw) = self.yaws[after.saturating_sub(1)];
        let nearest_ns = (after_ns - stamp_ns)
            .abs()
            .min((stamp_ns - before_ns).abs());
        if nearest_ns > MAX_YAW_GAP_NS {
            return None;
        }
        if after_ns <= before_ns {
            return Some(after_yaw);
        }
        let share = ((stamp_ns - before_ns) as f64 / (after_ns - before_ns) as f64).clamp(0.0, 1.0);
        Some(before_yaw + share * (after_yaw - before_yaw))
    }

    /// Takes out the lever arm of the antenna, where the log says where it is mounted.
    fn move_to_vehicle_origin(&mut self, fixes: &Series<GnssFix>, tree: &FrameTree) {
        let Some(antenna) = fixes
            .first()
            .filter(|fix| tree.places(&fix.frame_id))
            .and_then(|fix| tree.vehicle_from(&fix.frame_id))
        else {
            return;
        };
        let arm = antenna.translation.vector;
        for index in 0..self.stamps_ns.len() {
            if let Some(yaw) = self.yaw_at(self.stamps_ns[index]) {
                let (sin, cos) = yaw.sin_cos();
                self.positions_m[index][0] -= cos * arm.x - sin * arm.y;
                self.positions_m[index][1] -= sin * arm.x + cos * arm.y;
            }
        }
    }
}

/// Neighbours of a time in sorted stamps and the share of the way between them.
fn bracket(stamps_ns: &[i64], stamp_ns: i64, max_gap_ns: i64) -> Option<(usize, usize, f64)> {
    let after = stamps_ns.partition_point(|&at| at < stamp_ns);
    if after < stamps_ns.len() && stamps_ns[after] == stamp_ns {
        return Some((after, after, 0.0));
    }
    let before = after.checked_sub(1)?;
    let span_ns = stamps_ns.get(after)?.saturating_sub(stamps_ns[before]);
    (span_ns <= max_gap_ns).then(|| {
        let share = (stamp_ns - stamps_ns[before]) as f64 / span_ns as f64;
        (before, after, share)
    })
}

/// Usable fixes in the local frame, one a stamp.
struct Fixes {
    stamps_ns: Vec<i64>,
    positions_m: Vec<[f64; 2]>,
    sigmas_m: Vec<f64>,
    set_aside: u64,
}

impl Fixes {
    fn new(series: &Series<GnssFix>, frame: &LocalFrame) -> Self {
        let mut fixes = Self {
            stamps_ns: Vec::with_capacity(series.len()),
            positions_m: Vec::with_capacity(series.len()),
            sigmas_m: Vec::with_capacity(series.len()),
            set_aside: 0,
        };
        for fix in series {
            let is_new = fixes
                .stamps_ns
                .last()
                .is_none_or(|&last| fix.stamp_ns > last);
            if !fix.value.has_fix || !is_new {
                fixes.set_aside += 1;
                continue;
            }
            let [east_m, north_m, _] =
                frame.to_enu([fix.value.longitude_deg, fix.value.latitude_deg, 0.0]);
            fixes.stamps_ns.push(fix.stamp_ns);
            fixes.positions_m.push([east_m, north_m]);
            fixes.sigmas_m.push(sigma_m(&fix.value));
        }
        fixes.drop_teleports();
        fixes
    }

    /// Drops fixes that no car can reach from both neighbours.
    fn drop_teleports(&mut self) {
        let size = self.stamps_ns.len();
        let reachable = |a: usize, b: usize| {
            let seconds = (self.stamps_ns[b] - self.stamps_ns[a]) as f64 * 1e-9;
            let [p, q] = [self.positions_m[a], self.positions_m[b]];
            (q[0] - p[0]).hypot(q[1] - p[1]) <= MAX_SPEED_M_S * seconds.max(0.1)
        };
        let keep: Vec<bool> = (0..size)
            .map(|i| (i > 0 && reachable(i - 1, i)) || (i + 1 < size && reachable(i, i + 1)))
            .collect();
        let mut kept = keep.iter();
        self.stamps_ns.retain(|_| kept.next() == Some(&true));
        let mut kept = keep.iter();
        self.positions_m.retain(|_| kept.next() == Some(&true));
        let mut kept = keep.iter();
        self.sigmas_m.retain(|_| kept.next() == Some(&true));
        self.set_aside += (size - self.stamps_ns.len()) as u64;
    }
}

fn sigma_m(fix: &GnssFix) -> f64 {
    fix.covariance_enu_m2
        .map(|covariance| (0.5 * (covariance[0] + covariance[4])).sqrt())
        .filter(|sigma| sigma.is_finite() && *sigma > 0.0)
        .map_or(DEFAULT_FIX_SIGMA_M, |sigma| {
            sigma.clamp(FIX_SIGMA_M.0, FIX_SIGMA_M.1)
        })
}

/// Robust smoothing: iteratively re-weighted least squares with the Geman-McClure loss.
fn smooth(fixes: &Fixes) -> Vec<[f64; 2]> {
    let size = fixes.stamps_ns.len();
    let mut weights = vec![1.0; size];
    let mut smoothed = fixes.positions_m.clone();
    for _ in 0..ROBUST_ROUNDS {
        let Some(solution) = smooth_once(fixes, &weights) else {
            break;
        };
        smoothed = solution;
        let distances: Vec<f64> = smoothed
            .iter()
            .zip(&fixes.positions_m)
            .map(|(p, z)| (p[0] - z[0]).hypot(p[1] - z[1]))
            .collect();
        let scale_m = 3.0 * median(distances.clone()).max(JUMP_FLOOR_M);
        for (weight, distance_m) in weights.iter_mut().zip(distances) {
            let ratio = distance_m / scale_m;
            *weight = 1.0 / (1.0 + ratio * ratio).powi(2);
        }
    }
    smoothed
}

fn smooth_once(fixes: &Fixes, weights: &[f64]) -> Option<Vec<[f64; 2]>> {
    let size = fixes.stamps_ns.len();
    let mut normal = Banded::zero(size);
    let mut rhs = [vec![0.0; size], vec![0.0; size]];
    for i in 0..size {
        let information = weights[i] / fixes.sigmas_m[i].powi(2);
        normal.diagonal[i] += information;
        for (rhs, position_m) in rhs.iter_mut().zip(fixes.positions_m[i]) {
            rhs[i] += information * position_m;
        }
    }
    for i in 2..size {
        let seconds = |a: usize, b: usize| (fixes.stamps_ns[b] - fixes.stamps_ns[a]) as f64 * 1e-9;
        let (h1, h2) = (seconds(i - 2, i - 1), seconds(i - 1, i));
        let span = 0.5 * (h1 + h2);
        // Acceleration = (slope2 - slope1) / span.
        let row = [
            1.0 / (h1 * span),
            -(1.0 / h1 + 1.0 / h2) / span,
            1.0 / (h2 * span),
        ];
        normal.add_row(i, row, span / ACCELERATION_PSD);
    }
    let factor = normal.factorise()?;
    let [east, north] = rhs.map(|axis| factor.solve(axis));
    Some(east.into_iter().zip(north).map(|(e, n)| [e, n]).collect())
}

/// The median of finite values; 0 for none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Headings from orientations, unwrapped, in the vehicle's axes.
fn measured_yaws(recording: &Recording, tree: &FrameTree) -> Vec<(i64, f64)> {
    let mut yaws: Vec<(i64, f64)> = Vec::with_capacity(recording.imu.len());
    for imu in &recording.imu {
        let mounted_yaw = tree
            .vehicle_from(&imu.frame_id)
            .and_then(|mounting| {
                let q = mounting.rotation.coords;
                yaw_rad([q.x, q.y, q.z, q.w])
            })
            .unwrap_or(0.0);
        let measured = imu.value.orientation.and_then(yaw_rad);
        if let Some(yaw) = measured.map(|yaw| yaw - mounted_yaw) {
            push_unwrapped(&mut yaws, imu.stamp_ns, yaw);
        }
    }
    yaws
}

fn push_unwrapped(yaws: &mut Vec<(i64, f64)>, stamp_ns: i64, yaw: f64) {
    let unwrapped = match yaws.last() {
        Some(&(last_ns, _)) if last_ns >= stamp_ns => return,
        Some(&(_, last)) => {
            let turn = (yaw - last).rem_euclid(std::f64::consts::TAU);
            let turn = if turn > std::f64::consts::PI {
                turn - std::f64::consts::TAU
            } else {
                turn
            };
            last + turn
        }
        None => yaw,
    };
    yaws.push((stamp_ns, unwrapped));
}

/// Headings without their slow bias: the median of course minus heading around each second.
fn without_bias(yaws: Vec<(i64, f64)>, courses: &[(i64, f64)]) -> Vec<(i64, f64)> {
    let yaw_at = |stamp_ns: i64| {
        let after = yaws.partition_point(|&(at, _)| at < stamp_ns);
        yaws[after.min(yaws.len() - 1)].1
    };
    let differences: Vec<(i64, f64)> = courses
        .iter()
        .map(|&(stamp_ns, course)| (stamp_ns, wrap_angle(course - yaw_at(stamp_ns))))
        .collect();
    let mut knots: Vec<(i64, f64)> = Vec::new();
    let mut next_ns = i64::MIN;
    for &(stamp_ns, _) in &differences {
        if stamp_ns >= next_ns {
            let from = differences.partition_point(|&(at, _)| at < stamp_ns - BIAS_WINDOW_NS);
            let around = differences[from..]
                .iter()
                .take_while(|&&(at, _)| at <= stamp_ns + BIAS_WINDOW_NS)
                .map(|&(_, difference)| difference);
            knots.push((stamp_ns, median(around.collect())));
            next_ns = stamp_ns + 1_000_000_000;
        }
    }
    let bias_at = |stamp_ns: i64| {
        let after = knots.partition_point(|&(at, _)| at < stamp_ns);
        let (Some(b), Some(a)) = (
            knots.get(after).or(knots.last()),
            knots.get(after.saturating_sub(1)),
        ) else {
            return 0.0;
        };
        if b.0 <= a.0 {
            return b.1;
        }
        let share = ((stamp_ns - a.0) as f64 / (b.0 - a.0) as f64).clamp(0.0, 1.0);
        a.1 + share * wrap_angle(b.1 - a.1)
    };
    yaws.iter()
        .map(|&(stamp_ns, yaw)| (stamp_ns, yaw + bias_at(stamp_ns)))
        .collect()
}

/// Headings from the smoothed track, where the vehicle moves.
fn course_over_ground(stamps_ns: &[i64], positions_m: &[[f64; 2]]) -> Vec<(i64, f64)> {
    let mut yaws = Vec::new();
    for i in 1..stamps_ns.len().saturating_sub(1) {
        let seconds = (stamps_ns[i + 1] - stamps_ns[i - 1]) as f64 * 1e-9;
        let [a, b] = [positions_m[i - 1], positions_m[i + 1]];
        let (east, north) = (b[0] - a[0], b[1] - a[1]);
        if east.hypot(north) >= MIN_COURSE_SPEED_M_S * seconds {
            push_unwrapped(&mut yaws, stamps_ns[i], north.atan2(east));
        }
    }
    yaws
}
