//! A seeded city with known changes: a map as it was surveyed, the same map with known errors, and
//! the logs of vehicles that drove there.
//!
//! It is drawn in vectors: one long street of several roads, its paint, and drives with the errors
//! that real receivers and detectors have. What a line's way through the files is:
//! `curve` (where the street runs) -> `road` (which lines are painted) -> `survey` (elements of the
//! true map) -> `edit` (the map with known errors, and the truth) on the one hand, and
//! `course` (how a vehicle moves) -> `receiver`, `detector` (what it measures) -> `drive` (its log)
//! on the other. `write` joins them.
//! [`render`] takes pictures of a [`World`].
//!
//! Frames: the city is planar, in the east-north-up frame of [`CitySpec::anchor`]; stations are
//! metres along the street, offsets metres to its left.

mod course;
mod curve;
mod detector;
mod drive;
mod edit;
mod error;
mod random;
mod receiver;
mod relief;
pub mod render;
mod road;
mod spec;
mod survey;
mod truth;
mod world;
mod write;

pub use error::CityError;
pub use relief::Relief;
pub use spec::CitySpec;
pub use world::{Building, Lane, Paint, Point, World};
pub use write::{CityFiles, write};
