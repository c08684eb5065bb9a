//! A stretch of a log's data that is read in one go: a chunk, or messages outside of chunks.

/// How many messages of one channel a section holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tally {
    /// Counted by a scan.
    Exact(u64),
    /// As the message index record at this offset says.
    IndexAt(u64),
}

/// What a section is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SectionKind {
    /// One chunk record.
    Chunk,
    /// Whole records outside of chunks.
    Loose,
}

/// Where a section is and what it holds.
#[derive(Debug, Clone)]
pub(crate) struct Section {
    /// Chunk or loose records.
    pub(crate) kind: SectionKind,
    /// Byte in the file at which its (first) record begins.
    pub(crate) offset: u64,
    /// Bytes, heads of records included.
    pub(crate) length: u64,
    /// Log time of its first message, in nanoseconds since the Unix epoch.
    pub(crate) first_ns: i64,
    /// Log time of its last message.
    pub(crate) last_ns: i64,
    /// Messages by channel; empty if the file does not say.
    pub(crate) channels: Vec<(u16, Tally)>,
}

impl Section {
    /// Whether it may hold a message on a wanted channel in `[from_ns, to_ns)`.
    pub(crate) fn may_hold(
        &self,
        is_wanted: impl Fn(u16) -> bool,
        from_ns: i64,
        to_ns: i64,
    ) -> bool {
        let in_time = self.first_ns < to_ns && self.last_ns >= from_ns;
        let on_channel = self.channels.is_empty()
            || self.channels.iter().any(|(channel, _)| is_wanted(*channel));
        in_time && on_channel
    }
}
