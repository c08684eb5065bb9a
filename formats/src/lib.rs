//! Bytes to nouns and back: logs, pictures, maps, exports.

pub mod export;
pub mod geojson;
mod heights;
pub mod log;
pub mod log_write;
pub mod map;
pub mod map_compare;
pub mod map_patch;
pub mod map_write;
pub mod matching_truth;
pub mod model;
pub mod picture;
