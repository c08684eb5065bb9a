//! Bytes to nouns and back: logs, maps, exports.

pub mod log;
