//! The reduce stage: evidence in, verdicts and layers out.
//!
//! Pure: no disk, no clock, no environment, no randomness. [`passes`] forms the units of
//! independence, [`paper`] and [`calibrated`] are the two fusion models, [`sensor`] says how
//! detectors err, [`elements`] judges mapped elements and [`candidates`] what the map lacks, as a
//! [`fold`] says, [`areas`] and [`area_candidates`] do the same for stop lines, crosswalks and ground
//! signs; [`reduce_tile()`] joins them.

pub mod area_candidates;
pub mod areas;
pub mod calibrated;
pub mod candidates;
pub mod chain;
pub mod elements;
pub mod explain;
pub mod fit;
pub mod flip;
pub mod fold;
mod follow;
pub mod groups;
mod lines;
mod look;
mod markings;
pub mod moved;
pub mod paper;
pub mod passes;
pub mod reduce_tile;
pub mod regions;
pub mod sections;
pub mod sensor;
pub mod space;
pub mod stale;
mod traverse;

pub use explain::Explained;
pub use fold::{Fold, FusionModel};
pub use reduce_tile::{TileInput, reduce_tile};
pub use sensor::SensorModel;
