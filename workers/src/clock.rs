//! By how much the clock of the detection channel differs from that of the positions
//! (method.md, section 2: camera-GNSS time offset, estimated where the data can tell it).
//!
//! A pipeline that stamps detections when they come out, or a log that was put together wrongly,
//! shifts the two by up to many seconds. At 10 m/s a second is a whole section of the map, so this
//! comes before everything else. A lag is right if the lines that were seen fit the map along the
//! trajectory it implies: lane changes, curves and lanes that begin and end tell it. All lags on a
//! grid are weighed by the likelihood of the registration chain; no lag is the likeliest before
//! anything was seen.

use crate::cuts::{CutLine, cut_map, cut_seen};
use crate::local_map::LocalMap;
use crate::look::SeenFrame;
use crate::pose::Trajectory;
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
/// Prior of "no lag" against all others together, before a fleet was seen.
const NO_LAG_PRIOR: f64 = 0.5;
/// Spread of the lags of a fleet about their common value, in cells (2 s).
const FLEET_SPREAD_CELLS: f64 = 8.0;
/// Share of drives whose lag has nothing to do with that of their fleet.
const STRANGERS: f64 = 0.1;
/// A fleet's lag is believed if it explains the drives better than "no lag" by this much, in nats.
const FLEET_MARGIN: f64 = 20.0;
/// A lag within this many cells of the chosen one puts frames within a section of the right place.
const PEAK_CELLS: i64 = 5;

/// The chain's looks are tempered for an edit that a drive passes in seconds; a wrong lag must
/// explain the whole drive, so its evidence counts for more.
const LAG_WEIGHT: f64 = 2.0;

/// What is known of a channel's lag before a drive is looked at: a part of the sensor model,
/// fitted to a fleet and kept with the store.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ClockPrior {
    /// The fleet's common lag in seconds; none: the clocks are taken to agree unless a drive
    /// says otherwise.
    pub fleet_lag_s: Option<i64>,
}

impl ClockPrior {
    /// Fits the common lag of a fleet to the scores of its chunks. Whole seconds: finer than what
    /// drives of one fleet agree on, and coarse enough that a few drives more do not move it.
    #[must_use]
    pub fn fit(chunks: &[LagScores]) -> Self {
        let explained = |prior: Self| -> f64 {
            let of = chunks.iter().map(|scores| prior.log_evidence(scores));
            of.sum()
        };
        let cells_per_s = 1_000_000_000 / CELL_NS;
        let seconds = MIN_LAG_CELLS / cells_per_s..=MAX_LAG_CELLS / cells_per_s;
        let best = seconds
            .map(|second| Self {
                fleet_lag_s: Some(second),
            })
            .map(|prior| (explained(prior), prior))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match best {
            Some((nats, prior)) if nats > explained(Self::default()) + FLEET_MARGIN => prior,
            _ => Self::default(),
        }
    }

    /// Log-prior of a lag in cells, in nats.
    fn nats(self, lag: i64) -> f64 {
        let uniform = 1.0 / (MAX_LAG_CELLS - MIN_LAG_CELLS) as f64;
        let density = match self.fleet_lag_s {
            Some(seconds) => {
                let z = (lag - seconds * (1_000_000_000 / CELL_NS)) as f64 / FLEET_SPREAD_CELLS;
                let height = 1.0 / (FLEET_SPREAD_CELLS * std::f64::consts::TAU.sqrt());
                (1.0 - STRANGERS) * height * (-0.5 * z * z).exp() + STRANGERS * uniform
            }
            None if lag == 0 => NO_LAG_PRIOR,
            None => (1.0 - NO_LAG_PRIOR) * uniform,
        };
        density.ln()
    }

    /// Log-likelihood of a chunk under the prior, each tried lag standing for its neighbours.
    fn log_evidence(self, scores: &LagScores) -> f64 {
        let joint: Vec<f64> = scores
            .iter()
            .map(|&(lag, nats)| nats + self.nats(lag))
            .collect();
        let most = joint.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        most + joint
            .iter()
            .map(|nats| (nats - most).exp())
            .sum::<f64>()
            .ln()
    }
}

/// Lags in cells with the log-likelihood of the frames under each, in nats.
pub type LagScores = Vec<(i64, f64)>;

/// The offset between two clocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockOffset {
    /// How much later detections are stamped than positions, in nanoseconds.
    pub lag_ns: i64,
    /// Posterior of this lag (give or take a section's length) against all others.
    pub confidence: f64,
}

/// Log-likelihoods of the lags on the coarse grid; none if there is too little to tell any.
#[must_use]
pub fn scores(
    frames: &[SeenFrame],
    trajectory: &Trajectory,
    map: &LocalMap<'_>,
) -> Option<LagScores> {
    let cells = Cells::new(frames, trajectory, map);
    (cells.judged.len() >= MIN_CELLS).then(|| cells.coarse())
}

/// Estimates the lag of `frames` behind `trajectory`.
#[must_use]
pub fn estimate(
    frames: &[SeenFrame],
    trajectory: &Trajectory,
    map: &LocalMap<'_>,
    prior: ClockPrior,
) -> ClockOffset {
    let cells = Cells::new(frames, trajectory, map);
    if cells.judged.len() < MIN_CELLS {
        return prior.alone();
    }
    let with_prior = |(lag, nats): (i64, f64)| (lag, nats + prior.nats(lag));
    let coarse: LagScores = cells.coarse().into_iter().map(with_prior).collect();
    let best = |scores: &[(i64, f64)]| {
        let better =
            |a: &(i64, f64), b: &(i64, f64)| a.1.total_cmp(&b.1).then(b.0.abs().cmp(&a.0.abs()));
        scores.iter().copied().max_by(better).unwrap_or((0, 0.0))
    };
    let (around, _) = best(&coarse);
    let reach = COARSE_CELLS as i64 - 1;
    let fine = (around - reach..=around + reach)
        .filter(|lag| (lag - MIN_LAG_CELLS) % COARSE_CELLS as i64 != 0)
        .map(|lag| with_prior((lag, cells.score(lag))));
    let scores: LagScores = coarse.iter().copied().chain(fine).collect();
    let (lag, top) = best(&scores);
    // Posterior mass, each coarse lag standing for its neighbours.
    let mass = |near: bool| -> f64 {
        let of = coarse
            .iter()
            .filter(|(other, _)| ((other - lag).abs() <= PEAK_CELLS) == near);
        of.map(|(_, score)| (score - top).exp()).sum()
    };
    let (inside, outside) = (mass(true).max(1.0), mass(false));
    ClockOffset {
        lag_ns: lag * CELL_NS,
        confidence: inside / (inside + outside),
    }
}

impl ClockPrior {
    /// What is believed of a drive that cannot tell its lag.
    fn alone(self) -> ClockOffset {
        match self.fleet_lag_s {
            None => ClockOffset {
                lag_ns: 0,
                confidence: 1.0,
            },
            // The fleet's spread is wider than a section: the drive is about there, not surely.
            Some(seconds) => ClockOffset {
                lag_ns: seconds * 1_000_000_000,
                confidence: 0.5,
            },
        }
    }
}

/// Frames and map lines, sampled on the grid of times.
struct Cells {
    first: i64,
    /// Lines seen in each cell, by its first frame.
    seen: Vec<Option<Vec<CutLine>>>,
    /// Place of the vehicle in each cell, and map lines around it.
    mapped: Vec<Option<([f64; 2], Vec<CutLine>)>>,
    /// Cells whose frames have a pose under every lag, so that all lags explain the same frames.
    judged: Vec<usize>,
}

impl Cells {
    fn new(frames: &[SeenFrame], trajectory: &Trajectory, map: &LocalMap<'_>) -> Self {
        let cell_of = |stamp_ns: i64| stamp_ns.div_euclid(CELL_NS);
        let first = frames.first().map_or(0, |frame| cell_of(frame.stamp_ns));
        let last = frames.last().map_or(-1, |frame| cell_of(frame.stamp_ns));
        let size = usize::try_from(last - first + 1).unwrap_or(0);
        let mut seen: Vec<Option<Vec<CutLine>>> = vec![None; size];
        for frame in frames {
            let cell = &mut seen[(cell_of(frame.stamp_ns) - first) as usize];
            if cell.is_none() {
                *cell = Some(cut_seen(&frame.lines));
            }
        }
        let mut scratch = Vec::new();
        let mapped: Vec<_> = (first..first + size as i64)
            .map(|cell| {
                let pose = trajectory.at(cell * CELL_NS + CELL_NS / 2)?;
                Some((
                    [pose.east_m, pose.north_m],
                    cut_map(&pose, map, &mut scratch),
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

    fn coarse(&self) -> LagScores {
        (MIN_LAG_CELLS..=MAX_LAG_CELLS)
            .step_by(COARSE_CELLS)
            .map(|lag| (lag, self.score(lag)))
            .collect()
    }

    /// Log-likelihood of a lag, in nats.
    fn score(&self, lag: i64) -> f64 {
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
        LAG_WEIGHT * log_likelihood(&glances)
    }
}
