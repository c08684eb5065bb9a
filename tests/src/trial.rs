//! One store, the jobs that are tried on it, and all of its content in a few digests.

#![allow(clippy::unwrap_used)] // A job that fails ends its test.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use tilefold_city::{CityFiles, CitySpec, Site};
use tilefold_engine::{
    EngineError, Forget, FusionModel, InitOptions, Limit, RebaseReport, RetractReport, RunReport,
    Silent, init, rebase, retract, run, run_within,
};
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{ChangeRecord, ChunkRow, EvidenceRow, Footprint, LayerHeader, Sighting};
use tilefold_store::{Store, StoredTable, TileFilter};

/// A store in a folder of its own.
#[derive(Debug)]
pub struct Trial {
    _folder: TempDir,
    store: PathBuf,
}

impl Trial {
    /// A new store of the map.
    ///
    /// # Panics
    /// It cannot be made.
    #[must_use]
    pub fn new(map: &Path) -> Self {
        Self::with_salt(map, None)
    }

    /// A new store of the map whose vehicle keys do not depend on the map.
    ///
    /// # Panics
    /// It cannot be made.
    #[must_use]
    pub fn with_salt(map: &Path, salt: Option<[u8; 32]>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = folder.path().join("store");
        let options = InitOptions {
            tile_level: 15,
            salt,
        };
        init(&store, &[map.to_owned()], &options).unwrap();
        Self {
            _folder: folder,
            store,
        }
    }

    /// A store that is there, and the folder that goes with it in the end.
    #[must_use]
    pub fn of(folder: TempDir, store: PathBuf) -> Self {
        Self {
            _folder: folder,
            store,
        }
    }

    /// A copy of a store.
    ///
    /// # Panics
    /// It cannot be made.
    #[must_use]
    pub fn copy_of(other: &Self) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = folder.path().join("store");
        copy(&other.store, &store);
        Self::of(folder, store)
    }

    /// Runs a job over `logs`.
    ///
    /// # Panics
    /// It fails.
    pub fn run(&self, logs: &[PathBuf]) -> RunReport {
        run(&self.store, logs, FusionModel::default(), &Silent).unwrap()
    }

    /// As [`Trial::run`], with this fusion model and within a limit of memory.
    ///
    /// # Panics
    /// It fails.
    pub fn run_within(&self, logs: &[PathBuf], model: FusionModel, limit: &Limit) -> RunReport {
        run_within(&self.store, logs, model, None, limit, &Silent).unwrap()
    }

    /// Where the store is.
    #[must_use]
    pub fn store(&self) -> &Path {
        &self.store
    }

    /// Takes evidence out.
    ///
    /// # Errors
    /// As [`retract()`].
    pub fn retract(&self, forget: &Forget) -> Result<RetractReport, EngineError> {
        retract(&self.store, forget, &Silent)
    }

    /// Lays another map under the store.
    ///
    /// # Panics
    /// It fails.
    pub fn rebase(&self, map: &Path) -> RebaseReport {
        rebase(&self.store, &[map.to_owned()], &Silent).unwrap()
    }

    /// What the latest version holds.
    ///
    /// # Panics
    /// The store cannot be read.
    #[must_use]
    pub fn content(&self) -> Content {
        let snapshot = Store::open(self.store.clone())
            .unwrap()
            .snapshot(None)
            .unwrap();
        let layers = snapshot.read::<LayerHeader>(TileFilter::All).unwrap();
        macro_rules! tables {
            ($($row:ty),+) => {
                [$((
                    <$row as tilefold_schemas::table::Table>::NAME,
                    Rows {
                        count: snapshot.row_count::<$row>().unwrap(),
                        digest: snapshot.digest::<$row>().unwrap(),
                    },
                )),+]
            };
        }
        let tables = tables!(
            ElementRow,
            ChunkRow,
            EvidenceRow,
            Sighting,
            Footprint,
            ChangeRecord,
            LayerHeader
        );
        Content {
            layers,
            tables: tables.into(),
        }
    }

    /// All rows of a table in the latest version.
    ///
    /// # Panics
    /// The store cannot be read.
    #[must_use]
    pub fn rows<R: StoredTable>(&self) -> Vec<R> {
        let store = Store::open(self.store.clone()).unwrap();
        store.snapshot(None).unwrap().read(TileFilter::All).unwrap()
    }
}

/// Rows of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rows {
    /// How many.
    pub count: i64,
    /// Their digest.
    pub digest: String,
}

/// All that a version holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    /// Headers of its layers.
    pub layers: Vec<LayerHeader>,
    /// Its tables by name.
    pub tables: BTreeMap<&'static str, Rows>,
}

impl Content {
    /// Whether there is evidence, and something was judged from it.
    #[must_use]
    pub fn says_something(&self) -> bool {
        let is_judged = |layer: &LayerHeader| layer.no_change + layer.removed + layer.modified > 0;
        let is_filled = |table: &str| self.tables.get(table).is_some_and(|rows| rows.count > 0);
        self.layers.iter().any(is_judged)
            && ["chunks", "evidence", "sightings", "footprints", "changes"]
                .into_iter()
                .all(is_filled)
    }
}

/// A new store of the map after one job over `logs`.
///
/// # Panics
/// A job fails.
#[must_use]
pub fn content_of(map: &Path, logs: &[PathBuf]) -> Content {
    let trial = Trial::new(map);
    trial.run(logs);
    trial.content()
}

/// A city of one short road: seven drives by five vehicles, in both dialects.
///
/// # Panics
/// It cannot be written.
#[must_use]
pub fn small_city(into: &Path) -> CityFiles {
    tilefold_city::write(&small_spec(), into).unwrap()
}

/// The specification of [`small_city`].
#[must_use]
pub fn small_spec() -> CitySpec {
    CitySpec {
        seed: 5,
        site: Site::Drawn { km: 1.0 },
        vehicles: 5,
        drives: 7,
        drive_km: 0.6,
        days: 4,
        ..CitySpec::default()
    }
}

/// The same, but four drives of a few chunks by three vehicles, past many changes: for tests that run
/// hundreds of jobs.
///
/// # Panics
/// It cannot be written.
#[must_use]
pub fn tiny_city(into: &Path) -> CityFiles {
    tilefold_city::write(&tiny_spec(), into).unwrap()
}

/// The same, across the border between two data files of each table.
///
/// # Panics
/// It cannot be written.
#[must_use]
pub fn tiny_city_in_two_files(into: &Path) -> CityFiles {
    // 16 tiles of level 15, in degrees.
    let file_deg = 16.0 * 180.0 / 32_768.0;
    let spec = CitySpec {
        anchor: [114.0 * file_deg, 50.0, 300.0],
        ..tiny_spec()
    };
    tilefold_city::write(&spec, into).unwrap()
}

fn tiny_spec() -> CitySpec {
    CitySpec {
        seed: 11,
        site: Site::Drawn { km: 1.0 },
        vehicles: 3,
        drives: 4,
        drive_km: 0.25,
        days: 3,
        change_share: 0.2,
        ..CitySpec::default()
    }
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        match entry.file_type().unwrap().is_dir() {
            true => copy(&entry.path(), &target),
            false => drop(std::fs::copy(entry.path(), target).unwrap()),
        }
    }
}

/// The folder of real data, `TILEFOLD_TEST_DATA` or `../shared/data` beside the checkout; says so
/// where there is none.
#[must_use]
pub fn real_data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("TILEFOLD_TEST_DATA").map_or(beside, PathBuf::from);
    if folder.join("deecamp").is_dir() {
        return Some(folder);
    }
    println!("skipped: no real data (set TILEFOLD_TEST_DATA to its folder)");
    None
}
