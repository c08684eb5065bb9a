//! Maps: whatever they were drawn with, to the elements of `tilefold_schemas::element`.
//!
//! [`read`] looks at the content, never at the name. Today it reads Lanelet2 (OSM XML). A map is
//! untrusted: what breaks the file as a whole (XML that is none, a limit, an entity) refuses it with
//! line and column; what breaks one element sets that element aside and says where and why.
//! Half a map is refused, because every element that it lacks would later be "found" on the road.
//!
//! The siblings, in the way of the data: `fence` hands out bytes, counts lines and bounds what one
//! piece of XML may take; `osm` makes nodes, ways and relations of them; `paint` says which ways are
//! paint; `lanelet2` makes elements. [`read_roads`] makes lanelets of the same file (`lanelets`), whose
//! borders are stitched and turned in `border`; `traffic` says who may drive there and how.

mod border;
mod error;
mod fence;
mod lanelet2;
mod lanelets;
mod osm;
mod paint;
mod roads;
mod rough;
mod traffic;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use tilefold_schemas::limits::MAX_MAP_BYTES;
use tilefold_schemas::{Element, SetAside};

pub use error::MapError;
pub use roads::{Border, BorderKind, BorderWay, Crossing, Lanelet, Roads};

/// What a map file was written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapFormat {
    /// Lanelet2: OSM XML with lanelets as relations.
    Lanelet2,
}

/// What a map file held, counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MapCounts {
    /// Points (nodes), without the deleted ones.
    pub nodes: u64,
    /// Lines (ways), without the deleted ones.
    pub ways: u64,
    /// Relations, without the deleted ones.
    pub relations: u64,
    /// Relations that are lanelets.
    pub lanelets: u64,
    /// Relations that are areas.
    pub areas: u64,
    /// Relations that are regulatory elements.
    pub regulatory_elements: u64,
    /// What an editor marked as deleted: skipped.
    pub deleted: u64,
}

/// A map as it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct MapFile {
    /// What it was written in.
    pub format: MapFormat,
    /// The paint, sorted by id; ids are unique. Positions are WGS 84 (longitude, latitude, degrees;
    /// elevation in metres as the map says it, 0 where it does not).
    pub elements: Vec<Element>,
    /// Elements that could not be used. `offset` is the line in the file; line and column are in the
    /// reason too.
    pub set_aside: Vec<SetAside>,
    /// What was in the file.
    pub counts: MapCounts,
    /// Ways that are not paint, by their type (`virtual`, `curbstone`, ...; empty if untyped).
    pub not_paint: BTreeMap<String, u64>,
    /// What the file says of itself: `generator`, `map_version`, `format_version`, ...
    pub about: BTreeMap<String, String>,
}

/// Reads a map file.
///
/// # Errors
/// If the file cannot be read, is over a limit, is damaged, or is none of the formats that are read.
pub fn read(path: &Path) -> Result<MapFile, MapError> {
    let name = path.display().to_string();
    read_from(open(path, &name)?, &name)
}

/// Reads a map from `source`; `name` is what losses and errors call it.
///
/// # Errors
/// As [`read`].
pub fn read_from(source: impl Read, name: &str) -> Result<MapFile, MapError> {
    lanelet2::read(xml(source, name)?, name)
}

/// Reads the road network of a map file.
///
/// # Errors
/// As [`read`].
pub fn read_roads(path: &Path) -> Result<Roads, MapError> {
    let name = path.display().to_string();
    read_roads_from(open(path, &name)?, &name)
}

/// Reads the road network of a map from `source`; `name` is what losses and errors call it.
///
/// # Errors
/// As [`read`].
pub fn read_roads_from(source: impl Read, name: &str) -> Result<Roads, MapError> {
    lanelets::read(xml(source, name)?, name)
}

fn open(path: &Path, name: &str) -> Result<File, MapError> {
    let io = |source| MapError::Io {
        file: name.to_owned(),
        source,
    };
    let file = File::open(path).map_err(io)?;
    let bytes = file.metadata().map_err(io)?.len();
    if bytes > MAX_MAP_BYTES {
        return Err(MapError::TooLarge {
            file: name.to_owned(),
            bytes,
            limit: MAX_MAP_BYTES,
        });
    }
    Ok(file)
}

/// The whole of `source`, if it begins like XML.
fn xml(mut source: impl Read, name: &str) -> Result<impl Read, MapError> {
    let mut head = Vec::new();
    let taken = source.by_ref().take(HEAD_BYTES).read_to_end(&mut head);
    taken.map_err(|source| MapError::Io {
        file: name.to_owned(),
        source,
    })?;
    if let Some(looks_like) = not_xml(&head) {
        return Err(MapError::Format {
            file: name.to_owned(),
            looks_like: looks_like.to_owned(),
        });
    }
    Ok(std::io::Cursor::new(head).chain(source))
}

/// How much of a file is looked at to guess its format.
const HEAD_BYTES: u64 = 4096;

/// What a file without XML seems to be. XML goes on to the reader, which looks at its root.
fn not_xml(head: &[u8]) -> Option<&'static str> {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    let first = text.iter().find(|byte| !byte.is_ascii_whitespace());
    match (head, first) {
        (_, Some(b'<')) => None,
        ([0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [b'<', 0, ..] | [0, b'<', ..], _) => {
            Some("XML in UTF-16: save it as UTF-8")
        }
        ([0x1f, 0x8b, ..], _) => Some("a gzip archive: unpack it first"),
        ([b'P', b'K', 3, 4, ..], _) => Some("a zip archive: unpack it first"),
        ([0x89, b'M', b'C', b'A', b'P', ..], _) => Some("an MCAP log: give it to `run`"),
        (_, Some(b'{' | b'[')) => Some("JSON (Argoverse 2 or GeoJSON)"),
        (_, None) => Some("an empty file"),
        _ => Some("no map format that we know"),
    }
}
