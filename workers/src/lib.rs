//! The map stage: one chunk in, keyed evidence out.
//!
//! Pure: no disk, no clock, no environment, no randomness. The way of a frame is the order of the
//! modules: [`pose`] and [`frames`] place the vehicle; [`lens`], [`camera`], [`pixels`], [`surface`] and
//! [`look`] bring what was seen into metres, [`clock`] brings
//! the two clocks together, [`mounting`] says where the camera really is; [`local_map`] and [`cuts`] lay it beside the map, [`register`] and [`scale`] take out
//! the errors of position and mounting, [`matching`] says which line is which ([`aslant`]: those that run across), [`visibility`] what could be seen ([`hidden`]: what could not), and
//! [`testify`], [`sight`] and [`footprint`] write it down; [`areas`] does the same for stop lines, crosswalks and
//! ground signs. [`map_chunk()`] joins them; [`trace`] is for onlookers.

pub mod areas;
pub mod aslant;
mod banded;
pub mod camera;
pub mod clock;
pub mod cuts;
pub mod detector;
mod drift;
mod fixes;
pub mod footprint;
pub mod frames;
mod heading;
pub mod hidden;
pub mod lens;
pub mod local_map;
pub mod look;
pub mod map_chunk;
pub mod matching;
mod median;
mod motion;
pub mod mounting;
mod nodes;
pub mod perceived;
pub mod pixels;
pub mod pose;
pub mod profile;
pub mod register;
pub mod scale;
pub mod sight;
mod signal;
pub mod surface;
pub mod testify;
pub mod trace;
pub mod track;
pub mod view;
pub mod visibility;

pub use map_chunk::{Evidence, MapContext, map_chunk, map_chunk_traced};
pub use register::Registering;
