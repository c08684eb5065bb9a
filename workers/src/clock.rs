//! By how much the clock of the detection channel differs from that of the positions
//! (method.md, section 2: camera-GNSS time offset, estimated where the data can tell it).
//!
//! A pipeline that stamps detections when they come out, or a log that was put together wrongly,
//! shifts the two by up to many seconds. At 10 m/s a second is a whole section of the map, so this
//! comes before everything else. A lag is right if the lines that were seen fit the map along the
//! trajectory it implies: lane changes, curves and lanes that begin and end tell it. All lags on a
//! grid are weighed by the likelihood of the registration chain; no lag is the likeliest before
//! anything was seen. A lag at an end of the grid is not taken: what fits ever better up to there is
//! no peak, and the doubt that it leaves shows in the confidence.

use crate::cuts::{cut_map, cut_seen};
use crate::drift::Receivers;
use crate::local_map::{LocalMap, Near};
use crate::look::SeenFrame;
use crate::pose::Trajectory;
use crate::profile::{Profile, seen_profiles};
use crate::register::{Glance, log_likelihood};

/// Grid of times, in nanoseconds: frames, poses and lags are sampled on it.
const CELL_NS: i64 = 250_000_000;
/// Lags that are tried first, in cells.
const COARSE_CELLS: usize = 4;
/// Lags in cells: detections may be this much ahead of positions...
const MIN_LAG_CELLS: i64 = -8;
/// ... or behind them: 16 s.
const MAX_LAG_CELLS: i64 = 64;
/// Below this many cells with frames and poses, no lag can be told.
const MIN_CELLS: usize = 24;
/// Prior of "no lag" against all others together.
const NO_LAG_PRIOR: f64 = 0.99;
/// A lag within this many cells of the chosen one puts frames within a section of the right place.
const PEAK_CELLS: i64 = 5;

/// The chain's looks are tempered for an edit that a drive passes in seconds; a wrong lag must
/// explain the whole drive, so its evidence counts for more.
const LAG_WEIGHT: f64 = 2.0;

/// Log-prior of a lag in cells, in nats.
fn prior_nats(lag: i64) -> f64 {
    let others = (MAX_LAG_CELLS - MIN_LAG_CELLS) as f64;
    let density = if lag == 0 {
        NO_LAG_PRIOR
    } else {
        (1.0 - NO_LAG_PRIOR) / others
    };
    density.ln()
}

fn is_end(lag: i64) -> bool {
    lag == MIN_LAG_CELLS || lag == MAX_LAG_CELLS
}

/// Lags in cells with the log-likelihood of the frames under each, in nats.
type LagScores = Vec<(i64, f64)>;

/// The offset between two clocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockOffset {
    /// How much later detections are stamped than positions, in nanoseconds.
    pub lag_ns: i64,
    /// Posterior of this lag (give or take a section's length) against all others.
    pub confidence: f64,
}

/// Estimates the lag of `frames` behind `trajectory`.
#[must_use]
pub fn estimate(frames: &[SeenFrame], trajectory: &Trajectory, map: &LocalMap<'_>) -> ClockOffset {
    let cells = Cells::new(frames, trajectory, map);
    if cells.judged.len() < MIN_CELLS {
        return ClockOffset {
            lag_ns: 0,
            confidence: 1.0,
        };
    }
    let with_prior = |(lag, nats): (i64, f64)| (lag, nats + prior_nats(lag));
    let mut receivers = Receivers::default();
    let coarse: LagScores = cells
        .coarse(&mut receivers)
        .into_iter()
        .map(with_prior)
        .collect();
    let posterior = Posterior::new(&coarse);
    let around = posterior.peak();
    let reach = COARSE_CELLS as i64 - 1;
    let fine = (around - reach..=around + reach)
        .filter(|lag| (lag - MIN_LAG_CELLS) % COARSE_CELLS as i64 != 0)
        .map(|lag| with_prior((lag, cells.score(lag, &mut receivers))));
    let near = coarse.iter().copied().filter(|(lag, _)| *lag == around);
    let lag = likeliest(near.chain(fine)).unwrap_or(around);
    ClockOffset {
        lag_ns: lag * CELL_NS,
        confidence: posterior.near(around),
    }
}

/// The lag with the most; the smaller one of equals.
fn likeliest(scores: impl Iterator<Item = (i64, f64)>) -> Option<i64> {
    let better =
        |a: &(i64, f64), b: &(i64, f64)| a.1.total_cmp(&b.1).then(b.0.abs().cmp(&a.0.abs()));
    scores.max_by(better).map(|(lag, _)| lag)
}

/// Posterior of the lags on the coarse grid.
struct Posterior(Vec<(i64, f64)>);

impl Posterior {
    fn new(coarse: &[(i64, f64)]) -> Self {
        let top = coarse
            .iter()
            .map(|(_, score)| *score)
            .fold(f64::NEG_INFINITY, f64::max);
        // No lag is one lag; any other one stands for its neighbours as well.
        let mass = |&(lag, score): &(i64, f64)| {
            let cells = if lag == 0 { 1 } else { COARSE_CELLS };
            (lag, cells as f64 * (score - top).exp())
        };
        let masses: Vec<(i64, f64)> = coarse.iter().map(mass).collect();
        let sum: f64 = masses.iter().map(|(_, mass)| mass).sum();
        let share = |(lag, mass)| (lag, mass / sum);
        Self(masses.into_iter().map(share).collect())
    }

    /// How likely a lag is, give or take a section's length.
    fn near(&self, lag: i64) -> f64 {
        let near = self
            .0
            .iter()
            .filter(|(other, _)| (other - lag).abs() <= PEAK_CELLS);
        near.map(|(_, share)| share).sum()
    }

    /// The likeliest lag where most of the posterior lies. A lag at an end of the grid is none.
    fn peak(&self) -> i64 {
        let inner = || self.0.iter().filter(|(lag, _)| !is_end(*lag));
        let around = likeliest(inner().map(|&(lag, _)| (lag, self.near(lag)))).unwrap_or(0);
        let near = inner().filter(|(lag, _)| (lag - around).abs() <= PEAK_CELLS);
        likeliest(near.copied()).unwrap_or(0)
    }
}

/// Frames and map lines, sampled on the grid of times.
struct Cells {
    first: i64,
    /// Lines seen in each cell, by its first frame.
    seen: Vec<Option<Vec<Profile>>>,
    /// Place of the vehicle in each cell, and map lines around it.
    mapped: Vec<Option<([f64; 2], Vec<Profile>)>>,
    /// Cells whose frames have a pose under every lag, so that all lags explain the same frames.
    judged: Vec<usize>,
}

impl Cells {
    fn new(frames: &[SeenFrame], trajectory: &Trajectory, map: &LocalMap<'_>) -> Self {
        let cell_of = |stamp_ns: i64| stamp_ns.div_euclid(CELL_NS);
        let first = frames.first().map_or(0, |frame| cell_of(frame.stamp_ns));
        let last = frames.last().map_or(-1, |frame| cell_of(frame.stamp_ns));
        let size = usize::try_from(last - first + 1).unwrap_or(0);
        let mut seen: Vec<Option<Vec<Profile>>> = vec![None; size];
        for frame in frames {
            let cell = &mut seen[(cell_of(frame.stamp_ns) - first) as usize];
            if cell.is_none() {
                *cell = Some(seen_profiles(&cut_seen(&frame.lines), &frame.lines));
            }
        }
        let mut near = Near::default();
        let mapped: Vec<_> = (first..first + size as i64)
            .map(|cell| {
                let pose = trajectory.at(cell * CELL_NS + CELL_NS / 2)?;
                Some((
                    [pose.east_m, pose.north_m],
                    map.profiles(&cut_map(&pose, map, &mut near)),
                ))
            })
            .collect();
        let has_pose = |cell: i64| {
            let index = usize::try_from(cell).ok();
            index
                .and_then(|index| mapped.get(index))
                .is_some_and(Option::is_some)
        };
        let judged = (0..size)
            .filter(|&cell| seen[cell].as_ref().is_some_and(|lines| !lines.is_empty()))
            .filter(|&cell| {
                has_pose(cell as i64 - MAX_LAG_CELLS) && has_pose(cell as i64 - MIN_LAG_CELLS)
            })
            .collect();
        Self {
            first,
            seen,
            mapped,
            judged,
        }
    }

    fn coarse(&self, receivers: &mut Receivers) -> LagScores {
        (MIN_LAG_CELLS..=MAX_LAG_CELLS)
            .step_by(COARSE_CELLS)
            .map(|lag| (lag, self.score(lag, receivers)))
            .collect()
    }

    /// Log-likelihood of a lag, in nats.
    fn score(&self, lag: i64, receivers: &mut Receivers) -> f64 {
        let glances: Vec<Glance<'_>> = self
            .judged
            .iter()
            .filter_map(|&cell| {
                let seen = self.seen[cell].as_deref()?;
                let (place_m, mapped) = self.mapped.get((cell as i64 - lag) as usize)?.as_ref()?;
                Some(Glance {
                    stamp_ns: (self.first + cell as i64) * CELL_NS,
                    place_m: *place_m,
                    seen,
                    mapped,
                })
            })
            .collect();
        LAG_WEIGHT * log_likelihood(&glances, receivers)
    }
}
