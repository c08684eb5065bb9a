//! The states that a section of a line can be in, and what is held of them before anything is seen.
//!
//! A section is gone, in its place, or beside it. How well it can be seen is unknown, the same for
//! all passes, and part of the state. What is in its place does not lie exactly where the map has
//! it, and a change may be small: whether an offset is a change is a matter of how far unchanged
//! lines of this fleet and map usually lie off.

use crate::sensor::SensorModel;

/// How well a line can be seen, as shares of the sensor model's rate of matches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// From its own lane.
    pub near: f64,
    /// From other lanes; 0: it is matched no more often than if it were not there.
    pub aside: f64,
}

/// Lines differ in how well they can be seen: fresh paint, worn paint, and paint behind a barrier
/// or in the gutter, which nobody sees but from beside it. Which one a line is, is unknown, the same
/// for all passes, and summed over; so a line that is always hard to see is not taken for one that
/// is gone.
pub const LEVELS: [Level; 3] = [
    Level {
        near: 1.0,
        aside: 1.0,
    },
    Level {
        near: 0.6,
        aside: 0.6,
    },
    Level {
        near: 0.8,
        aside: 0.0,
    },
];

/// Grid of offsets, in metres.
const STEP_M: f64 = 0.1;
/// What is in its place lies within so many steps of it...
const PLACES: i32 = 12;
/// ... and what was moved, at least this many and at most that many off: less than two decimetres
/// is no change, and beyond the matching gate nothing is matched.
const SHIFTS: (i32, i32) = (2, 16);
/// Share of unchanged lines whose place is much worse known, and how much worse.
const ILL_PLACED: (f64, f64) = (0.02, 2.0);
/// An offset wanders by about this much from section to section, in metres.
const WANDER_M: f64 = 0.06;
/// Affinity of sections that differ in how well they can be seen, relative to those that do not.
const OTHER_LEVEL: f64 = 0.1;

/// What a state claims.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Claim {
    /// Not on the road.
    Removed,
    /// Where the map has it, as nearly as unchanged lines are.
    InPlace,
    /// Beside where the map has it.
    Shifted,
}

/// A state of a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// What it claims.
    pub claim: Claim,
    /// Which of [`LEVELS`]; none for what is not there.
    pub level: Option<usize>,
    /// Lateral offset, positive to the left, in metres; 0 for what is not there.
    pub offset_m: f64,
    /// Share of the prior within its claim.
    pub share: f64,
}

/// All states of a line, their prior, and how they go over into each other along it.
#[derive(Debug, Clone, PartialEq)]
pub struct Space {
    /// The states; the first is "removed".
    pub states: Vec<State>,
    /// Prior of each state.
    pub prior: Vec<f64>,
    /// `kin[a][b]` is the chance of state `b` after state `a` on a line of one piece.
    pub kin: Vec<Vec<f64>>,
}

impl Space {
    /// The states of a line whose unchanged place is known to this standard deviation, in metres.
    #[must_use]
    pub fn new(place_sigma_m: f64, sensor: &SensorModel) -> Self {
        let states = states(place_sigma_m, sensor.levels);
        let (removed, shifted) = (sensor.removed, sensor.shifted);
        let prior = states
            .iter()
            .map(|state| match state.claim {
                Claim::Removed => state.share * removed,
                Claim::InPlace => state.share * (1.0 - removed - shifted),
                Claim::Shifted => state.share * shifted,
            })
            .collect();
        let kin = kin(&states);
        Self { states, prior, kin }
    }

    /// The prior after a change: every claim is as likely.
    #[must_use]
    pub fn prior_after_change(&self) -> Vec<f64> {
        self.states.iter().map(|state| state.share / 3.0).collect()
    }
}

/// Claim by claim, so that what goes over into each other lies together.
fn states(place_sigma_m: f64, levels: [f64; LEVELS.len()]) -> Vec<State> {
    let removed = State {
        claim: Claim::Removed,
        level: None,
        offset_m: 0.0,
        share: 1.0,
    };
    let of_claim = |claim, steps: Vec<(i32, f64)>| {
        levels
            .into_iter()
            .enumerate()
            .flat_map(move |(level, prior)| {
                let state = move |&(steps, share): &(i32, f64)| State {
                    claim,
                    level: Some(level),
                    offset_m: f64::from(steps) * STEP_M,
                    share: share * prior,
                };
                steps.iter().map(state).collect::<Vec<_>>()
            })
    };
    let places = (-PLACES..=PLACES).map(|steps| (steps, in_place(steps, place_sigma_m)));
    let shifts = (-SHIFTS.1..=SHIFTS.1).filter(|steps| steps.abs() >= SHIFTS.0);
    let each = 1.0 / f64::from(2 * (SHIFTS.1 - SHIFTS.0 + 1));
    std::iter::once(removed)
        .chain(of_claim(Claim::InPlace, places.collect()))
        .chain(of_claim(
            Claim::Shifted,
            shifts.map(|steps| (steps, each)).collect(),
        ))
        .collect()
}

/// Prior that what is in its place lies in a cell of the grid; all cells sum to one.
fn in_place(steps: i32, place_sigma_m: f64) -> f64 {
    let cell = |scale: f64| {
        let at = |steps: f64| 0.5 * libm::erf(steps * STEP_M / (scale * place_sigma_m * SQRT_2));
        let within = at(f64::from(PLACES) + 0.5) - at(-f64::from(PLACES) - 0.5);
        (at(f64::from(steps) + 0.5) - at(f64::from(steps) - 0.5)) / within
    };
    let (ill, worse) = ILL_PLACED;
    (1.0 - ill) * cell(1.0) + ill * cell(worse)
}

const SQRT_2: f64 = std::f64::consts::SQRT_2;

/// Within a claim, offset and detectability may wander to the next ones from section to section.
fn kin(states: &[State]) -> Vec<Vec<f64>> {
    // Offsets differ by whole steps: their affinities are few.
    let near: Vec<f64> = (0..=2 * SHIFTS.1)
        .map(|steps| {
            let z = f64::from(steps) * STEP_M / WANDER_M;
            libm::exp(-0.5 * z * z)
        })
        .collect();
    let affinity = |a: &State, b: &State| {
        if a.claim != b.claim {
            return 0.0;
        }
        let steps = ((a.offset_m - b.offset_m).abs() / STEP_M).round() as usize;
        let level = if a.level == b.level { 1.0 } else { OTHER_LEVEL };
        near[steps] * level
    };
    let row = |from: &State| {
        let row: Vec<f64> = states.iter().map(|to| affinity(from, to)).collect();
        let total: f64 = row.iter().sum();
        row.iter().map(|value| value / total).collect()
    };
    states.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn priors_sum_to_one_within_each_claim_and_in_all() {
        for sigma_m in [0.02, 0.1, 0.6] {
            let space = Space::new(sigma_m, &SensorModel::default());
            for claim in [Claim::Removed, Claim::InPlace, Claim::Shifted] {
                let of = space.states.iter().filter(|state| state.claim == claim);
                let sum: f64 = of.map(|state| state.share).sum();
                assert!((sum - 1.0).abs() < 1e-9, "{claim:?} {sigma_m}: {sum}");
            }
            assert!((space.prior.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            assert!(
                space
                    .kin
                    .iter()
                    .all(|row| (row.iter().sum::<f64>() - 1.0).abs() < 1e-9)
            );
        }
    }

    #[test]
    fn the_better_the_map_the_smaller_the_offset_that_is_a_change() {
        let odds = |sigma_m: f64| {
            let space = Space::new(sigma_m, &SensorModel::default());
            let of = |claim| -> f64 {
                let at = space.states.iter().zip(&space.prior);
                at.filter(|(state, _)| state.claim == claim && (state.offset_m - 0.4).abs() < 1e-9)
                    .map(|(_, prior)| prior)
                    .sum()
            };
            of(Claim::Shifted) / of(Claim::InPlace)
        };
        assert!(odds(0.04) > 3.0, "{}", odds(0.04));
        assert!(odds(0.2) < 0.1, "{}", odds(0.2));
    }
}
