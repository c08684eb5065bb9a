//! ONNX Runtime sessions behind the [`tilefold_workers::detector::Detector`] of the map stage.
//!
//! The way of a picture is the order of the modules: `library` finds ONNX Runtime, `card` says
//! what a model is, `model_file` whether the file beside it is that model, `session` runs it;
//! `fit` brings a picture to its input, and `lines`, `mask` and `boxes` bring its outputs
//! back into pixels of the picture. `network` joins them.

mod boxes;
pub mod card;
mod chain;
pub mod error;
mod fit;
pub mod library;
mod lines;
mod mask;
pub mod model_file;
pub mod network;
pub mod session;

pub use card::Card;
pub use error::OnnxError;
pub use library::Library;
pub use network::{Device, Model, Network};
