//! The `calibrated` fusion model: likelihood ratios of a detection model (method.md, section 9).
//!
//! A section is in one of a few states: in its place (within a small tolerance), gone, or shifted
//! by one of a grid of offsets. Every pass gives each state a log-likelihood: how often the line was
//! matched, and where its match lay. Frames of a pass are alike: the share of them that match is
//! drawn anew for each pass, so that the number of matches is Beta-binomial, and a pass counts once,
//! however many frames it has. Its influence is bounded. Log-likelihoods are quantised once a pass
//! and summed as integers.

use tilefold_schemas::fixed;

use crate::passes::Pass;
use crate::sensor::{SensorModel, beta_binomial};

/// How well a line can be seen, as shares of the sensor model's rate of matches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// From its own lane.
    pub near: f64,
    /// From other lanes; 0: it is matched no more often than if it were not there.
    pub aside: f64,
    /// Share of the lines that are so.
    pub prior: f64,
}

/// Lines differ in how well they can be seen: fresh paint, worn paint, and paint behind a barrier
/// or in the gutter, which nobody sees but from beside it. Which one a line is, is unknown, the same
/// for all passes, and summed over; so a line that is always hard to see is not taken for one that
/// is gone.
pub const LEVELS: [Level; 3] = [
    Level {
        near: 1.0,
        aside: 1.0,
        prior: 0.72,
    },
    Level {
        near: 0.6,
        aside: 0.6,
        prior: 0.2,
    },
    Level {
        near: 0.8,
        aside: 0.0,
        prior: 0.08,
    },
];
/// Below this visibility a pass looked from another lane.
const ASIDE_VISIBILITY: f64 = 0.5;
/// Frames that a pass is worth at most: more of them see the same.
const MOST_FRAMES: f64 = 12.0;
/// Share of every pass likelihood that is the mean over states: a pass moves at most about
/// ln(states / eta) nats.
pub const CONTAMINATION: f64 = 0.05;
/// Matched frames from which the residual counts as a whole measurement.
const FULL_RESIDUAL_HITS: f64 = 2.5;
/// A false match lies anywhere within the matching gate: its density per metre.
const FALSE_MATCH_DENSITY: f64 = 1.0 / 3.2;
/// Square root of the full circle: of the height of a normal density.
const SQRT_TAU: f64 = 2.506_628_274_631_000_5;
/// Offsets that still are "in its place", with their prior.
const TOLERANCE: [(f64, f64); 7] = [
    (-0.3, 0.04),
    (-0.2, 0.1),
    (-0.1, 0.2),
    (0.0, 0.32),
    (0.1, 0.2),
    (0.2, 0.1),
    (0.3, 0.04),
];
/// Shifts are considered from here...
const SHIFT_FROM_M: f64 = 0.4;
/// ... in steps of this ...
const SHIFT_STEP_M: f64 = 0.1;
/// ... this many to either side.
const SHIFTS: usize = 13;

/// Number of states.
pub const STATES: usize = 1 + LEVELS.len() * (TOLERANCE.len() + 2 * SHIFTS);

/// What a state claims.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Claim {
    /// Not on the road.
    Removed,
    /// Where the map has it.
    InPlace {
        /// Lateral offset within the tolerance.
        offset_m: f64,
    },
    /// Beside where the map has it.
    Shifted {
        /// Lateral offset, positive to the left.
        offset_m: f64,
    },
}

/// A state of a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// What it claims.
    pub claim: Claim,
    /// Which of [`LEVELS`]; none for what is not there.
    pub level: Option<usize>,
    /// Share of the prior within its claim.
    pub share: f64,
}

/// All states.
#[must_use]
pub fn states() -> Vec<State> {
    let removed = State {
        claim: Claim::Removed,
        level: None,
        share: 1.0,
    };
    let in_place = TOLERANCE.map(|(offset_m, share)| (Claim::InPlace { offset_m }, share));
    let shifted = (0..2 * SHIFTS).map(|shift| {
        let size = SHIFT_FROM_M + SHIFT_STEP_M * (shift / 2) as f64;
        let offset_m = if shift % 2 == 0 { size } else { -size };
        (Claim::Shifted { offset_m }, 1.0 / (2 * SHIFTS) as f64)
    });
    let present: Vec<(Claim, f64)> = in_place.into_iter().chain(shifted).collect();
    let levels = (0..LEVELS.len()).flat_map(|level| {
        present.iter().map(move |&(claim, share)| State {
            claim,
            level: Some(level),
            share: share * LEVELS[level].prior,
        })
    });
    std::iter::once(removed).chain(levels).collect()
}

/// Log-likelihood of every state, summed over passes with their worths, fixed point.
#[must_use]
pub fn log_likelihoods(
    passes: &[Pass],
    worths: &[f64],
    states: &[State],
    sensor: &SensorModel,
) -> Vec<i64> {
    let mut sums = vec![0_i64; states.len()];
    for (pass, worth) in passes.iter().zip(worths) {
        let bounded = bounded(&pass_log_likelihoods(pass, states, sensor), states);
        for (sum, nats) in sums.iter_mut().zip(bounded) {
            *sum += fixed::from_f64(worth * nats);
        }
    }
    sums
}

fn pass_log_likelihoods(pass: &Pass, states: &[State], sensor: &SensorModel) -> Vec<f64> {
    let frames = pass.exposed.max(1) as f64;
    let share = (pass.hit as f64).min(frames) / frames;
    let worth = frames.min(MOST_FRAMES);
    let (hits, misses) = (worth * share, worth * (1.0 - share));
    let visibility = pass.visibility().clamp(0.0, 1.0);
    let absent = beta_binomial(hits, misses, sensor.absent, sensor.absent_concentration);
    let rate = sensor.present_at(visibility);
    let present = LEVELS.map(|level| {
        let share = match visibility < ASIDE_VISIBILITY {
            true => level.aside,
            false => level.near,
        };
        match share > 0.0 {
            true => beta_binomial(hits, misses, share * rate, sensor.present_concentration),
            false => absent,
        }
    });
    // The residual counts as one measurement, or less if there are few hits; what is seen from the
    // side is placed worse. A false match lies anywhere.
    let sigma_m = sensor.pass_sigma_m * (2.0 - visibility);
    let whole = (hits / FULL_RESIDUAL_HITS).min(1.0);
    let residual = pass.residual_m().map(|residual_m| (residual_m, whole));
    let off = |offset_m: f64| {
        residual.map_or(0.0, |(residual_m, weight)| {
            let z = (residual_m - offset_m) / sigma_m;
            let near = libm::exp(-0.5 * z * z) / (sigma_m * SQRT_TAU);
            let stray = sensor.residual_outliers;
            weight * libm::log((1.0 - stray) * near + stray * FALSE_MATCH_DENSITY)
        })
    };
    let anywhere = residual.map_or(0.0, |(_, weight)| weight * libm::log(FALSE_MATCH_DENSITY));
    let of_state = |state: &State| match state.claim {
        Claim::Removed => absent + anywhere,
        Claim::InPlace { offset_m } | Claim::Shifted { offset_m } => {
            state.level.map_or(absent, |level| present[level]) + off(offset_m)
        }
    };
    states.iter().map(of_state).collect()
}

/// Mixes a pass's likelihoods with their mean over claims, so that no pass can rule anything out.
/// Relative to that mean, so that a pass that tells nothing adds nothing.
fn bounded(logs: &[f64], states: &[State]) -> Vec<f64> {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut mean = 0.0;
    for (state, log) in states.iter().zip(logs) {
        mean += state.share * libm::exp(log - most) / 3.0;
    }
    let mixed = |log: &f64| {
        let mixed = (1.0 - CONTAMINATION) * libm::exp(log - most) + CONTAMINATION * mean;
        libm::log(mixed / mean)
    };
    logs.iter().map(mixed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn priors_within_each_claim_sum_to_one() {
        let share = |is: fn(&Claim) -> bool| -> f64 {
            let states = states();
            let of = states.iter().filter(|state| is(&state.claim));
            of.map(|state| state.share).sum()
        };
        assert!((share(|c| matches!(c, Claim::Removed)) - 1.0).abs() < 1e-12);
        assert!((share(|c| matches!(c, Claim::InPlace { .. })) - 1.0).abs() < 1e-12);
        assert!((share(|c| matches!(c, Claim::Shifted { .. })) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn no_pass_moves_the_odds_by_more_than_its_bound() {
        let states = states();
        let mut wild = vec![0.0; states.len()];
        wild[0] = -500.0;
        let bounded = bounded(&wild, &states);
        assert!(bounded[1] - bounded[0] < (3.0_f64 / CONTAMINATION).ln() + 1.0);
    }
}
