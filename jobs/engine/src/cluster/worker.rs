//! A machine's side of a job: what is read once for all tasks that run there.

use std::collections::BTreeSet;
use std::sync::Arc;

use tilefold_reducers::Fold;
use tilefold_schemas::{ChunkRow, TileId};
use tilefold_store::{Snapshot, Store, TileFilter};
use tilefold_tiler::map_index::MapIndex;
use tilefold_workers::MapContext;

use super::{Driver, Job, check_detector};
use crate::calibrate;
use crate::error::EngineError;
use crate::map_job::KnownChunks;
use crate::perceive::Perception;
use crate::run::{RunOptions, known_chunks};
use crate::update::read_elements;

/// Runs tasks of one job.
pub struct Worker {
    pub(super) job: Job,
    pub(super) snapshot: Snapshot,
    pub(super) context: Arc<MapContext>,
    pub(super) known: KnownChunks,
    pub(super) perception: Option<Perception>,
}

impl Worker {
    /// Reads what tasks need: the base map, and which chunks the store knows.
    ///
    /// # Errors
    /// The store cannot be read, or `perception` is not what the job was planned with.
    pub fn open(job: Job, perception: Option<Perception>) -> Result<Self, EngineError> {
        check_detector(&job, perception.as_ref())?;
        let options = job.options()?;
        let store = Store::open(job.store.as_str())?;
        let snapshot = store.snapshot(Some(job.version))?;
        let tile_level = u32::from(store.properties().tile_level);
        let rows: Vec<ChunkRow> = snapshot.read(TileFilter::All)?;
        Ok(Self {
            context: Arc::new(MapContext {
                map: MapIndex::new(read_elements(&snapshot, tile_level)?),
                tile_level,
                registering: options.registering,
            }),
            known: known_chunks(&rows),
            job,
            snapshot,
            perception,
        })
    }

    /// A worker in the driver's process, which shares what that has read.
    pub(crate) fn beside(driver: &Driver) -> Self {
        Self {
            job: driver.job.clone(),
            snapshot: driver.base.clone(),
            context: driver.context.clone(),
            known: known_chunks(&driver.known),
            perception: None,
        }
    }

    /// How a version is folded by this job.
    pub(super) fn fold(&self, base: &Snapshot) -> Result<Fold, EngineError> {
        fold(&self.job.options()?, base)
    }

    /// The tiles that are this group's.
    pub(super) fn is_of(&self, group: u32, tiles: &BTreeSet<TileId>) -> bool {
        let of = |tile: &TileId| super::group_of(*tile, self.job.groups) == group;
        tiles.iter().all(of)
    }
}

/// How a version is folded by a run with these options.
pub(super) fn fold(options: &RunOptions, base: &Snapshot) -> Result<Fold, EngineError> {
    let sensor = calibrate::sensor_model(base)?;
    Ok(Fold {
        as_of_ns: options.as_of_ns,
        ..Fold::of_fleet(options.model, sensor)
    })
}
