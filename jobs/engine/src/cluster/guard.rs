//! The guard of a job: everything that was planned came back once, whole, and nothing else.
//!
//! A runner that silently runs a leaf twice, or loses one, makes a wrong map: evidence counts passes.
//! So each task, each chunk and each row is counted where it is made and where it arrives.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_schemas::{ChunkId, ChunkRow};

use super::map::Manifest;
use super::reduce::{Reduced, Reduction};
use super::{Task, wire};
use crate::error::EngineError;

/// The manifests by task, and the rows of the chunks that they tell of.
///
/// # Errors
/// A task or a chunk is lacking, came twice, or was never asked for.
pub(super) fn manifests(
    tasks: &[Task],
    groups: u32,
    manifests: Vec<Manifest>,
) -> Result<Vec<(Manifest, Vec<ChunkRow>)>, EngineError> {
    let mut by_task: BTreeMap<usize, (Manifest, Vec<ChunkRow>)> = BTreeMap::new();
    let mut chunks: BTreeSet<ChunkId> = BTreeSet::new();
    for manifest in manifests {
        let number = manifest.task;
        let task = tasks.get(number);
        let task = task.ok_or_else(|| wrong(format!("there is no map task {number}")))?;
        if manifest.units != task.units.len() {
            return Err(wrong(format!(
                "map task {number} mapped {} units instead of {}",
                manifest.units,
                task.units.len()
            )));
        }
        if manifest.rows.len() != groups as usize {
            return Err(wrong(format!(
                "map task {number} made parts for {} groups of tiles instead of {groups}",
                manifest.rows.len()
            )));
        }
        let rows: Vec<ChunkRow> = wire::rows(&manifest.chunks)?;
        if let Some(twice) = rows.iter().find(|row| !chunks.insert(row.chunk())) {
            let id = twice.chunk();
            return Err(wrong(format!(
                "window {} of vehicle {} was mapped twice",
                id.window, id.vehicle
            )));
        }
        if by_task.insert(number, (manifest, rows)).is_some() {
            return Err(wrong(format!("map task {number} came back twice")));
        }
    }
    let lost = tasks
        .iter()
        .find(|task| !by_task.contains_key(&task.number));
    match lost {
        Some(task) => Err(wrong(format!(
            "map task {} of {} did not come back",
            task.number,
            tasks.len()
        ))),
        None => Ok(by_task.into_values().collect()),
    }
}

/// Checks that each group was reduced once, from all rows that were mapped for it.
///
/// # Errors
/// It was not.
pub(super) fn reduced(
    asked: &[Reduction],
    manifests: &[Manifest],
    all: &[Reduced],
) -> Result<(), EngineError> {
    let mut by_group: BTreeMap<u32, &Reduced> = BTreeMap::new();
    for one in all {
        if by_group.insert(one.reduction.group, one).is_some() {
            let group = one.reduction.group;
            return Err(wrong(format!("group {group} of tiles came back twice")));
        }
    }
    for reduction in asked {
        let group = reduction.group;
        let Some(one) = by_group.remove(&group) else {
            return Err(wrong(format!("group {group} of tiles did not come back")));
        };
        if &one.reduction != reduction {
            let reason = format!("group {group} of tiles was reduced as of something else");
            return Err(wrong(reason));
        }
        whole(reduction, manifests, one)?;
    }
    match by_group.keys().next() {
        Some(group) => Err(wrong(format!("group {group} of tiles was not asked for"))),
        None => Ok(()),
    }
}

fn whole(
    reduction: &Reduction,
    manifests: &[Manifest],
    reduced: &Reduced,
) -> Result<(), EngineError> {
    let group = reduction.group;
    let mut rows = reduced.rows.clone();
    for &task in &reduction.tasks {
        let sent = manifests.get(task);
        let sent = sent.and_then(|one| one.rows.get(group as usize).copied());
        let came = rows.remove(&task);
        if sent != came {
            return Err(wrong(format!(
                "map task {task} made {} for group {group} of tiles, and {} came",
                described(sent),
                described(came)
            )));
        }
    }
    match rows.keys().next() {
        Some(task) => Err(wrong(format!(
            "a part of map task {task} came to group {group} of tiles, and was not asked for"
        ))),
        None => Ok(()),
    }
}

fn described(rows: Option<[u64; 3]>) -> String {
    match rows {
        Some([evidence, sightings, footprints]) => {
            format!("{evidence} + {sightings} + {footprints} rows")
        }
        None => "nothing".to_owned(),
    }
}

fn wrong(what: String) -> EngineError {
    EngineError::Cluster(what)
}
