//! The ROS 2 messages that are read, field by field as their `.msg` files order them.
//!
//! Source: common_interfaces and geometry2 of ROS 2 Jazzy.

use bytes::Bytes;
use tilefold_schemas::limits::{MAX_DISTORTION_COEFFICIENTS, MAX_TRANSFORMS_PER_MESSAGE};
use tilefold_schemas::log::{
    CameraCalibration, CameraFrame, EncodedImage, FramePose, Imu, Odometry, Payload, RawImage,
    Transform,
};

use super::cdr::Cdr;
use super::decode::{Decoded, Loss};
use super::error::DecodeError;
use super::protobuf::push_by_stamp;
use super::sound;
use super::topic::is_static;

type Outcome = Result<Option<Loss>, DecodeError>;

/// `STATUS_FIX` of sensor_msgs/NavSatStatus: this and better is a fix.
const STATUS_FIX: i8 = 0;
/// Stands in the first place of a covariance whose quantity was not measured.
const NOT_MEASURED: f64 = -1.0;
/// Bytes that a transform takes at least.
const MIN_TRANSFORM_BYTES: usize = 64;

/// sensor_msgs/msg/NavSatFix.
pub(crate) fn nav_sat_fix(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let cdr = &mut Cdr::new(bytes)?;
    let header = Header::read(cdr)?;
    let status = cdr.i8("status")?;
    cdr.u16("service")?;
    let latitude_deg = cdr.f64("latitude")?;
    let longitude_deg = cdr.f64("longitude")?;
    let altitude_m = cdr.f64("altitude")?;
    let covariance = cdr.f64s::<9>("position_covariance")?;
    let is_stated = cdr.u8("position_covariance_type")? != 0;
    let covariance = is_stated.then_some(covariance);
    let has_fix = status >= STATUS_FIX;
    let fix = sound::fix(latitude_deg, longitude_deg, altitude_m, covariance, has_fix)?;
    header.push(Payload::Gnss(fix), decoded)
}

/// sensor_msgs/msg/Imu.
pub(crate) fn imu(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let cdr = &mut Cdr::new(bytes)?;
    let header = Header::read(cdr)?;
    let orientation = cdr.f64s::<4>("orientation")?;
    let orientation_covariance = cdr.f64s::<9>("orientation_covariance")?;
    let rate = cdr.f64s::<3>("angular_velocity")?;
    let rate_covariance = cdr.f64s::<9>("angular_velocity_covariance")?;
    let has_orientation = orientation_covariance[0] != NOT_MEASURED;
    let has_rate = rate_covariance[0] != NOT_MEASURED;
    let mut imu = Imu {
        orientation: None,
        yaw_variance_rad2: None,
        angular_velocity_rad_s: has_rate.then_some(rate).map(sound::turn_rate).transpose()?,
    };
    if has_orientation {
        imu.orientation = Some(sound::orientation(orientation)?);
        let stated = sound::covariance(orientation_covariance)?;
        imu.yaw_variance_rad2 = stated.map(|matrix| matrix[8]).filter(|yaw| *yaw > 0.0);
    }
    header.push(Payload::Imu(imu), decoded)
}

/// nav_msgs/msg/Odometry.
pub(crate) fn odometry(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let cdr = &mut Cdr::new(bytes)?;
    let header = Header::read(cdr)?;
    cdr.text("child_frame_id")?;
    let pose = read_pose(cdr)?;
    cdr.f64s::<36>("pose.covariance")?;
    let odometry = Odometry {
        pose,
        linear_velocity_m_s: sound::velocity(cdr.f64s("twist.linear")?)?,
        angular_velocity_rad_s: sound::turn_rate(cdr.f64s("twist.angular")?)?,
    };
    header.push(Payload::Odometry(odometry), decoded)
}

/// geometry_msgs/msg/PoseStamped, and the beginning of PoseWithCovarianceStamped.
pub(crate) fn pose_stamped(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let cdr = &mut Cdr::new(bytes)?;
    let header = Header::read(cdr)?;
    let pose = read_pose(cdr)?;
    header.push(Payload::Pose(pose), decoded)
}

/// tf2_msgs/msg/TFMessage: one thing per stamp.
pub(crate) fn transforms(bytes: &[u8], topic: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let cdr = &mut Cdr::new(bytes)?;
    let count = cdr.length(MIN_TRANSFORM_BYTES, "transforms")?;
    if count > MAX_TRANSFORMS_PER_MESSAGE {
        return Err(DecodeError::TooMany {
            what: "transforms",
            got: count,
            limit: MAX_TRANSFORMS_PER_MESSAGE,
        });
    }
    let mut stamped = Vec::with_capacity(count);
    for _ in 0..count {
        let header = Header::read(cdr)?;
        let child_frame = cdr.text("child_frame_id")?.to_owned();
        let pose = read_pose(cdr)?;
        stamped.push((
            header.stamp_ns,
            Transform {
                parent_frame: header.frame_id.to_owned(),
                child_frame,
                translation_m: pose.position_m,
                rotation: pose.orientation,
            },
        ));
    }
    push_by_stamp(stamped, is_static(topic), decoded);
    Ok(None)
}

/// sensor_msgs/msg/CameraInfo.
pub(crate) fn camera_info(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let cdr = &mut Cdr::new(bytes)?;
    let header = Header::read(cdr)?;
    let height_px = cdr.u32("height")?;
    let width_px = cdr.u32("width")?;
    let distortion_model = cdr.text("distortion_model")?.to_owned();
    let count = cdr.length(8, "d")?;
    if count > MAX_DISTORTION_COEFFICIENTS {
        return Err(DecodeError::TooMany {
            what: "distortion coefficients",
            got: count,
            limit: MAX_DISTORTION_COEFFICIENTS,
        });
    }
    let d = (0..count).map(|_| cdr.f64("d")).collect::<Result<_, _>>()?;
    let calibration = sound::calibration(CameraCalibration {
        width_px,
        height_px,
        distortion_model,
        d,
        k: cdr.f64s("k")?,
    })?;
    header.push(Payload::Calibration(calibration), decoded)
}

/// sensor_msgs/msg/CompressedImage.
pub(crate) fn compressed_image(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let cdr = &mut Cdr::new(bytes)?;
    let header = Header::read(cdr)?;
    let image = EncodedImage {
        format: cdr.text("format")?.to_owned(),
        data: Bytes::copy_from_slice(cdr.octets("data")?),
    };
    header.push(Payload::Image(CameraFrame::Encoded(image)), decoded)
}

/// sensor_msgs/msg/Image.
pub(crate) fn image(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let cdr = &mut Cdr::new(bytes)?;
    let header = Header::read(cdr)?;
    let height_px = cdr.u32("height")?;
    let width_px = cdr.u32("width")?;
    let image = RawImage {
        width_px,
        height_px,
        encoding: cdr.text("encoding")?.to_owned(),
        is_big_endian: cdr.u8("is_bigendian")? != 0,
        step: cdr.u32("step")?,
        data: Bytes::copy_from_slice(cdr.octets("data")?),
    };
    header.push(Payload::Image(CameraFrame::Raw(image)), decoded)
}

/// foxglove_msgs/msg/CompressedVideo.
pub(crate) fn compressed_video(bytes: &[u8], _: &str, decoded: &mut Vec<Decoded>) -> Outcome {
    let cdr = &mut Cdr::new(bytes)?;
    let header = Header::read(cdr)?;
    let image = EncodedImage {
        data: Bytes::copy_from_slice(cdr.octets("data")?),
        format: cdr.text("format")?.to_owned(),
    };
    header.push(Payload::Image(CameraFrame::Video(image)), decoded)
}

/// std_msgs/msg/Header.
struct Header<'a> {
    stamp_ns: Option<i64>,
    frame_id: &'a str,
}

impl<'a> Header<'a> {
    fn read(cdr: &mut Cdr<'a>) -> Result<Self, DecodeError> {
        let seconds = cdr.i32("header.stamp.sec")?;
        let nanoseconds = cdr.u32("header.stamp.nanosec")?;
        Ok(Self {
            stamp_ns: sound::stamp(i64::from(seconds), nanoseconds)?,
            frame_id: cdr.text("header.frame_id")?,
        })
    }

    fn push(self, payload: Payload, decoded: &mut Vec<Decoded>) -> Outcome {
        decoded.push(Decoded {
            stamp_ns: self.stamp_ns,
            frame_id: self.frame_id.to_owned(),
            payload,
        });
        Ok(None)
    }
}

/// geometry_msgs/msg/Pose; a Transform has the same layout.
fn read_pose(cdr: &mut Cdr<'_>) -> Result<FramePose, DecodeError> {
    let position_m = cdr.f64s("position")?;
    let orientation = cdr.f64s("orientation")?;
    sound::pose(position_m, orientation)
}
