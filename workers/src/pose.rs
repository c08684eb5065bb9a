//! Where the vehicle was: a smooth trajectory through noisy, jumping GNSS (method.md, section 2).
//!
//! Fixes, heading, gyro and wheels are fused at evenly spaced nodes: `heading` makes a
//! heading, `motion` the places and what the heading is off by. Slow GNSS error (which is
//! most of it) stays in the trajectory: registration against the map takes it out. What a log does
//! not have is done without, and [`Sources`] says so.

use tilefold_schemas::log::GnssFix;
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::recording::{Recording, Series};

use crate::fixes::Fixes;
use crate::frames::FrameTree;
use crate::heading::{self, Heading, HeadingInputs, push_unwrapped};
pub use crate::heading::{GyroUse, HeadingSource};
pub(crate) use crate::median::median;
use crate::motion::{self, Guides, Motion};
use crate::nodes::Nodes;
use crate::signal::Signal;

/// A pose is interpolated between fixes at most this far apart...
const MAX_FIX_GAP_NS: i64 = 2_000_000_000;
/// ... or this far, if wheels and heading lead from one to the other.
const MAX_BRIDGED_GAP_NS: i64 = 10_000_000_000;
/// Course over ground stands for the heading only above this speed, in m/s.
const MIN_COURSE_SPEED_M_S: f64 = 2.0;
/// Below this speed a vehicle stands, in m/s.
const STANDING_M_S: f64 = 0.2;
/// A yaw less certain than this is none, in radians.
const MAX_YAW_SIGMA: f64 = 0.17;
/// Nodes over which wheels are compared with positions: 5 s.
const WHEEL_NODES: usize = 25;
/// The vehicle must move this far meanwhile, in metres.
const MIN_WHEEL_WAY_M: f64 = 20.0;
/// Wheels whose scale is outside of this measure something else.
const WHEEL_SCALES: std::ops::RangeInclusive<f64> = 0.8..=1.25;

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

    /// A point of the local frame in the vehicle frame (x forward, y left, metres).
    #[must_use]
    pub fn vehicle_from_local(&self, [east_m, north_m]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let (dx, dy) = (east_m - self.east_m, north_m - self.north_m);
        [cos * dx + sin * dy, -sin * dx + cos * dy]
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

/// What became of the wheels' speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WheelUse {
    /// Their way is part of the trajectory.
    Used,
    /// The log has no odometry, or one that never moves.
    Missing,
    /// Their way has no steady relation to that of the positions.
    Refused,
}

/// What a trajectory is made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sources {
    /// Of the heading; none if nothing says where the vehicle heads: then there are no poses.
    pub heading: Option<HeadingSource>,
    /// The yaw rates.
    pub gyro: GyroUse,
    /// The speed.
    pub wheels: WheelUse,
}

impl Sources {
    /// What was done without, and why.
    pub fn fallbacks(&self) -> impl Iterator<Item = &'static str> {
        let heading = match self.heading {
            Some(HeadingSource::Orientation) => None,
            Some(HeadingSource::Course) => Some(
                "no orientation in the log: the heading is the course over ground, where the vehicle moves",
            ),
            None => {
                Some("no orientation in the log, and the vehicle never moved: it has no heading")
            }
        };
        let gyro = match self.gyro {
            GyroUse::Used => None,
            GyroUse::Missing => Some("no yaw rates in the log: turns follow from headings alone"),
            GyroUse::Refused => {
                Some("yaw rates contradict the headings, or never change: not used")
            }
        };
        let wheels = match self.wheels {
            WheelUse::Used => None,
            WheelUse::Missing => Some("no odometry in the log: gaps in GNSS are not bridged"),
            WheelUse::Refused => Some(
                "the odometry's way is not that of the positions by any steady scale: not used",
            ),
        };
        [heading, gyro, wheels].into_iter().flatten()
    }
}

/// A smooth trajectory with a heading.
#[derive(Debug, Clone)]
pub struct Trajectory {
    nodes: Nodes,
    motion: Motion,
    /// At the nodes, unwrapped, with what the motion adds; and their variances.
    yaws_rad: Vec<f64>,
    yaw_variances: Vec<f64>,
    fix_stamps_ns: Vec<i64>,
    /// What it is made from.
    pub sources: Sources,
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
        let too_few = PoseError::TooFewFixes(fixes.stamps_ns.len());
        let (&[first_ns, .., last_ns], 3..) = (&fixes.stamps_ns[..], fixes.stamps_ns.len()) else {
            return Err(too_few);
        };
        let nodes = Nodes::around(first_ns, last_ns);
        let alone = motion::solve(&nodes, &fixes, &Guides::default(), None).ok_or(too_few)?;
        let speeds = speeds(recording);
        let (wheels, ways_m) = ways_m(&nodes, &speeds, &alone);
        let heading = HeadingInputs {
            nodes: &nodes,
            orientations: &heading::orientations(recording, tree),
            courses: &courses(&alone),
            gyro: &heading::yaw_rates(recording, tree),
            stands: &stands(&alone, &ways_m),
        }
        .solve();
        let sources = Sources {
            heading: heading.as_ref().map(|heading| heading.source),
            gyro: heading
                .as_ref()
                .map_or(GyroUse::Missing, |heading| heading.gyro),
            wheels,
        };
        let guides = Guides {
            yaws_rad: heading.as_ref().map(|heading| heading.yaws_rad.as_slice()),
            is_independent: sources.has_independent_heading(),
            antenna_m: antenna_m(&recording.fixes, tree),
            ways_m: &ways_m,
        };
        let motion = motion::solve(&nodes, &fixes, &guides, Some(&alone)).unwrap_or(alone);
        let (yaws_rad, yaw_variances) = turned(heading, &motion);
        Ok(Self {
            nodes,
            motion,
            yaws_rad,
            yaw_variances,
            sources,
            fixes_set_aside: fixes.set_aside,
            fix_stamps_ns: fixes.stamps_ns,
        })
    }

    /// Places along the trajectory: east, north in metres.
    pub fn places(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.motion.places_m.iter().copied()
    }

    /// The pose at a time; none before the first fix, after the last, between fixes that are too
    /// far apart, and where the heading is not known.
    #[must_use]
    pub fn at(&self, stamp_ns: i64) -> Option<Pose> {
        let (node, share) = self.known(stamp_ns)?;
        let [east_m, north_m] = self.place_m(node, share);
        Some(Pose {
            stamp_ns,
            east_m,
            north_m,
            yaw_rad: mix(&self.yaws_rad, node, share),
        })
    }

    /// Covariance of east, north (m^2) and yaw (rad^2) of the pose at a time, against the earth:
    /// the slow error of GNSS, which neighbouring poses share, is part of it.
    #[must_use]
    pub fn covariance(&self, stamp_ns: i64) -> Option<[[f64; 3]; 3]> {
        let (node, share) = self.known(stamp_ns)?;
        let [a, b] = [node, node + 1].map(|node| self.motion.covariances[node]);
        let mut covariance: [[f64; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + share * (b[i][j] - a[i][j])));
        covariance[2][2] += mix(&self.yaw_variances, node, share);
        Some(covariance)
    }

    /// The node before a time at which the pose is known, and the share of the way to the next.
    fn known(&self, stamp_ns: i64) -> Option<(usize, f64)> {
        let after = self.fix_stamps_ns.partition_point(|&at| at < stamp_ns);
        let after_ns = *self.fix_stamps_ns.get(after)?;
        let before_ns = match after_ns == stamp_ns {
            true => after_ns,
            false => self.fix_stamps_ns[after.checked_sub(1)?],
        };
        let max_gap_ns = match self.sources {
            Sources {
                wheels: WheelUse::Used,
                ..
            } if self.sources.has_independent_heading() => MAX_BRIDGED_GAP_NS,
            _ => MAX_FIX_GAP_NS,
        };
        let (node, share) = self.nodes.between(stamp_ns)?;
        let is_headed = mix(&self.yaw_variances, node, share) <= MAX_YAW_SIGMA * MAX_YAW_SIGMA;
        (after_ns - before_ns <= max_gap_ns && is_headed).then_some((node, share))
    }

    /// Between nodes on the cubic through them and their neighbours (Catmull-Rom).
    fn place_m(&self, node: usize, share: f64) -> [f64; 2] {
        let places_m = &self.motion.places_m;
        let (b, c) = (places_m[node], places_m[node + 1]);
        let before = node.checked_sub(1).map(|before| places_m[before]);
        let after = places_m.get(node + 2).copied();
        std::array::from_fn(|axis| {
            let (b, c) = (b[axis], c[axis]);
            let a = before.map_or(2.0 * b - c, |a| a[axis]);
            let d = after.map_or(2.0 * c - b, |d| d[axis]);
            let (first, second) = (0.5 * (c - a), 0.5 * (d - b));
            let (s, left) = (share, 1.0 - share);
            let lift = s * left * (left * (first - (c - b)) - s * (second - (c - b)));
            b + s * (c - b) + lift
        })
    }
}

impl Sources {
    /// Whether the heading knows more than the positions do.
    fn has_independent_heading(&self) -> bool {
        match self.heading {
            Some(HeadingSource::Orientation) => true,
            Some(HeadingSource::Course) => self.gyro == GyroUse::Used,
            None => false,
        }
    }
}

fn mix(values: &[f64], node: usize, share: f64) -> f64 {
    match share {
        0.0 => values[node],
        _ => values[node] + share * (values[node + 1] - values[node]),
    }
}

/// Yaws with the bias that the motion found, and the variances of all else.
fn turned(heading: Option<Heading>, motion: &Motion) -> (Vec<f64>, Vec<f64>) {
    let Some(heading) = heading else {
        let nodes = motion.places_m.len();
        return (vec![0.0; nodes], vec![f64::INFINITY; nodes]);
    };
    let turns = motion.turns_rad.iter();
    let yaws = heading
        .yaws_rad
        .iter()
        .zip(turns)
        .map(|(yaw, turn)| yaw + turn);
    (yaws.collect(), heading.variances)
}

/// Where the antenna is, as far as the log says.
fn antenna_m(fixes: &Series<GnssFix>, tree: &FrameTree) -> [f64; 2] {
    let placed = fixes.first().filter(|fix| tree.places(&fix.frame_id));
    let antenna = placed.and_then(|fix| tree.vehicle_from(&fix.frame_id));
    antenna.map_or([0.0; 2], |antenna| {
        let arm = antenna.translation.vector;
        [arm.x, arm.y]
    })
}

fn way_m(motion: &Motion, from: usize, to: usize) -> f64 {
    let (a, b) = (motion.places_m[from], motion.places_m[to]);
    (b[0] - a[0]).hypot(b[1] - a[1])
}

/// Courses over ground at nodes where the vehicle moves, unwrapped.
fn courses(motion: &Motion) -> Vec<(usize, f64)> {
    let mut courses = Vec::new();
    for k in 1..motion.places_m.len() - 1 {
        if way_m(motion, k - 1, k + 1) >= 2.0 * MIN_COURSE_SPEED_M_S * Nodes::SPACING_S {
            let (a, b) = (motion.places_m[k - 1], motion.places_m[k + 1]);
            push_unwrapped(&mut courses, k, (b[1] - a[1]).atan2(b[0] - a[0]));
        }
    }
    courses
}

/// Whether the vehicle stands between a node and the next: by its wheels, else by its positions.
fn stands(motion: &Motion, ways_m: &[Option<f64>]) -> Vec<bool> {
    (1..motion.places_m.len())
        .map(|k| match ways_m.get(k - 1).copied().flatten() {
            Some(way_m) => way_m == 0.0,
            None => way_m(motion, k - 1, k) < STANDING_M_S * Nodes::SPACING_S,
        })
        .collect()
}

/// Forward speeds by odometry.
fn speeds(recording: &Recording) -> Signal {
    let odometry = recording.odometry.iter();
    Signal::new(odometry.map(|o| (o.stamp_ns, o.value.linear_velocity_m_s[0])))
}

/// Ways between nodes by the wheels, in metres of the positions: the scale of wheels is the median
/// of what positions and they say over some seconds. Empty if wheels are not used.
fn ways_m(nodes: &Nodes, speeds: &Signal, motion: &Motion) -> (WheelUse, Vec<Option<f64>>) {
    if speeds.is_flat() {
        return (WheelUse::Missing, Vec::new());
    }
    let way = |k: usize| {
        let mean = speeds.mean(nodes.stamp_ns(k), nodes.stamp_ns(k + 1))?;
        Some(mean * Nodes::SPACING_S)
    };
    let ways: Vec<Option<f64>> = (0..nodes.len() - 1).map(way).collect();
    let scales: Vec<f64> = ways
        .chunks_exact(WHEEL_NODES)
        .enumerate()
        .filter_map(|(chunk, ways)| {
            let wheels_m = ways.iter().copied().sum::<Option<f64>>()?;
            let first = chunk * WHEEL_NODES;
            let steps = first..first + WHEEL_NODES;
            let positions_m: f64 = steps.map(|k| way_m(motion, k, k + 1)).sum();
            (positions_m >= MIN_WHEEL_WAY_M).then(|| wheels_m / positions_m)
        })
        .collect();
    let scale = match scales.is_empty() {
        true => 1.0,
        false => median(scales),
    };
    if !WHEEL_SCALES.contains(&scale) {
        return (WheelUse::Refused, Vec::new());
    }
    let scaled = ways.into_iter().map(|way| way.map(|way| way / scale));
    (WheelUse::Used, scaled.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tilefold_schemas::log::{FramePose, Imu, Odometry};
    use tilefold_tiler::recording::Stamped;

    const TENTH_NS: i64 = 100_000_000;

    fn stamped<T>(tenth: i64, value: T) -> Stamped<T> {
        Stamped {
            stamp_ns: tenth * TENTH_NS,
            frame_id: String::new(),
            digest: tenth,
            value,
        }
    }

    fn fix(local: &LocalFrame, place_m: [f64; 2]) -> GnssFix {
        let [longitude_deg, latitude_deg, _] = local.to_wgs84([place_m[0], place_m[1], 0.0]);
        GnssFix {
            latitude_deg,
            longitude_deg,
            altitude_m: 0.0,
            covariance_enu_m2: None,
            has_fix: true,
        }
    }

    fn heading(yaw_rad: f64, rate_rad_s: Option<f64>) -> Imu {
        let (sin, cos) = (0.5 * yaw_rad).sin_cos();
        Imu {
            orientation: Some([0.0, 0.0, sin, cos]),
            yaw_variance_rad2: None,
            angular_velocity_rad_s: rate_rad_s.map(|rate| [0.0, 0.0, rate]),
        }
    }

    fn speed(metres_s: f64) -> Odometry {
        Odometry {
            pose: FramePose {
                position_m: [0.0; 3],
                orientation: [0.0, 0.0, 0.0, 1.0],
            },
            linear_velocity_m_s: [metres_s, 0.0, 0.0],
            angular_velocity_rad_s: [0.0; 3],
        }
    }

    fn local() -> LocalFrame {
        LocalFrame::new([10.0, 50.0, 0.0])
    }

    /// 20 s to the north-east at 10 m/s, standing for the last 5.
    fn way_m(tenth: i64) -> f64 {
        tenth.min(150) as f64
    }

    fn on_way() -> Recording {
        let local = local();
        let place = |tenth| [0.6 * way_m(tenth), 0.8 * way_m(tenth)];
        Recording {
            fixes: (0..200)
                .map(|t| stamped(t, fix(&local, place(t))))
                .collect(),
            ..Recording::default()
        }
    }

    fn estimate(recording: &Recording) -> Trajectory {
        Trajectory::estimate(recording, &local(), &FrameTree::default()).unwrap()
    }

    #[test]
    fn without_orientations_the_course_leads_and_is_kept_standing() {
        let trajectory = estimate(&on_way());
        assert_eq!(trajectory.sources.heading, Some(HeadingSource::Course));
        assert_eq!(trajectory.sources.fallbacks().count(), 3);
        for tenth in [50, 120, 190] {
            let pose = trajectory.at(tenth * TENTH_NS).unwrap();
            assert!((pose.yaw_rad - 0.8_f64.atan2(0.6)).abs() < 0.01, "{pose:?}");
            assert!((pose.east_m - 0.6 * way_m(tenth)).abs() < 0.1, "{pose:?}");
        }
    }

    #[test]
    fn a_heading_that_is_askew_is_set_right_by_the_way() {
        let mut recording = on_way();
        let yaw = 0.8_f64.atan2(0.6);
        recording.imu = (0..200)
            .map(|t| stamped(t, heading(yaw + 0.1, None)))
            .collect();
        let trajectory = estimate(&recording);
        assert_eq!(trajectory.sources.heading, Some(HeadingSource::Orientation));
        let found = trajectory.at(80 * TENTH_NS).unwrap().yaw_rad;
        assert!((found - yaw).abs() < 0.01, "{found} {yaw}");
    }

    #[test]
    fn sensors_that_contradict_are_refused_with_a_reason() {
        let mut recording = on_way();
        let yaw = |t: i64| (0.05 * t as f64).sin();
        let rate = |t: i64| 0.5 * (0.05 * t as f64).cos();
        recording.imu = (0..200)
            .map(|t| stamped(t, heading(yaw(t), Some(-rate(t)))))
            .collect();
        recording.odometry = (0..200)
            .map(|t| stamped(t, speed(36.0 + t as f64 % 2.0)))
            .collect();
        let sources = estimate(&recording).sources;
        assert_eq!(
            (sources.gyro, sources.wheels),
            (GyroUse::Refused, WheelUse::Refused)
        );
        recording.imu = (0..200)
            .map(|t| stamped(t, heading(yaw(t), Some(rate(t)))))
            .collect();
        recording.odometry = (0..200)
            .map(|t| stamped(t, speed(if t < 150 { 10.2 } else { 0.0 })))
            .collect();
        let sources = estimate(&recording).sources;
        assert_eq!(
            (sources.gyro, sources.wheels),
            (GyroUse::Used, WheelUse::Used)
        );
        assert_eq!(sources.fallbacks().count(), 0);
    }

    #[test]
    fn wheels_lead_through_a_gap() {
        let mut recording = on_way();
        recording
            .fixes
            .retain(|fix| !(40..90).contains(&(fix.stamp_ns / TENTH_NS)));
        let middle_ns = 65 * TENTH_NS;
        assert_eq!(estimate(&recording).at(middle_ns), None);
        let yaw = 0.8_f64.atan2(0.6);
        recording.imu = (0..200).map(|t| stamped(t, heading(yaw, None))).collect();
        recording.odometry = (0..200)
            .map(|t| stamped(t, speed(if t < 150 { 10.0 } else { 0.0 })))
            .collect();
        let trajectory = estimate(&recording);
        let pose = trajectory.at(middle_ns).unwrap();
        assert!((pose.east_m - 39.0).abs() < 0.3, "{pose:?}");
        let variance = |at_ns| trajectory.covariance(at_ns).unwrap()[0][0];
        assert!(variance(middle_ns) >= variance(20 * TENTH_NS));
    }

    #[test]
    fn who_never_moves_has_no_heading() {
        let mut recording = on_way();
        let first = recording.fixes[0].value.clone();
        for fix in &mut recording.fixes {
            fix.value = first.clone();
        }
        let trajectory = estimate(&recording);
        assert_eq!(trajectory.sources.heading, None);
        assert_eq!(trajectory.at(50 * TENTH_NS), None);
    }

    proptest! {
        /// Repeated stamps, steps back, jumps and gaps: no pose is off by what one fix is off by.
        #[test]
        fn a_few_wrong_fixes_do_not_matter(
            wrong in prop::collection::btree_map(10_i64..140, (-30.0..30.0_f64, -30.0..30.0_f64), 0..8),
        ) {
            let mut recording = on_way();
            let local = local();
            for (&tenth, &(east, north)) in &wrong {
                let place_m = [0.6 * way_m(tenth) + east, 0.8 * way_m(tenth) + north];
                recording.fixes[tenth as usize].value = fix(&local, place_m);
            }
            let copy = recording.fixes[20].clone();
            recording.fixes.insert(20, copy);
            let trajectory = estimate(&recording);
            prop_assert!(trajectory.fixes_set_aside >= 1);
            for tenth in 10..140 {
                let pose = trajectory.at(tenth * TENTH_NS).unwrap();
                let (east_m, north_m) = (0.6 * way_m(tenth), 0.8 * way_m(tenth));
                let off_m = (pose.east_m - east_m).hypot(pose.north_m - north_m);
                prop_assert!(off_m < 1.0, "{tenth}: {off_m}");
            }
        }
    }
}
