//! One frame as the map stage works on it: a pose and the lines that were seen, in metres in the
//! vehicle frame.

use nalgebra::Point3;
use tilefold_schemas::log::{Detection, DetectionFrame, DetectionSpace};
use tilefold_schemas::{Color, ElementKind, Marking};
use tilefold_tiler::recording::{Recording, Stamped};

use crate::camera::{Camera, CameraError};
use crate::frames::FrameTree;
use crate::pixels::Pixels;
use crate::pose::{Pose, Trajectory};
use crate::surface::Surface;

/// A line that was seen.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenLine {
    /// Which of the message's detections it is, counted from 0.
    pub detection: usize,
    /// How it is painted, if recognised.
    pub marking: Marking,
    /// Its colour, if recognised.
    pub color: Color,
    /// Vertices in the vehicle frame (x forward, y left), ascending in x.
    pub points_m: Vec<[f64; 2]>,
}

impl SeenLine {
    /// The detection of this number as a line that runs forward through `points_m`; none if fewer
    /// than two points are usable.
    pub(crate) fn new(
        (detection, of): (usize, &Detection),
        points_m: impl Iterator<Item = [f64; 2]>,
    ) -> Option<Self> {
        let line = Self {
            detection,
            marking: of.marking,
            color: of.color,
            points_m: Vec::new(),
        };
        line.through(points_m)
    }

    /// The same line through other points.
    pub(crate) fn through(&self, points_m: impl Iterator<Item = [f64; 2]>) -> Option<Self> {
        let mut points_m: Vec<[f64; 2]> = points_m.collect();
        points_m.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points_m.dedup_by(|b, a| b[0] - a[0] < 1e-6);
        (points_m.len() >= 2).then_some(Self { points_m, ..*self })
    }

    /// Lateral position at a range ahead; none outside the line's extent.
    #[must_use]
    pub fn lateral_m(&self, range_m: f64) -> Option<f64> {
        let after = self.points_m.partition_point(|point| point[0] < range_m);
        let to = self.points_m.get(after)?;
        if to[0] == range_m {
            return Some(to[1]);
        }
        let from = self.points_m.get(after.checked_sub(1)?)?;
        let share = (range_m - from[0]) / (to[0] - from[0]);
        Some(from[1] + share * (to[1] - from[1]))
    }
}

/// What was seen in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenFrame {
    /// Capture time by the detection channel's clock.
    pub stamp_ns: i64,
    /// Lines.
    pub lines: Vec<SeenLine>,
}

/// A frame with its pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    /// Where the vehicle was; the stamp is that of the frame.
    pub pose: Pose,
    /// What it saw.
    pub lines: Vec<SeenLine>,
}

/// Frames of a recording, and why the others could not be used.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SeenFrames {
    /// Usable frames in capture order.
    pub frames: Vec<SeenFrame>,
    /// What was seen in pixels, to be cast anew onto a better known road; `frames` has it on flat
    /// ground.
    pub pixels: Option<Pixels>,
    /// Capture times of frames that cannot be brought into the vehicle frame...
    pub without_place_ns: Vec<i64>,
    /// ... and why, of the last of them.
    pub no_place: String,
}

impl SeenFrames {
    /// All detection frames of a recording, in metres.
    #[must_use]
    pub fn collect(recording: &Recording, tree: &FrameTree) -> Self {
        let camera = camera(recording, tree);
        let mut collected = Self::default();
        let mut last_ns = None;
        for frame in &recording.detections {
            // Two different frames with one stamp: the first by digest stands.
            if last_ns.replace(frame.stamp_ns) == Some(frame.stamp_ns) {
                continue;
            }
            collected.add(frame, &camera, tree);
        }
        collected
    }

    fn add(
        &mut self,
        frame: &Stamped<DetectionFrame>,
        camera: &Result<Camera, NoPlace>,
        tree: &FrameTree,
    ) {
        let stamp_ns = frame.stamp_ns;
        let lines = match (frame.value.space, camera) {
            (DetectionSpace::Metres, _) => match lines_in_metres(frame, tree) {
                Some(lines) => lines,
                None => return self.lose(stamp_ns, &NoPlace::Circle(frame.frame_id.clone())),
            },
            (DetectionSpace::Pixels, Ok(camera)) => {
                let pixels = self
                    .pixels
                    .get_or_insert_with(|| Pixels::new(camera.clone()));
                pixels.add(frame);
                pixels.lines(stamp_ns, camera, &Surface::FLAT)
            }
            (DetectionSpace::Pixels, Err(error)) => return self.lose(stamp_ns, error),
        };
        self.frames.push(SeenFrame { stamp_ns, lines });
    }

    fn lose(&mut self, stamp_ns: i64, why: &NoPlace) {
        self.without_place_ns.push(stamp_ns);
        self.no_place = why.to_string();
    }
}

/// Frames with the poses of the time at which they were really captured: `lag_ns` before their
/// stamp. Stamps of frames without a pose come second.
#[must_use]
pub fn place(
    frames: Vec<SeenFrame>,
    trajectory: &Trajectory,
    lag_ns: i64,
) -> (Vec<Look>, Vec<i64>) {
    let mut looks = Vec::with_capacity(frames.len());
    let mut without_pose_ns = Vec::new();
    for SeenFrame { stamp_ns, lines } in frames {
        match trajectory.at(stamp_ns.saturating_sub(lag_ns)) {
            Some(pose) => looks.push(Look {
                pose: Pose { stamp_ns, ..pose },
                lines,
            }),
            None => without_pose_ns.push(stamp_ns),
        }
    }
    (looks, without_pose_ns)
}

/// Why frames have no place in the vehicle frame.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoPlace {
    /// No calibration was recorded.
    #[error("the log has no camera calibration; record CameraInfo or foxglove.CameraCalibration")]
    Uncalibrated,
    /// Transforms lead back to where they began.
    #[error("the static transforms of the frame `{0}` run in a circle")]
    Circle(String),
    /// Its calibration cannot be used.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

/// The camera that detections in pixels are of.
pub(crate) fn camera(recording: &Recording, tree: &FrameTree) -> Result<Camera, NoPlace> {
    let calibration = recording.calibrations.last();
    let calibration = calibration.ok_or(NoPlace::Uncalibrated)?;
    let frame = &calibration.frame_id;
    let mounting = tree.vehicle_from(frame);
    let mounting = mounting.ok_or_else(|| NoPlace::Circle(frame.clone()))?;
    Ok(Camera::new(&calibration.value, mounting)?)
}

/// The lane markings of a message and their numbers.
pub(crate) fn lane_markings(frame: &DetectionFrame) -> impl Iterator<Item = (usize, &Detection)> {
    let detections = frame.detections.iter().enumerate();
    detections.filter(|(_, detection)| detection.kind == ElementKind::LaneMarking)
}

fn lines_in_metres(frame: &Stamped<DetectionFrame>, tree: &FrameTree) -> Option<Vec<SeenLine>> {
    let vehicle_from_frame = tree.vehicle_from(&frame.frame_id)?;
    let place = |&[x, y, z]: &[f64; 3]| {
        let point = vehicle_from_frame * Point3::new(x, y, z);
        [point.x, point.y]
    };
    let line = |line: (usize, &Detection)| SeenLine::new(line, line.1.points.iter().map(place));
    Some(lane_markings(&frame.value).filter_map(line).collect())
}
