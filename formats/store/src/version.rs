//! A version of the store: who committed what, and which versions of the tables belong to it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::properties::Parameters;

/// The state of one table in one version of the store.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pin {
    /// Delta version of the table.
    pub version: i64,
    /// Digest of the list of its live data files (names, sizes, row counts, tiles): what the
    /// table's log must say at this version.
    pub files: String,
}

/// One version of the store.
#[derive(Debug, Clone, PartialEq)]
pub struct VersionInfo {
    /// Number of the version: the Delta version of `layers`.
    pub version: i64,
    /// When it was committed, milliseconds since the Unix epoch. Never before its predecessor,
    /// even where the clock was.
    pub timestamp_ms: i64,
    /// What the job was: `init`, `run`, `retract`, ...
    pub operation: String,
    /// The job's parameters.
    pub parameters: Parameters,
    /// The table states that belong to it, `layers` included, by table name.
    pub pins: BTreeMap<String, Pin>,
}
