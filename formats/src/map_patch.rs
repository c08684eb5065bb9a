//! A Lanelet2 map with changes in it: what the road says, written into the map that it was held
//! against.
//!
//! `text` knows where in the file each node, way and relation stands; [`Patch`] (`plan`) says what
//! becomes of them; `lanelet2` writes the map anew, every byte that no change is about as it was,
//! and `osc` writes the same edits as an OsmChange. What a patch does with shared nodes, and with
//! borders whose paint is gone, is decision 0017.

mod lanelet2;
mod line;
mod local_grid;
mod osc;
mod plan;
mod text;

use tilefold_schemas::wkb::WkbError;

pub(crate) use self::line::{distance_m, offset_m};
pub use self::plan::{NewIds, NotApplied, Patch};
pub use self::text::OsmText;
pub(crate) use self::text::Thing;

/// Why a map cannot be patched.
#[derive(Debug, thiserror::Error)]
pub enum PatchError {
    /// The file is no OSM XML.
    #[error("map {file}, byte {offset}: {what}; only Lanelet2 maps (.osm) can be patched")]
    Text {
        /// The file.
        file: String,
        /// Where.
        offset: u64,
        /// What is wrong.
        what: String,
    },
    /// A record whose geometry is none.
    #[error("change {change:016x}: its geometry is {source}; run `verify` on the store")]
    Geometry {
        /// The change.
        change: i64,
        /// What is wrong with it.
        source: WkbError,
    },
}
