//! One frame as the map stage works on it: a pose and the lines that were seen, in metres in the
//! vehicle frame.

use nalgebra::Point3;
use tilefold_schemas::log::{Detection, DetectionFrame, DetectionSpace};
use tilefold_schemas::{Color, ElementKind, Marking};
use tilefold_tiler::recording::{Recording, Stamped};

use crate::camera::Camera;
use crate::frames::FrameTree;
use crate::pose::{Pose, Trajectory};

/// Trusted range of pixels cast onto flat ground, metres ahead: nearer is the bonnet, farther a
/// degree of pitch is metres.
pub(crate) const PIXEL_RANGE_M: (f64, f64) = (3.0, 20.0);

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
    /// Capture times of frames in pixels without a usable camera.
    pub without_camera_ns: Vec<i64>,
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
            let stamp_ns = frame.stamp_ns;
            match seen_lines(frame, camera.as_ref(), tree) {
                Some(lines) => collected.frames.push(SeenFrame { stamp_ns, lines }),
                None => collected.without_camera_ns.push(stamp_ns),
            }
        }
        collected
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

/// The camera that detections in pixels are of.
pub(crate) fn camera(recording: &Recording, tree: &FrameTree) -> Option<Camera> {
    let calibration = recording.calibrations.last()?;
    let mounting = tree.vehicle_from(&calibration.frame_id)?;
    Camera::new(&calibration.value, mounting).ok()
}

fn seen_lines(
    frame: &Stamped<DetectionFrame>,
    camera: Option<&Camera>,
    tree: &FrameTree,
) -> Option<Vec<SeenLine>> {
    let detections = frame.value.detections.iter().enumerate();
    let lines = detections.filter(|(_, detection)| detection.kind == ElementKind::LaneMarking);
    match frame.value.space {
        DetectionSpace::Metres => {
            let vehicle_from_frame = tree.vehicle_from(&frame.frame_id)?;
            let place = |[x, y, z]: [f64; 3]| {
                let point = vehicle_from_frame * Point3::new(x, y, z);
                Some([point.x, point.y])
            };
            Some(lines.filter_map(|line| seen_line(line, place)).collect())
        }
        DetectionSpace::Pixels => {
            let camera = camera?;
            let place = |[u, v, _]: [f64; 3]| {
                let [x, y, _] = camera.road_from_pixel([u, v])?;
                (PIXEL_RANGE_M.0 <= x && x <= PIXEL_RANGE_M.1).then_some([x, y])
            };
            Some(lines.filter_map(|line| seen_line(line, place)).collect())
        }
    }
}

/// A detection as a line that runs forward; none if fewer than two points are usable.
fn seen_line(
    (number, detection): (usize, &Detection),
    place: impl Fn([f64; 3]) -> Option<[f64; 2]>,
) -> Option<SeenLine> {
    let mut points_m: Vec<[f64; 2]> = detection.points.iter().filter_map(|&p| place(p)).collect();
    points_m.sort_by(|a, b| a[0].total_cmp(&b[0]));
    points_m.dedup_by(|b, a| b[0] - a[0] < 1e-6);
    (points_m.len() >= 2).then_some(SeenLine {
        detection: number,
        marking: detection.marking,
        color: detection.color,
        points_m,
    })
}
