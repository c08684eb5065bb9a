//! Registration: how far to the side the vehicle really was (method.md, section 5).
//!
//! GNSS error is slow and metres large; a lane line is where it is. The lateral error of the
//! trajectory is the hidden state of a Markov chain on a grid: at each step the lines seen vote,
//! robustly, for the offsets that lay them on map lines; between steps the error drifts a little;
//! GNSS says that it is not too large. The forward-backward pass weighs all offsets against each
//! other, one lane to the side among them, so an ambiguous stretch stays ambiguous: it comes out
//! with a low confidence instead of a wrong pick. An edited line is one vote against those of its
//! neighbours and of the road before and after it.

use crate::cuts::{Against, CutLine};
use crate::visibility::line_sigma_m;

/// Largest lateral error that is considered, in metres.
const REACH_M: f64 = 5.0;
/// Grid spacing in metres.
const STEP_M: f64 = 0.1;
/// Number of grid offsets.
const STATES: usize = 101;
/// Length of a step of the chain.
const STEP_NS: i64 = 500_000_000;
/// Share of seen lines that belong to no map line (clutter, edits).
const OUTLIERS: f64 = 0.3;
/// Clutter lies anywhere over this width, in metres.
const CLUTTER_WIDTH_M: f64 = 10.0;
/// Independent looks that one step is worth, however many frames it has: frames of seconds see the
/// same paint, the same edit, the same kerb. A stiff chain is what keeps an edited line from
/// dragging the vehicle along.
const LOOKS_PER_STEP: f64 = 0.2;
/// A step is worth its full looks if the vehicle moved this far, in metres.
const FULL_STEP_M: f64 = 4.0;
/// Chance that the error jumps anywhere within a second (multipath).
const JUMPS_PER_S: f64 = 1e-3;
/// What belongs to the chosen offset, in metres to either side.
const PEAK_M: f64 = 0.5;

/// How the lateral error of a trajectory behaves: a stationary process that forgets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GnssError {
    /// Standard deviation in metres.
    pub sigma_m: f64,
    /// Time over which it forgets, in seconds.
    pub memory_s: f64,
}

impl GnssError {
    /// The receivers that are told apart: good ones (corrected, or coupled with inertia) and
    /// ordinary ones. Which one a drive has is decided by what explains it better.
    pub const KINDS: [Self; 2] = [
        Self {
            sigma_m: 0.4,
            memory_s: 50.0,
        },
        Self {
            sigma_m: 1.4,
            memory_s: 30.0,
        },
    ];
}

/// The lateral error at one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// How far to the left of its pose the vehicle really was, in metres.
    pub offset_m: f64,
    /// Standard deviation of it, given that the right peak was chosen.
    pub sigma_m: f64,
    /// Posterior of the chosen peak against all other offsets, in `[0, 1]`.
    pub confidence: f64,
}

/// What one frame says: the lines seen, and the map lines where its pose puts them.
#[derive(Debug, Clone, Copy)]
pub struct Glance<'a> {
    /// Capture time.
    pub stamp_ns: i64,
    /// Where the trajectory has the vehicle, east and north in metres.
    pub place_m: [f64; 2],
    /// Lines seen.
    pub seen: &'a [CutLine],
    /// Map lines.
    pub mapped: &'a [CutLine],
}

/// Registers all frames of a chunk (context included) against the map, under the kind of GNSS
/// error that explains them best.
#[must_use]
pub fn register(glances: &[Glance<'_>]) -> Vec<Registration> {
    let steps = Step::cut(glances);
    let kinds = GnssError::KINDS.iter();
    let chains = kinds.map(|error| Chain::run(&steps, *error));
    // The first of equals, so that nothing to go by means the better receiver.
    let best = chains.reduce(|a, b| {
        if b.log_likelihood > a.log_likelihood {
            b
        } else {
            a
        }
    });
    let Some(best) = best.filter(|_| !steps.is_empty()) else {
        return Vec::new();
    };
    let peaks: Vec<Registration> = best.posterior(&steps).iter().map(peak).collect();
    glances
        .iter()
        .map(|glance| interpolate(&steps, &peaks, glance.stamp_ns))
        .collect()
}

/// The log-likelihood alone, in nats: how well frames, poses and map go together.
#[must_use]
pub fn log_likelihood(glances: &[Glance<'_>]) -> f64 {
    let steps = Step::cut(glances);
    let kinds = GnssError::KINDS.iter();
    kinds
        .map(|error| Chain::run(&steps, *error).log_likelihood)
        .fold(f64::NEG_INFINITY, f64::max)
}

type Offsets = [f64; STATES];

fn offset_m(state: usize) -> f64 {
    state as f64 * STEP_M - REACH_M
}

/// A stretch of time with the votes of its frames.
struct Step {
    centre_ns: i64,
    log_likelihood: Offsets,
}

impl Step {
    fn cut(glances: &[Glance<'_>]) -> Vec<Self> {
        let window = |glance: &Glance<'_>| glance.stamp_ns.div_euclid(STEP_NS);
        glances
            .chunk_by(|a, b| window(a) == window(b))
            .map(|step| Self {
                centre_ns: window(&step[0]) * STEP_NS + STEP_NS / 2,
                log_likelihood: votes(step),
            })
            .collect()
    }
}

/// Summed votes of frames, tempered: frames within a step see the same paint.
fn votes(glances: &[Glance<'_>]) -> Offsets {
    let mut sum = [0.0; STATES];
    for glance in glances {
        vote(glance, &mut sum);
    }
    let (first, last) = (glances[0].place_m, glances[glances.len() - 1].place_m);
    let moved_m = (last[0] - first[0]).hypot(last[1] - first[1]);
    let frames = glances.len() as f64;
    let worth = LOOKS_PER_STEP * (moved_m / FULL_STEP_M).clamp(0.1, 1.0);
    sum.map(|nats| nats * worth / frames)
}

/// Adds one frame's log-likelihood of every offset, relative to clutter.
fn vote(glance: &Glance<'_>, sum: &mut Offsets) {
    for seen in glance.seen {
        let mut best = [0.0_f64; STATES];
        let sigma_m = line_sigma_m(seen.lateral_m());
        let height = (1.0 - OUTLIERS) / (sigma_m * std::f64::consts::TAU.sqrt());
        for mapped in glance.mapped {
            let Some(against) = Against::new(seen, mapped) else {
                continue;
            };
            for (state, best) in near(-against.offset_m, 4.0 * sigma_m, &mut best) {
                let z = (offset_m(state) + against.offset_m) / sigma_m;
                *best = best.max(height * (-0.5 * z * z).exp());
            }
        }
        // Any of the map lines in view could have been the one that is seen.
        let share = 1.0 / glance.mapped.len().max(1) as f64;
        for (sum, best) in sum.iter_mut().zip(best) {
            *sum += (OUTLIERS + best * share * CLUTTER_WIDTH_M).ln();
        }
    }
}

/// The states within `reach_m` of an offset, with their values.
fn near(
    centre_m: f64,
    reach_m: f64,
    values: &mut Offsets,
) -> impl Iterator<Item = (usize, &mut f64)> {
    let from = ((centre_m - reach_m + REACH_M) / STEP_M).ceil().max(0.0) as usize;
    let to = ((centre_m + reach_m + REACH_M) / STEP_M).floor();
    let size = if to < 0.0 { 0 } else { to as usize + 1 };
    values
        .iter_mut()
        .enumerate()
        .take(size)
        .skip(from.min(STATES))
}

/// The forward pass of the chain under one kind of GNSS error.
struct Chain {
    error: GnssError,
    /// Likelihood of each offset at each step, relative to the best.
    likelihoods: Vec<Offsets>,
    /// Belief at each step, given the steps up to it.
    forward: Vec<Offsets>,
    log_likelihood: f64,
}

impl Chain {
    fn run(steps: &[Step], error: GnssError) -> Self {
        let mut chain = Self {
            error,
            likelihoods: Vec::with_capacity(steps.len()),
            forward: Vec::with_capacity(steps.len()),
            log_likelihood: 0.0,
        };
        let mut belief = stationary(error);
        for (index, step) in steps.iter().enumerate() {
            if index > 0 {
                belief = Drift::new(error, seconds_between(steps, index)).ahead(&belief);
            }
            let best = step.log_likelihood.iter().copied().fold(f64::MIN, f64::max);
            let likelihood = step.log_likelihood.map(|nats| (nats - best).exp());
            chain.log_likelihood += best + multiply(&mut belief, &likelihood).ln();
            chain.likelihoods.push(likelihood);
            chain.forward.push(belief);
        }
        chain
    }

    /// Posterior of the offset at each step, given all steps.
    fn posterior(self, steps: &[Step]) -> Vec<Offsets> {
        let mut posterior = self.forward;
        let mut message = [1.0; STATES];
        for index in (0..posterior.len()).rev() {
            multiply(&mut posterior[index], &message);
            multiply(&mut message, &self.likelihoods[index]);
            if index > 0 {
                message = Drift::new(self.error, seconds_between(steps, index)).back(&message);
            }
        }
        posterior
    }
}

fn seconds_between(steps: &[Step], index: usize) -> f64 {
    (steps[index].centre_ns - steps[index - 1].centre_ns) as f64 * 1e-9
}

/// What GNSS says of the offset.
fn stationary(error: GnssError) -> Offsets {
    let weights: Offsets = std::array::from_fn(|state| {
        let z = offset_m(state) / error.sigma_m;
        (-0.5 * z * z).exp()
    });
    let total: f64 = weights.iter().sum();
    weights.map(|weight| weight / total)
}

/// Pointwise product, normalised to sum 1; returns the sum before. A product that vanishes
/// everywhere says nothing.
fn multiply(belief: &mut Offsets, factor: &Offsets) -> f64 {
    let mut total = 0.0;
    for (belief, factor) in belief.iter_mut().zip(factor) {
        *belief *= factor;
        total += *belief;
    }
    if total > 0.0 {
        belief.iter_mut().for_each(|value| *value /= total);
        total
    } else {
        belief.fill(1.0 / STATES as f64);
        f64::MIN_POSITIVE
    }
}

/// How the error moves in some seconds: it forgets a little and is driven a little
/// (Ornstein-Uhlenbeck), and rarely jumps (multipath).
struct Drift {
    /// For each offset, the first reachable one and the chances from there on.
    rows: Vec<(usize, Vec<f64>)>,
    jump: f64,
    anywhere: Offsets,
}

impl Drift {
    fn new(error: GnssError, seconds: f64) -> Self {
        let kept = (-seconds / error.memory_s).exp();
        let sigma_m = (error.sigma_m * (1.0 - kept * kept).sqrt()).max(0.5 * STEP_M);
        let reach_m = 3.5 * sigma_m;
        let rows = (0..STATES).map(|from| {
            let centre_m = kept * offset_m(from);
            let state = |metres: f64| ((metres + REACH_M) / STEP_M).clamp(0.0, (STATES - 1) as f64);
            let (first, last) = (
                state(centre_m - reach_m) as usize,
                state(centre_m + reach_m) as usize,
            );
            let weights: Vec<f64> = (first..=last)
                .map(|to| {
                    let z = (offset_m(to) - centre_m) / sigma_m;
                    (-0.5 * z * z).exp()
                })
                .collect();
            let total: f64 = weights.iter().sum();
            (first, weights.iter().map(|weight| weight / total).collect())
        });
        Self {
            rows: rows.collect(),
            jump: (JUMPS_PER_S * seconds).min(1.0),
            anywhere: stationary(error),
        }
    }

    /// The belief afterwards.
    fn ahead(&self, belief: &Offsets) -> Offsets {
        let mut moved = self.anywhere.map(|chance| self.jump * chance);
        for (value, (first, weights)) in belief.iter().zip(&self.rows) {
            for (to, weight) in moved[*first..].iter_mut().zip(weights) {
                *to += (1.0 - self.jump) * value * weight;
            }
        }
        moved
    }

    /// What a message from afterwards says before.
    fn back(&self, message: &Offsets) -> Offsets {
        let jumped: f64 = message
            .iter()
            .zip(&self.anywhere)
            .map(|(m, chance)| m * chance)
            .sum();
        std::array::from_fn(|from| {
            let (first, weights) = &self.rows[from];
            let kept: f64 = message[*first..]
                .iter()
                .zip(weights)
                .map(|(m, weight)| m * weight)
                .sum();
            (1.0 - self.jump) * kept + self.jump * jumped
        })
    }
}

/// The highest peak of a posterior.
fn peak(posterior: &Offsets) -> Registration {
    let reach = (PEAK_M / STEP_M).round() as usize;
    let window = |centre: usize| centre.saturating_sub(reach)..=(centre + reach).min(STATES - 1);
    let mass = |centre: usize| -> f64 { posterior[window(centre)].iter().sum() };
    let best = (0..STATES)
        .max_by(|&a, &b| mass(a).total_cmp(&mass(b)).then(b.cmp(&a)))
        .unwrap_or(STATES / 2);
    let confidence = mass(best);
    let mean = |value: &dyn Fn(usize) -> f64| -> f64 {
        window(best)
            .map(|state| posterior[state] * value(state))
            .sum::<f64>()
            / confidence
    };
    let offset = mean(&offset_m);
    let variance = mean(&|state| (offset_m(state) - offset).powi(2));
    Registration {
        offset_m: offset,
        sigma_m: (variance + STEP_M * STEP_M / 12.0).sqrt(),
        confidence: confidence.min(1.0),
    }
}

/// Between the centres of two steps on the same peak; else the nearer step's.
fn interpolate(steps: &[Step], peaks: &[Registration], stamp_ns: i64) -> Registration {
    let after = steps.partition_point(|step| step.centre_ns < stamp_ns);
    let after_index = after.min(steps.len() - 1);
    let before_index = after.saturating_sub(1);
    let (before, after) = (peaks[before_index], peaks[after_index]);
    let span_ns = steps[after_index].centre_ns - steps[before_index].centre_ns;
    let share = if span_ns > 0 {
        (stamp_ns - steps[before_index].centre_ns) as f64 / span_ns as f64
    } else {
        0.0
    }
    .clamp(0.0, 1.0);
    if (before.offset_m - after.offset_m).abs() > PEAK_M {
        return if share < 0.5 { before } else { after };
    }
    let mix = |from: f64, to: f64| from + share * (to - from);
    Registration {
        offset_m: mix(before.offset_m, after.offset_m),
        sigma_m: mix(before.sigma_m, after.sigma_m),
        confidence: mix(before.confidence, after.confidence),
    }
}
