//! `run`: new logs in, a new version out.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Serialize;
use tilefold_reducers::{Fold, FusionModel};
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{
    ChunkId, ChunkRow, EvidenceRow, LayerHeader, Ledger, SetAside, Testified, TileId,
};
use tilefold_store::{Parameters, Snapshot, Store, StoredTable, TileFilter, Transaction};
use tilefold_tiler::map_index::{MapIndex, MappedElement};
use tilefold_workers::{MapContext, Registering};

use crate::base_map;
use crate::calibrate;
use crate::error::EngineError;
use crate::logs::Catalogue;
use crate::map_job::{KnownChunks, MapOutput, map_units};
use crate::meter::{Meter, Stage, StageReport};
use crate::notes::{self, MountingNote, Without};
use crate::progress::Progress;
use crate::reduce_job::{Layer, Reduce};

/// Parameter of a commit: the time that it is as of.
pub(crate) const AS_OF: &str = "as_of_ns";

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

/// Looks at the logs' summaries only.
#[must_use]
pub fn plan(logs: &[PathBuf], meter: &Meter, progress: &dyn Progress) -> Plan {
    let catalogue = Catalogue::open(logs, meter, progress);
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
/// # Errors
/// The store cannot be read or written, its evidence was made by another method, or another writer
/// was faster. Nothing has changed then.
pub fn run(
    location: &Path,
    logs: &[PathBuf],
    options: impl Into<RunOptions>,
    progress: &dyn Progress,
) -> Result<RunReport, EngineError> {
    let options = options.into();
    let meter = Meter::default();
    let store = Store::open(location.to_path_buf())?;
    let snapshot = store.snapshot(None)?;
    let tile_level = u32::from(store.properties().tile_level);
    let catalogue = Catalogue::open(logs, &meter, progress);
    let units = catalogue.units();
    let vehicles: BTreeSet<&str> = units.iter().map(|unit| unit.vehicle.as_str()).collect();
    let context = MapContext {
        map: MapIndex::new(read_elements(&snapshot, tile_level)?),
        tile_level,
        registering: options.registering,
    };
    let sensor = calibrate::sensor_model(&snapshot)?;
    let known_rows: Vec<ChunkRow> = snapshot.read(TileFilter::All)?;
    check_method(&known_rows, options.registering.method())?;
    let salt = &store.properties().salt;
    let mapped = map_units(
        &catalogue,
        &units,
        &known_chunks(&known_rows),
        salt,
        &context,
        &meter,
        progress,
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
        wall_s: 0.0,
        set_aside: sorted(catalogue.set_aside.iter().chain(&mapped.set_aside)),
    };
    let transaction = store.begin_from(snapshot)?;
    let update = Update {
        map: &context.map,
        tile_level,
        fold: &Fold {
            as_of_ns: options.as_of_ns,
            ..Fold::of_fleet(options.model, sensor)
        },
        meter: &meter,
        progress,
    };
    let (version, tiles) = update.commit("run", transaction, known_rows, mapped)?;
    report.is_new_version = version != report.version;
    report.version = version;
    report.tiles_reduced = tiles;
    report.stages = meter.report();
    report.wall_s = meter.elapsed_s();
    Ok(report)
}

/// Evidence of two methods is never added up.
fn check_method(known: &[ChunkRow], wanted: i32) -> Result<(), EngineError> {
    let other = known.iter().find(|row| row.method != wanted);
    other.map_or(Ok(()), |row| {
        Err(EngineError::OtherMethod {
            found: row.method,
            wanted,
        })
    })
}

fn sorted<'a>(set_aside: impl Iterator<Item = &'a SetAside>) -> Vec<SetAside> {
    let mut all: Vec<SetAside> = set_aside.cloned().collect();
    all.sort();
    all.dedup();
    all
}

/// The base map of a version.
///
/// # Errors
/// The store is damaged.
pub fn read_elements(
    snapshot: &Snapshot,
    tile_level: u32,
) -> Result<Vec<MappedElement>, EngineError> {
    let rows: Vec<ElementRow> = snapshot.read(TileFilter::All)?;
    rows.into_iter()
        .map(|row| base_map::from_row(row, tile_level))
        .collect()
}

fn known_chunks(rows: &[ChunkRow]) -> KnownChunks {
    let known = rows
        .iter()
        .map(|row| (row.chunk(), (row.digest, row.messages)));
    known.collect()
}

fn tiles_of(row: &ChunkRow) -> impl Iterator<Item = TileId> + '_ {
    let tiles = row.tiles.split(',').filter_map(|tile| tile.parse().ok());
    tiles.map(TileId)
}

/// From mapped chunks to a committed version.
pub(crate) struct Update<'a> {
    pub(crate) map: &'a MapIndex,
    pub(crate) tile_level: u32,
    pub(crate) fold: &'a Fold,
    pub(crate) meter: &'a Meter,
    pub(crate) progress: &'a dyn Progress,
}

impl Update<'_> {
    /// Commits; returns the version and how many tiles were reduced.
    pub(crate) fn commit(
        &self,
        operation: &str,
        mut transaction: Transaction,
        known: Vec<ChunkRow>,
        output: MapOutput,
    ) -> Result<(i64, usize), EngineError> {
        if output.mapped.is_empty() && !self.changes_model(transaction.base())? {
            return Ok((transaction.base().version(), 0));
        }
        let (mut chunks, mut rows, mut sightings, mut footprints) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for mapped in output.mapped {
            chunks.push(mapped.row);
            rows.extend(mapped.evidence.rows);
            sightings.extend(mapped.evidence.sightings);
            footprints.extend(mapped.evidence.footprints);
        }
        let new: BTreeSet<ChunkId> = chunks.iter().map(ChunkRow::chunk).collect();
        let (replaced, kept): (Vec<ChunkRow>, Vec<ChunkRow>) = known
            .into_iter()
            .partition(|row| new.contains(&row.chunk()));
        let touched: BTreeSet<TileId> = chunks.iter().chain(&replaced).flat_map(tiles_of).collect();

        self.progress.begin(Stage::Exchange, 3);
        let rows = self.exchange(&mut transaction, &touched, &new, rows)?;
        self.exchange(&mut transaction, &touched, &new, sightings.clone())?;
        self.exchange(&mut transaction, &touched, &new, footprints.clone())?;
        self.progress.end(Stage::Exchange);
        let base = transaction.base().clone();
        let sightings = self.all(&base, &new, sightings)?;
        let footprints = self.all(&base, &new, footprints)?;
        chunks.extend(kept);
        transaction.overwrite(chunks)?;

        let tiles = self.dirty_tiles(&base, &touched)?;
        let reduce = Reduce {
            map: self.map,
            tile_level: self.tile_level,
            sightings: &sightings,
            footprints: &footprints,
            fold: self.fold,
            meter: self.meter,
            progress: self.progress,
        };
        let layers = reduce.layers(&tiles, |tiles| self.rows_of(&base, tiles, &touched, &rows))?;
        let layers = self.changed(&base, layers)?;
        let count = layers.len();
        self.progress.begin(Stage::Commit, count as u64);
        let version = self.meter.time(Stage::Commit, || {
            write_layers(&mut transaction, layers)?;
            Ok::<_, EngineError>(transaction.commit(operation, self.parameters())?)
        })?;
        self.meter.count(Stage::Commit, count as u64, 0);
        self.progress.end(Stage::Commit);
        Ok((version, count))
    }

    /// What the commit says of how it was folded.
    fn parameters(&self) -> Parameters {
        let model = self.fold.model.name().to_owned();
        let mut parameters = Parameters::from([("fusion_model".to_owned(), model.into())]);
        if let Some(as_of_ns) = self.fold.as_of_ns {
            parameters.insert(AS_OF.to_owned(), as_of_ns.into());
        }
        parameters
    }

    /// Whether layers were made as of another time than the one asked for.
    fn is_as_of_other_time(&self, base: &Snapshot) -> bool {
        let as_of_ns = base.info().parameters.get(AS_OF);
        as_of_ns.and_then(serde_json::Value::as_i64) != self.fold.as_of_ns
    }

    /// Whether layers were made with another model than the one asked for, or as of another time.
    fn changes_model(&self, base: &Snapshot) -> Result<bool, EngineError> {
        if self.is_as_of_other_time(base) {
            return Ok(true);
        }
        let headers: Vec<LayerHeader> = base.read(TileFilter::All)?;
        Ok(headers.iter().any(|header| self.is_other_model(header)))
    }

    fn is_other_model(&self, header: &LayerHeader) -> bool {
        header.fusion_model != self.fold.model.name()
            || header.sensor_model != self.fold.sensor.id()
    }

    /// Replaces what the touched tiles hold of `new` chunks; returns all their rows.
    fn exchange<R: Testified + StoredTable>(
        &self,
        transaction: &mut Transaction,
        touched: &BTreeSet<TileId>,
        new: &BTreeSet<ChunkId>,
        rows: Vec<R>,
    ) -> Result<Ledger<R>, EngineError> {
        let count = rows.len() as u64;
        let ledger = self.meter.time(Stage::Exchange, || {
            let known = Ledger::of(transaction.base().read(TileFilter::Tiles(touched))?);
            let ledger = known.subtract(new).merge(Ledger::of(rows));
            transaction.replace_tiles(touched, ledger.rows().to_vec())?;
            Ok::<_, EngineError>(ledger)
        })?;
        self.meter.count(Stage::Exchange, count, 0);
        self.progress.advance(Stage::Exchange, 1, 0);
        Ok(ledger)
    }

    /// All rows of a table as they will be.
    fn all<R: Testified + StoredTable>(
        &self,
        base: &Snapshot,
        new: &BTreeSet<ChunkId>,
        rows: Vec<R>,
    ) -> Result<Vec<R>, EngineError> {
        let known = Ledger::of(base.read(TileFilter::All)?);
        let ledger = known.subtract(new).merge(Ledger::of(rows));
        Ok(ledger.into_rows())
    }

    /// Tiles with new evidence, with additions, or with another model's layer.
    fn dirty_tiles(
        &self,
        base: &Snapshot,
        touched: &BTreeSet<TileId>,
    ) -> Result<BTreeSet<TileId>, EngineError> {
        let headers: Vec<LayerHeader> = base.read(TileFilter::All)?;
        let is_as_of_other_time = self.is_as_of_other_time(base);
        let others = headers
            .iter()
            .filter(|header| header.added > 0 || is_as_of_other_time || self.is_other_model(header))
            .map(|header| TileId(header.tile));
        Ok(touched.iter().copied().chain(others).collect())
    }

    /// The layers that are not in the store as they are.
    fn changed(&self, base: &Snapshot, layers: Vec<Layer>) -> Result<Vec<Layer>, EngineError> {
        let headers: Vec<LayerHeader> = base.read(TileFilter::All)?;
        let known: BTreeMap<i32, LayerHeader> = headers
            .into_iter()
            .map(|header| (header.tile, header))
            .collect();
        let is_new = |layer: &Layer| known.get(&layer.header.tile) != Some(&layer.header);
        Ok(layers.into_iter().filter(is_new).collect())
    }

    /// Ledger rows of tiles: those at hand of touched ones, and the store's of others.
    fn rows_of(
        &self,
        base: &Snapshot,
        tiles: &BTreeSet<TileId>,
        touched: &BTreeSet<TileId>,
        at_hand: &Ledger<EvidenceRow>,
    ) -> Result<Ledger<EvidenceRow>, EngineError> {
        let at_hand = at_hand.clone().within(tiles);
        let others: BTreeSet<TileId> = tiles.difference(touched).copied().collect();
        if others.is_empty() {
            return Ok(at_hand);
        }
        let stored = Ledger::of(base.read(TileFilter::Tiles(&others))?);
        Ok(at_hand.merge(stored))
    }
}

fn write_layers(transaction: &mut Transaction, layers: Vec<Layer>) -> Result<(), EngineError> {
    let tiles: BTreeSet<TileId> = layers
        .iter()
        .map(|layer| TileId(layer.header.tile))
        .collect();
    let (headers, records): (Vec<_>, Vec<_>) = layers
        .into_iter()
        .map(|layer| (layer.header, layer.records))
        .unzip();
    transaction.replace_tiles(&tiles, records.into_iter().flatten().collect())?;
    transaction.replace_tiles(&tiles, headers)?;
    Ok(())
}
