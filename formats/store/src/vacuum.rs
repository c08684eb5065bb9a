//! Removing data files that no kept version has.
//!
//! Delta Lake's own clean-up knows nothing of pins; this asks the versions that are kept. Commits
//! stay, so that the history can still be read; a version whose files are gone is refused by name.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::error::StoreError;
use crate::location::Place;
use crate::store::Store;

/// Name of the file that says how far back versions can be read.
const FILE: &str = "vacuum.json";

/// What is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Retention {
    /// Versions that were current at this instant or later stay readable, milliseconds since the Unix
    /// epoch. The latest one always does.
    pub since_ms: i64,
    /// Files written at this instant or later stay: they may be those of a job that goes on now.
    pub written_since_ms: i64,
    /// Only tells what would be removed.
    pub is_dry: bool,
}

/// What was removed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Vacuumed {
    /// The oldest version that can still be read.
    pub oldest_version: i64,
    /// Data files that were removed, or would be.
    pub files: usize,
    /// Their bytes.
    pub bytes: u64,
}

/// The file beside the tables.
#[derive(Debug, Serialize, Deserialize)]
struct Horizon {
    oldest_version: i64,
}

/// The oldest version that can be read.
pub(crate) fn oldest_version(place: &Place) -> Result<i64, StoreError> {
    let Some(bytes) = place.read_file(FILE)? else {
        return Ok(0);
    };
    let horizon: Result<Horizon, _> = serde_json::from_slice(&bytes);
    horizon
        .map(|horizon| horizon.oldest_version)
        .map_err(|error| StoreError::damaged(place.describe(FILE), error.to_string()))
}

impl Store {
    /// Removes data files that no kept version has: of older versions, and of jobs that were killed.
    ///
    /// # Errors
    /// A kept version is damaged, or the storage refuses. What was removed until then is gone; the same
    /// call goes on.
    pub fn vacuum(&self, retention: &Retention) -> Result<Vacuumed, StoreError> {
        let oldest = self.oldest_kept(retention)?;
        let wanted = self.files_since(oldest)?;
        let mut unwanted = self.place().data_files()?;
        unwanted.retain(|file| {
            file.written_ms < retention.written_since_ms && !wanted.contains(&file.path)
        });
        if !retention.is_dry {
            // First, so that nobody is sent to files that are no more.
            self.move_horizon(oldest)?;
            self.place()
                .delete(unwanted.iter().map(|file| file.path.clone()))?;
        }
        Ok(Vacuumed {
            oldest_version: oldest,
            files: unwanted.len(),
            bytes: unwanted.iter().map(|file| file.size_bytes).sum(),
        })
    }

    /// The first version that was current at the instant or later.
    fn oldest_kept(&self, retention: &Retention) -> Result<i64, StoreError> {
        let versions = self.versions()?;
        let replaced_before = versions.iter().skip(1);
        let gone = replaced_before.take_while(|next| next.timestamp_ms < retention.since_ms);
        let kept = i64::try_from(gone.count()).unwrap_or(i64::MAX);
        Ok(kept.max(oldest_version(self.place())?))
    }

    /// Data files of the versions from `oldest` on, by path.
    fn files_since(&self, oldest: i64) -> Result<BTreeSet<String>, StoreError> {
        let mut pinned = BTreeSet::new();
        for version in oldest..=self.latest_version()? {
            let snapshot = self.snapshot(Some(version))?;
            for (table, pin) in &snapshot.info().pins {
                pinned.insert((table.clone(), pin.version, version));
            }
        }
        let mut files = BTreeSet::new();
        let mut before = None;
        for (table, at, version) in pinned {
            // Many versions share a state of a table.
            if before.replace((table.clone(), at)) == Some((table.clone(), at)) {
                continue;
            }
            if let Some(state) = self.snapshot(Some(version))?.table(&table)? {
                files.extend(state.files.keys().map(|name| format!("{table}/{name}")));
            }
        }
        Ok(files)
    }

    fn move_horizon(&self, oldest_version: i64) -> Result<(), StoreError> {
        let text = serde_json::to_vec(&Horizon { oldest_version })
            .map_err(|error| StoreError::encode("write", FILE, error))?;
        self.place().write_file(FILE, text.into())
    }
}
