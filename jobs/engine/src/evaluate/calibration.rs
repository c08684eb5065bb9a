//! Calibration: whether P(change) is a probability. Expected calibration error over 15 bins of
//! equal width (Naeini et al. 2015), the Brier score, and the reliability of each bin.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use tilefold_formats::geojson::TruthChange;
use tilefold_schemas::{ChangeRecord, Verdict};

use super::claim::{Claim, Criteria};

/// Bins of the expected calibration error.
pub const BINS: usize = 15;

/// A bin of the reliability plot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Least probability in it.
    pub from: f64,
    /// Greatest probability in it; it belongs to the next bin, except in the last.
    pub to: f64,
    /// Judged elements in it.
    pub count: u64,
    /// Mean probability of change; null without elements.
    pub mean_p: Option<f64>,
    /// Share of them that changed; null without elements.
    pub changed_share: Option<f64>,
}

/// How well probabilities are kept, over judged elements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// Expected calibration error over 15 bins; null without judged elements.
    pub ece: Option<f64>,
    /// Mean squared error of P(change); null without judged elements.
    pub brier: Option<f64>,
    /// The bins, in order.
    pub bins: Vec<Bin>,
}

/// Claims on elements that the truth does not mention.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Control {
    /// Unchanged elements with enough vehicles to be judged.
    pub judged: usize,
    /// Of these, claimed as changed.
    pub claimed: usize,
}

/// What is said of one element that enough vehicles looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Judged {
    /// P(change) of its surest stretch.
    pub(super) p: f64,
    /// Whether the truth says so.
    pub(super) has_changed: bool,
    /// Whether it is claimed.
    pub(super) is_claimed: bool,
}

/// The judged elements of a network, by id. An element that was added has none, and no probability
/// where nothing was seen: additions are left out.
pub(super) fn judged(
    records: &[ChangeRecord],
    truth: &[TruthChange],
    criteria: Criteria,
) -> Vec<Judged> {
    let mapped = truth
        .iter()
        .filter(|change| change.change_type != Verdict::Added);
    let changed: BTreeSet<i64> = mapped.filter_map(|change| change.element_id).collect();
    let mut elements: BTreeMap<i64, Judged> = BTreeMap::new();
    for record in records {
        let Some(element) = record.element else {
            continue;
        };
        if record.vehicles < criteria.min_vehicles {
            continue;
        }
        let judged = elements.entry(element).or_insert(Judged {
            p: 0.0,
            has_changed: changed.contains(&element),
            is_claimed: false,
        });
        judged.p = judged.p.max(1.0 - record.p_no_change);
        judged.is_claimed |= Claim::of(record, criteria).is_some();
    }
    elements.into_values().collect()
}

/// Unchanged elements, and how many of them are claimed.
pub(super) fn control(judged: &[Judged]) -> Control {
    let unchanged = || judged.iter().filter(|judged| !judged.has_changed);
    Control {
        judged: unchanged().count(),
        claimed: unchanged().filter(|judged| judged.is_claimed).count(),
    }
}

/// Sums over one bin.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: u64,
    p: f64,
    changed: u64,
}

/// Calibration over judged elements.
pub(super) fn calibration(judged: &[Judged]) -> Calibration {
    let mut bins = [Sums::default(); BINS];
    let mut square = 0.0;
    for Judged { p, has_changed, .. } in judged {
        let bin = &mut bins[((p * BINS as f64) as usize).min(BINS - 1)];
        bin.count += 1;
        bin.p += p;
        bin.changed += u64::from(*has_changed);
        square += (p - f64::from(u8::from(*has_changed))).powi(2);
    }
    let count = judged.len() as f64;
    let gap: f64 = bins
        .iter()
        .map(|bin| (bin.p - bin.changed as f64).abs())
        .sum();
    let mean = |sum: f64| (count > 0.0).then(|| sum / count);
    Calibration {
        ece: mean(gap),
        brier: mean(square),
        bins: bins.iter().enumerate().map(reliability).collect(),
    }
}

fn reliability((index, sums): (usize, &Sums)) -> Bin {
    let mean = |sum: f64| (sums.count > 0).then(|| sum / sums.count as f64);
    Bin {
        from: index as f64 / BINS as f64,
        to: (index + 1) as f64 / BINS as f64,
        count: sums.count,
        mean_p: mean(sums.p),
        changed_share: mean(sums.changed as f64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(p: f64, has_changed: bool) -> Judged {
        Judged {
            p,
            has_changed,
            is_claimed: false,
        }
    }

    #[test]
    fn four_elements_by_hand() {
        // Bin 0: 0.02 and 0.04, none changed: |0.03 - 0| * 2. Bin 13 (0.867 to 0.933): 0.9 changed and
        // 0.9 not: |0.9 - 0.5| * 2. ECE = (0.06 + 0.8) / 4; Brier = (0.0004 + 0.0016 + 0.01 + 0.81) / 4.
        let found = calibration(&[
            judged(0.02, false),
            judged(0.04, false),
            judged(0.9, true),
            judged(0.9, false),
        ]);
        assert!((found.ece.unwrap() - 0.215).abs() < 1e-12);
        assert!((found.brier.unwrap() - 0.2055).abs() < 1e-12);
        let bin = found.bins[13];
        assert_eq!((bin.count, bin.changed_share), (2, Some(0.5)));
        assert!((bin.mean_p.unwrap() - 0.9).abs() < 1e-12);
        assert_eq!(found.bins[5].mean_p, None);
    }

    #[test]
    fn certainty_is_in_the_last_bin() {
        let found = calibration(&[judged(1.0, true)]);
        assert_eq!(found.bins[BINS - 1].count, 1);
        assert_eq!((found.ece, found.brier), (Some(0.0), Some(0.0)));
    }

    #[test]
    fn without_elements_there_is_nothing_to_calibrate() {
        let found = calibration(&[]);
        assert_eq!((found.ece, found.brier), (None, None));
        assert_eq!(found.bins.len(), BINS);
    }
}
