//! The reduce stage: evidence in, verdicts and layers out.
//!
//! Pure: no disk, no clock, no environment, no randomness. [`passes`] forms the units of
//! independence, [`paper`] and [`calibrated`] are the two fusion models, [`elements`] judges
//! mapped elements and [`candidates`] what the map lacks, [`areas`] and [`area_candidates`] the same for stop
//! lines, crosswalks and ground signs; [`reduce_tile()`] joins them.

pub mod area_candidates;
pub mod areas;
pub mod calibrated;
pub mod candidates;
pub mod chain;
pub mod elements;
pub mod paper;
pub mod passes;
pub mod reduce_tile;

pub use reduce_tile::{FusionModel, TileInput, reduce_tile};
