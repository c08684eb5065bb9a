//! Nouns to logs: the other way round than [`crate::log`], for simulated drives and for tests.
//!
//! [`LogWriter`] takes payloads of `tilefold_schemas::log` and writes an MCAP file in one of two
//! [`Dialect`]s, ROS 2 (CDR) or Foxglove (protobuf). Detections are Foxglove messages in both: ROS
//! has none for them. The same calls give the same bytes: no clock, no random ids, and compression
//! on one thread.
//!
//! The siblings: `cdr` lays out ROS 2 messages, `ros2` and `protobuf` know the messages of their
//! dialect, `detections` those that both share.

mod cdr;
mod detections;
mod protobuf;
mod ros2;
#[cfg(test)]
mod round_trip;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{Seek, Write};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions, Writer};
use tilefold_schemas::log::Payload;

pub(crate) use self::protobuf::{message, timestamp};

/// Bytes of messages after which a chunk is closed: about ten seconds of a drive.
const CHUNK_BYTES: u64 = 512 << 10;

/// Whose messages a log is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dialect {
    /// `sensor_msgs` and its kin in CDR, as rosbag2 writes them.
    Ros2,
    /// `foxglove.*` messages in protobuf.
    Foxglove,
}

/// Why a log could not be written.
#[derive(Debug, thiserror::Error)]
pub enum LogWriteError {
    /// The MCAP library or the file behind it failed.
    #[error("cannot write the log: {0}; check the disk and its rights, then write it again")]
    Mcap(#[from] mcap::McapError),
    /// A message of another schema on a topic that has one already.
    #[error(
        "topic {topic:?} carries {has}, but was given {given}; give each kind of message a topic of its own"
    )]
    Schema {
        /// The topic.
        topic: String,
        /// The schema of its first message.
        has: String,
        /// The schema of this message.
        given: String,
    },
    /// A payload for which the dialect has no message.
    #[error("{dialect:?} has no message for {payload}; write it in the other dialect")]
    Payload {
        /// The dialect.
        dialect: Dialect,
        /// What was to be written.
        payload: &'static str,
    },
    /// A time outside of what a header stamp can say.
    #[error("time {0} ns does not fit into a header stamp: it lies before 1970 or after 2038")]
    Time(i64),
    /// A protobuf message that did not encode.
    #[error("cannot encode {schema}: {why}")]
    Encode {
        /// Its schema.
        schema: &'static str,
        /// What the library says.
        why: String,
    },
}

/// One message to be written.
#[derive(Debug, Clone, Copy)]
pub struct Entry<'a> {
    /// Topic; all messages of one topic have one kind of payload.
    pub topic: &'a str,
    /// Capture time for the header, in nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// Time at which it was recorded, in nanoseconds since the Unix epoch.
    pub log_time_ns: i64,
    /// Frame for the header.
    pub frame_id: &'a str,
    /// What it says.
    pub payload: &'a Payload,
}

/// Writes one log.
///
/// ```
/// use tilefold_formats::log_write::{Dialect, Entry, LogWriter};
/// use tilefold_schemas::log::{GnssFix, Payload};
///
/// let sink = std::io::Cursor::new(Vec::new());
/// let mut log = LogWriter::create(sink, Dialect::Ros2, "vehicle-7", [])?;
/// let fix = Payload::Gnss(GnssFix {
///     latitude_deg: 49.0,
///     longitude_deg: 8.4,
///     altitude_m: 115.0,
///     covariance_enu_m2: None,
///     has_fix: true,
/// });
/// let stamp_ns = 1_700_000_000_000_000_000;
/// log.write(Entry { topic: "/gnss", stamp_ns, log_time_ns: stamp_ns, frame_id: "base_link", payload: &fix })?;
/// let bytes = log.finish()?.into_inner();
/// assert!(bytes.starts_with(b"\x89MCAP0\r\n"));
/// # Ok::<(), tilefold_formats::log_write::LogWriteError>(())
/// ```
pub struct LogWriter<W: Write + Seek> {
    mcap: Writer<W>,
    dialect: Dialect,
    channels: BTreeMap<String, Channel>,
}

struct Channel {
    id: u16,
    schema: &'static str,
    sequence: u32,
}

/// A message in its encoding, and what a reader has to know to decode it.
pub(crate) struct Encoded {
    pub(crate) schema: &'static str,
    pub(crate) schema_encoding: &'static str,
    pub(crate) schema_data: Cow<'static, [u8]>,
    pub(crate) message_encoding: &'static str,
    pub(crate) bytes: Vec<u8>,
}

impl<W: Write + Seek> LogWriter<W> {
    /// Begins a log of the vehicle called `vehicle_id`; `facts` are further entries of the metadata
    /// record `vehicle`.
    ///
    /// # Errors
    /// If `sink` does not take the first bytes.
    pub fn create<'a>(
        sink: W,
        dialect: Dialect,
        vehicle_id: &'a str,
        facts: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Self, LogWriteError> {
        let profile = match dialect {
            Dialect::Ros2 => "ros2",
            Dialect::Foxglove => "",
        };
        let mut mcap = WriteOptions::new()
            .profile(profile)
            .library("tilefold")
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .create(sink)?;
        let facts = facts.into_iter().chain([("vehicle_id", vehicle_id)]);
        mcap.write_metadata(&Metadata {
            name: "vehicle".to_owned(),
            metadata: facts
                .map(|(key, value)| (key.to_owned(), value.to_owned()))
                .collect(),
        })?;
        Ok(Self {
            mcap,
            dialect,
            channels: BTreeMap::new(),
        })
    }

    /// Writes one message.
    ///
    /// # Errors
    /// If the dialect has no message for the payload, the topic carries another kind, a time does
    /// not fit, or the file cannot be written.
    pub fn write(&mut self, entry: Entry<'_>) -> Result<(), LogWriteError> {
        let encoded = encode(self.dialect, &entry)?;
        let log_time =
            u64::try_from(entry.log_time_ns).map_err(|_| LogWriteError::Time(entry.log_time_ns))?;
        let channel = self.channel(entry.topic, &encoded)?;
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.sequence,
            log_time,
            publish_time: log_time,
        };
        channel.sequence = channel.sequence.wrapping_add(1);
        self.mcap.write_to_known_channel(&header, &encoded.bytes)?;
        Ok(())
    }

    /// Writes the summary and hands the sink back.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<W, LogWriteError> {
        self.mcap.finish()?;
        Ok(self.mcap.into_inner())
    }

    fn channel(&mut self, topic: &str, encoded: &Encoded) -> Result<&mut Channel, LogWriteError> {
        if !self.channels.contains_key(topic) {
            self.channels.insert(
                topic.to_owned(),
                Channel {
                    id: add_channel(&mut self.mcap, topic, encoded)?,
                    schema: encoded.schema,
                    sequence: 0,
                },
            );
        }
        let wrong = |has: &str| LogWriteError::Schema {
            topic: topic.to_owned(),
            has: has.to_owned(),
            given: encoded.schema.to_owned(),
        };
        match self.channels.get_mut(topic) {
            Some(channel) if channel.schema == encoded.schema => Ok(channel),
            Some(channel) => Err(wrong(channel.schema)),
            None => Err(wrong("nothing")),
        }
    }
}

/// Begins a topic whose messages are like this one.
pub(crate) fn add_channel<W: Write + Seek>(
    mcap: &mut Writer<W>,
    topic: &str,
    like: &Encoded,
) -> Result<u16, LogWriteError> {
    let schema = mcap.add_schema(like.schema, like.schema_encoding, &like.schema_data)?;
    let no_facts = BTreeMap::new();
    Ok(mcap.add_channel(schema, topic, like.message_encoding, &no_facts)?)
}

fn encode(dialect: Dialect, entry: &Entry<'_>) -> Result<Encoded, LogWriteError> {
    if let Payload::Detections(frame) = entry.payload {
        return detections::encode(entry, frame);
    }
    match dialect {
        Dialect::Ros2 => ros2::encode(entry),
        Dialect::Foxglove => protobuf::encode(entry),
    }
}

/// Seconds and nanoseconds of a header stamp; ROS 2 counts seconds in 31 bits.
fn seconds(stamp_ns: i64) -> Result<(i32, u32), LogWriteError> {
    let wrong = |_| LogWriteError::Time(stamp_ns);
    let seconds = i32::try_from(stamp_ns.div_euclid(1_000_000_000)).map_err(wrong)?;
    if seconds < 0 {
        return Err(LogWriteError::Time(stamp_ns));
    }
    let nanos = u32::try_from(stamp_ns.rem_euclid(1_000_000_000)).map_err(wrong)?;
    Ok((seconds, nanos))
}
