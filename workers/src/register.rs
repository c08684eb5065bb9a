//! Registration: how far to the side the vehicle really was (method.md, section 5).
//!
//! GNSS error is slow and metres large; a lane line is where it is. The lateral error of the
//! trajectory is the hidden state of a Markov chain on a grid: at each step the lines seen vote,
//! robustly, for the offsets that lay them on map lines; between steps the error drifts a little;
//! GNSS says that it is not too large. The forward-backward pass weighs all offsets against each
//! other, one lane to the side among them, so an ambiguous stretch stays ambiguous: it comes out
//! with a low confidence instead of a wrong pick. An edited line is one vote against those of its
//! neighbours and of the road before and after it.

use tilefold_schemas::Marking;
use tilefold_schemas::evidence::{METHOD_VERSION, UNREGISTERED_METHOD};

use crate::drift::{Drifts, Receivers, shifted};
use crate::profile::Profile;
use crate::visibility::line_sigma_m;

/// Largest lateral error that is considered, in metres.
pub(crate) const REACH_M: f64 = 5.0;
/// Grid spacing in metres.
pub(crate) const STEP_M: f64 = 0.1;
/// Number of grid offsets.
pub(crate) const STATES: usize = 101;
/// Length of a step of the chain.
const STEP_NS: i64 = 500_000_000;
/// Share of seen lines that belong to no map line (clutter, edits).
const OUTLIERS: f64 = 0.3;
/// How much likelier than by chance a seen line agrees with its map line on how it is painted, and
/// differs from it, where both say so: detectors misread paint, and paint is renewed otherwise.
const AGREES: f64 = 1.6;
const DIFFERS: f64 = 0.3;
/// Clutter lies anywhere over this width, in metres.
const CLUTTER_WIDTH_M: f64 = 10.0;
/// Independent looks that one step is worth, however many frames it has: frames of seconds see the
/// same paint, the same edit, the same kerb. A stiff chain is what keeps an edited line from
/// dragging the vehicle along.
const LOOKS_PER_STEP: f64 = 0.2;
/// A step is worth its full looks if the vehicle moved this far, in metres.
const FULL_STEP_M: f64 = 4.0;
/// What belongs to the chosen offset, in metres to either side.
const PEAK_M: f64 = 0.5;

/// How the lateral error of a trajectory behaves: a stationary process that forgets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GnssError {
    /// Standard deviation in metres.
    pub sigma_m: f64,
    /// Time over which it forgets, in seconds.
    pub memory_s: f64,
    /// By how much it must explain a chunk better than the first kind, in nats. An error that is
    /// large and stays is also what edits of several lines beside each other look like.
    pub handicap_nats: f64,
}

impl GnssError {
    /// The receivers that are told apart: good ones (corrected, or coupled with inertia), ordinary
    /// ones whose error stays for minutes, and those between high buildings. Which one a drive has
    /// is decided by what explains it better.
    pub const KINDS: [Self; 3] = [
        Self {
            sigma_m: 0.4,
            memory_s: 50.0,
            handicap_nats: 0.0,
        },
        Self {
            sigma_m: 1.4,
            memory_s: 300.0,
            handicap_nats: 12.0,
        },
        Self {
            sigma_m: 1.4,
            memory_s: 30.0,
            handicap_nats: 0.0,
        },
    ];
}

/// Whether poses are laid on the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Registering {
    /// By the lines that were seen.
    #[default]
    On,
    /// Poses are taken as they are, as the source paper does: to see what registration is worth.
    Off,
}

impl Registering {
    /// What evidence that is made so says of its method: the two are never added up.
    #[must_use]
    pub fn method(self) -> i32 {
        match self {
            Self::On => METHOD_VERSION,
            Self::Off => UNREGISTERED_METHOD,
        }
    }

    /// What evidence of a method was made with; none if this program does not make it.
    #[must_use]
    pub fn of_method(method: i32) -> Option<Self> {
        [Self::On, Self::Off]
            .into_iter()
            .find(|registering| registering.method() == method)
    }
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

impl Registration {
    /// The pose as it is.
    pub(crate) const NONE: Self = Self {
        offset_m: 0.0,
        sigma_m: 0.0,
        confidence: 1.0,
    };
}

/// What one frame says: the lines seen, and the map lines where its pose puts them.
#[derive(Debug, Clone, Copy)]
pub struct Glance<'a> {
    /// Capture time.
    pub stamp_ns: i64,
    /// Where the trajectory has the vehicle, east and north in metres.
    pub place_m: [f64; 2],
    /// Lines seen.
    pub seen: &'a [Profile],
    /// Map lines.
    pub mapped: &'a [Profile],
}

/// Registers all frames of a chunk (context included) against the map, under the kind of GNSS
/// error that explains them best.
#[must_use]
pub fn register(glances: &[Glance<'_>]) -> Vec<Registration> {
    let steps = Step::cut(glances);
    if steps.is_empty() {
        return Vec::new();
    }
    let Receivers(kinds) = &mut Receivers::default();
    let mut best = (f64::NEG_INFINITY, 0);
    for (kind, drifts) in kinds.iter_mut().enumerate() {
        let nats = forward(&steps, drifts, |_| ());
        // The first of equals, so that nothing to go by means the better receiver.
        if nats > best.0 {
            best = (nats, kind);
        }
    }
    let posterior = posterior(&steps, &mut kinds[best.1]);
    let peaks: Vec<Registration> = posterior.iter().map(peak).collect();
    glances
        .iter()
        .map(|glance| interpolate(&steps, &peaks, glance.stamp_ns))
        .collect()
}

/// The log-likelihood alone, in nats: how well frames, poses and map go together.
#[must_use]
pub(crate) fn log_likelihood(glances: &[Glance<'_>], receivers: &mut Receivers) -> f64 {
    let steps = Step::cut(glances);
    let kinds = receivers.0.iter_mut();
    kinds
        .map(|drifts| forward(&steps, drifts, |_| ()))
        .fold(f64::NEG_INFINITY, f64::max)
}

pub(crate) type Offsets = [f64; STATES];

pub(crate) fn offset_m(state: usize) -> f64 {
    state as f64 * STEP_M - REACH_M
}

/// A stretch of time with the votes of its frames.
struct Step {
    centre_ns: i64,
    /// Log-likelihood of the likeliest offset, in nats.
    best_nats: f64,
    /// Likelihood of each offset, relative to the likeliest.
    likelihood: Offsets,
}

impl Step {
    fn cut(glances: &[Glance<'_>]) -> Vec<Self> {
        let window = |glance: &Glance<'_>| glance.stamp_ns.div_euclid(STEP_NS);
        glances
            .chunk_by(|a, b| window(a) == window(b))
            .map(|step| Self::new(window(&step[0]) * STEP_NS + STEP_NS / 2, votes(step)))
            .collect()
    }

    fn new(centre_ns: i64, nats: Offsets) -> Self {
        let best_nats = nats.iter().copied().fold(f64::MIN, f64::max);
        // Offsets that no line votes for are alike, and lie side by side.
        let mut last = (best_nats, 1.0);
        let mut likelihood = nats;
        for value in &mut likelihood {
            if *value != last.0 {
                last = (*value, (*value - best_nats).exp());
            }
            *value = last.1;
        }
        Self {
            centre_ns,
            best_nats,
            likelihood,
        }
    }
}

/// Summed votes of frames, tempered: frames within a step see the same paint.
fn votes(glances: &[Glance<'_>]) -> Offsets {
    let mut sum = [0.0; STATES];
    let nobody = OUTLIERS.ln();
    for glance in glances {
        // Any of the map lines in view could have been the one that is seen.
        let share = 1.0 / glance.mapped.len().max(1) as f64;
        for seen in glance.seen {
            vote(seen, glance.mapped, share, nobody, &mut sum);
        }
    }
    let (first, last) = (glances[0].place_m, glances[glances.len() - 1].place_m);
    let moved_m = (last[0] - first[0]).hypot(last[1] - first[1]);
    let frames = glances.len() as f64;
    let worth = LOOKS_PER_STEP * (moved_m / FULL_STEP_M).clamp(0.1, 1.0);
    for nats in &mut sum {
        *nats = *nats * worth / frames;
    }
    sum
}

/// Adds one seen line's log-likelihood of every offset, relative to clutter; `nobody` is that of
/// an offset which lays it on no map line.
fn vote(seen: &Profile, mapped: &[Profile], share: f64, nobody: f64, sum: &mut Offsets) {
    let sigma_m = line_sigma_m(seen.lateral_m);
    let height = (1.0 - OUTLIERS) / (sigma_m * std::f64::consts::TAU.sqrt());
    let reach_m = 4.0 * sigma_m;
    // Squared distance to the likeliest map line in sigmas, and the states that have one nearby.
    let mut squares = [f64::INFINITY; STATES];
    let mut voted: u128 = 0;
    for mapped in mapped {
        // A step of slack for rounding: what is beyond the grid is left out by `near`.
        let Some(offset) = seen.offset_from(mapped, REACH_M + reach_m + STEP_M) else {
            continue;
        };
        let states = near(-offset, reach_m);
        let penalty = paint_penalty(seen.marking, mapped.marking);
        voted |= ((1 << states.len()) - 1) << states.start;
        for (square, state) in squares[states.clone()].iter_mut().zip(states) {
            let z = (offset_m(state) + offset) / sigma_m;
            *square = square.min(z * z + penalty);
        }
    }
    let mut votes = [nobody; STATES];
    while voted != 0 {
        let state = voted.trailing_zeros() as usize;
        let best = height * (-0.5 * squares[state]).exp();
        votes[state] = (OUTLIERS + best * share * CLUTTER_WIDTH_M).ln();
        voted &= voted - 1;
    }
    for (sum, vote) in sum.iter_mut().zip(votes) {
        *sum += vote;
    }
}

/// What is added to a squared distance in sigmas for how two lines are painted.
fn paint_penalty(seen: Marking, mapped: Marking) -> f64 {
    let kind = |marking| match marking {
        Marking::Unknown | Marking::Other => None,
        // Which side is solid depends on the direction of the map's line.
        Marking::DashedSolid => Some(Marking::SolidDashed),
        known => Some(known),
    };
    match (kind(seen), kind(mapped)) {
        (Some(seen), Some(mapped)) if seen == mapped => -2.0 * AGREES.ln(),
        (Some(_), Some(_)) => -2.0 * DIFFERS.ln(),
        _ => 0.0,
    }
}

/// The states within `reach_m` of an offset.
fn near(centre_m: f64, reach_m: f64) -> std::ops::Range<usize> {
    // Rounded up and down by hand: `ceil` and `floor` are calls on processors without SSE 4.1.
    let first = ((centre_m - reach_m + REACH_M) / STEP_M).max(0.0);
    let from = first as usize + usize::from(first > (first as usize) as f64);
    let last = (centre_m + reach_m + REACH_M) / STEP_M;
    let to = if last < 0.0 { 0 } else { last as usize + 1 }.min(STATES);
    from.min(to)..to
}

/// The forward pass of the chain under one kind of GNSS error: shows the belief at each step,
/// given the steps up to it, and returns the log-likelihood of all.
fn forward(steps: &[Step], drifts: &mut Drifts, mut show: impl FnMut(&Offsets)) -> f64 {
    let mut log_likelihood = -drifts.error.handicap_nats;
    let mut belief = drifts.stationary;
    for (index, step) in steps.iter().enumerate() {
        if index > 0 {
            drifts
                .over(time_between_ns(steps, index))
                .ahead(&mut belief);
        }
        log_likelihood += step.best_nats + multiply(&mut belief, &step.likelihood).ln();
        show(&belief);
    }
    log_likelihood
}

/// Posterior of the offset at each step, given all steps.
fn posterior(steps: &[Step], drifts: &mut Drifts) -> Vec<Offsets> {
    let mut posterior = Vec::with_capacity(steps.len());
    forward(steps, drifts, |belief| posterior.push(*belief));
    let mut message = [1.0; STATES];
    for index in (0..posterior.len()).rev() {
        multiply(&mut posterior[index], &message);
        multiply(&mut message, &steps[index].likelihood);
        if index > 0 {
            message = drifts.over(time_between_ns(steps, index)).back(&message);
        }
    }
    posterior
}

fn time_between_ns(steps: &[Step], index: usize) -> i64 {
    steps[index].centre_ns - steps[index - 1].centre_ns
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

/// The highest peak of a posterior.
fn peak(posterior: &Offsets) -> Registration {
    let reach = (PEAK_M / STEP_M).round() as usize;
    let window = |centre: usize| centre.saturating_sub(reach)..=(centre + reach).min(STATES - 1);
    let mut masses = [0.0; STATES];
    for shift in -(reach as isize)..=reach as isize {
        let (centres, states) = shifted(shift);
        for (mass, value) in masses[centres].iter_mut().zip(&posterior[states]) {
            *mass += value;
        }
    }
    let best = (0..STATES)
        .max_by(|&a, &b| masses[a].total_cmp(&masses[b]).then(b.cmp(&a)))
        .unwrap_or(STATES / 2);
    let confidence = masses[best];
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
