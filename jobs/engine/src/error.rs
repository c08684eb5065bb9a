//! Why a job failed. A failed job has changed nothing: it is safe to run again.

use tilefold_formats::map::MapError;
use tilefold_store::StoreError;
use tilefold_tiler::tile::TileError;

/// Why a job failed.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// The base map could not be read.
    #[error(transparent)]
    Map(#[from] MapError),
    /// A log could not be read.
    #[error(transparent)]
    Log(#[from] tilefold_formats::log::LogError),
    /// A model could not be read.
    #[error(transparent)]
    Model(#[from] tilefold_formats::model::ModelError),
    /// The store refused.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A truth file could not be read.
    #[error(transparent)]
    GeoJson(#[from] tilefold_formats::geojson::GeoJsonError),
    /// An export could not be written.
    #[error(transparent)]
    Export(#[from] tilefold_formats::export::ExportError),
    /// A map cannot be patched.
    #[error(transparent)]
    Patch(#[from] tilefold_formats::map_patch::PatchError),
    /// A map that is not the one the changes were found on.
    #[error(
        "{map} is not the map of version {version} of the store: {differ} of its elements are not in the store, or differ{}, and {lacking} of the store's are not in it; give the file of `tilefold init --map` or `rebase --map`", first.map_or(String::new(), |id| format!(" (the first is {id})"))
    )]
    OtherMap {
        /// The map.
        map: String,
        /// The version.
        version: i64,
        /// Elements of the map that the store does not have like this.
        differ: usize,
        /// Elements of the store from a file of this name that the map lacks.
        lacking: usize,
        /// The first element that differs.
        first: Option<i64>,
    },
    /// A row of the store is not what it should be.
    #[error(
        "the store holds a {what} that cannot be read: {reason}; run `tilefold verify` and restore the file it names"
    )]
    Damaged {
        /// What kind of row.
        what: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// The store's evidence and that of this run must not be added up.
    #[error(
        "the store's evidence was made by method {found}, and this run makes it by method {wanted}; they are never added up: make a new store with `tilefold init` and run all logs on it, or run as before (methods from 1000 on are those of `--registration off`)"
    )]
    OtherMethod {
        /// Method of the store.
        found: i32,
        /// Method of the run.
        wanted: i32,
    },
    /// Nothing in a version has that id.
    #[error(
        "nothing in version {version} has the id {id}; the nearest are {nearest}. Give a change id (16 hexadecimal digits) or an element id of the map; `tilefold export STORE --all` lists both"
    )]
    UnknownChange {
        /// What was asked for.
        id: String,
        /// The version.
        version: i64,
        /// Ids that look like it.
        nearest: String,
    },
    /// A map element is on no tile.
    #[error("element {element} is on no tile: {source}")]
    Tile {
        /// Element id.
        element: i64,
        /// Why.
        source: TileError,
    },
    /// Two maps given together have different elements under one id.
    #[error(
        "element {element} is in {first} and, different, in {second}; give maps that belong together"
    )]
    Clash {
        /// Element id.
        element: i64,
        /// File that was read first.
        first: String,
        /// File that differs.
        second: String,
    },
    /// A picture could not be written.
    #[error("cannot write pictures to {}: {source}; check the disk and the folder's rights", path.display())]
    Picture {
        /// The folder.
        path: std::path::PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// What does not fit into memory has no place on disk.
    #[error("cannot keep intermediate results in {}: {source}; make room there, name another folder with TMPDIR, or allow more --memory", folder.display())]
    Spill {
        /// The folder.
        folder: std::path::PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// What came back from a cluster is not what was asked of it.
    #[error(
        "the cluster's work does not add up: {0}; nothing was committed: run the same command again"
    )]
    Cluster(String),
    /// Nothing to do the job on.
    #[error("{0}")]
    Nothing(String),
}
