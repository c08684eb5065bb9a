//! The `calibrated` fusion model: likelihood ratios of a detection model (method.md, section 9).
//!
//! A section is in one of a few states: in its place (within a small tolerance), gone, or shifted
//! by one of a grid of offsets. Every pass gives each state a log-likelihood: whether the line was
//! matched as often as its visibility lets expect, and where its match lay. A pass counts once,
//! however many frames it has, and its influence is bounded. Log-likelihoods are quantised once a
//! pass and summed as integers.

use tilefold_schemas::fixed;

use crate::passes::Pass;

/// P(match | present, fully visible, exposed).
pub const DETECTION: f64 = 0.9;
/// P(match | absent).
pub const FALSE_MATCH: f64 = 0.08;
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
/// Offsets that still are "in its place", with their prior.
const TOLERANCE: [(f64, f64); 5] = [(-0.2, 0.1), (-0.1, 0.2), (0.0, 0.4), (0.1, 0.2), (0.2, 0.1)];
/// Shifts are considered from here...
const SHIFT_FROM_M: f64 = 0.4;
/// ... in steps of this ...
const SHIFT_STEP_M: f64 = 0.1;
/// ... this many to either side.
const SHIFTS: usize = 13;

/// Number of states.
pub const STATES: usize = 1 + TOLERANCE.len() + 2 * SHIFTS;

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

/// All states with their share of the prior within their claim.
#[must_use]
pub fn states() -> [(Claim, f64); STATES] {
    std::array::from_fn(|index| match index {
        0 => (Claim::Removed, 1.0),
        1..=5 => {
            let (offset_m, share) = TOLERANCE[index - 1];
            (Claim::InPlace { offset_m }, share)
        }
        _ => {
            let shift = index - 6;
            let size = SHIFT_FROM_M + SHIFT_STEP_M * (shift / 2) as f64;
            let offset_m = if shift % 2 == 0 { size } else { -size };
            let share = 1.0 / (2 * SHIFTS) as f64;
            (Claim::Shifted { offset_m }, share)
        }
    })
}

/// Log-likelihood of every state, summed over passes, fixed point.
#[must_use]
pub fn log_likelihoods(passes: &[Pass]) -> [i64; STATES] {
    let states = states();
    let mut sums = [0_i64; STATES];
    for pass in passes {
        let bounded = bounded(pass_log_likelihoods(pass, &states));
        for (sum, nats) in sums.iter_mut().zip(bounded) {
            *sum += fixed::from_f64(nats);
        }
    }
    sums
}

fn pass_log_likelihoods(pass: &Pass, states: &[(Claim, f64); STATES]) -> [f64; STATES] {
    let frames = pass.exposed.max(1) as f64;
    let hits = (pass.hit as f64).min(frames);
    let worth = 1.0 / (1.0 + (frames - 1.0) * FRAME_CORRELATION);
    let matched = |p: f64| worth * (hits * libm::log(p) + (frames - hits) * libm::log(1.0 - p));
    let visibility = pass.visibility().clamp(0.0, 1.0);
    let present = matched(visibility * DETECTION + (1.0 - visibility) * FALSE_MATCH);
    let absent = matched(FALSE_MATCH);
    // The residual counts as one measurement, or less if there are fewer effective hits.
    let residual = pass.residual_m().map(|r| (r, (worth * hits).min(1.0)));
    let off = |offset_m: f64| {
        residual.map_or(0.0, |(residual_m, weight)| {
            let z = (residual_m - offset_m) / PASS_SIGMA_M;
            weight * (-0.5 * z * z - libm::log(PASS_SIGMA_M * 2.506_628_274_631_000_5))
        })
    };
    let anywhere = residual.map_or(0.0, |(_, weight)| weight * libm::log(FALSE_MATCH_DENSITY));
    std::array::from_fn(|index| match states[index].0 {
        Claim::Removed => absent + anywhere,
        Claim::InPlace { offset_m } | Claim::Shifted { offset_m } => present + off(offset_m),
    })
}

/// Mixes a pass's likelihoods with their mean over claims, so that no pass can rule anything out.
/// Relative to that mean, so that a pass that tells nothing adds nothing.
fn bounded(logs: [f64; STATES]) -> [f64; STATES] {
    let states = states();
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut mean = 0.0;
    for ((_, share), log) in states.iter().zip(logs) {
        mean += share * libm::exp(log - most) / 3.0;
    }
    logs.map(|log| {
        let mixed = (1.0 - CONTAMINATION) * libm::exp(log - most) + CONTAMINATION * mean;
        libm::log(mixed / mean)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn priors_within_each_claim_sum_to_one() {
        let share = |is: fn(&Claim) -> bool| -> f64 {
            let states = states();
            let of = states.iter().filter(|(claim, _)| is(claim));
            of.map(|(_, share)| share).sum()
        };
        assert!((share(|c| matches!(c, Claim::Removed)) - 1.0).abs() < 1e-12);
        assert!((share(|c| matches!(c, Claim::InPlace { .. })) - 1.0).abs() < 1e-12);
        assert!((share(|c| matches!(c, Claim::Shifted { .. })) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn no_pass_moves_the_odds_by_more_than_its_bound() {
        let wild = std::array::from_fn(|index| if index == 0 { -500.0 } else { 0.0 });
        let bounded = bounded(wild);
        assert!(bounded[1] - bounded[0] < (3.0_f64 / CONTAMINATION).ln() + 1.0);
    }
}
