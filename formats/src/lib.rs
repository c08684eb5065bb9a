//! Bytes to nouns and back: logs, maps, exports.

pub mod log;
pub mod map;
pub mod log_write;
pub mod map_write;
