//! What one vehicle recorded, merged from however many log files, in capture order.
//!
//! A log is only a container. Messages of overlapping, renamed or re-chunked copies of a drive
//! are the same messages: they are recognised by capture time and payload digest, and kept once
//! (promise P1).

use tilefold_schemas::log::{
    CameraCalibration, DetectionFrame, GnssFix, Imu, LogMessage, Odometry, Payload, Transform,
    VehicleFrame,
};
use tilefold_schemas::observation::ObservationFrame;

/// A value with its capture time.
#[derive(Debug, Clone, PartialEq)]
pub struct Stamped<T> {
    /// Nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// Frame named by the message; empty if none.
    pub frame_id: String,
    /// Payload digest.
    pub digest: i64,
    /// What was captured.
    pub value: T,
}

impl<T> Stamped<T> {
    /// The same moment with another value.
    #[must_use]
    pub fn with<U>(&self, value: U) -> Stamped<U> {
        Stamped {
            stamp_ns: self.stamp_ns,
            frame_id: self.frame_id.clone(),
            digest: self.digest,
            value,
        }
    }
}

/// Messages of one kind, sorted by capture time and digest, each once.
pub type Series<T> = Vec<Stamped<T>>;

/// What one vehicle recorded on one detection channel, with everything that is needed to place it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recording {
    /// GNSS positions.
    pub fixes: Series<GnssFix>,
    /// Inertial measurements, and orientations given as poses.
    pub imu: Series<Imu>,
    /// Odometry.
    pub odometry: Series<Odometry>,
    /// Detections made on the vehicle.
    pub detections: Series<DetectionFrame>,
    /// What a network saw in the pictures of a camera; its digest is of picture and network. Empty
    /// where detections were made on the vehicle.
    pub observations: Series<ObservationFrame>,
    /// Other vehicles that were seen, on whatever topic.
    pub vehicles: Series<VehicleFrame>,
    /// Camera intrinsics. Latched: they hold until the next.
    pub calibrations: Series<CameraCalibration>,
    /// Static transforms. Latched.
    pub static_transforms: Series<Vec<Transform>>,
    /// Digest of the network that saw `observations`; 0 for detections made on the vehicle.
    pub model: i64,
    /// How many messages were copies of others.
    pub duplicates: u64,
}

impl Recording {
    /// Adds a message in any order. Kinds that the map stage does not read are dropped here.
    pub fn push(&mut self, message: LogMessage) {
        let LogMessage {
            stamp_ns,
            frame_id,
            digest,
            payload,
            ..
        } = message;
        macro_rules! push {
            ($series:ident, $value:expr) => {
                self.$series.push(Stamped {
                    stamp_ns,
                    frame_id,
                    digest,
                    value: $value,
                })
            };
        }
        match payload {
            Payload::Gnss(fix) => push!(fixes, fix),
            Payload::Imu(imu) => push!(imu, imu),
            Payload::Odometry(odometry) => push!(odometry, odometry),
            // What drifts from where it began says nothing of east.
            Payload::Pose(_) if is_odometry(&frame_id) => {}
            Payload::Pose(pose) => push!(
                imu,
                Imu {
                    orientation: Some(pose.orientation),
                    yaw_variance_rad2: None,
                    angular_velocity_rad_s: None,
                }
            ),
            Payload::Detections(frame) => push!(detections, frame),
            Payload::Vehicles(frame) => push!(vehicles, frame),
            Payload::Calibration(calibration) => push!(calibrations, calibration),
            Payload::Transforms {
                transforms,
                is_static: true,
            } => push!(static_transforms, transforms),
            Payload::Transforms { .. } | Payload::Image(_) => {}
        }
    }

    /// Brings every series into capture order and drops copies.
    pub fn settle(&mut self) {
        self.duplicates += settle(&mut self.fixes)
            + settle(&mut self.imu)
            + settle(&mut self.odometry)
            + settle(&mut self.detections)
            + settle(&mut self.observations)
            + settle(&mut self.vehicles)
            + settle(&mut self.calibrations)
            + settle(&mut self.static_transforms);
    }

    /// The part captured in `[from_ns, to_ns)`, with the latched messages that hold then.
    /// The recording must be settled.
    #[must_use]
    pub fn slice(&self, from_ns: i64, to_ns: i64) -> Self {
        Self {
            fixes: between(&self.fixes, from_ns, to_ns).to_vec(),
            imu: between(&self.imu, from_ns, to_ns).to_vec(),
            odometry: between(&self.odometry, from_ns, to_ns).to_vec(),
            detections: between(&self.detections, from_ns, to_ns).to_vec(),
            observations: between(&self.observations, from_ns, to_ns).to_vec(),
            vehicles: between(&self.vehicles, from_ns, to_ns).to_vec(),
            calibrations: latched(&self.calibrations, to_ns),
            static_transforms: self.static_transforms.clone(),
            model: self.model,
            duplicates: 0,
        }
    }

    /// Capture times of the frames of its channel, ascending: of its detections, or of its pictures.
    pub fn frames_ns(&self) -> impl Iterator<Item = i64> + '_ {
        let detections = self.detections.iter().map(|frame| frame.stamp_ns);
        detections.chain(self.observations.iter().map(|frame| frame.stamp_ns))
    }

    /// First and last capture time of a settled recording; what is latched has none of its own.
    #[must_use]
    pub fn span_ns(&self) -> Option<(i64, i64)> {
        let ends = [
            span(&self.fixes),
            span(&self.imu),
            span(&self.odometry),
            span(&self.detections),
            span(&self.observations),
            span(&self.vehicles),
        ];
        let ends = ends.into_iter().flatten();
        ends.reduce(|(from, to), (first, last)| (from.min(first), to.max(last)))
    }

    /// Digest of all messages: capture times and payloads, nothing of the files they came in.
    #[must_use]
    pub fn digest(&self) -> i64 {
        let mut hasher = blake3::Hasher::new();
        feed(&mut hasher, b"fixes", &self.fixes);
        feed(&mut hasher, b"imu", &self.imu);
        feed(&mut hasher, b"odometry", &self.odometry);
        feed(&mut hasher, b"detections", &self.detections);
        feed(&mut hasher, b"calibrations", &self.calibrations);
        feed(&mut hasher, b"static", &self.static_transforms);
        // Recordings from before vehicles were read keep their digests.
        if !self.vehicles.is_empty() {
            feed(&mut hasher, b"vehicles", &self.vehicles);
        }
        // So do those from before pictures were looked at.
        if !self.observations.is_empty() {
            feed(&mut hasher, b"observations", &self.observations);
        }
        tilefold_schemas::id::first_i64(&hasher.finalize())
    }
}

fn span<T>(series: &[Stamped<T>]) -> Option<(i64, i64)> {
    Some((series.first()?.stamp_ns, series.last()?.stamp_ns))
}

/// Whether a frame is the odometry frame of REP 105, under whatever prefix.
fn is_odometry(frame_id: &str) -> bool {
    frame_id.rsplit('/').next() == Some("odom")
}

fn settle<T>(series: &mut Series<T>) -> u64 {
    let before = series.len();
    series.sort_by_key(|entry| (entry.stamp_ns, entry.digest));
    series.dedup_by_key(|entry| (entry.stamp_ns, entry.digest));
    (before - series.len()) as u64
}

/// The entries of a settled series captured in `[from_ns, to_ns)`.
#[must_use]
pub fn between<T>(series: &[Stamped<T>], from_ns: i64, to_ns: i64) -> &[Stamped<T>] {
    let from = series.partition_point(|entry| entry.stamp_ns < from_ns);
    let to = series.partition_point(|entry| entry.stamp_ns < to_ns);
    &series[from..to.max(from)]
}

/// The last entry before `to_ns`, or the first at all where there is none before.
fn latched<T: Clone>(series: &[Stamped<T>], to_ns: i64) -> Series<T> {
    let end = series.partition_point(|entry| entry.stamp_ns < to_ns);
    series
        .get(end.saturating_sub(1))
        .cloned()
        .into_iter()
        .collect()
}

fn feed<T>(hasher: &mut blake3::Hasher, name: &[u8], series: &[Stamped<T>]) {
    hasher.update(name);
    hasher.update(&(series.len() as u64).to_le_bytes());
    for entry in series {
        hasher.update(&entry.stamp_ns.to_le_bytes());
        hasher.update(&entry.digest.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tilefold_schemas::log::FramePose;

    #[test]
    fn poses_point_east_of_something_unless_they_drift() {
        let headings = |frame: &str| {
            let mut recording = Recording::default();
            recording.push(LogMessage {
                topic: 0,
                stamp_ns: 0,
                log_time_ns: 0,
                frame_id: frame.to_owned(),
                payload: Payload::Pose(FramePose {
                    position_m: [0.0; 3],
                    orientation: [0.0, 0.0, 0.0, 1.0],
                }),
                digest: 0,
            });
            recording.imu.len()
        };
        assert_eq!(["enu", "map", ""].map(headings), [1; 3]);
        assert_eq!(["odom", "/odom", "car_3/odom"].map(headings), [0; 3]);
    }
}
