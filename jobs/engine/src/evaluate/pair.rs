//! Claims laid on true changes: which changes are found, and which claims are wrong.
//!
//! What is counted is changes found and wrong claims, and the result does not depend on how a
//! change is cut into records:
//!
//! * Claims are taken surest first. A claim covers a change where type and kind agree and it is on
//!   the same element at the same stations, or, where one of both has no element, within 1 m.
//! * What a claim covers that no surer one did counts; the pieces of a change add up. A change is
//!   **found** if at least half of it is covered. One claim may find several changes: a line that
//!   the truth cuts into ways and the claim does not.
//! * A claim that mostly covers what surer ones did is a **double**: one wrong claim.
//! * Pieces of a change that together cover less than half of it are **one** wrong claim.
//! * Claims on no true change are **one** wrong claim for each element and type, however many
//!   stretches they name; of additions, one each.
//!
//! A claim that runs on beyond its change is right: the sums of metres show how much it overreaches.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_schemas::ChangeRecord;

use super::claim::{Claim, Criteria, claims};
use super::known::Known;
use super::known::{Cover, PLACES};

/// Claims and true changes of one road network, with what covers what.
#[derive(Debug)]
pub(super) struct Laid<'a> {
    pub(super) claims: Vec<Claim<'a>>,
    /// For each claim the changes that it covers, and where.
    touches: Vec<Vec<(usize, Cover)>>,
    changes: usize,
}

/// What became of a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fate {
    /// A piece of a change that was found.
    Right,
    /// Under the claims that are one wrong claim: the first of them.
    Wrong {
        /// Index of the claim that stands for all of them.
        head: usize,
    },
    /// Below the threshold that was asked for.
    Unsaid,
}

/// What became of everything.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Paired {
    /// Of each claim.
    pub(super) fates: Vec<Fate>,
    /// Claims that cover each change, where they found it; else empty.
    pub(super) finders: Vec<Vec<usize>>,
    /// How much of each change is covered.
    pub(super) covers: Vec<Cover>,
}

impl Paired {
    pub(super) fn is_found(&self, change: usize) -> bool {
        !self.finders[change].is_empty()
    }

    /// Indices of the claims that stand for a wrong claim each.
    pub(super) fn wrong(&self) -> impl Iterator<Item = usize> + '_ {
        let heads = self.fates.iter().enumerate();
        heads.filter_map(|(index, fate)| (*fate == Fate::Wrong { head: index }).then_some(index))
    }
}

/// Why claims are one wrong claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Fault {
    /// They cover too little of this change.
    TooLittle(usize),
    /// They name this element, which has not changed so.
    NoChange(i64, i16),
    /// This claim by itself: a double, or an addition where there is none.
    Alone(usize),
}

impl<'a> Laid<'a> {
    /// Lays all records that claim anything at all under `criteria` on the changes.
    pub(super) fn new(
        records: &'a [ChangeRecord],
        known: &[Known<'_>],
        criteria: Criteria,
    ) -> Self {
        let claims = claims(records, criteria);
        let touched = |claim: &Claim<'_>| {
            let covers = known
                .iter()
                .map(|known| known.covered_by(claim))
                .enumerate();
            covers.filter(|(_, cover)| cover.places() > 0).collect()
        };
        Self {
            touches: claims.iter().map(touched).collect(),
            changes: known.len(),
            claims,
        }
    }

    /// What becomes of the claims with at least this posterior.
    pub(super) fn pair(&self, threshold: f64) -> Paired {
        let mut covers = vec![Cover::default(); self.changes];
        let mut pieces: Vec<Vec<usize>> = vec![Vec::new(); self.changes];
        let mut doubles = BTreeSet::new();
        let said = || (0..self.claims.len()).filter(|&i| self.claims[i].posterior >= threshold);
        for index in said() {
            let touches = &self.touches[index];
            let places = |cover: Cover| cover.places();
            let all: u32 = touches.iter().map(|&(_, cover)| places(cover)).sum();
            let new = |&(change, cover): &(usize, Cover)| cover.without(covers[change]);
            let fresh: u32 = touches.iter().map(|touch| places(new(touch))).sum();
            if all > 0 && 2 * fresh < all {
                doubles.insert(index);
                continue;
            }
            for &(change, cover) in touches {
                if places(cover.without(covers[change])) > 0 {
                    covers[change] = covers[change].with(cover);
                    pieces[change].push(index);
                }
            }
        }
        for (finders, cover) in pieces.iter_mut().zip(&covers) {
            if 2 * cover.places() < PLACES {
                finders.clear();
            }
        }
        let right: BTreeSet<usize> = pieces.iter().flatten().copied().collect();
        let mut fates = vec![Fate::Unsaid; self.claims.len()];
        let mut heads: BTreeMap<Fault, usize> = BTreeMap::new();
        for index in said() {
            fates[index] = if right.contains(&index) {
                Fate::Right
            } else {
                let fault = self.fault(index, doubles.contains(&index));
                let head = *heads.entry(fault).or_insert(index);
                Fate::Wrong { head }
            };
        }
        Paired {
            fates,
            finders: pieces,
            covers,
        }
    }

    /// Whether a claim covers something of a change that `is_one`.
    pub(super) fn touches_any(&self, claim: usize, is_one: impl Fn(usize) -> bool) -> bool {
        self.touches[claim]
            .iter()
            .any(|&(change, _)| is_one(change))
    }

    fn fault(&self, index: usize, is_double: bool) -> Fault {
        let record = self.claims[index].record;
        let most = self.touches[index]
            .iter()
            .max_by_key(|(change, cover)| (cover.places(), std::cmp::Reverse(*change)));
        match (most, record.element) {
            _ if is_double => Fault::Alone(index),
            (Some(&(change, _)), _) => Fault::TooLittle(change),
            (None, Some(element)) => Fault::NoChange(element, record.verdict),
            (None, None) => Fault::Alone(index),
        }
    }
}
