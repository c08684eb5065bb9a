//! The `calibrated` fusion model: likelihood ratios of a detection model (method.md, section 9).
//!
//! A section is in one of a few states: in its place (within a small tolerance), gone, or shifted
//! by one of a grid of offsets. Every pass gives each state a log-likelihood: whether the line was
//! matched as often as its visibility lets expect, and where its match lay. A pass counts once,
//! however many frames it has, and its influence is bounded. Log-likelihoods are quantised once a
//! pass and summed as integers.

use tilefold_schemas::fixed;

use crate::passes::Pass;

/// P(match | present, fully visible, exposed), in which lines differ from each other: fresh paint
/// on a quiet lane, and worn paint behind a crash barrier. Which of these levels a line has is
/// unknown, the same for all passes, and summed over with this prior; so a line that is always
/// hard to see is not taken for one that is gone.
pub const DETECTION: [(f64, f64); 3] = [(0.85, 0.5), (0.6, 0.3), (0.35, 0.2)];
/// P(match | absent).
pub const FALSE_MATCH: f64 = 0.06;
/// Correlation of frames within a pass: n frames are worth n / (1 + (n - 1) rho).
pub const FRAME_CORRELATION: f64 = 0.4;
/// Share of every pass likelihood that is the mean over states: a pass moves at most about
/// ln(states / eta) nats.
pub const CONTAMINATION: f64 = 0.05;
/// Standard deviation of a pass's mean residual about the truth: registration, map and vehicle
/// together, in metres.
pub const PASS_SIGMA_M: f64 = 0.3;
/// A false match lies anywhere within the matching gate: its density per metre.
const FALSE_MATCH_DENSITY: f64 = 1.0 / 3.2;
/// Square root of the full circle: of the height of a normal density.
const SQRT_TAU: f64 = 2.506_628_274_631_000_5;
/// Offsets that still are "in its place", with their prior.
const TOLERANCE: [(f64, f64); 5] = [(-0.2, 0.1), (-0.1, 0.2), (0.0, 0.4), (0.1, 0.2), (0.2, 0.1)];
/// Shifts are considered from here...
const SHIFT_FROM_M: f64 = 0.5;
/// ... in steps of this ...
const SHIFT_STEP_M: f64 = 0.1;
/// ... this many to either side.
const SHIFTS: usize = 12;

/// Number of states.
pub const STATES: usize = 1 + DETECTION.len() * (TOLERANCE.len() + 2 * SHIFTS);

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
    /// P(match) at full visibility.
    pub detection: f64,
    /// Share of the prior within its claim.
    pub share: f64,
}

/// All states.
#[must_use]
pub fn states() -> Vec<State> {
    let removed = State {
        claim: Claim::Removed,
        detection: FALSE_MATCH,
        share: 1.0,
    };
    let in_place = TOLERANCE.map(|(offset_m, share)| (Claim::InPlace { offset_m }, share));
    let shifted = (0..2 * SHIFTS).map(|shift| {
        let size = SHIFT_FROM_M + SHIFT_STEP_M * (shift / 2) as f64;
        let offset_m = if shift % 2 == 0 { size } else { -size };
        (Claim::Shifted { offset_m }, 1.0 / (2 * SHIFTS) as f64)
    });
    let present: Vec<(Claim, f64)> = in_place.into_iter().chain(shifted).collect();
    let levels = DETECTION.iter().flat_map(|&(detection, level)| {
        present.iter().map(move |&(claim, share)| State {
            claim,
            detection,
            share: share * level,
        })
    });
    std::iter::once(removed).chain(levels).collect()
}

/// Log-likelihood of every state, summed over passes, fixed point.
#[must_use]
pub fn log_likelihoods(passes: &[Pass], states: &[State]) -> Vec<i64> {
    let mut sums = vec![0_i64; states.len()];
    for pass in passes {
        let bounded = bounded(&pass_log_likelihoods(pass, states), states);
        for (sum, nats) in sums.iter_mut().zip(bounded) {
            *sum += fixed::from_f64(nats);
        }
    }
    sums
}

fn pass_log_likelihoods(pass: &Pass, states: &[State]) -> Vec<f64> {
    let frames = pass.exposed.max(1) as f64;
    let hits = (pass.hit as f64).min(frames);
    let worth = 1.0 / (1.0 + (frames - 1.0) * FRAME_CORRELATION);
    let visibility = pass.visibility().clamp(0.0, 1.0);
    let matched = |detection: f64| {
        let p = visibility * detection + (1.0 - visibility) * FALSE_MATCH;
        worth * (hits * libm::log(p) + (frames - hits) * libm::log(1.0 - p))
    };
    // The residual counts as one measurement, or less if there are fewer effective hits; what is
    // seen from the side is placed worse.
    let sigma_m = PASS_SIGMA_M * (2.0 - visibility);
    let residual = pass.residual_m().map(|r| (r, (worth * hits).min(1.0)));
    let off = |offset_m: f64| {
        residual.map_or(0.0, |(residual_m, weight)| {
            let z = (residual_m - offset_m) / sigma_m;
            weight * (-0.5 * z * z - libm::log(sigma_m * SQRT_TAU))
        })
    };
    let anywhere = residual.map_or(0.0, |(_, weight)| weight * libm::log(FALSE_MATCH_DENSITY));
    let of_state = |state: &State| match state.claim {
        Claim::Removed => matched(state.detection) + anywhere,
        Claim::InPlace { offset_m } | Claim::Shifted { offset_m } => {
            matched(state.detection) + off(offset_m)
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
