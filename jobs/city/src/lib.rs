//! A seeded city with known changes: a map as it was made, the road as it is now, and the logs of
//! vehicles that drove there.
//!
//! A `world` is drawn by seed (`network`) or taken from a map (`mapped`) -> `edit` lets things happen
//! to its paint, with dates -> a drive takes `route`s (`reach` says how far they lead), moves along them (`course`) amid `traffic`
//! in the lanes `alongside`, and measures: `receiver` its position, `inertial` its heading, `odometer` its way, `detector` the paint -> `drive` puts
//! that into a log. `write` joins them. How sensors err is read from parameter files (`noise`).
//! [`render`] takes pictures of a [`World`].
//!
//! Frames: the city's plane, metres east and north of the anchor; heights are above the anchor's.

mod alongside;
mod city;
mod course;
mod curve;
mod detector;
mod drift;
mod drive;
mod edit;
mod error;
mod ground;
mod inertial;
mod mapped;
mod mounting;
mod network;
pub mod noise;
mod odometer;
mod pictures;
mod random;
mod reach;
mod receiver;
mod relief;
pub mod render;
mod route;
mod spec;
mod traffic;
mod truth;
mod world;
mod write;

pub use edit::{Change, ChangeType, Happening};
pub use error::CityError;
pub use inertial::{Inertial, Wheels};
pub use mounting::{Body, Misalignment, clock_offset_s};
pub use noise::NoiseProfile;
pub use random::Random;
pub use receiver::{FixError, Receiver};
pub use relief::Relief;
pub use spec::{CitySpec, LogProfile, Site};
pub use traffic::Vehicle;
pub use world::{Building, Lane, Paint, Point, World};
pub use write::{CityFiles, write};
