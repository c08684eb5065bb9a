//! What a tracked thing is, from what the network said of it frame by frame.
//!
//! Marking and colour of a line may change along the road: they are read from the second around a
//! frame. A sign stays what it is: its class is that of the whole track. A network that confuses two
//! classes says so in its confusion matrix, and many frames of one look are no many witnesses.

use tilefold_schemas::observation::{COLORS, MARKINGS, Observation, Seen};
use tilefold_schemas::{Color, Marking};

/// Share of the frames that speak for themselves: neighbours see the same paint in the same light.
const INDEPENDENT: f64 = 0.3;
/// Least posterior of a class that is said.
const SURE: f64 = 0.5;

/// How often a class is taken for another: rows are true, columns seen; rows sum to one.
#[derive(Debug, Clone, PartialEq)]
pub struct Confusion(Vec<Vec<f64>>);

impl Confusion {
    /// Of `size` classes, each right with this probability and any other equally often.
    #[must_use]
    pub fn even(size: usize, right: f64) -> Self {
        let wrong = (1.0 - right) / (size.max(2) - 1) as f64;
        let row = |truth: usize| {
            (0..size)
                .map(|seen| if seen == truth { right } else { wrong })
                .collect()
        };
        Self((0..size).map(row).collect())
    }

    /// Log-likelihood of each true class, for log-probabilities of what is seen; none of others.
    fn log_likelihoods(&self, seen: &[f64]) -> Option<Vec<f64>> {
        let seen: Vec<f64> = seen.iter().map(|log| log.exp()).collect();
        let of = |row: &Vec<f64>| {
            let sum: f64 = row.iter().zip(&seen).map(|(share, p)| share * p).sum();
            sum.max(1e-12).ln()
        };
        (seen.len() == self.0.len()).then(|| self.0.iter().map(of).collect())
    }
}

/// Confusion of markings and colours.
#[derive(Debug, Clone, PartialEq)]
pub struct Confusions {
    marking: Confusion,
    color: Confusion,
}

impl Default for Confusions {
    /// Nine of ten markings and nineteen of twenty colours are right.
    fn default() -> Self {
        Self {
            marking: Confusion::even(MARKINGS.len(), 0.9),
            color: Confusion::even(COLORS.len(), 0.95),
        }
    }
}

impl Confusions {
    /// What an observation says of every marking and colour that may be there.
    #[must_use]
    pub fn reading(&self, observation: &Observation) -> Reading {
        Reading {
            marking: self.marking.log_likelihoods(&observation.marking),
            color: self.color.log_likelihoods(&observation.color),
        }
    }
}

/// Log-likelihoods of markings and colours by one observation, each none if it says nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    marking: Option<Vec<f64>>,
    color: Option<Vec<f64>>,
}

/// How a line is painted, from the readings around a frame.
#[must_use]
pub fn marking(around: &[Reading]) -> Marking {
    let sure = likeliest(
        around
            .iter()
            .filter_map(|reading| reading.marking.as_deref()),
    );
    sure.map_or(Marking::Unknown, |index| MARKINGS[index])
}

/// Its colour.
#[must_use]
pub fn color(around: &[Reading]) -> Color {
    let sure = likeliest(around.iter().filter_map(|reading| reading.color.as_deref()));
    sure.map_or(Color::Unknown, |index| COLORS[index])
}

/// The class of the greatest posterior over equal priors, if it is sure.
fn likeliest<'a>(readings: impl Iterator<Item = &'a [f64]>) -> Option<usize> {
    let mut sums: Vec<f64> = Vec::new();
    let mut count = 0_u32;
    for reading in readings {
        sums.resize(reading.len(), 0.0);
        sums.iter_mut()
            .zip(reading)
            .for_each(|(sum, value)| *sum += value);
        count += 1;
    }
    // The first frame counts whole.
    let count = f64::from(count);
    let weight = (1.0 + INDEPENDENT * (count - 1.0)) / count;
    let best = (0..sums.len()).max_by(|a, b| sums[*a].total_cmp(&sums[*b]).then(b.cmp(a)))?;
    let norm: f64 = sums
        .iter()
        .map(|sum| ((sum - sums[best]) * weight).exp())
        .sum();
    (1.0 / norm >= SURE).then_some(best)
}

/// The class that the whole track speaks for most, by its scores.
#[must_use]
pub fn class<'a>(track: impl Iterator<Item = &'a Observation>) -> Option<Seen> {
    let mut scores: Vec<(Seen, f64)> = Vec::new();
    for observation in track {
        match scores
            .iter_mut()
            .find(|(seen, _)| *seen == observation.seen)
        {
            Some((_, sum)) => *sum += observation.score,
            None => scores.push((observation.seen, observation.score)),
        }
    }
    let by_score = |a: &&(Seen, f64), b: &&(Seen, f64)| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0));
    scores.iter().max_by(by_score).map(|(seen, _)| *seen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tilefold_schemas::observation::Place;

    fn line(dashed: f64) -> Observation {
        let mut marking = vec![((1.0 - dashed) / 6.0).ln(); 7];
        marking[1] = dashed.ln();
        Observation {
            seen: Seen::LaneMarking,
            place: Place::Line(vec![[0.0, 1.0], [1.0, 0.0]]),
            score: 0.9,
            marking,
            color: Vec::new(),
            appearance: Vec::new(),
        }
    }

    #[test]
    fn one_confused_frame_does_not_outvote_the_others() {
        let confusions = Confusions::default();
        let track = [0.9, 0.8, 0.05, 0.85].map(|dashed| confusions.reading(&line(dashed)));
        assert_eq!(marking(&track), Marking::Dashed);
        assert_eq!(color(&track), Color::Unknown);
        // What says nothing stays unknown.
        let vague = [confusions.reading(&line(1.0 / 7.0))];
        assert_eq!(marking(&vague), Marking::Unknown);
        assert_eq!(marking(&[]), Marking::Unknown);
    }
}
