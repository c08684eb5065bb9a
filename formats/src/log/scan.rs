//! The sections of a log found by walking its records: for cut or damaged files, and for sound
//! ones whose summary does not say enough.
//!
//! Every chunk is opened once, so that only what is whole enters the index; a chunk that is not is
//! set aside with the number of its messages, which the message indexes behind it tell.

use std::collections::BTreeMap;

use mcap::records::{Record, op};
use tilefold_schemas::limits::{MAX_LOG_METADATA_BYTES, MAX_LOG_RECORD_BYTES};
use tilefold_schemas::{SetAside, SetAsideKind};

use super::chunk;
use super::error::LogError;
use super::file::RangedFile;
use super::losses::Losses;
use super::record::{MESSAGE_HEAD, RECORD_HEAD, RawMessage, split_head, to_ns};
use super::section::{Section, SectionKind, Tally};
use super::summary::Parts;

/// Bytes of loose records that are read in one go.
const LOOSE_SECTION_BYTES: u64 = 4 << 20;
/// Bytes read ahead while records are walked.
const WINDOW_BYTES: usize = 64 << 10;
/// Bytes of one message in a message index.
const INDEX_ENTRY_BYTES: u64 = 16;
/// Bytes of a message index before its entries.
const INDEX_HEAD_BYTES: u64 = 6;

/// Walks the whole of `file`, from its magic to its footer or its cut end.
pub(crate) fn scan(file: &mut RangedFile, losses: &mut Losses) -> Result<Parts, LogError> {
    let mut walk = Walk::new(file);
    let mut at = mcap::MAGIC.len() as u64;
    while walk.file.left(at) > 0 {
        match walk.step(at)? {
            Step::Next(next) => at = next,
            Step::Footer => break,
            Step::Cut(reason) => {
                let loss = SetAside::new(SetAsideKind::LogSection, walk.file.name(), reason);
                walk.lost.push((loss.at(at), None));
                break;
            }
        }
    }
    Ok(walk.finish(losses))
}

/// What follows a record.
enum Step {
    Next(u64),
    Footer,
    Cut(String),
}

/// A walk in progress.
struct Walk<'a> {
    file: &'a mut RangedFile,
    window: Vec<u8>,
    window_at: u64,
    parts: Parts,
    loose: Option<Section>,
    /// Set-asides so far; for a chunk, with the messages counted behind it.
    lost: Vec<(SetAside, Option<u64>)>,
    /// Whether the last chunk could not be used.
    is_last_chunk_lost: bool,
    has_messages: bool,
}

impl<'a> Walk<'a> {
    fn new(file: &'a mut RangedFile) -> Self {
        Self {
            file,
            window: Vec::new(),
            window_at: 0,
            parts: Parts::default(),
            loose: None,
            lost: Vec::new(),
            is_last_chunk_lost: false,
            has_messages: false,
        }
    }

    /// Takes the record at `at`.
    fn step(&mut self, at: u64) -> Result<Step, LogError> {
        let left = self.file.left(at);
        let Some(head) = self
            .peek(at, RECORD_HEAD)?
            .and_then(|head| head.first_chunk().copied())
        else {
            return Ok(Step::Cut(format!(
                "the file ends {left} bytes into the head of a record"
            )));
        };
        let (opcode, body) = split_head(&head);
        if opcode == op::FOOTER {
            return Ok(Step::Footer);
        }
        if opcode == 0 || body > left - RECORD_HEAD as u64 {
            return Ok(Step::Cut(format!(
                "record with opcode {opcode:#04x} says {body} bytes, the file has {} left",
                left - RECORD_HEAD as u64
            )));
        }
        self.take(at, opcode, body)?;
        Ok(Step::Next(at + RECORD_HEAD as u64 + body))
    }

    fn take(&mut self, at: u64, opcode: u8, body: u64) -> Result<(), LogError> {
        match opcode {
            op::CHUNK => self.take_chunk(at, RECORD_HEAD as u64 + body),
            op::MESSAGE => self.take_message(at, body),
            op::MESSAGE_INDEX => {
                self.take_message_index(body);
                Ok(())
            }
            op::SCHEMA | op::CHANNEL => self.take_description(at, opcode, body),
            op::METADATA if body <= MAX_LOG_METADATA_BYTES as u64 => {
                self.parts.metadata.push((at, RECORD_HEAD as u64 + body));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn take_chunk(&mut self, at: u64, length: u64) -> Result<(), LogError> {
        self.close_loose();
        let mut content = Content::default();
        let outcome = chunk::for_each_record(self.file, at, length, |opcode, body| {
            content.add(opcode, body);
        })?;
        self.is_last_chunk_lost = outcome.is_err();
        if let Err(reason) = outcome {
            let loss = SetAside::new(SetAsideKind::LogSection, self.file.name(), reason);
            self.lost.push((loss.at(at), Some(0)));
            return Ok(());
        }
        content.describe(&mut self.parts);
        self.count(content.first_ns, content.last_ns, &content.messages);
        let channels = content.messages.iter();
        self.parts.sections.push(Section {
            kind: SectionKind::Chunk,
            offset: at,
            length,
            first_ns: content.first_ns,
            last_ns: content.last_ns,
            channels: channels
                .map(|(id, count)| (*id, Tally::Exact(*count)))
                .collect(),
        });
        Ok(())
    }

    /// Counts the messages of a chunk that could not be used.
    fn take_message_index(&mut self, body: u64) {
        if !self.is_last_chunk_lost {
            return;
        }
        if let Some((_, Some(messages))) = self.lost.last_mut() {
            *messages += body.saturating_sub(INDEX_HEAD_BYTES) / INDEX_ENTRY_BYTES;
        }
    }

    fn take_message(&mut self, at: u64, body: u64) -> Result<(), LogError> {
        let head = self.peek(at + RECORD_HEAD as u64, MESSAGE_HEAD)?;
        let Some(message) = head.and_then(RawMessage::parse) else {
            return Ok(());
        };
        let (channel, time) = (message.channel, to_ns(message.log_time));
        let length = RECORD_HEAD as u64 + body;
        if self
            .loose
            .as_ref()
            .is_some_and(|section| section.is_full_for(at, length))
        {
            self.close_loose();
        }
        let section = self.loose.get_or_insert_with(|| Section::loose(at, time));
        section.extend(at + length, channel, time);
        self.count(time, time, &BTreeMap::from([(channel, 1)]));
        Ok(())
    }

    fn take_description(&mut self, at: u64, opcode: u8, body: u64) -> Result<(), LogError> {
        if body > MAX_LOG_RECORD_BYTES as u64 {
            return Ok(());
        }
        let Some(bytes) = self.file.read_range(at + RECORD_HEAD as u64, body)? else {
            return Ok(());
        };
        let mut content = Content::default();
        content.add(opcode, &bytes);
        content.describe(&mut self.parts);
        Ok(())
    }

    fn count(&mut self, first_ns: i64, last_ns: i64, messages: &BTreeMap<u16, u64>) {
        if messages.is_empty() {
            return;
        }
        for (channel, count) in messages {
            *self.parts.messages.entry(*channel).or_default() += count;
        }
        let parts = &mut self.parts;
        let is_first = !std::mem::replace(&mut self.has_messages, true);
        parts.first_ns = if is_first {
            first_ns
        } else {
            parts.first_ns.min(first_ns)
        };
        parts.last_ns = if is_first {
            last_ns
        } else {
            parts.last_ns.max(last_ns)
        };
    }

    fn close_loose(&mut self) {
        self.parts.sections.extend(self.loose.take());
    }

    /// The next `length` bytes from `at`, through a window that is read ahead.
    fn peek(&mut self, at: u64, length: usize) -> Result<Option<&[u8]>, LogError> {
        let begin = at
            .checked_sub(self.window_at)
            .and_then(|begin| usize::try_from(begin).ok());
        let is_inside = begin.is_some_and(|begin| {
            begin
                .checked_add(length)
                .is_some_and(|end| end <= self.window.len())
        });
        if !is_inside {
            self.window.resize(WINDOW_BYTES, 0);
            let filled = self.file.read_some(at, &mut self.window)?;
            self.window.truncate(filled);
            self.window_at = at;
        }
        let begin = (at - self.window_at) as usize;
        Ok(self.window.get(begin..begin + length))
    }

    fn finish(mut self, losses: &mut Losses) -> Parts {
        self.close_loose();
        for (mut loss, messages) in self.lost {
            if let Some(messages) = messages {
                loss.count = messages.max(1);
            }
            losses.push(loss);
        }
        self.parts
    }
}

impl Section {
    fn loose(offset: u64, time: i64) -> Self {
        Self {
            kind: SectionKind::Loose,
            offset,
            length: 0,
            first_ns: time,
            last_ns: time,
            channels: Vec::new(),
        }
    }

    /// Whether a record of `length` bytes at `at` should begin a new section.
    fn is_full_for(&self, at: u64, length: u64) -> bool {
        (at - self.offset).saturating_add(length) > LOOSE_SECTION_BYTES
    }

    fn extend(&mut self, end: u64, channel: u16, time: i64) {
        self.length = end - self.offset;
        self.first_ns = self.first_ns.min(time);
        self.last_ns = self.last_ns.max(time);
        match self.channels.iter_mut().find(|(id, _)| *id == channel) {
            Some((_, Tally::Exact(count))) => *count += 1,
            _ => self.channels.push((channel, Tally::Exact(1))),
        }
    }
}

/// What a chunk holds.
#[derive(Default)]
struct Content {
    messages: BTreeMap<u16, u64>,
    first_ns: i64,
    last_ns: i64,
    descriptions: Parts,
}

impl Content {
    fn add(&mut self, opcode: u8, body: &[u8]) {
        match opcode {
            op::MESSAGE => self.add_message(body),
            op::SCHEMA | op::CHANNEL => self.add_description(opcode, body),
            _ => {}
        }
    }

    fn add_message(&mut self, body: &[u8]) {
        let Some(message) = RawMessage::parse(body) else {
            return;
        };
        let time = to_ns(message.log_time);
        let is_first = self.messages.is_empty();
        self.first_ns = if is_first {
            time
        } else {
            self.first_ns.min(time)
        };
        self.last_ns = if is_first {
            time
        } else {
            self.last_ns.max(time)
        };
        *self.messages.entry(message.channel).or_default() += 1;
    }

    fn add_description(&mut self, opcode: u8, body: &[u8]) {
        match mcap::parse_record(opcode, body) {
            Ok(Record::Schema { header, .. }) => {
                self.descriptions
                    .schemas
                    .entry(header.id)
                    .or_insert(header.name);
            }
            Ok(Record::Channel(channel)) => self.descriptions.add_channel(channel),
            _ => {}
        }
    }

    /// Adds the channels and schemas that were described here, where they are new.
    fn describe(&mut self, parts: &mut Parts) {
        let described = std::mem::take(&mut self.descriptions);
        for (id, name) in described.schemas {
            parts.schemas.entry(id).or_insert(name);
        }
        for (id, channel) in described.channels {
            parts.channels.entry(id).or_insert(channel);
        }
    }
}
