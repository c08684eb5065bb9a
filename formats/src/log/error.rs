//! What can go wrong with a log as a whole, and with one message.

use std::path::PathBuf;

use tilefold_schemas::SetAsideKind;

/// Why a log could not be used at all. Losses inside a usable log are set aside instead.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file could not be opened.
    #[error("cannot open log {path}: {source}; check that it exists and may be read")]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The system failed while the file was read.
    #[error("cannot read log {path} at byte {offset}: {source}; check the disk, then run again")]
    Read {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file does not begin as an MCAP file does.
    #[error(
        "{path} is no MCAP file: expected it to begin with the bytes {expected:02x?}, got \
         {got:02x?}; logs of other kinds must be converted, e.g. with `mcap convert`"
    )]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// The magic of MCAP.
        expected: &'static [u8],
        /// The first bytes of the file.
        got: Vec<u8>,
    },
    /// The log has more channels than the limit.
    #[error(
        "log {path} has more than {limit} channels; split it by topic, e.g. with `mcap filter`"
    )]
    TooManyChannels {
        /// The file.
        path: PathBuf,
        /// `limits::MAX_LOG_CHANNELS`.
        limit: usize,
    },
}

/// Why one message could not become a noun.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DecodeError {
    /// The message ends before its field does.
    #[error("{field} at byte {offset} needs {expected} bytes, {got} are left")]
    Short {
        /// The field being read.
        field: &'static str,
        /// Byte in the message.
        offset: usize,
        /// Bytes needed.
        expected: usize,
        /// Bytes left.
        got: usize,
    },
    /// The message does not begin with the CDR encapsulation that ROS 2 writes.
    #[error("expected CDR encapsulation 00 00 or 00 01, got {got:02x?}")]
    Encapsulation {
        /// The first bytes.
        got: Vec<u8>,
    },
    /// A text is not UTF-8.
    #[error("{field} at byte {offset} is not UTF-8")]
    Text {
        /// The field being read.
        field: &'static str,
        /// Byte in the message.
        offset: usize,
    },
    /// The bytes are not the protobuf message that the schema names.
    #[error("not a {schema} in protobuf: {reason}")]
    Protobuf {
        /// The schema.
        schema: &'static str,
        /// What the decoder said.
        reason: String,
    },
    /// More of something than its limit.
    #[error("{got} {what}, the limit is {limit}")]
    TooMany {
        /// What was counted.
        what: &'static str,
        /// How many, or the number at which counting stopped.
        got: usize,
        /// The limit.
        limit: usize,
    },
    /// A position, orientation or covariance that cannot be true.
    #[error("{what} cannot be true: {value}, expected {expected}")]
    Pose {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What would be accepted.
        expected: &'static str,
    },
    /// Any other number that cannot be true.
    #[error("{what} cannot be true: {value}, expected {expected}")]
    Value {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What would be accepted.
        expected: &'static str,
    },
}

impl DecodeError {
    /// Under which name the loss is counted.
    #[must_use]
    pub fn kind(&self) -> SetAsideKind {
        match self {
            Self::Pose { .. } => SetAsideKind::Pose,
            _ => SetAsideKind::Message,
        }
    }
}
