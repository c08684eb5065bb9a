//! What a vehicle's log says, whatever its encoding: fixes, orientations, frames, detections.
//!
//! Frames follow REP 103 and REP 105: the vehicle frame is x forward, y left, z up; headings are
//! counter-clockwise from east. Times are header stamps in nanoseconds since the Unix epoch.

use bytes::Bytes;

use crate::element::{Color, ElementKind, Marking, SignClass};

/// A rotation as a quaternion (x, y, z, w), as read: not necessarily of unit length.
pub type Quaternion = [f64; 4];

/// A GNSS position on WGS 84.
#[derive(Debug, Clone, PartialEq)]
pub struct GnssFix {
    /// Degrees.
    pub latitude_deg: f64,
    /// Degrees.
    pub longitude_deg: f64,
    /// Metres above the ellipsoid; 0 where the receiver gives none.
    pub altitude_m: f64,
    /// Row-major east-north-up covariance in square metres, if the receiver gave one.
    pub covariance_enu_m2: Option<[f64; 9]>,
    /// Whether the receiver claims a fix.
    pub has_fix: bool,
}

/// A position and orientation in a named frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FramePose {
    /// Metres in the parent frame.
    pub position_m: [f64; 3],
    /// Orientation in the parent frame.
    pub orientation: Quaternion,
}

/// An inertial measurement in the sensor's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Imu {
    /// Orientation in the east-north-up frame, if estimated.
    pub orientation: Option<Quaternion>,
    /// Variance of the yaw, in square radians, if stated.
    pub yaw_variance_rad2: Option<f64>,
    /// Radians per second, if measured.
    pub angular_velocity_rad_s: Option<[f64; 3]>,
}

/// Odometry: a pose in a drifting frame and a twist in the vehicle frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Odometry {
    /// Pose in the odometry frame.
    pub pose: FramePose,
    /// Metres per second in the child frame.
    pub linear_velocity_m_s: [f64; 3],
    /// Radians per second in the child frame.
    pub angular_velocity_rad_s: [f64; 3],
}

/// A transform: where `child_frame` is in `parent_frame`.
#[derive(Debug, Clone, PartialEq)]
pub struct Transform {
    /// Parent frame.
    pub parent_frame: String,
    /// Child frame.
    pub child_frame: String,
    /// Origin of the child in the parent, in metres.
    pub translation_m: [f64; 3],
    /// Rotation from child to parent axes.
    pub rotation: Quaternion,
}

/// Camera intrinsics as stated by the log (`sensor_msgs/CameraInfo`, `foxglove.CameraCalibration`).
#[derive(Debug, Clone, PartialEq)]
pub struct CameraCalibration {
    /// Image width in pixels.
    pub width_px: u32,
    /// Image height in pixels.
    pub height_px: u32,
    /// Name of the distortion model, e.g. `plumb_bob`.
    pub distortion_model: String,
    /// Distortion coefficients.
    pub d: Vec<f64>,
    /// Row-major 3x3 camera matrix of the raw image.
    pub k: [f64; 9],
}

/// An encoded camera frame.
#[derive(Debug, Clone, PartialEq)]
pub struct EncodedImage {
    /// As the log names it: `jpeg`, `png`, ...
    pub format: String,
    /// The file's bytes.
    pub data: Bytes,
}

/// A camera frame of bare pixels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RawImage {
    /// Pixels in a row.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Bytes from one row to the next; 0 where the log does not say.
    pub step: u32,
    /// As the log names it: `rgb8`, `bayer_rggb8`, ...
    pub encoding: String,
    /// Whether numbers of two bytes have the greater one first.
    pub is_big_endian: bool,
    /// The rows.
    pub data: Bytes,
}

/// A camera frame as the log has it.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraFrame {
    /// A file.
    Encoded(EncodedImage),
    /// Bare pixels.
    Raw(RawImage),
    /// A frame of video: it may need those before it.
    Video(EncodedImage),
}

/// In which space the points of a detection are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DetectionSpace {
    /// Metres in the frame that the message names.
    Metres,
    /// Pixels of the raw image (`[x, y, 0]`).
    Pixels,
}

/// A detected lane marking or ground sign.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// What kind of thing.
    pub kind: ElementKind,
    /// How it is painted, if recognised.
    pub marking: Marking,
    /// Its colour, if recognised.
    pub color: Color,
    /// Its class, if it is a ground sign and recognised.
    pub sign: SignClass,
    /// Score in `[0, 1]`; 1 if the log gives none.
    pub score: f64,
    /// Polyline, or outline for areas.
    pub points: Vec<[f64; 3]>,
}

/// All detections of one frame; an empty one says "looked and saw nothing".
#[derive(Debug, Clone, PartialEq)]
pub struct DetectionFrame {
    /// Metres or pixels.
    pub space: DetectionSpace,
    /// What was seen, in the order of the message.
    pub detections: Vec<Detection>,
}

/// Other vehicles that were seen at one instant: they hide what lies behind them.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleFrame {
    /// Metres or pixels.
    pub space: DetectionSpace,
    /// Corners of the box around each: in metres of a solid one, in pixels its outline.
    pub vehicles: Vec<Vec<[f64; 3]>>,
}

/// What a message says.
#[derive(Debug, Clone, PartialEq)]
pub enum Payload {
    /// A GNSS position.
    Gnss(GnssFix),
    /// An inertial measurement.
    Imu(Imu),
    /// Odometry.
    Odometry(Odometry),
    /// A pose in the frame that the message names.
    Pose(FramePose),
    /// Transforms; `is_static` if they hold for all time.
    Transforms {
        /// The transforms.
        transforms: Vec<Transform>,
        /// Whether they were latched as static.
        is_static: bool,
    },
    /// Camera intrinsics.
    Calibration(CameraCalibration),
    /// A camera frame.
    Image(CameraFrame),
    /// Detections made on the vehicle.
    Detections(DetectionFrame),
    /// Other vehicles.
    Vehicles(VehicleFrame),
}

/// One decoded message.
#[derive(Debug, Clone, PartialEq)]
pub struct LogMessage {
    /// Index into the log's list of topics.
    pub topic: usize,
    /// Capture time from the message's header; the log time where it has none.
    pub stamp_ns: i64,
    /// Time at which it was recorded.
    pub log_time_ns: i64,
    /// Frame named by the message; empty if none.
    pub frame_id: String,
    /// What it says.
    pub payload: Payload,
    /// Hash of the encoded message, for the identity of frames.
    pub digest: i64,
}
