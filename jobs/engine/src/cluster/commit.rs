//! The end of a job: what the reduce tasks made becomes a version.

use std::borrow::Cow;
use std::collections::BTreeMap;

use tilefold_schemas::{ChunkId, Footprint, SetAside, Sighting, Testified};
use tilefold_workers::Evidence;

use super::reduce::Reduced;
use super::{Driver, Exchanged, guard, wire};
use crate::error::EngineError;
use crate::map_job::Mapped;
use crate::notes::{MountingNote, Without};
use crate::progress::Progress;
use crate::run::{RunReport, sorted};
use crate::update::Revision;

impl Driver {
    /// Judges what was added, makes the layers, and commits a version.
    ///
    /// # Errors
    /// A group of tiles is lacking, came twice, or was not reduced from all that was mapped for it;
    /// another writer committed meanwhile ([`Driver::catch_up`]); or the store cannot be written.
    /// Nothing has changed then.
    pub fn commit(
        &self,
        reduced: &[Reduced],
        progress: &dyn Progress,
    ) -> Result<RunReport, EngineError> {
        guard::reduced(&self.asked, &self.manifests, reduced)?;
        let mut exchanged = Exchanged::default();
        for one in reduced {
            exchanged.add(one)?;
            self.meter.add(&one.counts);
        }
        let revision = Revision {
            mapped: self.with_looks(reduced)?,
            exchanged: Some(exchanged),
            ..Revision::default()
        };
        let fold = self.fold()?;
        let transaction = self.base.store().begin_from(self.base.clone())?;
        let update = self.update(&fold, progress);
        let (version, tiles) = update.commit("run", transaction, self.known.clone(), revision)?;
        Ok(self.report(version, tiles))
    }

    /// The chunks with their sightings and footprints: their rows are in the store's files already.
    fn with_looks(&self, reduced: &[Reduced]) -> Result<Vec<Mapped>, EngineError> {
        let mut by_chunk: BTreeMap<ChunkId, Evidence> = BTreeMap::new();
        for one in reduced {
            for row in wire::rows::<Sighting>(&one.sightings)? {
                let evidence = by_chunk.entry(row.chunk()).or_default();
                evidence.sightings.push(row);
            }
            for row in wire::rows::<Footprint>(&one.footprints)? {
                let evidence = by_chunk.entry(row.chunk()).or_default();
                evidence.footprints.push(row);
            }
        }
        let chunks = self.mapped.iter().cloned().map(|row| {
            let evidence = by_chunk.remove(&row.chunk()).unwrap_or_default();
            Mapped { row, evidence }
        });
        let chunks: Vec<Mapped> = chunks.collect();
        match by_chunk.keys().next() {
            Some(id) => Err(EngineError::Cluster(format!(
                "rows of window {} of vehicle {} came, which no map task tells of",
                id.window, id.vehicle
            ))),
            None => Ok(chunks),
        }
    }

    fn report(&self, version: i64, tiles_reduced: usize) -> RunReport {
        let manifests = &self.manifests;
        let set_aside = manifests.iter().flat_map(|one| &one.set_aside);
        let all: Vec<&SetAside> = self.set_aside.iter().chain(set_aside).collect();
        RunReport {
            version,
            is_new_version: version != self.base.version(),
            logs: self.logs,
            vehicles: self.vehicles,
            chunks_mapped: self.mapped.len(),
            chunks_known: manifests.iter().map(|one| one.known).sum(),
            duplicate_messages: manifests.iter().map(|one| one.duplicates).sum(),
            tiles_reduced,
            stages: self.meter.report(),
            done_without: self.done_without(),
            mountings: self.mountings(),
            spilled_bytes: 0,
            wall_s: self.meter.elapsed_s(),
            set_aside: sorted(all.into_iter()),
        }
    }

    fn done_without(&self) -> Vec<Without> {
        let mut chunks: BTreeMap<Cow<'static, str>, u64> = BTreeMap::new();
        for one in self.manifests.iter().flat_map(|one| &one.done_without) {
            *chunks.entry(one.what.clone()).or_default() += one.chunks;
        }
        let all = chunks.into_iter();
        let mut all: Vec<Without> = all.map(|(what, chunks)| Without { what, chunks }).collect();
        all.sort_by_key(|without| std::cmp::Reverse(without.chunks));
        all
    }

    /// Of each channel of a log, the mounting that was told from most.
    fn mountings(&self) -> Vec<MountingNote> {
        let mut best: BTreeMap<(&str, &str), &MountingNote> = BTreeMap::new();
        for note in self.manifests.iter().flat_map(|one| &one.mountings) {
            let known = best.entry((&note.log, &note.topic)).or_insert(note);
            if note.pairs > known.pairs {
                *known = note;
            }
        }
        best.into_values().cloned().collect()
    }
}
