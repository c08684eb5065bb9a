//! The Foxglove messages that are read, but for detections: those are in `scene` and
//! `annotations`.
//!
//! Source: <https://docs.foxglove.dev/docs/visualization/message-schemas>.

use foxglove::Decode;
use foxglove::messages::location_fix::PositionCovarianceType;
use foxglove::messages::{
    CameraCalibration as FoxgloveCalibration, CompressedImage, CompressedVideo, FrameTransform,
    FrameTransforms, LocationFix, Odometry as FoxgloveOdometry, Pose, PoseInFrame, Quaternion,
    RawImage as FoxgloveRawImage, Timestamp, Vector3,
};
use tilefold_schemas::limits::{MAX_PRIMITIVES_PER_MESSAGE, MAX_TRANSFORMS_PER_MESSAGE};
use tilefold_schemas::log::{
    CameraCalibration, CameraFrame, EncodedImage, FramePose, Odometry, Payload, RawImage, Transform,
};

use super::decode::{Decoded, Loss};
use super::error::DecodeError;
use super::sound;
use super::topic::is_static;
use super::wire::{self, Level};

type Outcome = Result<Option<Loss>, DecodeError>;

const FLAT: &[Level] = &[Level {
    what: "fields",
    limit: MAX_PRIMITIVES_PER_MESSAGE,
    into: &[],
}];
const TRANSFORMS: &[Level] = &[Level {
    what: "transforms",
    limit: MAX_TRANSFORMS_PER_MESSAGE,
    into: &[],
}];

/// foxglove.LocationFix.
pub(crate) fn location_fix(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let message: LocationFix = decode(bytes, "foxglove.LocationFix", FLAT)?;
    let is_stated = message.position_covariance_type != PositionCovarianceType::Unknown as i32;
    let covariance = <[f64; 9]>::try_from(message.position_covariance).ok();
    let fix = sound::fix(
        message.latitude,
        message.longitude,
        message.altitude,
        covariance.filter(|_| is_stated),
        true,
    )?;
    push(
        message.timestamp,
        message.frame_id,
        Payload::Gnss(fix),
        decoded,
    )
}

/// foxglove.PoseInFrame.
pub(crate) fn pose_in_frame(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let message: PoseInFrame = decode(bytes, "foxglove.PoseInFrame", FLAT)?;
    let pose = to_pose(message.pose.unwrap_or_default())?;
    push(
        message.timestamp,
        message.frame_id,
        Payload::Pose(pose),
        decoded,
    )
}

/// foxglove.Odometry.
pub(crate) fn odometry(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let message: FoxgloveOdometry = decode(bytes, "foxglove.Odometry", FLAT)?;
    let odometry = Odometry {
        pose: to_pose(message.pose.unwrap_or_default())?,
        linear_velocity_m_s: sound::velocity(to_array(
            message.linear_velocity.unwrap_or_default(),
        ))?,
        angular_velocity_rad_s: sound::turn_rate(to_array(
            message.angular_velocity.unwrap_or_default(),
        ))?,
    };
    push(
        message.timestamp,
        message.frame_id,
        Payload::Odometry(odometry),
        decoded,
    )
}

/// foxglove.FrameTransform.
pub(crate) fn frame_transform(bytes: &[u8], topic: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let message: FrameTransform = decode(bytes, "foxglove.FrameTransform", FLAT)?;
    push_by_stamp(vec![to_transform(message)?], is_static(topic), decoded);
    Ok(None)
}

/// foxglove.FrameTransforms: one thing per stamp.
pub(crate) fn frame_transforms(bytes: &[u8], topic: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let message: FrameTransforms = decode(bytes, "foxglove.FrameTransforms", TRANSFORMS)?;
    let stamped = message.transforms.into_iter().map(to_transform);
    push_by_stamp(
        stamped.collect::<Result<_, _>>()?,
        is_static(topic),
        decoded,
    );
    Ok(None)
}

/// foxglove.CameraCalibration.
pub(crate) fn camera_calibration(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let message: FoxgloveCalibration = decode(bytes, "foxglove.CameraCalibration", FLAT)?;
    let numbers = message.k.len();
    let calibration = sound::calibration(CameraCalibration {
        width_px: message.width,
        height_px: message.height,
        distortion_model: message.distortion_model,
        d: message.d,
        k: <[f64; 9]>::try_from(message.k).map_err(|_| {
            sound::value_error("numbers in the camera matrix K", numbers as f64, "9")
        })?,
    })?;
    push(
        message.timestamp,
        message.frame_id,
        Payload::Calibration(calibration),
        decoded,
    )
}

/// foxglove.CompressedImage.
pub(crate) fn compressed_image(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let message: CompressedImage = decode(bytes, "foxglove.CompressedImage", FLAT)?;
    let image = EncodedImage {
        format: message.format,
        data: message.data,
    };
    push(
        message.timestamp,
        message.frame_id,
        Payload::Image(CameraFrame::Encoded(image)),
        decoded,
    )
}

/// foxglove.RawImage.
pub(crate) fn raw_image(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let message: FoxgloveRawImage = decode(bytes, "foxglove.RawImage", FLAT)?;
    let image = RawImage {
        width_px: message.width,
        height_px: message.height,
        step: message.step,
        encoding: message.encoding,
        is_big_endian: false,
        data: message.data,
    };
    let payload = Payload::Image(CameraFrame::Raw(image));
    push(message.timestamp, message.frame_id, payload, decoded)
}

/// foxglove.CompressedVideo.
pub(crate) fn compressed_video(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let message: CompressedVideo = decode(bytes, "foxglove.CompressedVideo", FLAT)?;
    let image = EncodedImage {
        format: message.format,
        data: message.data,
    };
    let payload = Payload::Image(CameraFrame::Video(image));
    push(message.timestamp, message.frame_id, payload, decoded)
}

/// Decodes a message whose parts are within `levels`.
pub(crate) fn decode<M: Decode>(
    bytes: &[u8],
    schema: &'static str,
    levels: &[Level],
) -> Result<M, DecodeError> {
    wire::check(bytes, schema, levels)?;
    M::decode(bytes).map_err(|error| DecodeError::Protobuf {
        schema,
        reason: error.to_string(),
    })
}

/// A stamp in nanoseconds since the Unix epoch; `None` if there is none.
pub(crate) fn to_stamp(timestamp: Option<Timestamp>) -> Result<Option<i64>, DecodeError> {
    match timestamp {
        Some(timestamp) => sound::stamp(i64::from(timestamp.sec()), timestamp.nsec()),
        None => Ok(None),
    }
}

/// A pose that must state its orientation.
pub(crate) fn to_pose(pose: Pose) -> Result<FramePose, DecodeError> {
    sound::pose(
        to_array(pose.position.unwrap_or_default()),
        to_quaternion(pose.orientation.unwrap_or_default()),
    )
}

/// Transforms grouped by stamp, one thing for each, in order of first appearance.
pub(crate) fn push_by_stamp(
    stamped: Vec<(Option<i64>, Transform)>,
    is_static: bool,
    decoded: &mut Vec<Decoded>,
) {
    let mut stamps: Vec<Option<i64>> = Vec::new();
    let mut groups: Vec<Vec<Transform>> = Vec::new();
    for (stamp_ns, transform) in stamped {
        // Transforms of one stamp follow each other: a look at the last group is enough.
        match groups.last_mut() {
            Some(group) if stamps.last() == Some(&stamp_ns) => group.push(transform),
            _ => {
                stamps.push(stamp_ns);
                groups.push(vec![transform]);
            }
        }
    }
    for (stamp_ns, transforms) in stamps.into_iter().zip(groups) {
        let frame_id = transforms.first().map(|first| first.parent_frame.clone());
        decoded.push(Decoded {
            stamp_ns,
            frame_id: frame_id.unwrap_or_default(),
            payload: Payload::Transforms {
                transforms,
                is_static,
            },
        });
    }
}

fn to_transform(message: FrameTransform) -> Result<(Option<i64>, Transform), DecodeError> {
    let pose = to_pose(Pose {
        position: message.translation,
        orientation: message.rotation,
    })?;
    let transform = Transform {
        parent_frame: message.parent_frame_id,
        child_frame: message.child_frame_id,
        translation_m: pose.position_m,
        rotation: pose.orientation,
    };
    Ok((to_stamp(message.timestamp)?, transform))
}

fn push(
    timestamp: Option<Timestamp>,
    frame_id: String,
    payload: Payload,
    decoded: &mut Vec<Decoded>,
) -> Outcome {
    decoded.push(Decoded {
        stamp_ns: to_stamp(timestamp)?,
        frame_id,
        payload,
    });
    Ok(None)
}

fn to_array(vector: Vector3) -> [f64; 3] {
    [vector.x, vector.y, vector.z]
}

fn to_quaternion(quaternion: Quaternion) -> [f64; 4] {
    [quaternion.x, quaternion.y, quaternion.z, quaternion.w]
}
