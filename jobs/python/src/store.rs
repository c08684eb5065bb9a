//! Stores and their versions.

use std::collections::BTreeSet;
use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde_json::json;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{
    ChangeRecord, ChunkRow, EvidenceRow, Footprint, LayerHeader, SensorRow, Sighting, TileId,
};
use tilefold_store::{StoreError, StoredTable, TileFilter};

use crate::failure::failed;
use crate::stream::Rows;

/// A store that is open.
#[pyclass(module = "tilefold._tilefold", frozen)]
pub(crate) struct Store(tilefold_store::Store);

#[pymethods]
impl Store {
    #[new]
    fn new(py: Python<'_>, location: PathBuf) -> PyResult<Self> {
        let store = py.detach(|| tilefold_store::Store::open(location));
        store.map(Self).map_err(|error| failed(&error))
    }

    fn location(&self) -> String {
        self.0.location()
    }

    fn tile_level(&self) -> u8 {
        self.0.properties().tile_level
    }

    /// The versions, as a JSON list.
    fn versions(&self, py: Python<'_>) -> PyResult<String> {
        let versions = py
            .detach(|| self.0.versions())
            .map_err(|error| failed(&error))?;
        let list: Vec<serde_json::Value> = versions
            .into_iter()
            .map(|info| {
                json!({
                    "version": info.version, "timestamp_ms": info.timestamp_ms,
                    "operation": info.operation, "parameters": info.parameters,
                })
            })
            .collect();
        Ok(json!(list).to_string())
    }

    fn snapshot(&self, py: Python<'_>, version: Option<i64>) -> PyResult<Snapshot> {
        let snapshot = py.detach(|| self.0.snapshot(version));
        snapshot.map(Snapshot).map_err(|error| failed(&error))
    }

    fn snapshot_as_of(&self, py: Python<'_>, as_of_ms: i64) -> PyResult<Snapshot> {
        let snapshot = py.detach(|| self.0.snapshot_as_of(as_of_ms));
        snapshot.map(Snapshot).map_err(|error| failed(&error))
    }
}

/// One version.
#[pyclass(module = "tilefold._tilefold", frozen)]
pub(crate) struct Snapshot(tilefold_store::Snapshot);

#[pymethods]
impl Snapshot {
    fn version(&self) -> i64 {
        self.0.version()
    }

    /// Rows of a table; of these tiles, where any are given.
    fn rows(&self, py: Python<'_>, table: &str, tiles: Option<Vec<i32>>) -> PyResult<Rows> {
        let tiles = tiles.map(|tiles| tiles.into_iter().map(TileId).collect());
        py.detach(|| self.in_table(table, Wanted::Rows(tiles)))
            .and_then(|found| match found {
                Found::Rows(rows) => Ok(rows),
                Found::Digest(_) => Err(PyValueError::new_err("a digest has no rows")),
            })
    }

    /// Digest of a table's rows.
    fn digest(&self, py: Python<'_>, table: &str) -> PyResult<String> {
        py.detach(|| self.in_table(table, Wanted::Digest))
            .and_then(|found| match found {
                Found::Digest(digest) => Ok(digest),
                Found::Rows(_) => Err(PyValueError::new_err("rows are no digest")),
            })
    }

    /// Whether the version is whole: `(ok, digest, findings)`.
    fn verify(&self, py: Python<'_>) -> PyResult<(bool, Option<String>, Vec<String>)> {
        let found = py
            .detach(|| tilefold_engine::verify(&self.0))
            .map_err(|error| failed(&error))?;
        Ok((found.ok, found.digest, found.findings))
    }
}

/// What is wanted of a table whose name is known at run time only.
enum Wanted {
    Rows(Option<BTreeSet<TileId>>),
    Digest,
}

enum Found {
    Rows(Rows),
    Digest(String),
}

impl Snapshot {
    fn in_table(&self, table: &str, wanted: Wanted) -> PyResult<Found> {
        let found = match table {
            "elements" => self.found::<ElementRow>(wanted),
            "evidence" => self.found::<EvidenceRow>(wanted),
            "sightings" => self.found::<Sighting>(wanted),
            "footprints" => self.found::<Footprint>(wanted),
            "chunks" => self.found::<ChunkRow>(wanted),
            "sensor_models" => self.found::<SensorRow>(wanted),
            "changes" => self.found::<ChangeRecord>(wanted),
            "layers" => self.found::<LayerHeader>(wanted),
            _ => {
                return Err(PyValueError::new_err(format!(
                    "there is no table {table:?}; there are elements, evidence, sightings, footprints, chunks, sensor_models, changes and layers"
                )));
            }
        };
        found.map_err(|error| failed(&error))
    }

    fn found<R: StoredTable>(&self, wanted: Wanted) -> Result<Found, StoreError> {
        match wanted {
            Wanted::Digest => self.0.digest::<R>().map(Found::Digest),
            Wanted::Rows(tiles) => {
                let filter = tiles.as_ref().map_or(TileFilter::All, TileFilter::Tiles);
                let batches = self.0.batches::<R>(filter)?;
                Ok(Found::Rows(Rows::of::<R>(batches)))
            }
        }
    }
}
