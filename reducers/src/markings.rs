//! What kind of line it is: the map's marking against what passes read.
//!
//! A pass reads a line many times, and its misreadings repeat themselves: it has one vote, for the
//! marking that it read most often. A line that was repainted is in its place and read as another.

use std::collections::BTreeMap;

use tilefold_schemas::evidence::CLASS_BINS;
use tilefold_schemas::{Marking, fixed};

use crate::elements::Judged;
use crate::explain::Weight;
use crate::passes::Pass;
use crate::sensor::SensorModel;

/// Prior that a line was repainted as another kind of line.
const PRIOR_RETYPED: f64 = 0.005;
/// A pass votes if it read the marking in at least so many frames.
const LEAST_READINGS: i64 = 4;
/// The markings that a line can have become. A line that is dashed on one side is read by the two
/// directions of traffic as each other's mirror: these are one kind.
const KINDS: [Marking; 5] = [
    Marking::Solid,
    Marking::Dashed,
    Marking::SolidSolid,
    Marking::SolidDashed,
    Marking::DashedDashed,
];

/// Moves the share of "no change" that is due to another marking to "modified". Returns what each
/// vote says, if another marking is likelier than the map's.
pub(crate) fn retype(
    mapped: Marking,
    sections: &[Vec<Pass>],
    sensor: &SensorModel,
    judged: &mut [Judged],
) -> Vec<Weight> {
    let votes = votes(sections);
    let counts = counts(&votes);
    let Some([p_same, p_retyped]) = p_retyped(mapped, &counts, sensor) else {
        return Vec::new();
    };
    for section in judged {
        let modified = section.posterior[3] + section.posterior[0] * p_retyped;
        section.posterior[0] *= p_same;
        // What is only repainted is not shifted.
        let shifted = section.posterior[3] / modified.max(f64::MIN_POSITIVE);
        section.posterior[3] = modified;
        section.shift_m *= shifted;
    }
    match p_retyped >= 0.5 {
        true => testimonies(one_kind(mapped), votes, &counts, sensor),
        false => Vec::new(),
    }
}

/// What each vote says of the map's marking and of the one that most others are for.
fn testimonies(
    mapped: Marking,
    votes: Vec<Weight>,
    counts: &BTreeMap<i16, i64>,
    sensor: &SensorModel,
) -> Vec<Weight> {
    let others = KINDS.iter().filter(|kind| **kind != mapped);
    let count = |kind: &&Marking| counts.get(&kind.code()).copied().unwrap_or(0);
    let Some(now) = others.max_by_key(|kind| (count(kind), -kind.code())) else {
        return votes;
    };
    let weigh = |mut vote: Weight| {
        let nats_fx = |kind: Marking| reading_fx(vote.read == Some(kind.code()), sensor);
        vote.nats_fx = [nats_fx(mapped), 0, 0, nats_fx(*now)];
        vote
    };
    votes.into_iter().map(weigh).collect()
}

/// Log-likelihood of a vote for a marking, by whether it is the one that is there.
fn reading_fx(is_right: bool, sensor: &SensorModel) -> i64 {
    let others = (KINDS.len() - 1) as f64;
    let rate = match is_right {
        true => sensor.marking_read,
        false => (1.0 - sensor.marking_read) / others,
    };
    fixed::from_f64(libm::log(rate))
}

/// Votes for markings: each vehicle's traverse has one, over all sections.
fn votes(sections: &[Vec<Pass>]) -> Vec<Weight> {
    let mut traverses: BTreeMap<(i64, i64), (Weight, [i64; CLASS_BINS])> = BTreeMap::new();
    for pass in sections.iter().flatten() {
        // Sections of one traverse are seconds apart; those of two are minutes.
        let traverse = (pass.vehicle, pass.first_ns.div_euclid(60_000_000_000));
        let entry = traverses.entry(traverse);
        let (vote, counts) = entry.or_insert_with(|| (silent(pass), [0; CLASS_BINS]));
        vote.first_ns = vote.first_ns.min(pass.first_ns);
        vote.last_ns = vote.last_ns.max(pass.last_ns);
        for (sum, seen) in counts.iter_mut().zip(pass.seen) {
            *sum += i64::from(seen);
        }
    }
    let mut votes = Vec::new();
    for (vote, counts) in traverses.into_values() {
        let read = |kind: Marking| counts[kind.code() as usize];
        let of = |kind: &Marking| match kind {
            Marking::SolidDashed => read(*kind) + read(Marking::DashedSolid),
            _ => read(*kind),
        };
        let most = KINDS.iter().max_by_key(|kind| (of(kind), -kind.code()));
        if let Some(kind) = most.filter(|kind| of(kind) >= LEAST_READINGS) {
            let read = Some(kind.code());
            votes.push(Weight { read, ..vote });
        }
    }
    votes
}

/// A vote without a reading yet. Its frames are counted by the passes that it is made of.
fn silent(pass: &Pass) -> Weight {
    Weight {
        exposed: 0,
        hit: 0,
        residual_m: None,
        ..Weight::of(pass, [0; 4])
    }
}

fn counts(votes: &[Weight]) -> BTreeMap<i16, i64> {
    let mut counts = BTreeMap::new();
    for kind in votes.iter().filter_map(|vote| vote.read) {
        *counts.entry(kind).or_insert(0) += 1;
    }
    counts
}

/// The two ways to be dashed on one side, as one.
fn one_kind(marking: Marking) -> Marking {
    match marking {
        Marking::DashedSolid => Marking::SolidDashed,
        marking => marking,
    }
}

/// Traverses that read the map's marking, and all that read any; none if the map says none.
pub(crate) fn agreement(mapped: Marking, sections: &[Vec<Pass>]) -> (f64, f64) {
    let votes = counts(&votes(sections));
    match KINDS.contains(&mapped) {
        true => (
            votes.get(&mapped.code()).copied().unwrap_or(0) as f64,
            votes.values().sum::<i64>() as f64,
        ),
        false => (0.0, 0.0),
    }
}

/// Posterior of the map's marking, and of any other; none if the map says none.
fn p_retyped(
    mapped: Marking,
    votes: &BTreeMap<i16, i64>,
    sensor: &SensorModel,
) -> Option<[f64; 2]> {
    let mapped = one_kind(mapped);
    if !KINDS.contains(&mapped) {
        return None;
    }
    let others = (KINDS.len() - 1) as f64;
    let nats_fx = |kind: &Marking| -> i64 {
        let vote = |(read, count): (&i16, &i64)| count * reading_fx(*read == kind.code(), sensor);
        votes.iter().map(vote).sum()
    };
    let nats: Vec<f64> = KINDS
        .iter()
        .map(|kind| fixed::to_f64(nats_fx(kind)))
        .collect();
    let most = nats.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (mut same, mut other) = (0.0, 0.0);
    for (kind, nats) in KINDS.iter().zip(nats) {
        let likelihood = libm::exp(nats - most);
        match *kind == mapped {
            true => same += (1.0 - PRIOR_RETYPED) * likelihood,
            false => other += PRIOR_RETYPED / others * likelihood,
        }
    }
    let both = same + other;
    Some([same / both, other / both])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_passes_of_one_mind_are_needed() {
        let sensor = SensorModel::default();
        let p = |count| {
            let votes = BTreeMap::from([(Marking::Dashed.code(), count)]);
            p_retyped(Marking::Solid, &votes, &sensor).map_or(0.0, |[_, p_retyped]| p_retyped)
        };
        // One vote for dashed: odds 0.005 / 4 * 0.8 to 0.995 * 0.05, and three unlikely others.
        let by_hand = 0.005 / 4.0 * (0.8 + 3.0 * 0.05);
        assert!((p(1) - by_hand / (by_hand + 0.995 * 0.05)).abs() < 1e-6);
        assert!(p(2) < 0.5 && p(3) > 0.8, "{} {}", p(2), p(3));
        assert_eq!(p_retyped(Marking::Unknown, &BTreeMap::new(), &sensor), None);
    }
}
