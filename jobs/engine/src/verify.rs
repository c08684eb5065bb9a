//! Whether a version is whole: every data file against its hash, every layer against its digest.

use std::collections::BTreeMap;

use serde::Serialize;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{
    ChangeRecord, ChunkRow, EvidenceRow, Footprint, LayerHeader, SensorRow, Sighting,
};
use tilefold_store::{Snapshot, StoreError, StoredTable, TileFilter, digest_rows};

use crate::error::EngineError;

/// What the check of a version found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Verification {
    /// The version.
    pub version: i64,
    /// Digest of the layers; null where they are damaged.
    pub digest: Option<String>,
    /// Whether nothing is wrong.
    pub ok: bool,
    /// What is wrong, a sentence each.
    #[serde(skip)]
    pub findings: Vec<String>,
}

/// Reads a version as a whole.
///
/// # Errors
/// The storage refuses; damage is a finding and no error.
pub fn verify(snapshot: &Snapshot) -> Result<Verification, EngineError> {
    let mut findings = Vec::new();
    // Every data file is read and held against its hash on the way.
    let digest = sound_digest::<LayerHeader>(snapshot, &mut findings)?;
    let tables = [
        digest.clone(),
        sound_digest::<ChangeRecord>(snapshot, &mut findings)?,
        sound_digest::<EvidenceRow>(snapshot, &mut findings)?,
        sound_digest::<Sighting>(snapshot, &mut findings)?,
        sound_digest::<Footprint>(snapshot, &mut findings)?,
        sound_digest::<ChunkRow>(snapshot, &mut findings)?,
        sound_digest::<SensorRow>(snapshot, &mut findings)?,
        sound_digest::<ElementRow>(snapshot, &mut findings)?,
    ];
    if tables.iter().all(Option::is_some) {
        findings.extend(unfit_layers(snapshot)?);
    }
    Ok(Verification {
        version: snapshot.version(),
        digest,
        ok: findings.is_empty(),
        findings,
    })
}

/// The digest of a table; none, and a finding that says which file it is, where one is damaged.
fn sound_digest<R: StoredTable>(
    snapshot: &Snapshot,
    findings: &mut Vec<String>,
) -> Result<Option<String>, EngineError> {
    match snapshot.digest::<R>() {
        Ok(digest) => Ok(Some(digest)),
        Err(error @ (StoreError::Damaged { .. } | StoreError::Column { .. })) => {
            findings.push(error.to_string());
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

/// Layers whose header has not the digest of their records.
fn unfit_layers(snapshot: &Snapshot) -> Result<Vec<String>, EngineError> {
    let headers: Vec<LayerHeader> = snapshot.read(TileFilter::All)?;
    let changes: Vec<ChangeRecord> = snapshot.read(TileFilter::All)?;
    let mut by_tile: BTreeMap<i32, Vec<ChangeRecord>> = BTreeMap::new();
    for change in changes {
        by_tile.entry(change.tile).or_default().push(change);
    }
    let mut findings = Vec::new();
    for header in &headers {
        let digest = digest_rows(by_tile.remove(&header.tile).unwrap_or_default())?;
        if digest != header.digest {
            findings.push(format!(
                "tile {} differs: its header says {}, its records are {digest}",
                header.tile, header.digest
            ));
        }
    }
    if let Some(tile) = by_tile.keys().next() {
        findings.push(format!(
            "tile {tile} has change records but no layer header"
        ));
    }
    Ok(findings)
}
