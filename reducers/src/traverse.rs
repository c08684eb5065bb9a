//! How much each section of a traverse is worth.
//!
//! A vehicle that drives along a line sees its sections under the same conditions: what it missed
//! on all of them it may have missed for one reason, a lorry or a bad registration, and what it
//! matched on all of them may be one ghost. Such sections together are worth little more than one.
//! But where it saw the line before and behind a section, and not there, nothing about the
//! conditions explains it: such a section stands for itself.

use std::collections::BTreeMap;

use crate::passes::Pass;

/// A gap longer than this begins a new traverse.
const GAP_NS: i64 = 30_000_000_000;
/// What a section is worth that agrees with the rest of its traverse...
const ALIKE: f64 = 1.0 / 3.0;
/// ... and one that stands out from it.
const STANDS_OUT: f64 = 0.8;
/// Below this share of matched frames a section was missed; above the other it was seen.
const MISSED: f64 = 0.25;
const SEEN: f64 = 0.5;
/// A section with fewer frames says nothing of the traverse.
const LEAST_FRAMES: i64 = 4;

/// The worth of every pass of every section, as the sections and their passes are ordered.
pub(crate) fn worths(sections: &[Vec<Pass>]) -> Vec<Vec<f64>> {
    let mut worths: Vec<Vec<f64>> = sections
        .iter()
        .map(|passes| vec![ALIKE; passes.len()])
        .collect();
    for traverse in traverses(sections) {
        let share = |&(section, pass): &(usize, usize)| {
            let pass = &sections[section][pass];
            (pass.exposed >= LEAST_FRAMES).then(|| pass.hit as f64 / pass.exposed as f64)
        };
        let shares: Vec<f64> = traverse.iter().filter_map(share).collect();
        let seen = shares.iter().filter(|share| **share >= SEEN).count();
        let missed = shares.iter().filter(|share| **share <= MISSED).count();
        for place in &traverse {
            let stands_out = match share(place) {
                Some(share) if share <= MISSED => seen >= 2,
                Some(share) if share >= SEEN => missed > seen,
                _ => false,
            };
            if stands_out {
                worths[place.0][place.1] = STANDS_OUT;
            }
        }
    }
    worths
}

/// The passes of each traverse, as (section, pass).
pub(crate) fn traverses(sections: &[Vec<Pass>]) -> Vec<Vec<(usize, usize)>> {
    let mut vehicles: BTreeMap<i64, Vec<(usize, usize)>> = BTreeMap::new();
    for (section, passes) in sections.iter().enumerate() {
        for (index, pass) in passes.iter().enumerate() {
            vehicles
                .entry(pass.vehicle)
                .or_default()
                .push((section, index));
        }
    }
    let pass = |(section, index): (usize, usize)| &sections[section][index];
    let mut traverses = Vec::new();
    for mut places in vehicles.into_values() {
        places.sort_by_key(|&place| (pass(place).first_ns, place));
        let is_near = |a: &(usize, usize), b: &(usize, usize)| {
            pass(*b).first_ns.saturating_sub(pass(*a).last_ns) <= GAP_NS
        };
        traverses.extend(places.chunk_by(is_near).map(<[(usize, usize)]>::to_vec));
    }
    traverses
}
