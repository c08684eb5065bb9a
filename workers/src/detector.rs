//! What the map stage asks of a network: pixels in, observations out. Sessions live elsewhere
//! (`tilefold-onnx`); this is all that is known of them here.

use std::error::Error;

use tilefold_schemas::Picture;
use tilefold_schemas::observation::Observation;

/// A network with its card, ready to look at pictures one after the other.
pub trait Detector {
    /// What it sees in a picture, in pixels of that picture, quantised; in an order that depends
    /// on the picture alone.
    ///
    /// # Errors
    /// The network failed; the next picture may be tried.
    fn detect(
        &mut self,
        picture: &Picture,
    ) -> Result<Vec<Observation>, Box<dyn Error + Send + Sync>>;
}
