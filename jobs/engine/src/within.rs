//! `run` within a limit of memory: the tasks of a cluster's job, all of them on this machine.
//!
//! What tasks leave for the reduce stage waits in memory as long as there is room, and on disk after
//! that; then the tiles that share a data file are reduced, one such group after the other. Map and
//! reduce are the functions of any run, so the bytes are the same.
//!
//! What is not bounded: the base map, the rows that one data file gets (16 x 16 tiles), and the
//! store's sightings and footprints, which are needed to judge what was added.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use tilefold_store::StoreError;

use crate::cluster::{Driver, Manifest, Reduced, Spill, Worker};
use crate::error::EngineError;
use crate::meter::Stage;
use crate::perceive::Perception;
use crate::progress::Progress;
use crate::run::{RunOptions, RunReport};

/// Units that one task maps: their logs are opened once for all of them.
const UNITS_A_TASK: usize = 8;
/// Groups that tiles are split into: so many that the data files of a city are hardly ever in one.
const GROUPS: u32 = 256;
/// Share of the limit that parts may take while they wait. Rows take about four times their part when
/// their group is reduced.
const SHARE_OF_PARTS: f64 = 0.2;

/// How much memory a job may take, and where the rest goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Limit {
    /// Bytes.
    pub bytes: u64,
    /// Folder for what is spilled.
    pub folder: PathBuf,
}

/// As [`crate::run_seeing`], within a limit of memory.
///
/// # Errors
/// As [`crate::run()`]; or the folder for what is spilled cannot be written.
pub fn run_within(
    location: &Path,
    logs: &[PathBuf],
    options: impl Into<RunOptions>,
    perception: Option<&Perception>,
    limit: &Limit,
    progress: &dyn Progress,
) -> Result<RunReport, EngineError> {
    let detector = perception.map(|perception| perception.model().digest);
    let cut = (&|_| UNITS_A_TASK) as &dyn Fn(usize) -> usize;
    let options = options.into();
    let mut driver = Driver::plan_in(location, logs, options, detector, (cut, GROUPS), progress)?;
    let worker = Worker::beside(&driver);
    let room_bytes = (limit.bytes as f64 * SHARE_OF_PARTS) as u64;
    let spill = Spill::new(room_bytes, &limit.folder)?;
    let manifests = map(&driver, &worker, perception, &spill, progress)?;
    driver.mapped(manifests)?;
    let mut attempts = Driver::ATTEMPTS;
    loop {
        attempts -= 1;
        let reduced = reduce(&mut driver, &worker, &spill, progress)?;
        match driver.commit(&reduced, progress) {
            Err(EngineError::Store(StoreError::Conflict { .. } | StoreError::Busy { .. }))
                if attempts > 0 =>
            {
                driver.catch_up()?;
            }
            done => {
                return Ok(RunReport {
                    spilled_bytes: spill.spilled_bytes(),
                    ..done?
                });
            }
        }
    }
}

fn map(
    driver: &Driver,
    worker: &Worker,
    perception: Option<&Perception>,
    spill: &Spill,
    progress: &dyn Progress,
) -> Result<Vec<Manifest>, EngineError> {
    let units = driver.tasks().iter().map(|task| task.units.len() as u64);
    progress.begin(Stage::Map, units.sum());
    let one = |task| {
        let partial = worker.map_seeing(perception, task)?;
        let losses = partial.manifest.set_aside.iter().map(|loss| loss.count);
        progress.advance(Stage::Map, task.units.len() as u64, losses.sum());
        spill.put(task.number, partial.parts)?;
        Ok(partial.manifest)
    };
    let tasks = driver.tasks().par_iter().with_max_len(1);
    let manifests = tasks.map(one).collect();
    progress.end(Stage::Map);
    manifests
}

/// One group after the other: the rows of a group are what takes memory.
fn reduce(
    driver: &mut Driver,
    worker: &Worker,
    spill: &Spill,
    progress: &dyn Progress,
) -> Result<Vec<Reduced>, EngineError> {
    let reductions = driver.reductions()?;
    progress.begin(Stage::Exchange, reductions.len() as u64);
    let one = |reduction: &crate::cluster::Reduction| {
        let parts = spill.parts(reduction.group, &reduction.tasks)?;
        let reduced = worker.reduce(reduction, &parts);
        progress.advance(Stage::Exchange, 1, 0);
        reduced
    };
    let reduced = reductions.iter().map(one).collect();
    progress.end(Stage::Exchange);
    reduced
}
