//! The reduce stage: evidence in, verdicts and layers out.
//!
//! Pure: no disk, no clock, no environment, no randomness. [`passes`] forms the units of
//! independence, [`paper`] and [`calibrated`] are the two fusion models, [`sensor`] says how detectors err, [`elements`] judges
//! mapped elements and [`candidates`] what the map lacks; [`reduce_tile()`] joins them.

pub mod calibrated;
pub mod candidates;
pub mod chain;
pub mod elements;
mod markings;
pub mod paper;
pub mod passes;
pub mod reduce_tile;
pub mod sensor;
mod traverse;

pub use reduce_tile::{FusionModel, TileInput, reduce_tile};
pub use sensor::SensorModel;
