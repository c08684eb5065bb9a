//! The frames that say most of a change, as pictures, from logs that whoever serves the page named.
//!
//! A request names a change and the place of a frame in its explanation, and no file. Paths of logs
//! that stand in the store are not followed here: a store may come from anywhere, and the page may be
//! open to others.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use tilefold_engine::Perception;
use tilefold_engine::frames::{Sources, Studio};

use crate::documents::Version;
use crate::error::ReviewError;

/// Where pictures come from.
pub struct Gallery {
    logs: Vec<PathBuf>,
    perception: Option<Perception>,
    /// A picture takes a map, a chunk and a camera image in memory: one is drawn at a time.
    turn: Mutex<()>,
}

impl Gallery {
    /// Pictures from these logs, or folders of them; `perception` is the network that looked at those
    /// without detections. None where no log is named.
    #[must_use]
    pub fn new(logs: Vec<PathBuf>, perception: Option<Perception>) -> Option<Self> {
        (!logs.is_empty()).then(|| Self {
            logs,
            perception,
            turn: Mutex::new(()),
        })
    }

    /// A frame of a change's explanation as PNG; none where there is no such change or frame.
    ///
    /// # Errors
    /// The store is damaged, or there is no picture of the frame in the logs.
    pub(crate) fn picture(
        &self,
        version: &Version,
        change: &str,
        place: usize,
    ) -> Result<Option<Vec<u8>>, ReviewError> {
        let told = version.explain(change)?;
        let Some(frame) = told.as_ref().and_then(|told| told.frames.get(place)) else {
            return Ok(None);
        };
        let _turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        let sources = Sources {
            logs: &self.logs,
            perception: self.perception.as_ref(),
        };
        let studio = Studio::open(&version.snapshot, sources)?;
        let picture = studio.picture(frame).map(Some);
        // Here logs are named by another flag than with `explain`.
        picture.map_err(|why| ReviewError::NoPicture(why.replace("`--logs`", "`--frames-from`")))
    }
}
