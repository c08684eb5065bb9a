//! The `calibrated` fusion model: likelihood ratios of a detection model (method.md, section 9).
//!
//! Every pass gives each state of a section a log-likelihood: how often the line was matched, and
//! where its match lay. Frames of a pass are alike: the share of them that match is drawn anew for
//! each pass, so that the number of matches is Beta-binomial, and a pass counts once, however many
//! frames it has. Its influence is bounded, and so is that of a vehicle that comes again and again.
//! Log-likelihoods are quantised once a pass and summed as integers.

use std::collections::BTreeMap;

use tilefold_schemas::fixed;

use crate::passes::Pass;
use crate::sensor::{SensorModel, beta_binomial};
use crate::space::{LEVELS, State};

/// Below this visibility a pass looked from another lane.
const ASIDE_VISIBILITY: f64 = 0.5;
/// Frames that a pass is worth at most: more of them see the same.
const MOST_FRAMES: f64 = 12.0;
/// Share of every pass likelihood that is the mean over states: a pass moves at most about
/// ln(claims / eta) nats.
pub const CONTAMINATION: f64 = 0.05;
/// Matched frames from which the residual counts as a whole measurement.
const FULL_RESIDUAL_HITS: f64 = 2.5;
/// A false match lies anywhere within the matching gate: its density per metre.
const FALSE_MATCH_DENSITY: f64 = 1.0 / 3.2;
/// Square root of the full circle: of the height of a normal density.
const SQRT_TAU: f64 = 2.506_628_274_631_000_5;
/// How alike passes of one vehicle are: n of them are worth n / (1 + (n - 1) rho).
const SAME_VEHICLE: f64 = 0.25;
/// No rate is surer than this.
const RATES: (f64, f64) = (0.02, 0.98);

/// Log-likelihood of every state by one pass, in fixed point: bounded, and times what the pass is
/// worth.
#[must_use]
pub fn testimony(pass: &Pass, worth: f64, states: &[State], sensor: &SensorModel) -> Vec<i64> {
    let bounded = bounded(&log_likelihoods(pass, states, sensor), states);
    bounded
        .into_iter()
        .map(|nats| fixed::from_f64(worth * nats))
        .collect()
}

/// By how much each pass counts less because its vehicle was there before or comes again.
#[must_use]
pub fn shares_of_vehicles(passes: &[Pass]) -> Vec<f64> {
    let mut counts: BTreeMap<i64, f64> = BTreeMap::new();
    for pass in passes {
        *counts.entry(pass.vehicle).or_default() += 1.0;
    }
    let share = |pass: &Pass| 1.0 / (1.0 + (counts[&pass.vehicle] - 1.0) * SAME_VEHICLE);
    passes.iter().map(share).collect()
}

/// Frames of a pass as hits and misses of at most [`MOST_FRAMES`].
#[must_use]
pub(crate) fn looks(pass: &Pass) -> (f64, f64) {
    let frames = pass.exposed.max(1) as f64;
    let share = (pass.hit as f64).min(frames) / frames;
    let worth = frames.min(MOST_FRAMES);
    (worth * share, worth * (1.0 - share))
}

/// What a level does to the rate of matches at a visibility.
#[must_use]
pub(crate) fn level_share(level: usize, visibility: f64) -> f64 {
    match visibility < ASIDE_VISIBILITY {
        true => LEVELS[level].aside,
        false => LEVELS[level].near,
    }
}

fn log_likelihoods(pass: &Pass, states: &[State], sensor: &SensorModel) -> Vec<f64> {
    let (hits, misses) = looks(pass);
    let visibility = pass.visibility().clamp(0.0, 1.0);
    let vehicle = sensor.vehicle(pass.vehicle);
    let rate = |mean: f64| mean.clamp(RATES.0, RATES.1);
    let absent = rate(vehicle.absent);
    let gone = beta_binomial(hits, misses, absent, sensor.absent_concentration);
    let seen = vehicle.detection * sensor.present.at(visibility);
    let there: Vec<f64> = (0..LEVELS.len())
        .map(|level| match level_share(level, visibility) {
            share if share > 0.0 => {
                // Paint that is there is matched no less often than paint that is not.
                let mean = rate(share * seen).max(absent);
                beta_binomial(hits, misses, mean, sensor.present_concentration)
            }
            _ => gone,
        })
        .collect();
    // The residual counts as one measurement, or less if there are few hits. A false match lies
    // anywhere.
    let sigma_m = vehicle.sigma * sensor.pass_sigma_m.at(visibility);
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
    let of_state = |state: &State| match state.level {
        None => gone + anywhere,
        Some(level) => there[level] + off(state.offset_m),
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
    use crate::space::Space;

    #[test]
    fn no_pass_moves_the_odds_by_more_than_its_bound() {
        let states = Space::new(0.1, &SensorModel::default()).states;
        let mut wild = vec![0.0; states.len()];
        wild[0] = -500.0;
        let bounded = bounded(&wild, &states);
        assert!(bounded[1] - bounded[0] < (3.0_f64 / CONTAMINATION).ln() + 1.0);
    }
}
