//! The versioned tile store: Delta tables, commits, time travel.
//!
//! A store is a folder (or a URL) with one Delta Lake table per row type and a `tilefold.json`.
//! Its version is the Delta version of the table `layers`: the commit there is the last one of a
//! job and names the version and the digest of every other table ([`Pin`]). Whoever opens the
//! store at version V opens all tables at the pins of V, so a reader sees the old store or the new
//! one and never something between, whatever was killed meanwhile.
//!
//! Reading goes through [`Snapshot`], writing through [`Transaction`]. Data files are a function
//! of their rows alone: sorted, encoded with fixed settings, named by the hash of their bytes. A
//! tiled table has exactly one file per coarse tile, so two stores with the same rows have the
//! same files, whatever their histories. What is read is checked against these hashes.
//!
//! The calls block; a private runtime does the waiting. Do not call them from async code.

mod bbox;
mod commit_info;
mod data_file;
mod delta;
mod digest;
mod elsewhere;
mod error;
mod folder;
mod geo;
mod layout;
mod location;
mod order;
mod properties;
mod s3;
mod snapshot;
mod store;
mod transaction;
mod vacuum;
mod version;

pub use data_file::{DataFile, coarse};
pub use digest::digest_rows;
pub use elsewhere::Rewritten;
pub use error::StoreError;
pub use layout::StoredTable;
pub use location::Location;
pub use properties::{FORMAT_VERSION, Parameters, StoreProperties};
pub use snapshot::{Batches, Snapshot, TileFilter};
pub use store::Store;
pub use transaction::Transaction;
pub use vacuum::{Retention, Vacuumed};
pub use version::{Pin, VersionInfo};

#[cfg(test)]
mod tests;
