//! One map task: the units of a task, mapped as a local run maps them, split by groups of tiles.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tilefold_schemas::{ChunkRow, EvidenceRow, Footprint, SetAside, Sighting, Testified};
use tilefold_store::Store;

use super::worker::Worker;
use super::{Task, group_of, wire};
use crate::error::EngineError;
use crate::logs::{Catalogue, Unit};
use crate::map_job::{MapOutput, map_units};
use crate::meter::{Count, Meter};
use crate::notes::{self, MountingNote, Without};
use crate::perceive::Perception;
use crate::progress::Silent;

/// What a map task says of its work; small, for the driver.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Manifest {
    /// The task.
    pub task: usize,
    /// How many units it mapped.
    pub units: usize,
    /// Rows of the chunks that were mapped, as an Arrow IPC stream of the table `chunks`.
    #[serde(skip)]
    pub chunks: Vec<u8>,
    /// Chunks that the store knew already.
    pub known: u64,
    /// Messages that came more than once.
    pub duplicates: u64,
    /// What was set aside.
    pub set_aside: Vec<SetAside>,
    /// What poses had to do without.
    pub done_without: Vec<Without>,
    /// How cameras are mounted.
    pub mountings: Vec<MountingNote>,
    /// Of each group, how many rows of evidence, sightings and footprints its part has.
    pub rows: Vec<[u64; 3]>,
    /// What was counted of each stage.
    pub counts: Vec<Count>,
}

/// The rows of one map task in the tiles of one group, each an Arrow IPC stream.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Part {
    /// Of the table `evidence`.
    pub evidence: Vec<u8>,
    /// Of the table `sightings`.
    pub sightings: Vec<u8>,
    /// Of the table `footprints`.
    pub footprints: Vec<u8>,
}

/// What a map task made.
#[derive(Debug, Clone)]
pub struct MapPartial {
    /// For the driver.
    pub manifest: Manifest,
    /// For each group.
    pub parts: Vec<Part>,
}

impl Worker {
    /// Maps the units of a task.
    ///
    /// # Errors
    /// The logs are not those that were planned with, or another version of the map.
    pub fn map(&self, task: &Task) -> Result<MapPartial, EngineError> {
        self.map_seeing(self.perception.as_ref(), task)
    }

    /// As [`Worker::map`]; `perception` looks at pictures.
    pub(crate) fn map_seeing(
        &self,
        perception: Option<&Perception>,
        task: &Task,
    ) -> Result<MapPartial, EngineError> {
        let catalogue = self.catalogue(task)?;
        let units = units(&catalogue, task)?;
        // The logs were indexed, and counted, when the job was planned.
        let meter = Meter::default();
        let mapped = map_units(
            perception,
            &catalogue,
            &units,
            &self.known,
            &self.store().properties().salt,
            &self.context,
            &meter,
            &Silent,
        );
        self.partial(task, units.len(), mapped, &meter)
    }

    fn store(&self) -> &Store {
        self.snapshot.store()
    }

    fn catalogue(&self, task: &Task) -> Result<Catalogue, EngineError> {
        let files: Vec<PathBuf> = task.logs.iter().map(|(log, _)| log.into()).collect();
        let meter = Meter::default();
        let model = self.job.detector;
        let catalogue = Catalogue::open_seeing(&files, model, &meter, &Silent);
        for (log, size_bytes) in &task.logs {
            let found = catalogue.logs.iter().find(|one| one.path == Path::new(log));
            let found_bytes = found.map(|one| one.size_bytes);
            if found_bytes != Some(*size_bytes) {
                let found = found_bytes.map_or_else(
                    || "cannot be read".to_owned(),
                    |bytes| format!("has {bytes} bytes"),
                );
                return Err(EngineError::Cluster(format!(
                    "{log} {found} on this machine, and {size_bytes} bytes where the job was planned; every machine must see the same logs under the same names"
                )));
            }
        }
        Ok(catalogue)
    }

    fn partial(
        &self,
        task: &Task,
        units: usize,
        output: MapOutput,
        meter: &Meter,
    ) -> Result<MapPartial, EngineError> {
        let done_without = notes::done_without(&output.mapped);
        let mountings = notes::mountings(&output.mapped);
        let mut chunks: Vec<ChunkRow> = Vec::new();
        let mut groups: Vec<Rows> = Vec::new();
        groups.resize_with(self.job.groups as usize, Rows::default);
        for mapped in output.mapped {
            chunks.push(mapped.row);
            let evidence = mapped.evidence;
            for row in evidence.rows {
                self.group(&mut groups, &row).evidence.push(row);
            }
            for row in evidence.sightings {
                self.group(&mut groups, &row).sightings.push(row);
            }
            for row in evidence.footprints {
                self.group(&mut groups, &row).footprints.push(row);
            }
        }
        let manifest = Manifest {
            task: task.number,
            units,
            chunks: wire::bytes(chunks)?,
            known: output.known,
            duplicates: output.duplicates,
            set_aside: output.set_aside,
            done_without,
            mountings,
            rows: groups.iter().map(Rows::counts).collect(),
            counts: meter.counts(),
        };
        let parts: Result<Vec<Part>, EngineError> = groups.into_iter().map(Rows::part).collect();
        Ok(MapPartial {
            manifest,
            parts: parts?,
        })
    }

    fn group<'g, R: Testified>(&self, groups: &'g mut [Rows], row: &R) -> &'g mut Rows {
        &mut groups[group_of(row.tile(), self.job.groups) as usize]
    }
}

/// The units of a task, in the catalogue of its logs alone.
fn units(catalogue: &Catalogue, task: &Task) -> Result<Vec<Unit>, EngineError> {
    let mut all: BTreeMap<(i64, i64), Unit> = BTreeMap::new();
    let own = catalogue.units().into_iter();
    all.extend(
        own.filter(|unit| unit.vehicle == task.vehicle)
            .map(|unit| (unit.windows, unit)),
    );
    let find = |windows: &(i64, i64)| {
        all.remove(windows).ok_or_else(|| {
            EngineError::Cluster(format!(
                "the logs of {} have nothing in windows {} to {} on this machine",
                task.vehicle, windows.0, windows.1
            ))
        })
    };
    task.units.iter().map(find).collect()
}

/// Rows in the tiles of a group.
#[derive(Default)]
struct Rows {
    evidence: Vec<EvidenceRow>,
    sightings: Vec<Sighting>,
    footprints: Vec<Footprint>,
}

impl Rows {
    fn counts(&self) -> [u64; 3] {
        [
            self.evidence.len() as u64,
            self.sightings.len() as u64,
            self.footprints.len() as u64,
        ]
    }

    fn part(self) -> Result<Part, EngineError> {
        Ok(Part {
            evidence: wire::bytes(self.evidence)?,
            sightings: wire::bytes(self.sightings)?,
            footprints: wire::bytes(self.footprints)?,
        })
    }
}
