//! The review page: where a person looks at what a store claims, and decides.
//!
//! [`Review`] turns a version of a store into the page's documents: the layer of changes, why each
//! is claimed, where nobody looked, the map as tiles. [`serve()`] hands them out over HTTP,
//! [`write_folder`] writes them beside the page so that it opens without a server. [`decision`]
//! keeps what was decided. The page itself (HTML, CSS, JavaScript) is in `page/`; `assets` bundles
//! it with MapLibre GL JS, which `cargo xtask setup` fetches.

mod assets;
mod coverage;
pub mod decision;
mod documents;
mod error;
mod folder;
mod gallery;
mod layer;
mod once;
mod serve;

pub use decision::{Decision, Decisions, Said};
pub use documents::Review;
pub use error::ReviewError;
pub use folder::{FolderReport, write_folder};
pub use gallery::Gallery;
pub use serve::{Door, Served, serve};
