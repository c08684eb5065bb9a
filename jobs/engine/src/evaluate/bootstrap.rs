//! Bootstrap intervals over places (Efron 1979): as many places as there are, drawn with
//! replacement, again and again; the middle 95 % of what comes out is the interval.
//!
//! How often a place is drawn is drawn once and used for every score, so that scores of one
//! evaluation can be compared. Everything before the last division is integers.

use std::collections::{BTreeMap, BTreeSet};

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

use super::place::Place;
use super::score::{Counts, Found, Interval, Score};

/// Resamples.
pub(super) const RESAMPLES: usize = 1_000;
/// One in so many resamples lies beyond either end of an interval.
const TAIL: usize = 40;

/// How often each place is drawn in each resample.
pub(super) struct Resamples {
    /// Places in order, and the row of each in `times`.
    places: BTreeMap<Place, usize>,
    /// For each resample how often each place was drawn.
    times: Vec<Vec<u16>>,
}

impl Resamples {
    /// Draws from all `places`, also from those where nothing is counted.
    pub(super) fn draw(places: &BTreeSet<Place>, seed: u64) -> Self {
        let mut generator = Pcg64Mcg::seed_from_u64(seed);
        let count = places.len();
        let mut resample = || {
            let mut times = vec![0_u16; count];
            for _ in 0..count {
                // The high half of a product: uniform to one in 2^64 / count.
                let lot = (u128::from(generator.next_u64()) * count as u128) >> 64;
                let drawn = &mut times[lot as usize];
                *drawn = drawn.saturating_add(1);
            }
            times
        };
        Self {
            times: (0..RESAMPLES).map(|_| resample()).collect(),
            places: places.iter().copied().zip(0..).collect(),
        }
    }

    /// What would have been counted in each resample.
    fn counts(&self, by_place: &BTreeMap<Place, Counts>) -> Vec<Counts> {
        let counted: Vec<(usize, &Counts)> = by_place
            .iter()
            .filter_map(|(place, counts)| Some((*self.places.get(place)?, counts)))
            .collect();
        let sum = |times: &Vec<u16>| {
            let mut sum = Counts::default();
            for &(place, counts) in &counted {
                sum.add(counts, u64::from(times[place]));
            }
            sum
        };
        self.times.iter().map(sum).collect()
    }

    /// The interval of a figure; none where there is but one place, or where most resamples do not
    /// have the figure.
    fn interval(
        &self,
        resampled: &[Counts],
        figure: impl Fn(&Counts) -> Option<f64>,
    ) -> Option<Interval> {
        let mut figures: Vec<f64> = resampled.iter().filter_map(figure).collect();
        if self.places.len() < 2 || 2 * figures.len() < RESAMPLES {
            return None;
        }
        figures.sort_by(f64::total_cmp);
        let tail = figures.len() / TAIL;
        Some([figures[tail], figures[figures.len() - 1 - tail]])
    }

    /// The score of what was counted, with its intervals.
    pub(super) fn score(&self, by_place: &BTreeMap<Place, Counts>) -> Score {
        let all = total(by_place);
        let resampled = self.counts(by_place);
        Score {
            truth: all.truth,
            claimed: all.found + all.wrong,
            right: all.found,
            precision: all.precision(),
            recall: all.recall(),
            f1: all.f1(),
            precision_95: self.interval(&resampled, Counts::precision),
            recall_95: self.interval(&resampled, Counts::recall),
            f1_95: self.interval(&resampled, Counts::f1),
        }
    }

    /// The recall of what was counted, with its interval.
    pub(super) fn found(&self, by_place: &BTreeMap<Place, Counts>) -> Found {
        let score = self.score(by_place);
        Found {
            truth: score.truth,
            right: score.right,
            recall: score.recall,
            recall_95: score.recall_95,
        }
    }
}

fn total(by_place: &BTreeMap<Place, Counts>) -> Counts {
    let mut total = Counts::default();
    for counts in by_place.values() {
        total.add(counts, 1);
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::place::Grid;
    use tilefold_formats::geojson::{Shape, TruthChange};
    use tilefold_schemas::{ElementKind, Verdict};

    /// `count` places along a meridian.
    fn places(count: usize) -> Vec<Place> {
        let grid = Grid {
            network: 0,
            side_m: 500.0,
        };
        let place = |number: usize| {
            grid.of_change(&TruthChange {
                element_id: None,
                change_type: Verdict::Added,
                kind: ElementKind::LaneMarking,
                from_m: None,
                to_m: None,
                detail: None,
                since_ns: None,
                shape: Shape::Point,
                points: vec![[10.0, 50.0 + 0.01 * number as f64, 0.0]],
            })
        };
        (0..count).map(place).collect()
    }

    /// One change a place, found in the first `found` of them.
    fn counted(places: &[Place], found: usize) -> BTreeMap<Place, Counts> {
        let counts = |index| Counts {
            truth: 1,
            found: u64::from(index < found),
            wrong: 0,
        };
        (places.iter().copied().zip((0..).map(counts))).collect()
    }

    #[test]
    fn the_interval_is_that_of_the_binomial() {
        // 400 places with one change each, 300 found: a resample's recall is Binomial(400, 3/4) / 400,
        // with standard deviation sqrt(0.75 * 0.25 / 400) = 0.02165; 95 % are 0.75 -+ 1.96 of it.
        let places = places(400);
        let resamples = Resamples::draw(&places.iter().copied().collect(), 7);
        let score = resamples.score(&counted(&places, 300));
        let [low, high] = score.recall_95.unwrap();
        assert!((low - 0.7076).abs() < 0.006, "{low}");
        assert!((high - 0.7924).abs() < 0.006, "{high}");
        // All claims are right, in every resample.
        assert_eq!(score.precision_95, Some([1.0, 1.0]));
        assert_eq!((score.truth, score.claimed, score.right), (400, 300, 300));
    }

    #[test]
    fn changes_of_one_place_count_together() {
        // The same 300 of 400, but all of a place have one fate: four places, three of them found.
        let four = places(4);
        let counts = |index| Counts {
            truth: 100,
            found: if index < 3 { 100 } else { 0 },
            wrong: 0,
        };
        let by_place = four.iter().copied().zip((0..).map(counts)).collect();
        let resamples = Resamples::draw(&four.into_iter().collect(), 7);
        let [low, high] = resamples.score(&by_place).recall_95.unwrap();
        // P(recall <= 1/4) = 13/256 = 0.051 and P(0) = 1/256: the lower 2.5 % end at 1/4.
        assert_eq!([low, high], [0.25, 1.0]);
    }

    #[test]
    fn the_same_seed_draws_the_same() {
        let places = places(30);
        let all: BTreeSet<Place> = places.iter().copied().collect();
        let draw = |seed| Resamples::draw(&all, seed);
        assert_eq!(draw(1).times, draw(1).times);
        assert_ne!(draw(1).times, draw(2).times);
        let counted = counted(&places, 20);
        assert_eq!(draw(1).score(&counted), draw(1).score(&counted));
    }

    #[test]
    fn one_place_has_no_interval() {
        let one = places(1);
        let resamples = Resamples::draw(&one.iter().copied().collect(), 1);
        let score = resamples.score(&counted(&one, 1));
        assert_eq!((score.recall, score.recall_95), (Some(1.0), None));
        // Nor has a figure that most resamples lack.
        assert_eq!(score.precision_95, None);
    }

    #[test]
    fn every_place_is_drawn_as_often_as_any_other() {
        let all: BTreeSet<Place> = places(10).into_iter().collect();
        let resamples = Resamples::draw(&all, 3);
        for place in 0..10 {
            let drawn: u32 = resamples.times.iter().map(|t| u32::from(t[place])).sum();
            // 10,000 draws, a tenth each: 1,000 with a standard deviation of 30.
            assert!((880..1120).contains(&drawn), "{place}: {drawn}");
        }
    }
}
