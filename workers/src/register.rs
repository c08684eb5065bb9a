//! Registration: how far to the side the vehicle really was (method.md, section 5).
//!
//! GNSS error is slow and metres large; a lane line is where it is. The lateral error of the
//! trajectory is the hidden state of a Markov chain on a grid: at each step the lines seen vote,
//! robustly, for the offsets that lay them on map lines; between steps the error drifts a little;
//! GNSS says that it is not too large. The forward-backward pass weighs all offsets against each
//! other, one lane to the side among them, so an ambiguous stretch stays ambiguous: it comes out
//! with a low confidence instead of a wrong pick. An edited line is one vote against those of its
//! neighbours and of the road before and after it.

use crate::cuts::{Against, CrossCut};
use crate::look::Look;
use crate::visibility::line_sigma_m;

/// Largest lateral error that is considered, in metres.
const REACH_M: f64 = 5.0;
/// Grid spacing in metres: half of the lateral noise of a seen line.
const STEP_M: f64 = 0.1;
/// Number of grid offsets.
const STATES: usize = 101;
/// Length of a step of the chain.
const STEP_NS: i64 = 500_000_000;
/// Clutter lies anywhere over this width, in metres.
const CLUTTER_WIDTH_M: f64 = 10.0;
/// Share of seen lines that belong to no map line (clutter, edits).
const OUTLIERS: f64 = 0.15;
/// Log-likelihood of a map line beside the vehicle that is not seen.
const MISS_NATS: f64 = -0.4;
/// Lines this near to the vehicle's axis should be seen, in metres.
const MISS_WITHIN_M: f64 = 2.3;
/// A line counts as seen if a seen line is this near, in metres.
const SEEN_WITHIN_M: f64 = 0.6;
/// Independent looks that one step is worth, however many frames it has.
const LOOKS_PER_STEP: f64 = 2.0;
/// A step is worth its full looks if the vehicle moved this far, in metres.
const FULL_STEP_M: f64 = 4.0;
/// Drift of the lateral error, in metres per square root of a second.
const DRIFT_M_PER_SQRT_S: f64 = 0.15;
/// Chance that the error jumps anywhere within a second (multipath).
const JUMPS_PER_S: f64 = 1e-3;
/// Standard deviation of the lateral GNSS error, in metres, and for how long one draw lasts.
const PRIOR_SIGMA_M: f64 = 1.2;
const PRIOR_SECONDS: f64 = 20.0;
/// What belongs to the chosen offset, in metres to either side.
const PEAK_M: f64 = 0.4;

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

/// Registers all looks of a chunk (context included) against the map.
#[must_use]
pub fn register(looks: &[Look], cross_cuts: &[CrossCut]) -> Vec<Registration> {
    let steps = Step::cut(looks, cross_cuts);
    let posterior = forward_backward(&steps);
    let peaks: Vec<Registration> = posterior.iter().map(peak).collect();
    looks
        .iter()
        .map(|look| interpolate(&steps, &peaks, look.pose.stamp_ns))
        .collect()
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
    fn cut(looks: &[Look], cross_cuts: &[CrossCut]) -> Vec<Self> {
        let mut steps = Vec::new();
        let mut from = 0;
        while from < looks.len() {
            let window = looks[from].pose.stamp_ns.div_euclid(STEP_NS);
            let size = looks[from..]
                .iter()
                .take_while(|look| look.pose.stamp_ns.div_euclid(STEP_NS) == window)
                .count();
            let to = from + size;
            steps.push(Self {
                centre_ns: window * STEP_NS + STEP_NS / 2,
                log_likelihood: votes(&looks[from..to], &cross_cuts[from..to]),
            });
            from = to;
        }
        steps
    }
}

/// Summed votes of frames, tempered: frames within a step see the same paint.
fn votes(looks: &[Look], cross_cuts: &[CrossCut]) -> Offsets {
    let mut sum = [0.0; STATES];
    for cross_cut in cross_cuts {
        vote(cross_cut, &mut sum);
    }
    let (first, last) = (&looks[0].pose, &looks[looks.len() - 1].pose);
    let moved_m = (last.east_m - first.east_m).hypot(last.north_m - first.north_m);
    let frames = looks.len() as f64;
    let worth = LOOKS_PER_STEP.min(frames) * (moved_m / FULL_STEP_M).clamp(0.1, 1.0);
    sum.map(|nats| nats * worth / frames)
}

/// Adds one frame's log-likelihood of every offset.
fn vote(cross_cut: &CrossCut, sum: &mut Offsets) {
    for seen in &cross_cut.seen {
        let mut best = [0.0_f64; STATES];
        let sigma_m = line_sigma_m(seen.lateral_m());
        let height = 1.0 / (sigma_m * std::f64::consts::TAU.sqrt());
        for mapped in &cross_cut.mapped {
            let Some(against) = Against::new(seen, mapped) else {
                continue;
            };
            for (state, best) in near(-against.offset_m, 4.0 * sigma_m, &mut best) {
                let z = (offset_m(state) + against.offset_m) / sigma_m;
                *best = best.max(height * (-0.5 * z * z).exp());
            }
        }
        let clutter = OUTLIERS / CLUTTER_WIDTH_M;
        for (sum, best) in sum.iter_mut().zip(best) {
            *sum += (1.0 + (1.0 - OUTLIERS) * best / clutter).ln();
        }
    }
    if !cross_cut.seen.is_empty() {
        vote_misses(cross_cut, sum);
    }
}

/// Lowers offsets that would put map lines beside the vehicle where nothing is seen.
fn vote_misses(cross_cut: &CrossCut, sum: &mut Offsets) {
    for mapped in &cross_cut.mapped {
        let lateral_m = mapped.lateral_m();
        let offsets: Vec<f64> = cross_cut
            .seen
            .iter()
            .filter_map(|seen| Against::new(seen, mapped))
            .map(|against| against.offset_m)
            .collect();
        for (state, sum) in near(lateral_m, MISS_WITHIN_M, sum) {
            let is_seen = offsets
                .iter()
                .any(|offset| (offset + offset_m(state)).abs() <= SEEN_WITHIN_M);
            if !is_seen {
                *sum += MISS_NATS;
            }
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

/// Posterior of the offset at each step, given all steps.
fn forward_backward(steps: &[Step]) -> Vec<Offsets> {
    let likelihoods: Vec<Offsets> = steps
        .iter()
        .map(|step| scaled(&step.log_likelihood))
        .collect();
    let size = steps.len();
    let mut forward = Vec::with_capacity(size);
    let mut belief = prior(1.0);
    for index in 0..size {
        if index > 0 {
            belief = drift(&belief, seconds_between(steps, index));
        }
        multiply(&mut belief, &likelihoods[index]);
        forward.push(belief);
    }
    let mut posterior = forward;
    let mut message = [1.0; STATES];
    for index in (0..size).rev() {
        multiply(&mut posterior[index], &message);
        multiply(&mut message, &likelihoods[index]);
        if index > 0 {
            message = drift(&message, seconds_between(steps, index));
        }
    }
    posterior
}

fn seconds_between(steps: &[Step], index: usize) -> f64 {
    (steps[index].centre_ns - steps[index - 1].centre_ns) as f64 * 1e-9
}

/// Likelihoods relative to the best offset.
fn scaled(log_likelihood: &Offsets) -> Offsets {
    let best = log_likelihood.iter().copied().fold(f64::MIN, f64::max);
    log_likelihood.map(|nats| (nats - best).exp())
}

/// What GNSS says of the offset, raised to a share of one draw.
fn prior(share: f64) -> Offsets {
    std::array::from_fn(|state| {
        let z = offset_m(state) / PRIOR_SIGMA_M;
        (-0.5 * z * z * share).exp()
    })
}

/// Pointwise product, normalised to sum 1. A product that vanishes everywhere says nothing.
fn multiply(belief: &mut Offsets, factor: &Offsets) {
    let mut total = 0.0;
    for (belief, factor) in belief.iter_mut().zip(factor) {
        *belief *= factor;
        total += *belief;
    }
    if total > 0.0 {
        belief.iter_mut().for_each(|value| *value /= total);
    } else {
        belief.fill(1.0 / STATES as f64);
    }
}

/// The belief after some seconds: blurred by drift, with a little anywhere, drawn towards GNSS.
fn drift(belief: &Offsets, seconds: f64) -> Offsets {
    let sigma_m = DRIFT_M_PER_SQRT_S * seconds.sqrt();
    let reach = ((3.0 * sigma_m / STEP_M).ceil() as usize).clamp(1, STATES);
    let kernel: Vec<f64> = (0..=reach)
        .map(|bins| {
            let z = bins as f64 * STEP_M / sigma_m;
            (-0.5 * z * z).exp()
        })
        .collect();
    let mut blurred = [0.0; STATES];
    for (state, &value) in belief.iter().enumerate() {
        let (from, to) = (state.saturating_sub(reach), (state + reach).min(STATES - 1));
        for (target, sum) in blurred.iter_mut().enumerate().take(to + 1).skip(from) {
            *sum += value * kernel[target.abs_diff(state)];
        }
    }
    let total: f64 = blurred.iter().sum();
    let jump = (JUMPS_PER_S * seconds).min(1.0);
    let anywhere = jump / STATES as f64;
    let gnss = prior((seconds / PRIOR_SECONDS).min(1.0));
    for (value, gnss) in blurred.iter_mut().zip(gnss) {
        *value = ((1.0 - jump) * *value / total + anywhere) * gnss;
    }
    blurred
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
