//! foxglove.ImageAnnotations: detections in pixels of the raw image.
//!
//! Every annotation drawn as lines is a detection, or the outline of another vehicle. Metadata of the annotation overrides that of
//! the message. A message without annotations is an empty frame: looked, and saw nothing.

use foxglove::messages::points_annotation::Type;
use foxglove::messages::{ImageAnnotations, PointsAnnotation};
use tilefold_schemas::limits::{
    MAX_DETECTION_POINT_PX, MAX_DETECTIONS_PER_FRAME, MAX_POINTS_PER_DETECTION,
    MAX_PRIMITIVES_PER_MESSAGE,
};
use tilefold_schemas::log::DetectionSpace;

use super::decode::{Decoded, Loss};
use super::detection::{Attributes, Frames, Shape};
use super::error::DecodeError;
use super::protobuf::{decode, to_stamp};
use super::sound;
use super::vehicles::{Vehicles, is_vehicle};
use super::wire::Level;

const POINTS: u64 = 2;
const LEVELS: &[Level] = &[
    Level {
        what: "annotations",
        limit: MAX_PRIMITIVES_PER_MESSAGE,
        into: &[POINTS],
    },
    Level {
        what: "points and colours",
        limit: MAX_DETECTIONS_PER_FRAME * MAX_POINTS_PER_DETECTION,
        into: &[],
    },
];

/// foxglove.ImageAnnotations: one frame per stamp.
pub(crate) fn image_annotations(
    bytes: &[u8],
    _: &str,
    decoded: &mut Vec<Decoded>,
) -> Result<Option<Loss>, DecodeError> {
    let message: ImageAnnotations = decode(bytes, "foxglove.ImageAnnotations", LEVELS)?;
    let stamp_ns = to_stamp(message.timestamp)?;
    let mut frames = Frames::new(DetectionSpace::Pixels);
    let mut vehicles = Vehicles::new(DetectionSpace::Pixels);
    let mut is_about_others = !message.circles.is_empty();
    for annotation in &message.points {
        let metadata = message.metadata.iter().chain(&annotation.metadata);
        let pairs = metadata.map(|pair| (pair.key.as_str(), pair.value.as_str()));
        let stamp = || stamp_ns.map_or_else(|| to_stamp(annotation.timestamp), |ns| Ok(Some(ns)));
        let Some(attributes) = Attributes::read(pairs.clone())? else {
            is_about_others = true;
            if is_vehicle(pairs) && shape_of(annotation).is_some() {
                vehicles.add(stamp()?, "", pixels(annotation)?)?;
            }
            continue;
        };
        let at = frames.open(stamp()?, "");
        match shape_of(annotation) {
            Some(shape) => frames.add(at, &attributes, shape, pixels(annotation)?)?,
            None => frames.lose_not_line(),
        }
    }
    if frames.is_empty() && !is_about_others {
        frames.open(stamp_ns, "");
    }
    vehicles.finish(decoded);
    Ok(frames.finish(decoded))
}

fn shape_of(annotation: &PointsAnnotation) -> Option<Shape> {
    match annotation.r#type() {
        Type::LineStrip => Some(Shape::Strip),
        Type::LineLoop => Some(Shape::Loop),
        Type::LineList => Some(Shape::Pairs),
        Type::Points | Type::Unknown => None,
    }
}

fn pixels(annotation: &PointsAnnotation) -> Result<Vec<[f64; 3]>, DecodeError> {
    let points = annotation.points.iter().map(|point| {
        match [point.x, point.y]
            .iter()
            .find(|value| !sound::is_within(**value, MAX_DETECTION_POINT_PX))
        {
            Some(value) => Err(sound::value_error(
                "point in pixels",
                *value,
                "at most 1e6 either way",
            )),
            None => Ok([point.x, point.y, 0.0]),
        }
    });
    points.collect()
}
