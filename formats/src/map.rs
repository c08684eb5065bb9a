//! Maps: whatever they were drawn with, to the elements of `tilefold_schemas::element`.
//!
//! [`read`] looks at the content, not at the name. It reads Lanelet2 (OSM XML), OpenDRIVE and the
//! vector map of Argoverse 2. A map is untrusted: what breaks the file as a whole (XML that is none, a limit, an entity) refuses it with
//! line and column; what breaks one element sets that element aside and says where and why.
//! Half a map is refused, because every element that it lacks would later be "found" on the road.
//!
//! The siblings, in the way of the data: `fence` hands out bytes, counts lines and bounds what one
//! piece of XML may take; `xml` walks through the document and `document` says which map it is.
//! `osm` makes nodes, ways and relations of it; `paint` says which ways are paint; `lanelet2` makes
//! elements. `opendrive` and `argoverse2` are the other formats; `make` judges the shape of any
//! element. `local_frames` puts Autoware's local coordinates on the Earth, `tiles` joins the tiles of a
//! divided map. [`read_roads`] makes lanelets of a Lanelet2 file (`lanelets`), whose borders are stitched
//! and turned in `border`; `traffic` says who may drive there and how.

mod argoverse2;
mod border;
mod border_uses;
mod document;
mod error;
mod fence;
mod lanelet2;
mod lanelets;
mod local_frames;
mod make;
mod mgrs_square;
mod opendrive;
mod osm;
mod paint;
mod plain_yaml;
mod roads;
mod rough;
mod tiles;
mod traffic;
mod xml;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

use tilefold_schemas::limits::MAX_MAP_BYTES;
use tilefold_schemas::{Element, SetAside};

use document::Document;

pub use error::MapError;
pub use local_frames::{LocalFrames, PROJECTOR_FILE};
pub(crate) use paint::marking as marking_of;
pub use roads::{Border, BorderKind, BorderWay, Crossing, Lanelet, Roads};
pub use tiles::METADATA_FILE;

/// What a map file was written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapFormat {
    /// Lanelet2: OSM XML with lanelets as relations.
    Lanelet2,
    /// OpenDRIVE: XML with roads as formulas.
    OpenDrive,
    /// The vector map of Argoverse 2: JSON with lane segments.
    Argoverse2,
}

/// What a map file held, counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MapCounts {
    /// Points (nodes), without the deleted ones; 0 in formats without nodes.
    pub nodes: u64,
    /// Lines: ways without the deleted ones, road marks of OpenDRIVE, different boundaries of
    /// Argoverse 2.
    pub ways: u64,
    /// Relations without the deleted ones, roads of OpenDRIVE, crossings of Argoverse 2.
    pub relations: u64,
    /// Relations that are lanelets, lanes of OpenDRIVE, lane segments of Argoverse 2.
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
    /// What is not paint, by its type in the map's own words (`virtual`, `curbstone`, ...; empty if
    /// untyped).
    pub not_paint: BTreeMap<String, u64>,
    /// What the file says of itself: `generator`, `map_version`, `format_version`, ...
    pub about: BTreeMap<String, String>,
}

/// The files of a map: itself, or the tiles of a divided one as [`read`] takes it.
///
/// # Errors
/// A tile is not there, or the file that names them is damaged.
pub fn files(path: &Path) -> Result<Vec<PathBuf>, MapError> {
    match tiles::metadata(path) {
        Some(metadata) => tiles::files(&metadata),
        None => Ok(vec![path.to_owned()]),
    }
}

/// Reads a map: a file, or the tiles of one by their metadata file or by the folder that it is in.
///
/// # Errors
/// If a file cannot be read, is over a limit, is damaged, or is none of the formats that are read.
pub fn read(path: &Path) -> Result<MapFile, MapError> {
    match tiles::metadata(path) {
        Some(metadata) => tiles::read(&metadata),
        None => read_one(path),
    }
}

/// Reads one file.
fn read_one(path: &Path) -> Result<MapFile, MapError> {
    let name = path.display().to_string();
    read_in(open(path, &name)?, &name, &mut LocalFrames::beside(path))
}

/// Reads a map from `source`; `name` is what losses and errors call it. Of an Argoverse 2 map it is
/// also what says which city it is of.
///
/// # Errors
/// As [`read`].
pub fn read_from(source: impl Read, name: &str) -> Result<MapFile, MapError> {
    read_in(source, name, &mut LocalFrames::default())
}

fn read_in(source: impl Read, name: &str, frames: &mut LocalFrames) -> Result<MapFile, MapError> {
    let (head, source) = headed(source, name)?;
    if looks_like_object(&head) {
        return argoverse2::read(source, name);
    }
    match document::read(xml(&head, source, name)?, name)? {
        Document::Osm(mut osm) => {
            osm.locate(frames);
            Ok(lanelet2::read(&osm, name))
        }
        Document::OpenDrive(drive) => opendrive::read(drive, name),
    }
}

/// Reads the road network of a map file. Only Lanelet2 says enough of it.
///
/// # Errors
/// As [`read`].
pub fn read_roads(path: &Path) -> Result<Roads, MapError> {
    let name = path.display().to_string();
    read_roads_in(open(path, &name)?, &name, &mut LocalFrames::beside(path))
}

/// Reads the road network of a map from `source`; `name` is what losses and errors call it.
///
/// # Errors
/// As [`read`].
pub fn read_roads_from(source: impl Read, name: &str) -> Result<Roads, MapError> {
    read_roads_in(source, name, &mut LocalFrames::default())
}

fn read_roads_in(
    source: impl Read,
    name: &str,
    frames: &mut LocalFrames,
) -> Result<Roads, MapError> {
    let (head, source) = headed(source, name)?;
    match document::read(xml(&head, source, name)?, name)? {
        Document::Osm(mut osm) => {
            osm.locate(frames);
            Ok(lanelets::read(&osm, name))
        }
        Document::OpenDrive(_) => Err(MapError::NoRoads {
            file: name.to_owned(),
        }),
    }
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

/// How `source` begins, and the whole of it.
fn headed(mut source: impl Read, name: &str) -> Result<(Vec<u8>, impl Read), MapError> {
    let mut head = Vec::new();
    let taken = source.by_ref().take(HEAD_BYTES).read_to_end(&mut head);
    taken.map_err(|source| MapError::Io {
        file: name.to_owned(),
        source,
    })?;
    Ok((head.clone(), Cursor::new(head).chain(source)))
}

/// `source`, if it begins like XML.
fn xml<R: Read>(head: &[u8], source: R, name: &str) -> Result<R, MapError> {
    match not_xml(head) {
        None => Ok(source),
        Some(looks_like) => Err(MapError::Format {
            file: name.to_owned(),
            looks_like: looks_like.to_owned(),
        }),
    }
}

/// How much of a file is looked at to guess its format.
const HEAD_BYTES: u64 = 4096;

/// The first byte that is not white space.
fn first_byte(head: &[u8]) -> Option<u8> {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    text.iter()
        .find(|byte| !byte.is_ascii_whitespace())
        .copied()
}

fn looks_like_object(head: &[u8]) -> bool {
    first_byte(head) == Some(b'{')
}

/// What a file without XML seems to be. XML goes on to the reader, which looks at its root.
fn not_xml(head: &[u8]) -> Option<&'static str> {
    match (head, first_byte(head)) {
        (_, Some(b'<')) => None,
        ([0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [b'<', 0, ..] | [0, b'<', ..], _) => {
            Some("XML in UTF-16: save it as UTF-8")
        }
        ([0x1f, 0x8b, ..], _) => Some("a gzip archive: unpack it first"),
        ([b'P', b'K', 3, 4, ..], _) => Some("a zip archive: unpack it first"),
        ([0x89, b'M', b'C', b'A', b'P', ..], _) => Some("an MCAP log: give it to `run`"),
        (_, Some(b'{' | b'[')) => Some("JSON"),
        (_, None) => Some("an empty file"),
        _ => Some("no map format that we know"),
    }
}
