//! `run`: new logs in, a new version out.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tilefold_reducers::{Fold, FusionModel};
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::table::Table;
use tilefold_schemas::{ChunkRow, SetAside};
use tilefold_store::{Snapshot, Store, StoreError, TileFilter};
use tilefold_tiler::map_index::MapIndex;
use tilefold_workers::{MapContext, Registering};

use crate::calibrate;
use crate::error::EngineError;
use crate::logs::Catalogue;
use crate::map_job::{Known, KnownChunks, Mapped, map_units};
use crate::meter::{Meter, StageReport};
use crate::notes::{self, MountingNote, Without};
use crate::perceive::Perception;
use crate::progress::Progress;
use crate::update::{Revision, Update};

pub(crate) use crate::update::AS_OF;
pub use crate::update::read_elements;

/// How often what was mapped is folded onto a version that another writer made meanwhile.
pub(crate) const ATTEMPTS: usize = 32;

/// What a run did.
#[derive(Debug, Clone, Serialize)]
pub struct RunReport {
    /// Version that readers see now.
    pub version: i64,
    /// Whether it is a new one.
    pub is_new_version: bool,
    /// Logs that could be read.
    pub logs: usize,
    /// Vehicles in them.
    pub vehicles: usize,
    /// Chunks that were mapped now.
    pub chunks_mapped: usize,
    /// Chunks that the store knew already.
    pub chunks_known: u64,
    /// Messages that were copies of others.
    pub duplicate_messages: u64,
    /// Tiles that were reduced.
    pub tiles_reduced: usize,
    /// Stages with their rates.
    pub stages: Vec<StageReport>,
    /// What poses had to do without, the most frequent first.
    pub done_without: Vec<Without>,
    /// How cameras are mounted, by log and topic, where detections are in pixels.
    pub mountings: Vec<MountingNote>,
    /// Bytes that waited on disk, because of a limit of memory.
    pub spilled_bytes: u64,
    /// Seconds from start to commit.
    pub wall_s: f64,
    /// What was set aside.
    pub set_aside: Vec<SetAside>,
}

/// What a run would do.
#[derive(Debug, Clone, Serialize)]
pub struct Plan {
    /// Logs that can be read.
    pub logs: usize,
    /// Their bytes.
    pub bytes: u64,
    /// Vehicles in them.
    pub vehicles: usize,
    /// Units of work (a block of a vehicle's time each).
    pub units: usize,
    /// Messages in the logs.
    pub messages: u64,
    /// What would be set aside, as far as the summaries say.
    pub set_aside: Vec<SetAside>,
}

/// Looks at the logs' summaries only; `perception` would look at their pictures.
#[must_use]
pub fn plan(
    logs: &[PathBuf],
    perception: Option<&Perception>,
    meter: &Meter,
    progress: &dyn Progress,
) -> Plan {
    let model = perception.map(|perception| perception.model().digest);
    let catalogue = Catalogue::open_seeing(logs, model, meter, progress);
    let units = catalogue.units();
    let vehicles: BTreeSet<&str> = units.iter().map(|unit| unit.vehicle.as_str()).collect();
    Plan {
        logs: catalogue.logs.len(),
        bytes: catalogue.logs.iter().map(|log| log.size_bytes).sum(),
        vehicles: vehicles.len(),
        units: units.len(),
        messages: catalogue.logs.iter().map(|log| log.message_count()).sum(),
        set_aside: catalogue.set_aside,
    }
}

/// How a run is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RunOptions {
    /// How evidence becomes a posterior.
    pub model: FusionModel,
    /// Whether poses are laid on the map.
    pub registering: Registering,
    /// Only what was seen until then counts, nanoseconds since the Unix epoch; none: all of it.
    pub as_of_ns: Option<i64>,
}

impl From<FusionModel> for RunOptions {
    fn from(model: FusionModel) -> Self {
        Self {
            model,
            ..Self::default()
        }
    }
}

/// Maps what is new in `logs`, folds what it touches, and commits a version.
///
/// Where another writer commits meanwhile, what was mapped is folded onto that version, unless its
/// base map is another one.
///
/// # Errors
/// The store cannot be read or written, its evidence was made by another method, or other writers
/// were faster. Nothing has changed then.
pub fn run(
    location: &Path,
    logs: &[PathBuf],
    options: impl Into<RunOptions>,
    progress: &dyn Progress,
) -> Result<RunReport, EngineError> {
    run_seeing(location, logs, options, None, progress)
}

/// As [`run`], with the pictures of logs without detections: `perception` looks at them.
///
/// # Errors
/// As [`run`].
pub fn run_seeing(
    location: &Path,
    logs: &[PathBuf],
    options: impl Into<RunOptions>,
    perception: Option<&Perception>,
    progress: &dyn Progress,
) -> Result<RunReport, EngineError> {
    let options = options.into();
    let job = tracing::info_span!("run", store = %location.display());
    let _job = job.enter();
    let model = perception.map(|perception| perception.model().digest);
    let meter = Meter::default();
    let store = Store::open(location.to_path_buf())?;
    let snapshot = store.snapshot(None)?;
    let tile_level = u32::from(store.properties().tile_level);
    let catalogue = Catalogue::open_seeing(logs, model, &meter, progress);
    let units = catalogue.units();
    let vehicles: BTreeSet<&str> = units.iter().map(|unit| unit.vehicle.as_str()).collect();
    tracing::info!(
        logs = catalogue.logs.len(),
        vehicles = vehicles.len(),
        units = units.len(),
        onto_version = snapshot.version(),
        "logs indexed"
    );
    let context = MapContext {
        map: MapIndex::new(read_elements(&snapshot, tile_level)?),
        tile_level,
        registering: options.registering,
    };
    let known_rows: Vec<ChunkRow> = snapshot.read(TileFilter::All)?;
    check_method(&known_rows, options.registering.method())?;
    let salt = &store.properties().salt;
    let mapped = map_units(
        perception,
        &catalogue,
        &units,
        &known_chunks(&known_rows),
        salt,
        &context,
        &meter,
        progress,
    );
    tracing::info!(
        chunks = mapped.mapped.len(),
        known = mapped.known,
        "logs mapped"
    );
    let mut report = RunReport {
        version: snapshot.version(),
        is_new_version: false,
        logs: catalogue.logs.len(),
        vehicles: vehicles.len(),
        chunks_mapped: mapped.mapped.len(),
        chunks_known: mapped.known,
        duplicate_messages: mapped.duplicates,
        tiles_reduced: 0,
        stages: Vec::new(),
        done_without: notes::done_without(&mapped.mapped),
        mountings: notes::mountings(&mapped.mapped),
        spilled_bytes: 0,
        wall_s: 0.0,
        set_aside: sorted(catalogue.set_aside.iter().chain(&mapped.set_aside)),
    };
    report.set_aside.iter().for_each(tell_loss);
    let folding = Folding {
        context: &context,
        options,
        meter: &meter,
        progress,
    };
    let folded = folding.commit(snapshot, known_rows, mapped.mapped)?;
    report.is_new_version = folded.is_new_version;
    report.version = folded.version;
    report.tiles_reduced = folded.tiles;
    report.stages = meter.report();
    report.wall_s = meter.elapsed_s();
    Ok(report)
}

/// What came of it.
struct Folded {
    version: i64,
    /// Whether this job made it.
    is_new_version: bool,
    tiles: usize,
}

/// What was mapped, on its way into the store.
struct Folding<'a> {
    context: &'a MapContext,
    options: RunOptions,
    meter: &'a Meter,
    progress: &'a dyn Progress,
}

impl Folding<'_> {
    /// Commits onto `snapshot`, or onto what other writers make of it meanwhile.
    fn commit(
        &self,
        mut snapshot: Snapshot,
        mut known: Vec<ChunkRow>,
        mut mapped: Vec<Mapped>,
    ) -> Result<Folded, EngineError> {
        let mut attempts = ATTEMPTS;
        loop {
            attempts -= 1;
            let conflict = match self.commit_onto(&snapshot, known, mapped.clone()) {
                Err(EngineError::Store(
                    error @ (StoreError::Conflict { .. } | StoreError::Busy { .. }),
                )) if attempts > 0 => error,
                done => {
                    let (version, tiles) = done?;
                    return Ok(Folded {
                        version,
                        is_new_version: version != snapshot.version(),
                        tiles,
                    });
                }
            };
            let latest = snapshot.store().snapshot(None)?;
            let map = |snapshot: &Snapshot| snapshot.info().pins.get(ElementRow::NAME).cloned();
            if map(&latest) != map(&snapshot) {
                return Err(conflict.into());
            }
            tracing::info!(
                onto_version = latest.version(),
                attempts_left = attempts,
                reason = %conflict,
                "another writer was faster: folding onto its version"
            );
            snapshot = latest;
            known = snapshot.read(TileFilter::All)?;
            check_method(&known, self.options.registering.method())?;
            keep_better(&mut mapped, &known_chunks(&known));
        }
    }

    fn commit_onto(
        &self,
        snapshot: &Snapshot,
        known: Vec<ChunkRow>,
        mapped: Vec<Mapped>,
    ) -> Result<(i64, usize), EngineError> {
        let sensor = calibrate::sensor_model(snapshot)?;
        let update = Update {
            map: &self.context.map,
            tile_level: self.context.tile_level,
            fold: &Fold {
                as_of_ns: self.options.as_of_ns,
                ..Fold::of_fleet(self.options.model, sensor)
            },
            meter: self.meter,
            progress: self.progress,
        };
        let revision = Revision {
            mapped,
            ..Revision::default()
        };
        let transaction = snapshot.store().begin_from(snapshot.clone())?;
        update.commit("run", transaction, known, revision)
    }
}

/// A loss, in the log. The report lists it too: at the level of warnings it would be said twice.
fn tell_loss(loss: &SetAside) {
    tracing::info!(
        kind = loss.kind.name(),
        file = %loss.file,
        topic = loss.topic,
        offset = loss.offset,
        stamp_ns = loss.stamp_ns,
        reason = %loss.reason,
        count = loss.count,
        "set aside"
    );
}

/// Drops what another writer brought as well.
pub(crate) fn keep_better(mapped: &mut Vec<Mapped>, known: &KnownChunks) {
    mapped.retain(|chunk| {
        let known = known.get(&chunk.row.chunk());
        known.is_none_or(|known| {
            known.gives_way_to(chunk.row.digest, chunk.row.messages, chunk.row.model)
        })
    });
}

/// Evidence of two methods is never added up.
pub(crate) fn check_method(known: &[ChunkRow], wanted: i32) -> Result<(), EngineError> {
    let other = known.iter().find(|row| row.method != wanted);
    other.map_or(Ok(()), |row| {
        Err(EngineError::OtherMethod {
            found: row.method,
            wanted,
        })
    })
}

pub(crate) fn sorted<'a>(set_aside: impl Iterator<Item = &'a SetAside>) -> Vec<SetAside> {
    let mut all: Vec<SetAside> = set_aside.cloned().collect();
    all.sort();
    all.dedup();
    all
}

pub(crate) fn known_chunks(rows: &[ChunkRow]) -> KnownChunks {
    let known = rows.iter().map(|row| (row.chunk(), Known::of(row)));
    known.collect()
}
