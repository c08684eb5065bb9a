//! The messages of the ROS 2 dialect.
//!
//! The definitions in `msg/` are the ones that rosbag2 writes beside the messages; decoders that
//! know nothing of ROS read the layout from there.

use std::borrow::Cow;

use tilefold_schemas::log::{
    CameraCalibration, CameraFrame, EncodedImage, FramePose, GnssFix, Imu, Odometry, Payload,
    Transform,
};

use super::cdr::Cdr;
use super::{Encoded, Entry, LogWriteError, seconds};

/// `sensor_msgs/NavSatFix`: covariance unknown, and known.
const COVARIANCE_UNKNOWN: u8 = 0;
const COVARIANCE_KNOWN: u8 = 3;
/// `sensor_msgs/NavSatStatus`: no fix (-1 as a byte), a fix, and the GPS service.
const STATUS_NO_FIX: u8 = 0xff;
const STATUS_FIX: u8 = 0;
const SERVICE_GPS: u16 = 1;
/// `sensor_msgs/Imu`: the first number of a covariance says that nothing was measured.
const NOT_MEASURED: [f64; 9] = [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
/// Variance of roll and pitch where only that of the yaw is known, in square radians.
const TILT_VARIANCE_RAD2: f64 = 0.01;

/// The message of the dialect for a payload.
pub(super) fn encode(entry: &Entry<'_>) -> Result<Encoded, LogWriteError> {
    let mut cdr = Cdr::new();
    let (schema, definition) = match entry.payload {
        Payload::Gnss(fix) => nav_sat_fix(&mut cdr, entry, fix)?,
        Payload::Imu(measured) => imu(&mut cdr, entry, measured)?,
        Payload::Pose(pose) => pose_stamped(&mut cdr, entry, pose)?,
        Payload::Odometry(odometry) => nav_odometry(&mut cdr, entry, odometry)?,
        Payload::Transforms { transforms, .. } => tf_message(&mut cdr, entry, transforms)?,
        Payload::Calibration(calibration) => camera_info(&mut cdr, entry, calibration)?,
        Payload::Image(CameraFrame::Encoded(image)) => compressed_image(&mut cdr, entry, image)?,
        Payload::Image(CameraFrame::Video(image)) => compressed_video(&mut cdr, entry, image)?,
        Payload::Image(CameraFrame::Raw(_)) => return Err(lacking("raw images")),
        Payload::Detections(_) => return Err(lacking("detections")),
        Payload::Vehicles(_) => return Err(lacking("other vehicles")),
    };
    Ok(Encoded {
        schema,
        schema_encoding: "ros2msg",
        schema_data: Cow::Borrowed(definition.as_bytes()),
        message_encoding: "cdr",
        bytes: cdr.into_bytes(),
    })
}

fn lacking(payload: &'static str) -> LogWriteError {
    LogWriteError::Payload {
        dialect: super::Dialect::Ros2,
        payload,
    }
}

/// Name and definition of a message.
type Schema = (&'static str, &'static str);

fn header(cdr: &mut Cdr, stamp_ns: i64, frame_id: &str) -> Result<(), LogWriteError> {
    let (sec, nanosec) = seconds(stamp_ns)?;
    cdr.i32(sec);
    cdr.u32(nanosec);
    cdr.string(frame_id);
    Ok(())
}

fn nav_sat_fix(cdr: &mut Cdr, entry: &Entry<'_>, fix: &GnssFix) -> Result<Schema, LogWriteError> {
    header(cdr, entry.stamp_ns, entry.frame_id)?;
    cdr.u8(if fix.has_fix {
        STATUS_FIX
    } else {
        STATUS_NO_FIX
    });
    cdr.u16(SERVICE_GPS);
    cdr.f64s([fix.latitude_deg, fix.longitude_deg, fix.altitude_m]);
    cdr.f64s(fix.covariance_enu_m2.unwrap_or_default());
    cdr.u8(match fix.covariance_enu_m2 {
        None => COVARIANCE_UNKNOWN,
        Some(_) => COVARIANCE_KNOWN,
    });
    Ok((
        "sensor_msgs/msg/NavSatFix",
        include_str!("msg/NavSatFix.msg"),
    ))
}

fn imu(cdr: &mut Cdr, entry: &Entry<'_>, imu: &Imu) -> Result<Schema, LogWriteError> {
    header(cdr, entry.stamp_ns, entry.frame_id)?;
    cdr.f64s(imu.orientation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    cdr.f64s(match imu.orientation {
        None => NOT_MEASURED,
        Some(_) => diagonal(imu.yaw_variance_rad2),
    });
    cdr.f64s(imu.angular_velocity_rad_s.unwrap_or_default());
    cdr.f64s(match imu.angular_velocity_rad_s {
        None => NOT_MEASURED,
        Some(_) => [0.0; 9],
    });
    cdr.f64s([0.0; 3]);
    cdr.f64s(NOT_MEASURED);
    Ok(("sensor_msgs/msg/Imu", include_str!("msg/Imu.msg")))
}

/// All zeros say "unknown".
fn diagonal(yaw_variance_rad2: Option<f64>) -> [f64; 9] {
    let mut covariance = [0.0; 9];
    if let Some(yaw) = yaw_variance_rad2 {
        covariance[0] = TILT_VARIANCE_RAD2;
        covariance[4] = TILT_VARIANCE_RAD2;
        covariance[8] = yaw;
    }
    covariance
}

fn pose(cdr: &mut Cdr, pose: &FramePose) {
    cdr.f64s(pose.position_m);
    cdr.f64s(pose.orientation);
}

fn pose_stamped(
    cdr: &mut Cdr,
    entry: &Entry<'_>,
    stamped: &FramePose,
) -> Result<Schema, LogWriteError> {
    header(cdr, entry.stamp_ns, entry.frame_id)?;
    pose(cdr, stamped);
    Ok((
        "geometry_msgs/msg/PoseStamped",
        include_str!("msg/PoseStamped.msg"),
    ))
}

fn nav_odometry(
    cdr: &mut Cdr,
    entry: &Entry<'_>,
    odometry: &Odometry,
) -> Result<Schema, LogWriteError> {
    header(cdr, entry.stamp_ns, entry.frame_id)?;
    cdr.string("base_link");
    pose(cdr, &odometry.pose);
    cdr.f64s([0.0; 36]);
    cdr.f64s(odometry.linear_velocity_m_s);
    cdr.f64s(odometry.angular_velocity_rad_s);
    cdr.f64s([0.0; 36]);
    Ok(("nav_msgs/msg/Odometry", include_str!("msg/Odometry.msg")))
}

fn tf_message(
    cdr: &mut Cdr,
    entry: &Entry<'_>,
    transforms: &[Transform],
) -> Result<Schema, LogWriteError> {
    cdr.count(transforms.len());
    for transform in transforms {
        header(cdr, entry.stamp_ns, &transform.parent_frame)?;
        cdr.string(&transform.child_frame);
        cdr.f64s(transform.translation_m);
        cdr.f64s(transform.rotation);
    }
    Ok(("tf2_msgs/msg/TFMessage", include_str!("msg/TFMessage.msg")))
}

fn camera_info(
    cdr: &mut Cdr,
    entry: &Entry<'_>,
    calibration: &CameraCalibration,
) -> Result<Schema, LogWriteError> {
    let [fx, _, cx, _, fy, cy, ..] = calibration.k;
    header(cdr, entry.stamp_ns, entry.frame_id)?;
    cdr.u32(calibration.height_px);
    cdr.u32(calibration.width_px);
    cdr.string(&calibration.distortion_model);
    cdr.count(calibration.d.len());
    cdr.f64s(calibration.d.iter().copied());
    cdr.f64s(calibration.k);
    cdr.f64s([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    cdr.f64s([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
    // No binning; the region of interest is the whole image.
    for _ in 0..6 {
        cdr.u32(0);
    }
    cdr.u8(0);
    Ok((
        "sensor_msgs/msg/CameraInfo",
        include_str!("msg/CameraInfo.msg"),
    ))
}

fn compressed_image(
    cdr: &mut Cdr,
    entry: &Entry<'_>,
    image: &EncodedImage,
) -> Result<Schema, LogWriteError> {
    header(cdr, entry.stamp_ns, entry.frame_id)?;
    cdr.string(&image.format);
    cdr.octets(&image.data);
    Ok((
        "sensor_msgs/msg/CompressedImage",
        include_str!("msg/CompressedImage.msg"),
    ))
}

fn compressed_video(
    cdr: &mut Cdr,
    entry: &Entry<'_>,
    image: &EncodedImage,
) -> Result<Schema, LogWriteError> {
    header(cdr, entry.stamp_ns, entry.frame_id)?;
    cdr.octets(&image.data);
    cdr.string(&image.format);
    Ok((
        "foxglove_msgs/msg/CompressedVideo",
        include_str!("msg/CompressedVideo.msg"),
    ))
}
