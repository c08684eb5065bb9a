//! The messages of the Foxglove dialect, and how any Foxglove message is encoded.

use bytes::Bytes;
use foxglove::Encode;
use foxglove::messages as fox;
use tilefold_schemas::log::{
    CameraCalibration, CameraFrame, EncodedImage, FramePose, GnssFix, Odometry, Payload,
    Quaternion, Transform,
};

use super::{Dialect, Encoded, Entry, LogWriteError, seconds};

/// The message of the dialect for a payload.
pub(super) fn encode(entry: &Entry<'_>) -> Result<Encoded, LogWriteError> {
    match entry.payload {
        Payload::Gnss(fix) => message("foxglove.LocationFix", &location_fix(entry, fix)?),
        Payload::Pose(pose) => message("foxglove.PoseInFrame", &pose_in_frame(entry, pose)?),
        Payload::Odometry(measured) => message("foxglove.Odometry", &odometry(entry, measured)?),
        Payload::Transforms { transforms, .. } => {
            let transforms = frame_transforms(entry, transforms)?;
            message("foxglove.FrameTransforms", &transforms)
        }
        Payload::Calibration(calibration) => message(
            "foxglove.CameraCalibration",
            &camera_calibration(entry, calibration)?,
        ),
        Payload::Image(CameraFrame::Encoded(image)) => {
            message("foxglove.CompressedImage", &compressed_image(entry, image)?)
        }
        Payload::Image(CameraFrame::Video(image)) => {
            message("foxglove.CompressedVideo", &compressed_video(entry, image)?)
        }
        Payload::Image(CameraFrame::Raw(_)) => Err(lacking("raw images")),
        Payload::Imu(_) => Err(lacking("an inertial measurement")),
        Payload::Detections(_) => Err(lacking("detections here")),
        Payload::Vehicles(frame) => super::detections::encode_vehicles(entry, frame),
    }
}

/// A Foxglove message with its schema.
pub(crate) fn message<M: Encode>(
    schema: &'static str,
    message: &M,
) -> Result<Encoded, LogWriteError> {
    let mut bytes = Vec::with_capacity(message.encoded_len().unwrap_or_default());
    let wrong = |why: String| LogWriteError::Encode { schema, why };
    message
        .encode(&mut bytes)
        .map_err(|error| wrong(error.to_string()))?;
    let described = M::get_schema().ok_or_else(|| wrong("it has no schema".to_owned()))?;
    Ok(Encoded {
        schema,
        schema_encoding: "protobuf",
        schema_data: described.data,
        message_encoding: "protobuf",
        bytes,
    })
}

/// A header stamp.
pub(crate) fn timestamp(stamp_ns: i64) -> Result<fox::Timestamp, LogWriteError> {
    let (sec, nanosec) = seconds(stamp_ns)?;
    Ok(fox::Timestamp::new(sec.unsigned_abs(), nanosec))
}

fn lacking(payload: &'static str) -> LogWriteError {
    LogWriteError::Payload {
        dialect: Dialect::Foxglove,
        payload,
    }
}

/// The protocol has no "no fix": such a position is written with an unknown covariance.
fn location_fix(entry: &Entry<'_>, fix: &GnssFix) -> Result<fox::LocationFix, LogWriteError> {
    use fox::location_fix::PositionCovarianceType as Covariance;
    let known = fix.covariance_enu_m2.filter(|_| fix.has_fix);
    let covariance_type = match known {
        None => Covariance::Unknown,
        Some(_) => Covariance::Known,
    };
    Ok(fox::LocationFix {
        timestamp: Some(timestamp(entry.stamp_ns)?),
        frame_id: entry.frame_id.to_owned(),
        latitude: fix.latitude_deg,
        longitude: fix.longitude_deg,
        altitude: fix.altitude_m,
        position_covariance: known.unwrap_or_default().to_vec(),
        position_covariance_type: covariance_type.into(),
        ..Default::default()
    })
}

fn pose_in_frame(entry: &Entry<'_>, pose: &FramePose) -> Result<fox::PoseInFrame, LogWriteError> {
    Ok(fox::PoseInFrame {
        timestamp: Some(timestamp(entry.stamp_ns)?),
        frame_id: entry.frame_id.to_owned(),
        pose: Some(pose_message(pose)),
    })
}

/// Covariances that nobody knows are left out.
fn odometry(entry: &Entry<'_>, measured: &Odometry) -> Result<fox::Odometry, LogWriteError> {
    Ok(fox::Odometry {
        timestamp: Some(timestamp(entry.stamp_ns)?),
        frame_id: entry.frame_id.to_owned(),
        body_frame_id: "base_link".to_owned(),
        pose: Some(pose_message(&measured.pose)),
        linear_velocity: Some(vector(measured.linear_velocity_m_s)),
        angular_velocity: Some(vector(measured.angular_velocity_rad_s)),
        ..Default::default()
    })
}

fn pose_message(pose: &FramePose) -> fox::Pose {
    fox::Pose {
        position: Some(vector(pose.position_m)),
        orientation: Some(quaternion(pose.orientation)),
    }
}

fn frame_transforms(
    entry: &Entry<'_>,
    transforms: &[Transform],
) -> Result<fox::FrameTransforms, LogWriteError> {
    let stamp = timestamp(entry.stamp_ns)?;
    let transforms = transforms.iter().map(|transform| fox::FrameTransform {
        timestamp: Some(stamp),
        parent_frame_id: transform.parent_frame.clone(),
        child_frame_id: transform.child_frame.clone(),
        translation: Some(vector(transform.translation_m)),
        rotation: Some(quaternion(transform.rotation)),
    });
    Ok(fox::FrameTransforms {
        transforms: transforms.collect(),
    })
}

fn camera_calibration(
    entry: &Entry<'_>,
    calibration: &CameraCalibration,
) -> Result<fox::CameraCalibration, LogWriteError> {
    let [fx, _, cx, _, fy, cy, ..] = calibration.k;
    Ok(fox::CameraCalibration {
        timestamp: Some(timestamp(entry.stamp_ns)?),
        frame_id: entry.frame_id.to_owned(),
        width: calibration.width_px,
        height: calibration.height_px,
        distortion_model: calibration.distortion_model.clone(),
        d: calibration.d.clone(),
        k: calibration.k.to_vec(),
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    })
}

fn compressed_image(
    entry: &Entry<'_>,
    image: &EncodedImage,
) -> Result<fox::CompressedImage, LogWriteError> {
    Ok(fox::CompressedImage {
        timestamp: Some(timestamp(entry.stamp_ns)?),
        frame_id: entry.frame_id.to_owned(),
        data: Bytes::clone(&image.data),
        format: image.format.clone(),
    })
}

fn compressed_video(
    entry: &Entry<'_>,
    image: &EncodedImage,
) -> Result<fox::CompressedVideo, LogWriteError> {
    Ok(fox::CompressedVideo {
        timestamp: Some(timestamp(entry.stamp_ns)?),
        frame_id: entry.frame_id.to_owned(),
        data: Bytes::clone(&image.data),
        format: image.format.clone(),
    })
}

fn vector([x, y, z]: [f64; 3]) -> fox::Vector3 {
    fox::Vector3 { x, y, z }
}

/// A quaternion as a message.
pub(super) fn quaternion([x, y, z, w]: Quaternion) -> fox::Quaternion {
    fox::Quaternion { x, y, z, w }
}
