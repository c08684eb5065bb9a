//! Detections: `foxglove.SceneUpdate` in metres and `foxglove.ImageAnnotations` in pixels, with
//! the metadata keys `class`, `type`, `color` and `score`.
//!
//! A frame in which nothing was seen is written too: as a scene with one entity that has a stamp
//! and no lines, or as annotations that hold nothing but their stamp.

use foxglove::messages as fox;
use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_schemas::log::{Detection, DetectionFrame, DetectionSpace, VehicleFrame};

use super::protobuf::{message, quaternion, timestamp};
use super::{Encoded, Entry, LogWriteError};

/// Width of a painted line, in metres, and of a drawn one, in pixels.
const PAINT_WIDTH_M: f64 = 0.15;
const DRAWN_WIDTH_PX: f64 = 2.0;
/// Colour of other vehicles.
const VEHICLE_COLOR: fox::Color = fox::Color {
    r: 0.9,
    g: 0.5,
    b: 0.1,
    a: 1.0,
};
/// How long viewers show a detection, in nanoseconds.
const SHOWN_NS: u32 = 200_000_000;

/// The message for one frame's detections.
pub(super) fn encode(entry: &Entry<'_>, frame: &DetectionFrame) -> Result<Encoded, LogWriteError> {
    let stamp = timestamp(entry.stamp_ns)?;
    match frame.space {
        DetectionSpace::Metres => message("foxglove.SceneUpdate", &scene(entry, stamp, frame)),
        DetectionSpace::Pixels => message("foxglove.ImageAnnotations", &annotations(stamp, frame)),
    }
}

/// The message for one frame's other vehicles: boxes drawn into the picture, with their class.
pub(super) fn encode_vehicles(
    entry: &Entry<'_>,
    frame: &VehicleFrame,
) -> Result<Encoded, LogWriteError> {
    use fox::points_annotation::Type;
    if frame.space == DetectionSpace::Metres {
        return Err(LogWriteError::Payload {
            dialect: super::Dialect::Foxglove,
            payload: "other vehicles in metres",
        });
    }
    let stamp = timestamp(entry.stamp_ns)?;
    let points = frame.vehicles.iter().map(|corners| fox::PointsAnnotation {
        timestamp: Some(stamp),
        r#type: Type::LineLoop.into(),
        points: corners
            .iter()
            .map(|&[x, y, _]| fox::Point2 { x, y })
            .collect(),
        outline_color: Some(VEHICLE_COLOR),
        thickness: DRAWN_WIDTH_PX,
        metadata: vec![fox::KeyValuePair {
            key: "class".to_owned(),
            value: "vehicle".to_owned(),
        }],
        ..Default::default()
    });
    let annotations = fox::ImageAnnotations {
        timestamp: Some(stamp),
        points: points.collect(),
        ..Default::default()
    };
    message("foxglove.ImageAnnotations", &annotations)
}

fn scene(entry: &Entry<'_>, stamp: fox::Timestamp, frame: &DetectionFrame) -> fox::SceneUpdate {
    let blank = fox::SceneEntity {
        timestamp: Some(stamp),
        frame_id: entry.frame_id.to_owned(),
        lifetime: Some(fox::Duration::new(0, SHOWN_NS)),
        ..Default::default()
    };
    let entities: Vec<_> = frame
        .detections
        .iter()
        .enumerate()
        .map(|(index, detection)| fox::SceneEntity {
            id: index.to_string(),
            metadata: metadata(detection),
            lines: vec![line(detection)],
            ..blank.clone()
        })
        .collect();
    fox::SceneUpdate {
        deletions: Vec::new(),
        entities: if entities.is_empty() {
            vec![blank]
        } else {
            entities
        },
    }
}

fn line(detection: &Detection) -> fox::LinePrimitive {
    use fox::line_primitive::Type;
    let points = detection.points.iter();
    fox::LinePrimitive {
        r#type: match is_area(detection.kind) {
            true => Type::LineLoop.into(),
            false => Type::LineStrip.into(),
        },
        pose: Some(fox::Pose {
            position: None,
            orientation: Some(quaternion([0.0, 0.0, 0.0, 1.0])),
        }),
        thickness: PAINT_WIDTH_M,
        points: points.map(|&[x, y, z]| fox::Point3 { x, y, z }).collect(),
        color: Some(drawn_color(detection.color)),
        ..Default::default()
    }
}

fn annotations(stamp: fox::Timestamp, frame: &DetectionFrame) -> fox::ImageAnnotations {
    use fox::points_annotation::Type;
    let points = frame
        .detections
        .iter()
        .map(|detection| fox::PointsAnnotation {
            timestamp: Some(stamp),
            r#type: match is_area(detection.kind) {
                true => Type::LineLoop.into(),
                false => Type::LineStrip.into(),
            },
            points: detection
                .points
                .iter()
                .map(|&[x, y, _]| fox::Point2 { x, y })
                .collect(),
            outline_color: Some(drawn_color(detection.color)),
            thickness: DRAWN_WIDTH_PX,
            metadata: metadata(detection),
            ..Default::default()
        });
    fox::ImageAnnotations {
        timestamp: Some(stamp),
        points: points.collect(),
        ..Default::default()
    }
}

fn is_area(kind: ElementKind) -> bool {
    matches!(kind, ElementKind::Crosswalk | ElementKind::GroundSign)
}

fn metadata(detection: &Detection) -> Vec<fox::KeyValuePair> {
    let painted = (detection.marking != Marking::Unknown).then(|| detection.marking.name());
    let drawn = (detection.sign != SignClass::Unknown).then(|| detection.sign.name());
    let color = (detection.color != Color::Unknown).then(|| detection.color.name());
    let pairs = [
        ("class", Some(detection.kind.name().to_owned())),
        ("type", painted.or(drawn).map(str::to_owned)),
        ("color", color.map(str::to_owned)),
        ("score", Some(detection.score.to_string())),
    ];
    let pairs = pairs.into_iter().filter_map(|(key, value)| {
        Some(fox::KeyValuePair {
            key: key.to_owned(),
            value: value?,
        })
    });
    pairs.collect()
}

fn drawn_color(color: Color) -> fox::Color {
    let (r, g, b) = match color {
        Color::Yellow => (1.0, 0.8, 0.0),
        Color::Unknown | Color::White | Color::Other => (1.0, 1.0, 1.0),
    };
    fox::Color { r, g, b, a: 1.0 }
}
