//! Changes, and the map that they are changes of, for programs that are not ours.
//!
//! `change` reads a record once for all formats, `attributes` is the one table of what is said of
//! it; then each format has its file: [`write_flatgeobuf`], [`write_geoparquet`],
//! [`write_pmtiles`] (whose tiles are cut in `cut` and encoded in `vector_tile`) and
//! [`write_scene`] (MCAP). [`write_case`] writes the frames of a verdict, and
//! `memory_log` what the two MCAP writers share. GeoJSON, which is also read, is in [`crate::geojson`]; maps with the
//! changes in them are in [`crate::map_patch`]. The same records give the same bytes.

pub(crate) mod attributes;
mod case;
pub(crate) mod change;
mod cut;
mod error;
mod flatgeobuf;
mod geoparquet;
mod map_tiles;
mod memory_log;
mod pmtiles;
mod scene;
mod vector_tile;

pub use self::case::{CaseFrame, CaseLine, write_case};
pub use self::cut::Address;
pub use self::error::ExportError;
pub use self::flatgeobuf::write_flatgeobuf;

pub use self::geoparquet::write_geoparquet;
pub use self::map_tiles::{FIRST_ZOOM, MapTiles};
pub use self::pmtiles::{MAX_ZOOM, MIN_MAP_ZOOM, MIN_ZOOM, write_pmtiles};
pub use self::scene::{Scene, write_scene};
