//! Areas as the frames of a recording show them, in metres in the vehicle frame.

use std::collections::BTreeMap;

use nalgebra::Point3;
use tilefold_schemas::log::{Detection, DetectionFrame, DetectionSpace};
use tilefold_schemas::{ElementKind, SignClass};
use tilefold_tiler::recording::{Recording, Stamped};

use super::shape;
use crate::frames::FrameTree;
use crate::pixels::Casting;

/// An area that was seen in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenArea {
    /// What kind of thing.
    pub kind: ElementKind,
    /// Its class, if recognised.
    pub sign: SignClass,
    /// Vertices in the vehicle frame (x forward, y left), in the order of [`shape::ordered`].
    pub points_m: Vec<[f64; 2]>,
    /// Its centre.
    pub centre_m: [f64; 2],
}

impl SeenArea {
    /// An area of a kind; none if it has too few vertices.
    #[must_use]
    pub fn new(kind: ElementKind, sign: SignClass, points_m: Vec<[f64; 2]>) -> Option<Self> {
        let points_m = shape::ordered(kind, points_m);
        let least = if kind == ElementKind::StopLine { 2 } else { 3 };
        let centre_m = shape::centre(kind, &points_m)?;
        (points_m.len() >= least).then_some(Self {
            kind,
            sign,
            points_m,
            centre_m,
        })
    }
}

/// Areas of all frames, by stamp; those in pixels as `casting` has them. `stretch` is the lateral scale of the detector.
#[must_use]
pub fn collect(
    recording: &Recording,
    tree: &FrameTree,
    casting: Option<&Casting>,
    stretch: f64,
) -> BTreeMap<i64, Vec<SeenArea>> {
    let mut areas = BTreeMap::new();
    for frame in &recording.detections {
        // Of two frames with one stamp the first stands, as for lines.
        areas
            .entry(frame.stamp_ns)
            .or_insert_with(|| seen_areas(frame, tree, casting, stretch));
    }
    areas
}

fn seen_areas(
    frame: &Stamped<DetectionFrame>,
    tree: &FrameTree,
    casting: Option<&Casting>,
    stretch: f64,
) -> Vec<SeenArea> {
    let vehicle_from_frame = tree.vehicle_from(&frame.frame_id);
    let place = |[x, y, z]: [f64; 3]| match frame.value.space {
        DetectionSpace::Metres => {
            let point = vehicle_from_frame? * Point3::new(x, y, z);
            Some([point.x, point.y])
        }
        DetectionSpace::Pixels => casting?.road_from_pixel(frame.stamp_ns, [x, y]),
    };
    let area = |detection: &Detection| {
        // An outline of which a corner has no place is not the thing's outline.
        let points: Option<Vec<[f64; 2]>> = detection.points.iter().map(|&p| place(p)).collect();
        let points = points?.into_iter().map(|[x, y]| [x, y * stretch]);
        SeenArea::new(detection.kind, detection.sign, points.collect())
    };
    let detections = frame.value.detections.iter();
    detections
        .filter(|detection| detection.kind != ElementKind::LaneMarking)
        .filter_map(area)
        .collect()
}
