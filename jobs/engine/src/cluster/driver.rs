//! The driver's side of a job: what is to be done, and what came of it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tilefold_reducers::Fold;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::table::Table;
use tilefold_schemas::{ChunkId, ChunkRow, LayerHeader, SetAside, TileId};
use tilefold_store::{Snapshot, Store, TileFilter};
use tilefold_tiler::map_index::MapIndex;
use tilefold_workers::{MapContext, Registering};

use super::reduce::{Chunk, chunk};
use super::{Job, Manifest, Reduction, Task, group_of, guard, worker};
use crate::error::EngineError;
use crate::logs::{Catalogue, Unit};
use crate::map_job::Known;
use crate::meter::Meter;
use crate::progress::{Progress, Silent};
use crate::run::{ATTEMPTS, RunOptions, check_method, known_chunks};
use crate::update::{Update, read_elements, tiles_of};

/// A job on its way.
pub struct Driver {
    pub(super) job: Job,
    pub(super) tasks: Vec<Task>,
    pub(super) logs: usize,
    pub(super) vehicles: usize,
    pub(super) set_aside: Vec<SetAside>,
    pub(super) base: Snapshot,
    pub(super) known: Vec<ChunkRow>,
    pub(super) context: Arc<MapContext>,
    pub(super) meter: Meter,
    pub(super) manifests: Vec<Manifest>,
    /// Chunks that were mapped, and that count.
    pub(super) mapped: Vec<ChunkRow>,
    /// Chunks that were mapped, but that another writer brought meanwhile.
    dropped: BTreeSet<Chunk>,
    pub(super) asked: Vec<Reduction>,
}

impl Driver {
    /// How often a job is folded onto a version that another writer made meanwhile, at most.
    pub const ATTEMPTS: usize = ATTEMPTS;

    /// Looks at the logs' summaries and cuts the job into about `tasks` map tasks.
    ///
    /// # Errors
    /// The store cannot be read, or its evidence was made by another method.
    pub fn plan(
        location: &Path,
        logs: &[PathBuf],
        options: RunOptions,
        detector: Option<i64>,
        (tasks, groups): (usize, u32),
        progress: &dyn Progress,
    ) -> Result<Self, EngineError> {
        let size = |units: usize| units.div_ceil(tasks.max(1));
        Self::plan_in(location, logs, options, detector, (&size, groups), progress)
    }

    /// As [`Driver::plan`]; `size` says how many units a task has at most, of how many there are.
    pub(crate) fn plan_in(
        location: &Path,
        logs: &[PathBuf],
        options: RunOptions,
        detector: Option<i64>,
        (size, groups): (&dyn Fn(usize) -> usize, u32),
        progress: &dyn Progress,
    ) -> Result<Self, EngineError> {
        let meter = Meter::default();
        let store = Store::open(location.to_path_buf())?;
        let base = store.snapshot(None)?;
        let known: Vec<ChunkRow> = base.read(TileFilter::All)?;
        check_method(&known, options.registering.method())?;
        let catalogue = Catalogue::open_seeing(logs, detector, &meter, progress);
        let units = catalogue.units();
        let vehicles: BTreeSet<&str> = units.iter().map(|unit| unit.vehicle.as_str()).collect();
        let tile_level = u32::from(store.properties().tile_level);
        Ok(Self {
            job: Job {
                store: location.display().to_string(),
                version: base.version(),
                model: options.model.name().to_owned(),
                registration: options.registering == Registering::On,
                as_of_ns: options.as_of_ns,
                detector,
                groups: groups.max(1),
            },
            tasks: cut(&catalogue, &units, size(units.len())),
            logs: catalogue.logs.len(),
            vehicles: vehicles.len(),
            context: Arc::new(MapContext {
                map: MapIndex::new(read_elements(&base, tile_level)?),
                tile_level,
                registering: options.registering,
            }),
            set_aside: catalogue.set_aside,
            base,
            known,
            meter,
            manifests: Vec::new(),
            mapped: Vec::new(),
            dropped: BTreeSet::new(),
            asked: Vec::new(),
        })
    }

    /// What every task must know.
    #[must_use]
    pub fn job(&self) -> &Job {
        &self.job
    }

    /// The map tasks.
    #[must_use]
    pub fn tasks(&self) -> &[Task] {
        &self.tasks
    }

    /// Takes what the map tasks say, all of them, in any order.
    ///
    /// # Errors
    /// A task or a chunk is lacking, or came twice.
    pub fn mapped(&mut self, manifests: Vec<Manifest>) -> Result<(), EngineError> {
        let checked = guard::manifests(&self.tasks, self.job.groups, manifests)?;
        for (manifest, rows) in checked {
            self.meter.add(&manifest.counts);
            self.manifests.push(manifest);
            self.mapped.extend(rows);
        }
        Ok(())
    }

    /// The reduce tasks, on what the commit will be based on.
    ///
    /// # Errors
    /// The store is damaged.
    pub fn reductions(&mut self) -> Result<&[Reduction], EngineError> {
        let ids: BTreeSet<ChunkId> = self.mapped.iter().map(ChunkRow::chunk).collect();
        let replaced = self.known.iter().filter(|row| ids.contains(&row.chunk()));
        let replaced: Vec<&ChunkRow> = replaced.collect();
        let all = self.mapped.iter().chain(replaced.iter().copied());
        let touched: BTreeSet<TileId> = all.flat_map(tiles_of).collect();
        let mut groups: BTreeMap<u32, Reduction> = BTreeMap::new();
        for tile in self.judged(&touched)? {
            let group = group_of(tile, self.job.groups);
            let reduction = groups.entry(group).or_insert_with(|| self.empty(group));
            reduction.judged.insert(tile.0);
            if touched.contains(&tile) {
                reduction.touched.insert(tile.0);
            }
        }
        // Only chunks that the store has can leave it.
        for row in replaced {
            for tile in tiles_of(row) {
                if let Some(reduction) = groups.get_mut(&group_of(tile, self.job.groups)) {
                    reduction.leaving.insert(chunk(&row.chunk()));
                }
            }
        }
        self.asked = groups.into_values().collect();
        Ok(&self.asked)
    }

    /// The tiles that are judged: those whose rows change; all of them for another model or time.
    fn judged(&self, touched: &BTreeSet<TileId>) -> Result<BTreeSet<TileId>, EngineError> {
        let headers: Vec<LayerHeader> = self.base.read(TileFilter::All)?;
        let fold = self.fold()?;
        let update = self.update(&fold, &Silent);
        let mut judged = touched.clone();
        if update.changes_model(&self.base, &headers) {
            judged.extend(self.context.map.elements().iter().map(|mapped| mapped.tile));
            judged.extend(headers.iter().map(|header| TileId(header.tile)));
        }
        Ok(judged)
    }

    /// After a conflict: the latest version is what the reduce tasks and the commit are based on.
    ///
    /// # Errors
    /// Its base map is another one, or its evidence was made by another method.
    pub fn catch_up(&mut self) -> Result<(), EngineError> {
        let latest = self.base.store().snapshot(None)?;
        let map = |snapshot: &Snapshot| snapshot.info().pins.get(ElementRow::NAME).cloned();
        if map(&latest) != map(&self.base) {
            return Err(EngineError::Cluster(format!(
                "another writer gave the store a new base map (version {}) after this job was planned",
                latest.version()
            )));
        }
        self.known = latest.read(TileFilter::All)?;
        let method = self.job.options()?.registering.method();
        check_method(&self.known, method)?;
        let known = known_chunks(&self.known);
        let gives_way =
            |known: &Known, row: &ChunkRow| known.gives_way_to(row.digest, row.messages, row.model);
        let dropped = &mut self.dropped;
        self.mapped.retain(|row| {
            let stays = known
                .get(&row.chunk())
                .is_none_or(|known| gives_way(known, row));
            if !stays {
                dropped.insert(chunk(&row.chunk()));
            }
            stays
        });
        self.base = latest;
        Ok(())
    }

    pub(super) fn fold(&self) -> Result<Fold, EngineError> {
        worker::fold(&self.job.options()?, &self.base)
    }

    pub(super) fn update<'a>(&'a self, fold: &'a Fold, progress: &'a dyn Progress) -> Update<'a> {
        Update {
            map: &self.context.map,
            tile_level: self.context.tile_level,
            fold,
            meter: &self.meter,
            progress,
        }
    }

    /// The reduction of a group without tiles yet.
    fn empty(&self, group: u32) -> Reduction {
        let rows = |one: &Manifest| one.rows.get(group as usize).copied().unwrap_or_default();
        let has_part = |one: &&Manifest| rows(one) != [0; 3];
        let tasks = self.manifests.iter().filter(has_part).map(|one| one.task);
        Reduction {
            group,
            version: self.base.version(),
            tasks: tasks.collect(),
            touched: BTreeSet::new(),
            judged: BTreeSet::new(),
            leaving: BTreeSet::new(),
            dropped: self.dropped.clone(),
        }
    }
}

/// Tasks of this many units of a vehicle, or of what is left of it.
fn cut(catalogue: &Catalogue, units: &[Unit], size: usize) -> Vec<Task> {
    let of_vehicles = units.chunk_by(|a, b| a.vehicle == b.vehicle);
    let bundles = of_vehicles.flat_map(|units| units.chunks(size.max(1)));
    let task = |(number, units): (usize, &[Unit])| {
        let logs: BTreeSet<usize> = units.iter().flat_map(|unit| &unit.logs).copied().collect();
        let named = |&log: &usize| {
            let log = &catalogue.logs[log];
            (log.path.display().to_string(), log.size_bytes)
        };
        Task {
            number,
            vehicle: units[0].vehicle.clone(),
            units: units.iter().map(|unit| unit.windows).collect(),
            logs: logs.iter().map(named).collect(),
        }
    };
    bundles.enumerate().map(task).collect()
}
