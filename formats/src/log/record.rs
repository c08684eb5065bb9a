//! Bytes to MCAP records: one opcode, one length, one body.
//!
//! Source: MCAP specification, <https://mcap.dev/spec>.

/// Bytes of a record's opcode and length.
pub(crate) const RECORD_HEAD: usize = 9;
/// Bytes of a message record before its payload.
pub(crate) const MESSAGE_HEAD: usize = 22;

/// Opcode and body length of the record that begins with `head`.
pub(crate) fn split_head(head: &[u8; RECORD_HEAD]) -> (u8, u64) {
    let mut length = [0; 8];
    length.copy_from_slice(&head[1..]);
    (head[0], u64::from_le_bytes(length))
}

/// Walks the records in a slice. Ends at its end, or at a record that runs over it.
#[derive(Debug, Clone)]
pub(crate) struct Records<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Records<'a> {
    /// The records of `bytes`.
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Where the next record begins.
    pub(crate) fn position(&self) -> usize {
        self.at
    }

    /// Whether every byte belonged to a whole record.
    pub(crate) fn is_finished(&self) -> bool {
        self.at == self.bytes.len()
    }
}

impl<'a> Iterator for Records<'a> {
    type Item = (u8, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let (head, rest) = self
            .bytes
            .get(self.at..)?
            .split_first_chunk::<RECORD_HEAD>()?;
        let (opcode, length) = split_head(head);
        let body = rest.get(..usize::try_from(length).ok()?)?;
        self.at += RECORD_HEAD + body.len();
        Some((opcode, body))
    }
}

/// A message record: its head, and its payload still encoded.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RawMessage<'a> {
    /// Channel it was sent on.
    pub(crate) channel: u16,
    /// Nanoseconds since the Unix epoch at which it was recorded.
    pub(crate) log_time: u64,
    /// The encoded message.
    pub(crate) payload: &'a [u8],
}

impl<'a> RawMessage<'a> {
    /// Splits the body of a message record; `None` if it is shorter than its head.
    pub(crate) fn parse(body: &'a [u8]) -> Option<Self> {
        let (head, payload) = body.split_first_chunk::<MESSAGE_HEAD>()?;
        Some(Self {
            channel: u16::from_le_bytes([head[0], head[1]]),
            log_time: u64::from_le_bytes([
                head[6], head[7], head[8], head[9], head[10], head[11], head[12], head[13],
            ]),
            payload,
        })
    }
}

/// A time of the file as the nouns have it. Times past the year 2262 all become the last one.
pub(crate) fn to_ns(time: u64) -> i64 {
    i64::try_from(time).unwrap_or(i64::MAX).min(i64::MAX - 1)
}
