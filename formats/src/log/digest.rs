//! The identity of a message: what was said, not where it was found.
//!
//! Only schema name, message encoding and payload enter, so that a renamed, re-chunked, re-compressed,
//! merged or split copy of a log has the same digests. XXH3 tells copies from messages of their own as
//! well as a cryptographic hash of 64 bits does, at a fraction of the time; who can write a message can
//! lie in simpler ways than by a collision.

use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};

/// Hashes the messages of one topic.
#[derive(Debug, Clone)]
pub(crate) struct Digester {
    seed: u64,
}

impl Digester {
    /// For messages of this schema and encoding.
    pub(crate) fn new(schema_name: &str, encoding: &str) -> Self {
        let of = format!("{}:{schema_name}{encoding}", schema_name.len());
        Self {
            seed: xxh3_64(of.as_bytes()),
        }
    }

    /// Digest of part `part` of a message; a message that is not divided is part 0.
    pub(crate) fn digest(&self, payload: &[u8], part: u64) -> i64 {
        xxh3_64_with_seed(payload, self.seed.wrapping_add(part)).cast_signed()
    }
}
