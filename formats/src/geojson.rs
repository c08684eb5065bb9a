//! Changes as GeoJSON (RFC 7946): exports of change records, and the truth and change files that
//! evaluations read. Both share one form: a `FeatureCollection` whose features say `element_id`,
//! `change_type`, `kind` and, where they know it, `from_m`, `to_m`, `detail` and `since`.

mod read;
mod regions;
mod write;

use tilefold_schemas::{ElementKind, Verdict};

pub use read::{MAX_CHANGES_BYTES, read_changes, read_changes_file};
pub use regions::write_regions;
pub use write::{Reviewed, write_changes, write_reviewed};
pub(crate) use write::{closed_ring, utc};

/// The shape of a change's geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shape {
    /// No geometry.
    #[default]
    None,
    /// One position.
    Point,
    /// A line.
    Line,
    /// An area: its outer ring, first vertex not repeated.
    Area,
}

/// A change as a truth or change file says it.
#[derive(Debug, Clone, PartialEq)]
pub struct TruthChange {
    /// Id in the base map; none for what the base map does not have.
    pub element_id: Option<i64>,
    /// What is said of it.
    pub change_type: Verdict,
    /// What kind of thing it is.
    pub kind: ElementKind,
    /// Station at which the changed stretch begins, metres; none: at the beginning.
    pub from_m: Option<f64>,
    /// Station at which it ends, metres; none: at the end.
    pub to_m: Option<f64>,
    /// What kind of change it is more closely, in the words of whoever knows: `shifted`,
    /// `retyped`, `construction`, ...
    pub detail: Option<String>,
    /// Since when the road is as it is, nanoseconds since the Unix epoch.
    pub since_ns: Option<i64>,
    /// What `points` are.
    pub shape: Shape,
    /// Vertices `[longitude_deg, latitude_deg, elevation_m]`; elevation 0 where there is none.
    pub points: Vec<[f64; 3]>,
}

/// Why changes cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum GeoJsonError {
    /// The disk said no.
    #[error("changes {file}: {source}; check the path and its rights")]
    Io {
        /// The file.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The output did not take the bytes.
    #[error("cannot write changes: {0}; check the disk, then write them again")]
    Write(#[from] std::io::Error),
    /// A record whose geometry is none.
    #[error("change {change:016x}: its geometry is {source}; run `verify` on the store")]
    Geometry {
        /// The change.
        change: i64,
        /// What is wrong with it.
        source: tilefold_schemas::wkb::WkbError,
    },
    /// A record with a code that nothing has.
    #[error(
        "change {change:016x}: {field} has the unknown code {code}; was it written by a newer version?"
    )]
    Code {
        /// The change.
        change: i64,
        /// The column.
        field: &'static str,
        /// Its value.
        code: i16,
    },
    /// A file over its limit.
    #[error(
        "changes {file} have over {limit} bytes (MAX_CHANGES_BYTES): cut the file into several"
    )]
    TooLarge {
        /// The file.
        file: String,
        /// The limit.
        limit: u64,
    },
    /// No JSON.
    #[error("changes {file} are no JSON: {source}")]
    Json {
        /// The file.
        file: String,
        /// What is wrong, with line and column.
        source: serde_json::Error,
    },
    /// JSON, but no collection of features.
    #[error("changes {file} are no GeoJSON FeatureCollection: {what}")]
    Collection {
        /// The file.
        file: String,
        /// What is missing.
        what: &'static str,
    },
    /// A feature that says something else than it should.
    #[error("changes {file}, feature {index} (counted from 0), {field}: {what}")]
    Feature {
        /// The file.
        file: String,
        /// Which feature, counted from 0.
        index: usize,
        /// The field, as a path.
        field: &'static str,
        /// What is wrong with it, and what would be right.
        what: String,
    },
}
