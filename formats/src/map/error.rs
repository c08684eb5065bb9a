//! Why a map file is refused as a whole.

/// A map file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// The disk said no.
    #[error("cannot read map {file}: {source}; check the path and its rights")]
    Io {
        /// The file.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// More bytes than a map may have.
    #[error(
        "map {file} has {bytes} bytes, the limit is {limit} (MAX_MAP_BYTES): cut it into several files"
    )]
    TooLarge {
        /// The file.
        file: String,
        /// Its bytes, or those read so far.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// Another format.
    #[error(
        "{file} is not a map that is read here: it looks like {looks_like}; Lanelet2 (.osm), OpenDRIVE (.xodr) and Argoverse 2 \
         (log_map_archive_*.json) are read"
    )]
    Format {
        /// The file.
        file: String,
        /// What its content looks like.
        looks_like: String,
    },
    /// XML or JSON that is none, or that lacks what the whole map needs.
    #[error("map {file} is damaged at line {line}, column {column}: {what}; mend or re-export it")]
    Damaged {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Column, from 1: in characters, in JSON in bytes.
        column: u64,
        /// What is wrong.
        what: String,
    },
    /// A map that does not say where on Earth it is.
    #[error(
        "map {file} is in the coordinates of a city, but its name does not say which: give it the \
         name it was published with (log_map_archive_*____PIT_city_*.json; one of {cities})"
    )]
    City {
        /// The file.
        file: String,
        /// The cities that are known.
        cities: String,
    },
    /// A divided map of which a tile is missing, or whose tiles disagree.
    #[error("divided map {file}: {what}; divide the map again")]
    Tiles {
        /// The metadata file.
        file: String,
        /// What is wrong.
        what: String,
    },
    /// A map without lanelets.
    #[error("map {file} is OpenDRIVE: roads to drive on are read from Lanelet2 (.osm) only")]
    NoRoads {
        /// The file.
        file: String,
    },
    /// A piece of XML beyond its limit.
    #[error(
        "map {file} is refused at line {line}, column {column}: {what} is over the limit of {limit} ({name})"
    )]
    Limit {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Column, in characters, from 1.
        column: u64,
        /// What is too large.
        what: &'static str,
        /// The limit.
        limit: u64,
        /// Its name in `tilefold_schemas::limits`.
        name: &'static str,
    },
    /// XML that could make us read or build what is not in the file.
    #[error(
        "map {file} is refused at line {line}, column {column}: {what} is not allowed in a map; remove it"
    )]
    Forbidden {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Column, in characters, from 1.
        column: u64,
        /// A document type or an entity, named.
        what: String,
    },
}
