//! Bytes to nouns and back: logs, maps, exports.
