//! The messages of the wanted topics and times, one section of the log in memory at a time.

use std::ops::Range;

use mcap::records::op;
use tilefold_schemas::limits::MAX_MESSAGE_BYTES;
use tilefold_schemas::log::LogMessage;
use tilefold_schemas::{SetAside, SetAsideKind};

use super::chunk;
use super::decode::{Decoded, Decoder, Loss};
use super::digest::Digester;
use super::error::{DecodeError, LogError};
use super::file::RangedFile;
use super::index::LogIndex;
use super::losses::Losses;
use super::record::{RECORD_HEAD, RawMessage, Records, split_head, to_ns};
use super::section::{Section, SectionKind, Tally};
use super::topic::Topic;

/// The range of every log time.
pub const ALL_TIME: Range<i64> = i64::MIN..i64::MAX;

/// What came out of a read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReadReport {
    /// Bytes read from disk (compressed, where chunks are).
    pub bytes_read: u64,
    /// Messages handed to the sink.
    pub messages: u64,
    /// Messages that are sound but say nothing that is read, e.g. scenes of cars.
    pub ignored: u64,
    /// What was lost.
    pub set_aside: Vec<SetAside>,
}

/// Reads messages of indexed logs. Holds buffers only: one reader serves any number of logs.
#[derive(Debug, Default)]
pub struct LogReader {
    decoded: Vec<Decoded>,
}

impl LogReader {
    /// A reader.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Hands `sink` the messages of the topics that `is_wanted` accepts (index into
    /// [`LogIndex::topics`] and topic) whose log time is in `log_time_ns` (half open, nanoseconds
    /// since the Unix epoch; [`ALL_TIME`] for all), in the order of the file: sorted neither by
    /// log time nor by stamp.
    ///
    /// Chunks that hold no wanted topic or time are not read. A chunk with a wrong checksum is
    /// set aside with its offset and the messages of wanted topics in it, and the rest is used.
    ///
    /// # Errors
    /// [`LogError`] if the file cannot be opened, or the system fails while it is read. What the
    /// sink was handed before remains good.
    pub fn read(
        &mut self,
        index: &LogIndex,
        is_wanted: impl Fn(usize, &Topic) -> bool,
        log_time_ns: Range<i64>,
        sink: impl FnMut(LogMessage),
    ) -> Result<ReadReport, LogError> {
        let mut file = RangedFile::open(&index.path)?;
        let routes = Routes::new(index, is_wanted);
        let mut delivery = Delivery {
            name: file.name(),
            routes: &routes,
            log_time_ns: log_time_ns.clone(),
            decoded: &mut self.decoded,
            sink,
            report: ReadReport::default(),
            losses: Losses::default(),
        };
        for section in &index.sections {
            let is_on_route = |channel| routes.find(channel).is_some();
            if section.may_hold(is_on_route, log_time_ns.start, log_time_ns.end) {
                delivery.take(&mut file, section)?;
            }
        }
        Ok(ReadReport {
            bytes_read: file.bytes_read(),
            set_aside: delivery.losses.into_list(),
            ..delivery.report
        })
    }
}

/// How the messages of one wanted topic are read.
struct Route<'a> {
    topic: usize,
    name: &'a str,
    decoder: Decoder,
    digester: Digester,
}

/// The wanted topics by channel.
struct Routes<'a> {
    routes: Vec<Route<'a>>,
    by_channel: Vec<(u16, usize)>,
}

impl<'a> Routes<'a> {
    fn new(index: &'a LogIndex, is_wanted: impl Fn(usize, &Topic) -> bool) -> Self {
        let mut routes = Vec::new();
        let mut by_channel = Vec::new();
        for (at, topic) in index.topics.iter().enumerate() {
            let Some(decoder) = Decoder::find(&topic.schema_name, &topic.encoding) else {
                continue;
            };
            if !is_wanted(at, topic) {
                continue;
            }
            by_channel.extend(topic.channel_ids.iter().map(|id| (*id, routes.len())));
            routes.push(Route {
                topic: at,
                name: &topic.name,
                decoder,
                digester: Digester::new(&topic.schema_name, &topic.encoding),
            });
        }
        by_channel.sort_unstable();
        Self { routes, by_channel }
    }

    fn find(&self, channel: u16) -> Option<&Route<'a>> {
        let at = self
            .by_channel
            .binary_search_by_key(&channel, |(id, _)| *id)
            .ok()?;
        self.routes.get(self.by_channel.get(at)?.1)
    }
}

/// A read in progress: everything between a section's bytes and the sink.
struct Delivery<'a, S> {
    name: String,
    routes: &'a Routes<'a>,
    log_time_ns: Range<i64>,
    decoded: &'a mut Vec<Decoded>,
    sink: S,
    report: ReadReport,
    losses: Losses,
}

impl<S: FnMut(LogMessage)> Delivery<'_, S> {
    fn take(&mut self, file: &mut RangedFile, section: &Section) -> Result<(), LogError> {
        match section.kind {
            SectionKind::Chunk => self.take_chunk(file, section),
            SectionKind::Loose => self.take_loose(file, section),
        }
    }

    fn take_chunk(&mut self, file: &mut RangedFile, section: &Section) -> Result<(), LogError> {
        let mut seen = 0;
        let outcome =
            chunk::for_each_record(file, section.offset, section.length, |opcode, body| {
                if opcode == op::MESSAGE {
                    seen += u64::from(self.take_message(section.offset, body));
                }
            })?;
        if let Err(reason) = outcome {
            self.lose_section(file, section, seen, &reason)?;
        }
        Ok(())
    }

    fn take_loose(&mut self, file: &mut RangedFile, section: &Section) -> Result<(), LogError> {
        let Some(bytes) = file.read_range(section.offset, section.length)? else {
            return self.lose_section(file, section, 0, "the file ends within its messages");
        };
        let mut records = Records::new(&bytes);
        let mut at = section.offset;
        while let Some((opcode, body)) = records.next() {
            if opcode == op::MESSAGE {
                self.take_message(at, body);
            }
            at = section.offset + records.position() as u64;
        }
        Ok(())
    }

    /// Decodes a message and hands it on; whether it was on a wanted channel.
    fn take_message(&mut self, offset: u64, body: &[u8]) -> bool {
        let Some(message) = RawMessage::parse(body) else {
            let reason = format!(
                "message record of {} bytes is shorter than its head",
                body.len()
            );
            let loss = SetAside::new(SetAsideKind::Message, &self.name, reason);
            self.losses.push(loss.at(offset));
            return false;
        };
        let Some(route) = self.routes.find(message.channel) else {
            return false;
        };
        let log_time_ns = to_ns(message.log_time);
        if self.log_time_ns.contains(&log_time_ns) {
            self.decode(route, offset, log_time_ns, message.payload);
        }
        true
    }

    fn decode(&mut self, route: &Route<'_>, offset: u64, log_time_ns: i64, payload: &[u8]) {
        self.decoded.clear();
        let loss_at = |kind, reason| {
            let loss = SetAside::new(kind, &self.name, reason).at(offset);
            loss.on(route.name).when(log_time_ns)
        };
        match decode_within_limit(route, payload, self.decoded) {
            Ok(loss) => {
                self.losses.extend(loss.map(|Loss { reason, count }| {
                    loss_at(SetAsideKind::Message, reason).times(count)
                }));
                self.report.ignored += u64::from(self.decoded.is_empty());
            }
            Err(error) => {
                self.losses.push(loss_at(error.kind(), error.to_string()));
                self.decoded.clear();
            }
        }
        for (part, decoded) in self.decoded.drain(..).enumerate() {
            self.report.messages += 1;
            (self.sink)(LogMessage {
                topic: route.topic,
                stamp_ns: decoded.stamp_ns.unwrap_or(log_time_ns),
                log_time_ns,
                frame_id: decoded.frame_id,
                payload: decoded.payload,
                digest: route.digester.digest(payload, part as u64),
            });
        }
    }

    /// Sets a section aside, with the messages of wanted topics that it should have held.
    fn lose_section(
        &mut self,
        file: &mut RangedFile,
        section: &Section,
        seen: u64,
        reason: &str,
    ) -> Result<(), LogError> {
        let mut held = 0_u64;
        for (channel, tally) in &section.channels {
            if self.routes.find(*channel).is_some() {
                held = held.saturating_add(count(file, *channel, *tally)?);
            }
        }
        let lost = held.saturating_sub(seen);
        let known = match lost {
            0 => "an unknown number of messages is lost".to_owned(),
            _ => format!("{lost} messages of wanted topics are lost"),
        };
        let reason = format!("{reason}; {known}");
        let loss = SetAside::new(SetAsideKind::LogSection, &self.name, reason);
        self.losses.push(loss.at(section.offset).times(lost.max(1)));
        Ok(())
    }
}

/// Bytes of a message index record up to its entries.
const INDEX_HEAD: u64 = RECORD_HEAD as u64 + 6;

/// How many messages a tally stands for; 0 if its record is damaged.
fn count(file: &mut RangedFile, channel: u16, tally: Tally) -> Result<u64, LogError> {
    let offset = match tally {
        Tally::Exact(count) => return Ok(count),
        Tally::IndexAt(offset) => offset,
    };
    let Some(bytes) = file.read_range(offset, INDEX_HEAD)? else {
        return Ok(0);
    };
    let Some((head, body)) = bytes.split_first_chunk::<RECORD_HEAD>() else {
        return Ok(0);
    };
    let (opcode, length) = split_head(head);
    let is_sound = opcode == op::MESSAGE_INDEX
        && body.starts_with(&channel.to_le_bytes())
        && length <= file.left(offset);
    Ok(if is_sound {
        length.saturating_sub(6) / 16
    } else {
        0
    })
}

fn decode_within_limit(
    route: &Route<'_>,
    payload: &[u8],
    decoded: &mut Vec<Decoded>,
) -> Result<Option<Loss>, DecodeError> {
    if payload.len() > MAX_MESSAGE_BYTES {
        return Err(DecodeError::TooMany {
            what: "bytes in a message",
            got: payload.len(),
            limit: MAX_MESSAGE_BYTES,
        });
    }
    route.decoder.decode(payload, route.name, decoded)
}
