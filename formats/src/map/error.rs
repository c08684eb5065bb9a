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
        "{file} is not a map that is read here: it looks like {looks_like}; Lanelet2 (.osm) is read"
    )]
    Format {
        /// The file.
        file: String,
        /// What its content looks like.
        looks_like: String,
    },
    /// XML that is none.
    #[error("map {file} is damaged at line {line}, column {column}: {what}; mend or re-export it")]
    Xml {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Column, in characters, from 1.
        column: u64,
        /// What is wrong.
        what: String,
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
