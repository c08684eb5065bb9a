//! Precision, recall and F1 from counts.

use serde::Serialize;

/// What is counted of one kind of change, in one place or in all.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Counts {
    /// True changes.
    pub(super) truth: u64,
    /// Of these, found.
    pub(super) found: u64,
    /// Wrong claims.
    pub(super) wrong: u64,
}

impl Counts {
    pub(super) fn add(&mut self, other: &Self, times: u64) {
        self.truth += times * other.truth;
        self.found += times * other.found;
        self.wrong += times * other.wrong;
    }

    /// Share of claims that are right; none without claims.
    pub(super) fn precision(&self) -> Option<f64> {
        share(self.found, self.found + self.wrong)
    }

    /// Share of true changes that are found; none without any.
    pub(super) fn recall(&self) -> Option<f64> {
        share(self.found, self.truth)
    }

    /// Harmonic mean of both; none where one of them is, or both are 0.
    pub(super) fn f1(&self) -> Option<f64> {
        let (precision, recall) = (self.precision()?, self.recall()?);
        (precision + recall > 0.0).then(|| 2.0 * precision * recall / (precision + recall))
    }
}

fn share(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

/// A 95 % interval: its lower and upper end.
pub type Interval = [f64; 2];

/// Precision and recall of one kind of change.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Score {
    /// True changes.
    pub truth: u64,
    /// Claims: the right and the wrong ones.
    pub claimed: u64,
    /// True changes that were found: each is one right claim.
    pub right: u64,
    /// Share of claims that are right; null without claims.
    pub precision: Option<f64>,
    /// Share of true changes that were claimed; null without any.
    pub recall: Option<f64>,
    /// Harmonic mean of both; null where one of them is, or both are 0.
    pub f1: Option<f64>,
    /// Bootstrap interval of the precision over places; null where places are too few.
    pub precision_95: Option<Interval>,
    /// Bootstrap interval of the recall.
    pub recall_95: Option<Interval>,
    /// Bootstrap interval of F1.
    pub f1_95: Option<Interval>,
}

/// How many changes of one kind were found; claims do not say their detail, so that there is no
/// precision.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Found {
    /// True changes.
    pub truth: u64,
    /// Of these, found.
    pub right: u64,
    /// Their share.
    pub recall: Option<f64>,
    /// Its bootstrap interval.
    pub recall_95: Option<Interval>,
}
