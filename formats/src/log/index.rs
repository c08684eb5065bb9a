//! What is in a log, without reading its messages.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use tilefold_schemas::limits::{
    MAX_LOG_CHANNELS, MAX_LOG_METADATA_BYTES, MAX_LOG_METADATA_RECORDS,
};
use tilefold_schemas::{SetAside, SetAsideKind};

use super::decode::Decoder;
use super::error::LogError;
use super::file::RangedFile;
use super::losses::Losses;
use super::record::Records;
use super::scan;
use super::section::Section;
use super::summary::{self, Channel, Parts, SummaryOutcome};
use super::topic::{Topic, TopicKind};

/// How an index came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IndexOrigin {
    /// From the log's summary; nothing else was read.
    Summary,
    /// From a walk over the whole file, because the summary is missing, damaged or says too
    /// little. If that is damage, a set-aside says so.
    Scan,
}

/// A metadata record of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MetadataRecord {
    /// Name of the record.
    pub name: String,
    /// Its entries.
    pub entries: BTreeMap<String, String>,
}

/// What is in one log file.
#[derive(Debug, Clone)]
pub struct LogIndex {
    /// The file.
    pub path: PathBuf,
    /// Its size in bytes.
    pub size_bytes: u64,
    /// Its topics, by name, schema and encoding.
    pub topics: Vec<Topic>,
    /// Log time of the first message, in nanoseconds since the Unix epoch; 0 without messages.
    pub start_ns: i64,
    /// Log time of the last message, in nanoseconds since the Unix epoch; 0 without messages.
    pub end_ns: i64,
    /// The vehicle, if a metadata record names it under `vehicle_id` or else `vehicle`.
    pub vehicle: Option<String>,
    /// Metadata records, in file order.
    pub metadata: Vec<MetadataRecord>,
    /// How the index came about.
    pub origin: IndexOrigin,
    /// What was lost while the index was made. Reading does not repeat it.
    pub set_aside: Vec<SetAside>,
    /// Bytes read to make the index.
    pub bytes_read: u64,
    pub(crate) sections: Vec<Section>,
}

impl LogIndex {
    /// Indexes the log at `path` by its summary; by a walk over the file if it has none to use.
    ///
    /// # Errors
    /// [`LogError`] if the file cannot be opened or read, is no MCAP file, or has too many channels.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, LogError> {
        let mut file = RangedFile::open(path.as_ref())?;
        check_magic(&mut file)?;
        let mut losses = Losses::default();
        let (parts, origin) = find_parts(&mut file, &mut losses)?;
        let metadata = read_metadata(&mut file, &parts.metadata, &mut losses)?;
        let index = Self::assemble(&file, parts, origin, metadata, &mut losses)?;
        Ok(Self {
            set_aside: losses.into_list(),
            ..index
        })
    }

    /// Messages in the log.
    #[must_use]
    pub fn message_count(&self) -> u64 {
        self.topics.iter().map(|topic| topic.messages).sum()
    }

    /// Indexes and topics of `kind`.
    pub fn topics_of(&self, kind: TopicKind) -> impl Iterator<Item = (usize, &Topic)> {
        self.topics
            .iter()
            .enumerate()
            .filter(move |(_, topic)| topic.kind == kind)
    }

    fn assemble(
        file: &RangedFile,
        parts: Parts,
        origin: IndexOrigin,
        metadata: Vec<MetadataRecord>,
        losses: &mut Losses,
    ) -> Result<Self, LogError> {
        if parts.channels.len() > MAX_LOG_CHANNELS {
            return Err(LogError::TooManyChannels {
                path: file.path().to_owned(),
                limit: MAX_LOG_CHANNELS,
            });
        }
        let topics = group_topics(&parts);
        report_unreadable(file, &topics, losses);
        report_undescribed(file, &parts, losses);
        Ok(Self {
            path: file.path().to_owned(),
            size_bytes: file.size(),
            topics,
            start_ns: parts.first_ns,
            end_ns: parts.last_ns,
            vehicle: find_vehicle(&metadata),
            metadata,
            origin,
            set_aside: Vec::new(),
            bytes_read: file.bytes_read(),
            sections: parts.sections,
        })
    }
}

fn check_magic(file: &mut RangedFile) -> Result<(), LogError> {
    let mut got = vec![0; mcap::MAGIC.len()];
    let filled = file.read_some(0, &mut got)?;
    got.truncate(filled);
    if got == mcap::MAGIC {
        return Ok(());
    }
    Err(LogError::NotMcap {
        path: file.path().to_owned(),
        expected: mcap::MAGIC,
        got,
    })
}

fn find_parts(
    file: &mut RangedFile,
    losses: &mut Losses,
) -> Result<(Parts, IndexOrigin), LogError> {
    match summary::read(file)? {
        SummaryOutcome::Usable(parts) => return Ok((parts, IndexOrigin::Summary)),
        SummaryOutcome::Insufficient => {}
        SummaryOutcome::Damaged(offset, reason) => {
            let reason = format!("{reason}: the whole file was walked instead");
            losses.push(SetAside::new(SetAsideKind::LogSection, file.name(), reason).at(offset));
        }
    }
    Ok((scan::scan(file, losses)?, IndexOrigin::Scan))
}

/// Topics by name, schema and encoding.
fn group_topics(parts: &Parts) -> Vec<Topic> {
    let mut groups: BTreeMap<(&str, &str, &str), Vec<u16>> = BTreeMap::new();
    for (id, channel) in &parts.channels {
        let key = (
            channel.topic.as_str(),
            schema_name(parts, channel),
            channel.encoding.as_str(),
        );
        groups.entry(key).or_default().push(*id);
    }
    let mut topics = Vec::with_capacity(groups.len());
    for ((name, schema_name, encoding), channel_ids) in groups {
        let messages = channel_ids.iter().filter_map(|id| parts.messages.get(id));
        topics.push(Topic {
            name: name.to_owned(),
            schema_name: schema_name.to_owned(),
            encoding: encoding.to_owned(),
            kind: Decoder::find(schema_name, encoding).map_or(TopicKind::Unknown, Decoder::kind),
            messages: messages.fold(0, |sum: u64, count| sum.saturating_add(*count)),
            channel_ids,
        });
    }
    topics
}

fn schema_name<'a>(parts: &'a Parts, channel: &Channel) -> &'a str {
    parts
        .schemas
        .get(&channel.schema_id)
        .map_or("", String::as_str)
}

/// Sets aside topics whose schema is known, but not in the encoding that they use.
fn report_unreadable(file: &RangedFile, topics: &[Topic], losses: &mut Losses) {
    for topic in topics {
        let is_known = Decoder::is_known_schema(&topic.schema_name);
        if topic.messages == 0 || !is_known || topic.kind != TopicKind::Unknown {
            continue;
        }
        let reason = format!(
            "{} in encoding {:?} is not read; read are ROS 2 schemas in cdr and foxglove schemas in protobuf",
            topic.schema_name, topic.encoding
        );
        let loss = SetAside::new(SetAsideKind::Message, file.name(), reason);
        losses.push(loss.on(topic.name.clone()).times(topic.messages));
    }
}

/// Sets aside messages on channels that the file does not describe.
fn report_undescribed(file: &RangedFile, parts: &Parts, losses: &mut Losses) {
    for (id, messages) in &parts.messages {
        if *messages > 0 && !parts.channels.contains_key(id) {
            let reason = format!("messages on channel {id}, which the file does not describe");
            let loss = SetAside::new(SetAsideKind::Message, file.name(), reason);
            losses.push(loss.times(*messages));
        }
    }
}

fn read_metadata(
    file: &mut RangedFile,
    places: &[(u64, u64)],
    losses: &mut Losses,
) -> Result<Vec<MetadataRecord>, LogError> {
    let mut records = Vec::new();
    for (offset, length) in places.iter().take(MAX_LOG_METADATA_RECORDS) {
        let bytes = match *length <= MAX_LOG_METADATA_BYTES as u64 {
            true => file.read_range(*offset, *length)?,
            false => None,
        };
        match bytes.as_deref().and_then(parse_metadata) {
            Some(record) => records.push(record),
            None => {
                let reason = format!("metadata record of {length} bytes cannot be read");
                let loss = SetAside::new(SetAsideKind::LogSection, file.name(), reason);
                losses.push(loss.at(*offset));
            }
        }
    }
    Ok(records)
}

fn parse_metadata(bytes: &[u8]) -> Option<MetadataRecord> {
    let (opcode, body) = Records::new(bytes).next()?;
    if opcode != op::METADATA {
        return None;
    }
    match mcap::parse_record(opcode, body) {
        Ok(Record::Metadata(metadata)) => Some(MetadataRecord {
            name: metadata.name,
            entries: metadata.metadata,
        }),
        _ => None,
    }
}

fn find_vehicle(metadata: &[MetadataRecord]) -> Option<String> {
    ["vehicle_id", "vehicle"].iter().find_map(|key| {
        let values = metadata
            .iter()
            .filter_map(|record| record.entries.get(*key));
        values
            .map(|value| value.trim())
            .find(|value| !value.is_empty())
            .map(str::to_owned)
    })
}
