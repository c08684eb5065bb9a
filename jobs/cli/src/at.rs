//! Which version a command reads: by number, or as of a time.

use std::error::Error;
use std::path::Path;

use tilefold_store::{Snapshot, Store, StoreError};

use crate::command::utc;

/// A version by its number, or the one that was the latest at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum At {
    /// Its number.
    Version(i64),
    /// Milliseconds since the Unix epoch.
    Instant(i64),
}

/// Reads a number, or a time like 2026-03-15T00:00:00Z.
///
/// # Errors
/// It is neither.
pub(crate) fn at(text: &str) -> Result<At, String> {
    if let Ok(version) = text.parse() {
        return Ok(At::Version(version));
    }
    let time = chrono::DateTime::parse_from_rfc3339(text).map_err(|_| {
        "neither a number nor a time; give the number of a version (`tilefold log` lists them) or a time like 2026-03-15T00:00:00Z, or leave it away for the latest".to_owned()
    })?;
    Ok(At::Instant(time.timestamp_millis()))
}

/// The version of a store that is meant; the latest if none is.
///
/// # Errors
/// There is no such version, or the store cannot be read.
pub(crate) fn open(store: &Path, at: Option<At>) -> Result<Snapshot, Box<dyn Error>> {
    let store = Store::open(store.to_path_buf())?;
    Ok(match at {
        Some(At::Instant(as_of_ms)) => store.snapshot_as_of(as_of_ms).map_err(in_words)?,
        Some(At::Version(version)) => store.snapshot(Some(version))?,
        None => store.snapshot(None)?,
    })
}

/// The store knows instants as numbers; people know them as times.
fn in_words(error: StoreError) -> Box<dyn Error> {
    match error {
        StoreError::BeforeFirstVersion {
            location,
            as_of_ms,
            first_ms,
        } => format!(
            "{location} has no version as old as {} (UTC): the first one was written at {}; give a later time, or `--as-of` to `run` for what was seen until then",
            utc(as_of_ms),
            utc(first_ms)
        )
        .into(),
        other => other.into(),
    }
}
