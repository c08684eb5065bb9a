//! The same job on many machines: what a cluster's runner calls.
//!
//! ```text
//! driver: Driver::plan -> tasks            worker: Worker::map    one task -> a part a group, a manifest
//! driver: Driver::mapped (guard)           worker: Worker::reduce one group's parts -> data files, verdicts
//! driver: Driver::commit (guard): candidates, layers, one commit
//! ```
//! Maps and reductions are the functions of the local run on the same inputs, so the bytes are the
//! same. A task may be run any number of times, anywhere: its result is a function of its words, and
//! what it writes into the store is seen by nobody before the commit. What a runner loses, doubles or
//! mixes up is counted, and refused.

mod commit;
mod driver;
mod guard;
mod map;
mod reduce;
mod spill;
mod wire;
mod worker;

use serde::{Deserialize, Serialize};
use tilefold_reducers::FusionModel;
use tilefold_schemas::{ChangeRecord, TileId};
use tilefold_store::{Rewritten, Transaction};
use tilefold_workers::Registering;

use crate::error::EngineError;
use crate::perceive::Perception;
use crate::reduce_job::Judged;
use crate::run::RunOptions;

pub use driver::Driver;
pub use map::{Manifest, MapPartial, Part};
pub use reduce::{Reduced, Reduction};
pub(crate) use spill::Spill;
pub use worker::Worker;

/// What every task of a job must know.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Job {
    /// The store, by the path or URL that all machines know it by.
    pub store: String,
    /// The version that the job's map stage looks at.
    pub version: i64,
    /// Name of the fusion model.
    pub model: String,
    /// Whether poses are laid on the map.
    pub registration: bool,
    /// Only what was seen until then counts, nanoseconds since the Unix epoch; none: all of it.
    pub as_of_ns: Option<i64>,
    /// Digest of the network that looks at pictures; none: only detections made on the vehicle count.
    pub detector: Option<i64>,
    /// Into how many groups tiles are split.
    pub groups: u32,
}

impl Job {
    /// How the run is made.
    ///
    /// # Errors
    /// There is no such fusion model here.
    pub fn options(&self) -> Result<RunOptions, EngineError> {
        let named = FusionModel::ALL
            .into_iter()
            .find(|one| one.name() == self.model);
        let unknown = || EngineError::Cluster(format!("there is no fusion model {}", self.model));
        Ok(RunOptions {
            model: named.ok_or_else(unknown)?,
            registering: match self.registration {
                true => Registering::On,
                false => Registering::Off,
            },
            as_of_ns: self.as_of_ns,
        })
    }
}

/// Work for one map task: some of the units of one vehicle.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Task {
    /// Its number in the job, from 0.
    pub number: usize,
    /// The vehicle, as the logs name it.
    pub vehicle: String,
    /// Of each unit, its first window and the one after the last.
    pub units: Vec<(i64, i64)>,
    /// The logs that cover them, with their sizes in bytes: whoever sees others has other logs.
    pub logs: Vec<(String, u64)>,
}

/// The group that works on a tile. All tiles that share a data file are in one.
#[must_use]
pub fn group_of(tile: TileId, groups: u32) -> u32 {
    let coarse = tilefold_store::coarse(tile);
    let hash = tilefold_schemas::id::first_i64(&blake3::hash(&coarse.0.to_le_bytes()));
    (hash.cast_unsigned() % u64::from(groups.max(1))) as u32
}

/// What workers exchanged and judged, for the commit.
#[derive(Debug, Default)]
pub(crate) struct Exchanged {
    rewritten: Vec<[Rewritten; 3]>,
    judged: Judged,
}

impl Exchanged {
    /// Puts the workers' data files into the transaction; what they judged is left.
    pub(crate) fn take_over(self, transaction: &mut Transaction) -> Result<Judged, EngineError> {
        for [evidence, sightings, footprints] in &self.rewritten {
            transaction.take_over::<tilefold_schemas::EvidenceRow>(evidence)?;
            transaction.take_over::<tilefold_schemas::Sighting>(sightings)?;
            transaction.take_over::<tilefold_schemas::Footprint>(footprints)?;
        }
        Ok(self.judged)
    }

    fn add(&mut self, reduced: &Reduced) -> Result<(), EngineError> {
        let records: Vec<ChangeRecord> = wire::rows(&reduced.records)?;
        self.rewritten.push(reduced.rewritten.clone());
        self.judged.tiles.extend(reduced.sums());
        self.judged.records.extend(records);
        Ok(())
    }
}

/// Refuses a network that is not the one that the job was planned with.
fn check_detector(job: &Job, perception: Option<&Perception>) -> Result<(), EngineError> {
    let found = perception.map(|perception| perception.model().digest);
    if found == job.detector {
        return Ok(());
    }
    Err(EngineError::Cluster(
        "the network on this machine is not the one that the job was planned with; every machine needs the same card and model".to_owned(),
    ))
}
