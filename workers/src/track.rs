//! Tracking by detection (method.md, section 3): which observations of following frames are one
//! thing, which of them are worth believing, and what the thing is.
//!
//! `kalman` carries a state from frame to frame, `association` says which observation goes on
//! with which track, [`assign`] solves that for all at once, [`identity`] reads from a whole track
//! what it is. All of it works on quantised numbers, and in the order of the frames.

pub mod assign;
mod association;
pub mod identity;
mod kalman;
mod tracker;

pub use tracker::{Track, Tracker, Weights};
