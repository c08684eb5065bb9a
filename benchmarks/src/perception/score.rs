//! Counts of what was found of what is there, by class, and the scores that they give.

use std::collections::BTreeMap;

use serde::Serialize;

/// What was counted of one class. For lines these are points, and a wanted point may be found where
/// two found points lie: both sides are counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) wanted: u64,
    pub(super) wanted_found: u64,
    pub(super) found: u64,
    pub(super) found_right: u64,
}

/// Counts by class.
#[derive(Debug, Default)]
pub(super) struct ByClass(pub(super) BTreeMap<String, Counts>);

/// Precision, recall and F1 of one class.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Score {
    /// How many are there: points of lines, or boxes.
    pub(super) wanted: u64,
    pub(super) found: u64,
    pub(super) precision: Option<f64>,
    pub(super) recall: Option<f64>,
    pub(super) f1: Option<f64>,
}

/// Scores by class.
pub(super) type Scores = BTreeMap<String, Score>;

impl ByClass {
    pub(super) fn of(&mut self, class: &str) -> &mut Counts {
        self.0.entry(class.to_owned()).or_default()
    }

    pub(super) fn add(&mut self, other: &Self) {
        for (class, counts) in &other.0 {
            let own = self.of(class);
            own.wanted += counts.wanted;
            own.wanted_found += counts.wanted_found;
            own.found += counts.found;
            own.found_right += counts.found_right;
        }
    }

    pub(super) fn scores(&self) -> Scores {
        self.0
            .iter()
            .map(|(class, counts)| (class.clone(), counts.score()))
            .collect()
    }
}

impl Counts {
    fn score(self) -> Score {
        let precision = share(self.found_right, self.found);
        let recall = share(self.wanted_found, self.wanted);
        Score {
            wanted: self.wanted,
            found: self.found,
            precision,
            recall,
            f1: precision
                .zip(recall)
                .map(|(p, r)| 2.0 * p * r / (p + r).max(1e-12)),
        }
    }
}

fn share(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_are_counted() {
        let counts = Counts {
            wanted: 10,
            wanted_found: 8,
            found: 5,
            found_right: 2,
        };
        let score = counts.score();
        assert_eq!((score.precision, score.recall), (Some(0.4), Some(0.8)));
        assert!((score.f1.unwrap() - 0.64 / 1.2).abs() < 1e-12);
        assert_eq!(Counts::default().score().f1, None);
    }
}
