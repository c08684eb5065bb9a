//! Which schema in which encoding is read by which decoder: one table.

use tilefold_schemas::log::{DetectionSpace, Payload};

use super::error::DecodeError;
use super::topic::TopicKind;
use super::{annotations, protobuf, ros2, scene};

/// What a message says, before it is placed in its log.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Decoded {
    /// Header stamp, if it is set.
    pub(crate) stamp_ns: Option<i64>,
    /// Frame named by the message.
    pub(crate) frame_id: String,
    /// What it says.
    pub(crate) payload: Payload,
}

/// Parts of a message that could not be used, while the rest could.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Loss {
    /// Why.
    pub(crate) reason: String,
    /// How many parts.
    pub(crate) count: u64,
}

/// Decodes `payload`, a message of the topic of that name, and appends what it says.
///
/// A message appends nothing if it says nothing that is read, and several things if it speaks of
/// several times or frames.
pub(crate) type Decode = fn(
    payload: &[u8],
    topic: &str,
    decoded: &mut Vec<Decoded>,
) -> Result<Option<Loss>, DecodeError>;

/// One row of the table.
#[derive(Debug)]
struct Dialect {
    schema: &'static str,
    encoding: &'static str,
    kind: TopicKind,
    decode: Decode,
}

const METRES: TopicKind = TopicKind::Detections(DetectionSpace::Metres);
const PIXELS: TopicKind = TopicKind::Detections(DetectionSpace::Pixels);

const fn ros(schema: &'static str, kind: TopicKind, decode: Decode) -> Dialect {
    Dialect {
        schema,
        encoding: "cdr",
        kind,
        decode,
    }
}

const fn foxglove(schema: &'static str, kind: TopicKind, decode: Decode) -> Dialect {
    Dialect {
        schema,
        encoding: "protobuf",
        kind,
        decode,
    }
}

static DIALECTS: &[Dialect] = &[
    ros(
        "sensor_msgs/msg/NavSatFix",
        TopicKind::Gnss,
        ros2::nav_sat_fix,
    ),
    ros("sensor_msgs/msg/Imu", TopicKind::Imu, ros2::imu),
    ros("nav_msgs/msg/Odometry", TopicKind::Odometry, ros2::odometry),
    ros(
        "geometry_msgs/msg/PoseStamped",
        TopicKind::Pose,
        ros2::pose_stamped,
    ),
    ros(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        TopicKind::Pose,
        ros2::pose_stamped,
    ),
    ros(
        "tf2_msgs/msg/TFMessage",
        TopicKind::Transforms,
        ros2::transforms,
    ),
    ros(
        "sensor_msgs/msg/CameraInfo",
        TopicKind::Calibration,
        ros2::camera_info,
    ),
    ros(
        "sensor_msgs/msg/CompressedImage",
        TopicKind::Image,
        ros2::compressed_image,
    ),
    ros("sensor_msgs/msg/Image", TopicKind::Image, ros2::image),
    ros(
        "foxglove_msgs/msg/CompressedVideo",
        TopicKind::Image,
        ros2::compressed_video,
    ),
    foxglove(
        "foxglove.LocationFix",
        TopicKind::Gnss,
        protobuf::location_fix,
    ),
    foxglove("foxglove.Odometry", TopicKind::Odometry, protobuf::odometry),
    foxglove(
        "foxglove.PoseInFrame",
        TopicKind::Pose,
        protobuf::pose_in_frame,
    ),
    foxglove(
        "foxglove.FrameTransform",
        TopicKind::Transforms,
        protobuf::frame_transform,
    ),
    foxglove(
        "foxglove.FrameTransforms",
        TopicKind::Transforms,
        protobuf::frame_transforms,
    ),
    foxglove(
        "foxglove.CameraCalibration",
        TopicKind::Calibration,
        protobuf::camera_calibration,
    ),
    foxglove(
        "foxglove.CompressedImage",
        TopicKind::Image,
        protobuf::compressed_image,
    ),
    foxglove("foxglove.RawImage", TopicKind::Image, protobuf::raw_image),
    foxglove(
        "foxglove.CompressedVideo",
        TopicKind::Image,
        protobuf::compressed_video,
    ),
    foxglove("foxglove.SceneUpdate", METRES, scene::scene_update),
    foxglove(
        "foxglove.ImageAnnotations",
        PIXELS,
        annotations::image_annotations,
    ),
];

/// The decoder of one schema in one encoding.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Decoder(&'static Dialect);

impl Decoder {
    /// The decoder for messages of this schema in this encoding, if they are read.
    pub(crate) fn find(schema_name: &str, encoding: &str) -> Option<Self> {
        let is_it = |row: &&Dialect| row.encoding == encoding && is_schema(row, schema_name);
        DIALECTS.iter().find(is_it).map(Self)
    }

    /// Whether messages of this schema are read in some encoding.
    pub(crate) fn is_known_schema(schema_name: &str) -> bool {
        DIALECTS.iter().any(|row| is_schema(row, schema_name))
    }

    /// What the messages say.
    pub(crate) fn kind(self) -> TopicKind {
        self.0.kind
    }

    /// Decodes one message; see [`Decode`].
    pub(crate) fn decode(
        self,
        payload: &[u8],
        topic: &str,
        decoded: &mut Vec<Decoded>,
    ) -> Result<Option<Loss>, DecodeError> {
        (self.0.decode)(payload, topic, decoded)
    }
}

/// Whether a row is about this schema; older recorders leave `msg/` out.
fn is_schema(row: &Dialect, schema_name: &str) -> bool {
    row.schema == schema_name
        || row
            .schema
            .split_once("/msg/")
            .zip(schema_name.split_once('/'))
            .is_some_and(|(known, named)| known == named)
}
