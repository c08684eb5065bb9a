//! The sections of a log from its summary: footer, then the section it points to, never more.
//!
//! A summary is believed only if its checksum holds (where it has one) and its chunk indexes lie
//! within the data, apart from each other. Records are parsed by the `mcap` crate.

use std::collections::BTreeMap;

use mcap::records::{ChunkIndex, MetadataIndex, Record, Statistics, op};
use tilefold_schemas::limits::MAX_LOG_SUMMARY_BYTES;

use super::error::LogError;
use super::file::RangedFile;
use super::record::{RECORD_HEAD, Records, split_head, to_ns};
use super::section::{Section, SectionKind, Tally};

/// Bytes of the footer's body.
const FOOTER_BODY: usize = 20;
/// Bytes of footer record and closing magic.
const TAIL: usize = RECORD_HEAD + FOOTER_BODY + mcap::MAGIC.len();
/// Bytes of the footer record that its checksum covers.
const FOOTER_COVERED: usize = RECORD_HEAD + 16;

/// A channel as the file describes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    pub(crate) encoding: String,
    pub(crate) schema_id: u16,
}

/// What an index of a log is made from.
#[derive(Debug, Default)]
pub(crate) struct Parts {
    pub(crate) channels: BTreeMap<u16, Channel>,
    /// Names of schemas by id.
    pub(crate) schemas: BTreeMap<u16, String>,
    pub(crate) sections: Vec<Section>,
    /// Messages by channel.
    pub(crate) messages: BTreeMap<u16, u64>,
    pub(crate) first_ns: i64,
    pub(crate) last_ns: i64,
    /// Offset and length of metadata records, in file order.
    pub(crate) metadata: Vec<(u64, u64)>,
}

/// What the end of a file says.
pub(crate) enum SummaryOutcome {
    /// A whole and believable summary.
    Usable(Parts),
    /// A sound file whose summary does not say enough to find its messages.
    Insufficient,
    /// Damage at this byte, for this reason.
    Damaged(u64, String),
}

/// Reads the summary of `file`.
pub(crate) fn read(file: &mut RangedFile) -> Result<SummaryOutcome, LogError> {
    let tail_at = file.size().saturating_sub(TAIL as u64);
    let damaged = |reason: &str| Ok(SummaryOutcome::Damaged(tail_at, reason.to_owned()));
    let Some(tail) = file.read_range(tail_at, TAIL as u64)? else {
        return damaged("the file ends before its footer");
    };
    let Some(footer) = Footer::parse(&tail) else {
        return damaged("the file does not end with an MCAP footer");
    };
    if footer.summary_start == 0 {
        return Ok(SummaryOutcome::Insufficient);
    }
    let length = tail_at.saturating_sub(footer.summary_start);
    if footer.summary_start > tail_at || length > MAX_LOG_SUMMARY_BYTES as u64 {
        return damaged("the footer points to a summary outside of the file");
    }
    let Some(bytes) = file.read_range(footer.summary_start, length)? else {
        return damaged("the file ends within its summary");
    };
    if !footer.covers(&bytes, &tail) {
        return damaged("the summary's checksum is wrong");
    }
    Ok(collect(&bytes, footer.summary_start))
}

/// The fields of a footer.
struct Footer {
    summary_start: u64,
    summary_crc: u32,
}

impl Footer {
    fn parse(tail: &[u8]) -> Option<Self> {
        let (head, rest) = tail.split_first_chunk::<RECORD_HEAD>()?;
        let (body, magic) = rest.split_first_chunk::<FOOTER_BODY>()?;
        if split_head(head) != (op::FOOTER, FOOTER_BODY as u64) || magic != mcap::MAGIC {
            return None;
        }
        Some(Self {
            summary_start: u64::from_le_bytes(*body.first_chunk()?),
            summary_crc: u32::from_le_bytes(*body.last_chunk()?),
        })
    }

    /// Whether the checksum, if there is one, is that of the summary and the footer's beginning.
    fn covers(&self, summary: &[u8], tail: &[u8]) -> bool {
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(summary);
        hasher.update(tail.get(..FOOTER_COVERED).unwrap_or(tail));
        self.summary_crc == 0 || self.summary_crc == hasher.finalize()
    }
}

/// The records of a summary, before they are believed.
#[derive(Default)]
struct Collected {
    parts: Parts,
    chunks: Vec<ChunkIndex>,
    metadata: Vec<MetadataIndex>,
    statistics: Option<Statistics>,
}

fn collect(bytes: &[u8], summary_start: u64) -> SummaryOutcome {
    let mut collected = Collected::default();
    let mut records = Records::new(bytes);
    let mut at = summary_start;
    for (opcode, body) in records.by_ref() {
        if let Err(reason) = collected.add(opcode, body) {
            return SummaryOutcome::Damaged(at, reason);
        }
        at += (RECORD_HEAD + body.len()) as u64;
    }
    if !records.is_finished() {
        return SummaryOutcome::Damaged(at, "a record runs over the end of the summary".to_owned());
    }
    collected.judge(summary_start)
}

impl Collected {
    fn add(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        let is_read = [
            op::SCHEMA,
            op::CHANNEL,
            op::CHUNK_INDEX,
            op::STATISTICS,
            op::METADATA_INDEX,
        ];
        if !is_read.contains(&opcode) {
            return Ok(());
        }
        match mcap::parse_record(opcode, body).map_err(|error| error.to_string())? {
            Record::Schema { header, .. } => {
                self.parts.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => self.parts.add_channel(channel),
            Record::ChunkIndex(index) => self.chunks.push(index),
            Record::Statistics(statistics) => self.statistics = Some(statistics),
            Record::MetadataIndex(index) => self.metadata.push(index),
            _ => {}
        }
        Ok(())
    }

    fn judge(mut self, summary_start: u64) -> SummaryOutcome {
        self.chunks.sort_by_key(|chunk| chunk.chunk_start_offset);
        if let Some(reason) = misplaced(&self.chunks, summary_start) {
            return SummaryOutcome::Damaged(summary_start, reason);
        }
        let Some(statistics) = self.statistics.take() else {
            return SummaryOutcome::Insufficient;
        };
        if !self.says_enough(&statistics) {
            return SummaryOutcome::Insufficient;
        }
        self.metadata.sort_by_key(|index| index.offset);
        let metadata = self
            .metadata
            .iter()
            .map(|index| (index.offset, index.length));
        SummaryOutcome::Usable(Parts {
            sections: self.chunks.iter().map(to_section).collect(),
            messages: statistics.channel_message_counts,
            first_ns: to_ns(statistics.message_start_time),
            last_ns: to_ns(statistics.message_end_time),
            metadata: metadata.collect(),
            ..self.parts
        })
    }

    /// Whether every chunk is indexed and every channel that occurs is described.
    fn says_enough(&self, statistics: &Statistics) -> bool {
        let channels = &self.parts.channels;
        let schemas = &self.parts.schemas;
        let in_chunks = self
            .chunks
            .iter()
            .flat_map(|chunk| chunk.message_index_offsets.keys());
        let mut named = statistics.channel_message_counts.keys().chain(in_chunks);
        statistics.chunk_count as usize == self.chunks.len()
            && (statistics.message_count == 0 || !self.chunks.is_empty())
            && statistics.channel_count as usize <= channels.len()
            && named.all(|id| channels.contains_key(id))
            && channels
                .values()
                .all(|channel| channel.schema_id == 0 || schemas.contains_key(&channel.schema_id))
    }
}

impl Parts {
    /// Notes a channel; the first description of an id counts.
    pub(crate) fn add_channel(&mut self, channel: mcap::records::Channel) {
        self.channels.entry(channel.id).or_insert(Channel {
            topic: channel.topic,
            encoding: channel.message_encoding,
            schema_id: channel.schema_id,
        });
    }
}

/// Why chunk indexes (sorted by offset) cannot be true, if they cannot.
fn misplaced(chunks: &[ChunkIndex], data_end: u64) -> Option<String> {
    let mut free_from = mcap::MAGIC.len() as u64;
    for chunk in chunks {
        let begin = chunk.chunk_start_offset;
        let end = begin.checked_add(chunk.chunk_length);
        match end {
            Some(end) if begin >= free_from && end > begin && end <= data_end => free_from = end,
            _ => {
                return Some(format!(
                    "a chunk index points to {} bytes at {begin}, outside of the data or into another chunk",
                    chunk.chunk_length
                ));
            }
        }
    }
    None
}

fn to_section(chunk: &ChunkIndex) -> Section {
    let channels = chunk.message_index_offsets.iter();
    Section {
        kind: SectionKind::Chunk,
        offset: chunk.chunk_start_offset,
        length: chunk.chunk_length,
        first_ns: to_ns(chunk.message_start_time),
        last_ns: to_ns(chunk.message_end_time),
        channels: channels
            .map(|(id, at)| (*id, Tally::IndexAt(*at)))
            .collect(),
    }
}
