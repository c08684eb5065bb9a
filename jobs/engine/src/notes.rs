//! What a run found out about the drives besides their evidence: what poses had to do without, and
//! how cameras are really mounted.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tilefold_workers::mounting::Mounting;

use crate::map_job::Mapped;

/// Something that chunks had to do without.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Without {
    /// What, and what was done instead.
    pub what: Cow<'static, str>,
    /// In how many chunks.
    pub chunks: u64,
}

/// How the camera behind a channel of a log is mounted, by the chunk that tells most about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MountingNote {
    /// The log's file.
    pub log: String,
    /// The channel of the detections.
    pub topic: String,
    /// What is to be added to the stated roll, pitch and yaw, radians about the vehicle's axes, and
    /// to the height in metres; none where the drive could not tell.
    pub correction: [Option<f64>; 4],
    /// The standard deviations, where told.
    pub sigma: [Option<f64>; 4],
    /// Pairs of a seen and a mapped line that it was told from.
    pub pairs: usize,
    /// Median distance of matched lines from the map's, metres, with the stated mounting...
    pub stated_miss_m: f64,
    /// ... and with the refined one.
    pub refined_miss_m: f64,
}

impl MountingNote {
    fn new(mapped: &Mapped, mounting: &Mounting) -> Self {
        let observed = |values: [f64; 4]| {
            std::array::from_fn(|axis| mounting.is_observed[axis].then_some(values[axis]))
        };
        Self {
            log: mapped.row.log.clone(),
            topic: mapped.row.topic.clone(),
            correction: observed(mounting.correction),
            sigma: observed(mounting.sigma),
            pairs: mounting.pairs,
            stated_miss_m: mounting.stated_miss_m,
            refined_miss_m: mounting.refined_miss_m,
        }
    }
}

/// What poses were made without, the most frequent first.
pub(crate) fn done_without(mapped: &[Mapped]) -> Vec<Without> {
    let mut chunks: BTreeMap<&'static str, u64> = BTreeMap::new();
    for what in mapped.iter().flat_map(|mapped| &mapped.evidence.without) {
        *chunks.entry(what).or_default() += 1;
    }
    let mut all: Vec<Without> = chunks
        .into_iter()
        .map(|(what, chunks)| Without {
            what: what.into(),
            chunks,
        })
        .collect();
    all.sort_by_key(|without| std::cmp::Reverse(without.chunks));
    all
}

/// The mounting behind each channel of each log, by log and topic.
pub(crate) fn mountings(mapped: &[Mapped]) -> Vec<MountingNote> {
    let mut best: BTreeMap<(&str, &str), (&Mapped, &Mounting)> = BTreeMap::new();
    for chunk in mapped {
        let Some(mounting) = &chunk.evidence.mounting else {
            continue;
        };
        let key = (chunk.row.log.as_str(), chunk.row.topic.as_str());
        let known = best.entry(key).or_insert((chunk, mounting));
        if mounting.pairs > known.1.pairs {
            *known = (chunk, mounting);
        }
    }
    best.into_values()
        .map(|(chunk, mounting)| MountingNote::new(chunk, mounting))
        .collect()
}
