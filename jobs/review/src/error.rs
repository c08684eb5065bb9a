//! Why the review page cannot be shown.

use std::path::PathBuf;

use tilefold_engine::EngineError;
use tilefold_formats::export::ExportError;
use tilefold_store::StoreError;

/// Why the review page cannot be shown, or a decision not be kept.
#[derive(Debug, thiserror::Error)]
pub enum ReviewError {
    /// The store refused.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A verdict cannot be explained.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The map cannot be cut into tiles.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// A row of the store is not what it should be.
    #[error(
        "change {change:016x} of the store cannot be read: {reason}; run `tilefold verify` and restore the file it names"
    )]
    Damaged {
        /// The change.
        change: i64,
        /// What is wrong with it.
        reason: String,
    },
    /// The program was built without MapLibre GL JS.
    #[error(
        "this program was built without the map library of the review page: run `cargo xtask setup` and build it again"
    )]
    NoMapLibrary,
    /// A version without layers.
    #[error(
        "version {version} of {location} has no layer of changes yet: run logs on it first (`tilefold run`)"
    )]
    NoLayers {
        /// The store.
        location: String,
        /// The version.
        version: i64,
    },
    /// A file of decisions that is not one.
    #[error(
        "{}, line {line}: this is no decision: {reason}; mend or remove the line", path.display()
    )]
    NoDecision {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// A decision that makes no sense.
    #[error("this decision cannot be kept: {0}")]
    Refused(String),
    /// A frame has no picture.
    #[error("there is no picture of this frame: {0}")]
    NoPicture(String),
    /// A file that cannot be read or written.
    #[error("cannot use {}: {source}; check the disk and the folder's rights", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The address is taken, or not this machine's.
    #[error(
        "cannot listen on {address}: {source}; another server may be there: give another --port"
    )]
    Listen {
        /// The address.
        address: std::net::SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// A document could not be made into JSON.
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
}
