//! An MCAP file in memory: the container wants to seek, and standard output cannot.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions, Writer};

use crate::log_write::{Encoded, LogWriteError, add_channel};

pub(super) struct MemoryLog {
    mcap: Writer<Cursor<Vec<u8>>>,
    channels: BTreeMap<&'static str, u16>,
    sequence: u32,
}

impl MemoryLog {
    pub(super) fn create() -> Result<Self, LogWriteError> {
        let mcap = WriteOptions::new()
            .library("tilefold")
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            .create(Cursor::new(Vec::new()))?;
        Ok(Self {
            mcap,
            channels: BTreeMap::new(),
            sequence: 0,
        })
    }

    /// Writes a metadata record.
    pub(super) fn describe<'a>(
        &mut self,
        name: &str,
        facts: impl IntoIterator<Item = (&'a str, String)>,
    ) -> Result<(), LogWriteError> {
        let facts = facts.into_iter();
        self.mcap.write_metadata(&Metadata {
            name: name.to_owned(),
            metadata: facts
                .map(|(name, value)| (name.to_owned(), value))
                .collect(),
        })?;
        Ok(())
    }

    pub(super) fn write(
        &mut self,
        topic: &'static str,
        stamp_ns: i64,
        encoded: &Encoded,
    ) -> Result<(), LogWriteError> {
        let time = u64::try_from(stamp_ns).map_err(|_| LogWriteError::Time(stamp_ns))?;
        let header = MessageHeader {
            channel_id: self.channel(topic, encoded)?,
            sequence: self.sequence,
            log_time: time,
            publish_time: time,
        };
        self.sequence = self.sequence.wrapping_add(1);
        self.mcap.write_to_known_channel(&header, &encoded.bytes)?;
        Ok(())
    }

    fn channel(&mut self, topic: &'static str, encoded: &Encoded) -> Result<u16, LogWriteError> {
        if let Some(channel) = self.channels.get(topic) {
            return Ok(*channel);
        }
        let channel = add_channel(&mut self.mcap, topic, encoded)?;
        self.channels.insert(topic, channel);
        Ok(channel)
    }

    pub(super) fn finish(mut self) -> Result<Vec<u8>, LogWriteError> {
        self.mcap.finish()?;
        Ok(self.mcap.into_inner().into_inner())
    }
}
