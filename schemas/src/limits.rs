//! Every limit on what comes from outside, by name (promise P7).
//!
//! A limit is generous for honest data and small enough that a lying length cannot take the
//! machine's memory. Error messages print the limit and the value that broke it.

/// Bytes of one MCAP record (a chunk, compressed or not, is one).
pub const MAX_LOG_RECORD_BYTES: usize = 256 << 20;
/// Bytes of one message.
pub const MAX_MESSAGE_BYTES: usize = 64 << 20;
/// Channels of one log.
pub const MAX_LOG_CHANNELS: usize = 4_096;
/// Bytes that a compressed byte of a chunk may stand for: zstd on constant data stays below.
pub const MAX_CHUNK_EXPANSION: u64 = 40_000;
/// Bytes of a log's summary section.
pub const MAX_LOG_SUMMARY_BYTES: usize = 256 << 20;
/// Metadata records of one log.
pub const MAX_LOG_METADATA_RECORDS: usize = 1_024;
/// Bytes of one metadata record.
pub const MAX_LOG_METADATA_BYTES: usize = 1 << 20;
/// Metres of a position along an axis: beyond the Earth, and any map frame on it.
pub const MAX_POSITION_M: f64 = 1e8;
/// Metres above or below the ellipsoid.
pub const MAX_ALTITUDE_M: f64 = 1e5;
/// Metres per second of a vehicle, along an axis.
pub const MAX_SPEED_M_S: f64 = 1e3;
/// Radians per second of a vehicle, about an axis.
pub const MAX_TURN_RATE_RAD_S: f64 = 1e3;
/// Variance in square metres or square radians.
pub const MAX_VARIANCE: f64 = 1e12;
/// Metres from the sensor to a detected point, along an axis.
pub const MAX_DETECTION_POINT_M: f64 = 1e8;
/// Pixels from the image's corner to a detected point, along an axis.
pub const MAX_DETECTION_POINT_PX: f64 = 1e6;
/// Length of a quaternion, which should be one.
pub const MAX_QUATERNION_NORM: f64 = 1e3;
/// Length of a quaternion, below which it says nothing.
pub const MIN_QUATERNION_NORM: f64 = 1e-3;
/// A camera parameter: focal length in pixels, distortion coefficient.
pub const MAX_CAMERA_PARAMETER: f64 = 1e6;
/// Primitives of all kinds, labels included, in one scene or annotation message.
pub const MAX_PRIMITIVES_PER_MESSAGE: usize = 20_000;
/// Detections in one frame.
pub const MAX_DETECTIONS_PER_FRAME: usize = 1_000;
/// Points of one detection.
pub const MAX_POINTS_PER_DETECTION: usize = 2_000;
/// Transforms in one message.
pub const MAX_TRANSFORMS_PER_MESSAGE: usize = 10_000;
/// Distortion coefficients of a camera.
pub const MAX_DISTORTION_COEFFICIENTS: usize = 16;
/// Bytes of a map file.
pub const MAX_MAP_BYTES: u64 = 8 << 30;
/// Depth of XML or JSON in a map.
pub const MAX_MAP_DEPTH: usize = 32;
/// Attributes of one XML element.
pub const MAX_XML_ATTRIBUTES: usize = 64;
/// Tags of one map element.
pub const MAX_TAGS_PER_ELEMENT: usize = 1_000;
/// Bytes of one tag's key or value.
pub const MAX_TAG_BYTES: usize = 64 << 10;
/// Nodes of one way.
pub const MAX_POINTS_PER_ELEMENT: usize = 100_000;
/// Borders of lanelets that one way is a part of.
pub const MAX_LANELETS_PER_WAY: usize = 64;
/// Outlines of one OpenDRIVE object: each becomes an element with all that the object says.
pub const MAX_OUTLINES_PER_OBJECT: usize = 64;
/// Lanes on one side of an OpenDRIVE road.
pub const MAX_LANES_PER_SIDE: usize = 100;
/// Points at which the curves of an OpenDRIVE file are looked at: 1,000 km of road with 20 lines, a
/// point each metre. A short file can describe any length of line.
pub const MAX_MAP_SAMPLES: usize = 20_000_000;
/// Radians that one spiral of an OpenDRIVE road turns.
pub const MAX_SPIRAL_TURN_RAD: f64 = 20.0;
/// Metres of one element along its line.
pub const MAX_ELEMENT_LENGTH_M: f64 = 100_000.0;
/// Losses listed by name in a report; beyond that they are only counted.
pub const MAX_SET_ASIDE_LISTED: usize = 1_000;
/// Bytes of a model's file.
pub const MAX_MODEL_BYTES: u64 = 2 << 30;
/// Bytes of a model card.
pub const MAX_MODEL_CARD_BYTES: u64 = 1 << 20;
/// Pixels of a picture: more than any camera of a vehicle has.
pub const MAX_PICTURE_PX: u64 = 64_000_000;
/// Pixels of a picture's side.
pub const MAX_PICTURE_SIDE_PX: u32 = 16_384;
/// Bytes of an encoded picture.
pub const MAX_ENCODED_PICTURE_BYTES: u64 = 64 << 20;
