//! The identity of a message: what was said, not where it was found.
//!
//! Only schema name, message encoding and payload enter, each with its length, so that a renamed,
//! re-chunked, re-compressed, merged or split copy of a log has the same digests.

use tilefold_schemas::id::first_i64;

/// Hashes the messages of one topic.
#[derive(Debug, Clone)]
pub(crate) struct Digester(blake3::Hasher);

impl Digester {
    /// For messages of this schema and encoding.
    pub(crate) fn new(schema_name: &str, encoding: &str) -> Self {
        let mut hasher = blake3::Hasher::new();
        for text in [schema_name, encoding] {
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        }
        Self(hasher)
    }

    /// Digest of part `part` of a message; a message that is not divided is part 0.
    pub(crate) fn digest(&self, payload: &[u8], part: u64) -> i64 {
        let mut hasher = self.0.clone();
        hasher.update(payload);
        if part > 0 {
            hasher.update(b"part");
            hasher.update(&part.to_le_bytes());
        }
        first_i64(&hasher.finalize())
    }
}
