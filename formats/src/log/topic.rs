//! What a topic of a log is about, found by the name of its schema.

use tilefold_schemas::log::DetectionSpace;

/// What the messages of a topic say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum TopicKind {
    /// Positions on WGS 84.
    Gnss,
    /// Inertial measurements.
    Imu,
    /// Poses in a drifting frame, with twists.
    Odometry,
    /// Poses in a named frame.
    Pose,
    /// Transforms between frames.
    Transforms,
    /// Camera intrinsics.
    Calibration,
    /// Encoded camera frames.
    Image,
    /// Detections made on the vehicle, in metres or in pixels.
    Detections(DetectionSpace),
    /// Anything that is not read: unknown schema, or a known one in an encoding that is not read.
    Unknown,
}

/// One topic of a log, with all channels that carry it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Name of the topic.
    pub name: String,
    /// Name of its schema, as written; empty if it has none.
    pub schema_name: String,
    /// How messages are encoded: `cdr`, `protobuf`, ...
    pub encoding: String,
    /// What the messages say.
    pub kind: TopicKind,
    /// Channels of the file that carry it, in ascending order.
    pub channel_ids: Vec<u16>,
    /// Messages in the log, as far as its index or a scan can tell.
    pub messages: u64,
}

/// Whether the transforms of a topic hold for all time: ROS latches them on `/tf_static`.
pub(crate) fn is_static(topic: &str) -> bool {
    topic.rsplit('/').next() == Some("tf_static")
}
