//! Judging a lane marking by the calibrated model: sections, their passes over time, and the line
//! that ties them together.
//!
//! A road that changed while vehicles drove on it was in two states. What was seen before the
//! change must not outvote what was seen after it: where two histories explain the evidence better
//! than one, and by more than a change costs, only what came after the last change counts.

use std::collections::BTreeSet;

use tilefold_schemas::{Verdict, fixed};

use crate::calibrated::{shares_of_vehicles, testimony};
use crate::chain::{self, Chain};
use crate::elements::{Judged, verdict};
use crate::passes::Pass;
use crate::sensor::SensorModel;
use crate::space::{Claim, Space, State};
use crate::traverse;

/// Log-prior that a line changed while it was observed, spread over the times at which it may have.
const CHANGED_NATS: f64 = -4.0;
/// A section's gain by a change below this is noise, in nats.
const SECTION_NOISE_NATS: f64 = 1.0;
/// Below this gain over all sections no change is looked into, in nats.
const LEAST_GAIN_NATS: f64 = 4.0;

/// When a line changed while it was observed: between these two looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Since {
    /// Last look at the state before, nanoseconds since the Unix epoch.
    pub(crate) after_ns: i64,
    /// First look at the state now.
    pub(crate) before_ns: i64,
}

/// What is said of a line.
pub(crate) struct JudgedLine {
    /// By section.
    pub(crate) sections: Vec<Judged>,
    /// Posterior of every state by section.
    pub(crate) states: Vec<Vec<f64>>,
    /// Passes that count, by section: those since the last change.
    pub(crate) passes: Vec<Vec<Pass>>,
    /// What each of them says of no change, added, removed and modified, at the best place of each.
    pub(crate) testimonies: Vec<Vec<[i64; 4]>>,
    /// When it changed, if it did while it was observed.
    pub(crate) since: Option<Since>,
}

/// The states that a line with these passes can be in. How well its place is known depends on where
/// it is seen from, and on how many vehicles saw it: each has a bias of its own.
pub(crate) fn space(sections: &[Vec<Pass>], sensor: &SensorModel) -> Space {
    let place_sigma_m = sensor.place_sigma_m.at(matched_from(sections));
    let vehicles = (vehicles_that_matched(sections) as f64).max(1.0);
    let sigma_m = place_sigma_m.hypot(sensor.vehicle_sigma_m / vehicles.sqrt());
    Space::new(sigma_m, sensor)
}

/// Vehicles that matched a line.
pub(crate) fn vehicles_that_matched(sections: &[Vec<Pass>]) -> usize {
    let matched = sections.iter().flatten().filter(|pass| pass.hit > 0);
    let vehicles: BTreeSet<i64> = matched.map(|pass| pass.vehicle).collect();
    vehicles.len()
}

/// Mean visibility of the passes that matched a line; 1 if none did.
pub(crate) fn matched_from(sections: &[Vec<Pass>]) -> f64 {
    let matched = || sections.iter().flatten().filter(|pass| pass.hit > 0);
    let sum_fx: i64 = matched()
        .map(|pass| fixed::from_f64(pass.visibility()))
        .sum();
    match matched().count() {
        0 => 1.0,
        count => fixed::to_f64(sum_fx) / count as f64,
    }
}

/// Judges a line.
pub(crate) fn judge(sections: &[Vec<Pass>], sensor: &SensorModel) -> JudgedLine {
    let space = space(sections, sensor);
    let mut looks = Looks::new(sections, &space.states, sensor);
    let mut chain = looks.chain(0, &space.prior, &space);
    let mut since = None;
    // A site that came and goes changes twice.
    for _ in 0..2 {
        let Some(time) = looks.likeliest_change() else {
            break;
        };
        let before = looks.until(time).chain(0, &space.prior, &space);
        let after = looks.chain(time, &space.prior_after_change(), &space);
        let times = looks.times_ns.len().max(1) as f64;
        let gain = before.log_evidence + after.log_evidence - chain.log_evidence + CHANGED_NATS
            - libm::log(times);
        if gain <= 0.0 || !is_other_claim(&before, &after, &space.states) {
            break;
        }
        since = Some(Since {
            after_ns: looks.times_ns[time - 1].1,
            before_ns: looks.times_ns[time].0,
        });
        chain = after;
        looks = looks.since(time);
    }
    let merged = |states_p: &Vec<f64>| merge_states(states_p, &space.states);
    JudgedLine {
        sections: chain.posterior.iter().map(merged).collect(),
        passes: looks.passes(sections),
        testimonies: looks.testimonies(&chain.posterior, &space.states),
        states: chain.posterior,
        since,
    }
}

/// What every pass says of every state, by section and time.
struct Looks {
    /// First and last look of each traverse, ascending by the first.
    times_ns: Vec<(i64, i64)>,
    /// By section: the index of the traverse, the index of the pass, its log-likelihoods.
    sections: Vec<Vec<Look>>,
    states: usize,
}

struct Look {
    time: usize,
    pass: usize,
    nats_fx: Vec<i64>,
}

impl Looks {
    fn new(sections: &[Vec<Pass>], states: &[State], sensor: &SensorModel) -> Self {
        let worths = traverse::worths(sections);
        let mut traverses = traverse::traverses(sections);
        let pass = |&(section, pass): &(usize, usize)| &sections[section][pass];
        let span = |places: &Vec<(usize, usize)>| {
            let first = places.iter().map(|place| pass(place).first_ns).min();
            let last = places.iter().map(|place| pass(place).last_ns).max();
            (first.unwrap_or(0), last.unwrap_or(0))
        };
        traverses.sort_by_cached_key(|places| (span(places), places.clone()));
        let times_ns = traverses.iter().map(span).collect();
        let shares: Vec<Vec<f64>> = sections
            .iter()
            .map(|passes| shares_of_vehicles(passes))
            .collect();
        let mut looks: Vec<Vec<Look>> = sections.iter().map(|_| Vec::new()).collect();
        for (time, places) in traverses.iter().enumerate() {
            for &(section, index) in places {
                let worth = worths[section][index] * shares[section][index];
                looks[section].push(Look {
                    time,
                    pass: index,
                    nats_fx: testimony(&sections[section][index], worth, states, sensor),
                });
            }
        }
        Self {
            times_ns,
            sections: looks,
            states: states.len(),
        }
    }

    /// The chain along the line over what was seen from a time on.
    fn chain(&self, from: usize, prior: &[f64], space: &Space) -> Chain {
        let sum = |looks: &Vec<Look>| {
            let mut sums_fx = vec![0_i64; self.states];
            for look in looks.iter().filter(|look| look.time >= from) {
                add(&mut sums_fx, &look.nats_fx);
            }
            sums_fx.into_iter().map(fixed::to_f64).collect()
        };
        let logs: Vec<Vec<f64>> = self.sections.iter().map(sum).collect();
        chain::posterior(&logs, prior, &space.kin)
    }

    /// The time at which two histories gain most over one, if that is worth looking into.
    fn likeliest_change(&self) -> Option<usize> {
        let mut gains_fx = vec![0_i64; self.times_ns.len()];
        for looks in &self.sections {
            let mut all = vec![0_i64; self.states];
            looks.iter().for_each(|look| add(&mut all, &look.nats_fx));
            let one = most(&all);
            let mut before = vec![0_i64; self.states];
            let mut looks = looks.iter().peekable();
            for (time, gain_fx) in gains_fx.iter_mut().enumerate() {
                while let Some(look) = looks.next_if(|look| look.time < time) {
                    add(&mut before, &look.nats_fx);
                }
                let after = all.iter().zip(&before).map(|(all, before)| all - before);
                let two = most(&before) + after.max().unwrap_or(0);
                *gain_fx += (two - one - fixed::from_f64(SECTION_NOISE_NATS)).max(0);
            }
        }
        let at =
            (1..gains_fx.len()).max_by_key(|&time| (gains_fx[time], std::cmp::Reverse(time)))?;
        (gains_fx[at] >= fixed::from_f64(LEAST_GAIN_NATS)).then_some(at)
    }

    fn part(&self, times: std::ops::Range<usize>) -> Self {
        let within = |looks: &Vec<Look>| {
            let within = looks.iter().filter(|look| times.contains(&look.time));
            let moved = within.map(|look| Look {
                time: look.time - times.start,
                pass: look.pass,
                nats_fx: look.nats_fx.clone(),
            });
            moved.collect()
        };
        Self {
            times_ns: self.times_ns[times.clone()].to_vec(),
            sections: self.sections.iter().map(within).collect(),
            states: self.states,
        }
    }

    fn until(&self, time: usize) -> Self {
        self.part(0..time)
    }

    fn since(&self, time: usize) -> Self {
        self.part(time..self.times_ns.len())
    }

    /// What the passes say, as [`Self::passes`] orders them, of the likeliest state of each claim.
    fn testimonies(&self, posterior: &[Vec<f64>], states: &[State]) -> Vec<Vec<[i64; 4]>> {
        let of_section = |(looks, states_p): (&Vec<Look>, &Vec<f64>)| {
            let at = |claim| likeliest(states_p, states, claim);
            let (here, gone, aside) = (at(Claim::InPlace), at(Claim::Removed), at(Claim::Shifted));
            let mut ordered: Vec<&Look> = looks.iter().collect();
            ordered.sort_unstable_by_key(|look| look.pass);
            let nats = |look: &&Look| {
                let nats_fx = &look.nats_fx;
                [nats_fx[here], 0, nats_fx[gone], nats_fx[aside]]
            };
            ordered.iter().map(nats).collect()
        };
        self.sections
            .iter()
            .zip(posterior)
            .map(of_section)
            .collect()
    }

    /// The passes of these looks, as ordered in `sections`.
    fn passes(&self, sections: &[Vec<Pass>]) -> Vec<Vec<Pass>> {
        let of = |(looks, passes): (&Vec<Look>, &Vec<Pass>)| {
            let mut indices: Vec<usize> = looks.iter().map(|look| look.pass).collect();
            indices.sort_unstable();
            indices.into_iter().map(|index| passes[index]).collect()
        };
        self.sections.iter().zip(sections).map(of).collect()
    }
}

/// Whether the likeliest claim of any section differs: a line that moved within what it is called is
/// no change of it.
fn is_other_claim(before: &Chain, after: &Chain, states: &[State]) -> bool {
    let likeliest = |states_p: &Vec<f64>| verdict(&merge_states(states_p, states).posterior);
    let claims =
        |chain: &Chain| -> Vec<Verdict> { chain.posterior.iter().map(likeliest).collect() };
    claims(before) != claims(after)
}

/// Index of the likeliest state that makes a claim; the first of equals.
fn likeliest(states_p: &[f64], states: &[State], claim: Claim) -> usize {
    let mut most: Option<usize> = None;
    for (index, state) in states.iter().enumerate() {
        let is_likelier = most.is_none_or(|most| states_p[index] > states_p[most]);
        if state.claim == claim && is_likelier {
            most = Some(index);
        }
    }
    most.unwrap_or(0)
}

fn add(sums_fx: &mut [i64], nats_fx: &[i64]) {
    for (sum, nats) in sums_fx.iter_mut().zip(nats_fx) {
        *sum += nats;
    }
}

fn most(nats_fx: &[i64]) -> i64 {
    nats_fx.iter().copied().max().unwrap_or(0)
}

fn merge_states(posterior: &[f64], states: &[State]) -> Judged {
    let mut merged = [0.0; 4];
    let (mut sum, mut square) = (0.0, 0.0);
    for (p, state) in posterior.iter().zip(states) {
        match state.claim {
            Claim::InPlace => merged[0] += p,
            Claim::Removed => merged[2] += p,
            Claim::Shifted => {
                merged[3] += p;
                sum += p * state.offset_m;
                square += p * state.offset_m * state.offset_m;
            }
        }
    }
    let shifted = merged[3].max(f64::MIN_POSITIVE);
    let shift_m = sum / shifted;
    let variance = (square / shifted - shift_m * shift_m).max(0.0);
    Judged {
        posterior: merged,
        shift_m,
        // The grid itself is no finer than its step.
        shift_sigma_m: (variance + 0.1 * 0.1 / 12.0).sqrt(),
    }
}
