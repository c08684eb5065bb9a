//! How the lateral error of a trajectory moves from one step of the chain to the next: the
//! transition of the registration chain, on its grid of offsets.

use std::collections::BTreeMap;

use crate::register::{GnssError, Offsets, REACH_M, STATES, STEP_M, offset_m};

/// Chance that the error jumps anywhere within a second (multipath).
const JUMPS_PER_S: f64 = 1e-3;

/// The kinds of receivers that are told apart, with their drifts.
pub(crate) struct Receivers(pub(crate) [Drifts; GnssError::KINDS.len()]);

impl Default for Receivers {
    fn default() -> Self {
        Self(GnssError::KINDS.map(Drifts::new))
    }
}

/// The drifts of one kind of GNSS error. Steps are mostly equally far apart, and a drift takes
/// two thousand exponentials, so each is worked out once.
pub(crate) struct Drifts {
    pub(crate) error: GnssError,
    /// What GNSS says of the offset.
    pub(crate) stationary: Offsets,
    by_time_ns: BTreeMap<i64, Drift>,
}

impl Drifts {
    fn new(error: GnssError) -> Self {
        Self {
            error,
            stationary: stationary(error),
            by_time_ns: BTreeMap::new(),
        }
    }

    /// The drift over some time.
    pub(crate) fn over(&mut self, time_ns: i64) -> &Drift {
        let (error, anywhere) = (self.error, &self.stationary);
        self.by_time_ns
            .entry(time_ns)
            .or_insert_with(|| Drift::new(error, time_ns as f64 * 1e-9, anywhere))
    }
}

fn stationary(error: GnssError) -> Offsets {
    let weights: Offsets = std::array::from_fn(|state| {
        let z = offset_m(state) / error.sigma_m;
        (-0.5 * z * z).exp()
    });
    let total: f64 = weights.iter().sum();
    weights.map(|weight| weight / total)
}

/// How the error moves in some time: it forgets a little and is driven a little
/// (Ornstein-Uhlenbeck), and rarely jumps (multipath).
pub(crate) struct Drift {
    /// Chances of moving by a number of states, ascending: for each offset that is moved from, 0
    /// beyond the reach. A loop over offsets has no branches and no sums that wait for each other.
    bands: Vec<(isize, Offsets)>,
    jump: f64,
    anywhere: Offsets,
    /// Where the error is after a jump, times the chance of one.
    jumped: Offsets,
}

impl Drift {
    fn new(error: GnssError, seconds: f64, anywhere: &Offsets) -> Self {
        let kept = (-seconds / error.memory_s).exp();
        let sigma_m = (error.sigma_m * (1.0 - kept * kept).sqrt()).max(0.5 * STEP_M);
        let reach_m = 3.5 * sigma_m;
        let mut bands: BTreeMap<isize, Offsets> = BTreeMap::new();
        for from in 0..STATES {
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
            for (to, weight) in (first..=last).zip(weights) {
                let band = bands.entry(to as isize - from as isize);
                band.or_insert([0.0; STATES])[from] = weight / total;
            }
        }
        let jump = (JUMPS_PER_S * seconds).min(1.0);
        Self {
            bands: bands.into_iter().collect(),
            jump,
            anywhere: *anywhere,
            jumped: anywhere.map(|chance| jump * chance),
        }
    }

    /// Moves a belief on.
    pub(crate) fn ahead(&self, belief: &mut Offsets) {
        let mut kept = *belief;
        kept.iter_mut().for_each(|value| *value *= 1.0 - self.jump);
        belief.copy_from_slice(&self.jumped);
        // Descending: each offset gathers from the lowest to the highest.
        for (shift, weights) in self.bands.iter().rev() {
            let (from, to) = shifted(*shift);
            let chances = kept[from.clone()].iter().zip(&weights[from]);
            for (moved, (kept, weight)) in belief[to].iter_mut().zip(chances) {
                *moved += kept * weight;
            }
        }
    }

    /// What a message from afterwards says before.
    pub(crate) fn back(&self, message: &Offsets) -> Offsets {
        let jumped: f64 = message
            .iter()
            .zip(&self.anywhere)
            .map(|(m, chance)| m * chance)
            .sum();
        let mut kept = [0.0; STATES];
        for (shift, weights) in &self.bands {
            let (from, to) = shifted(*shift);
            let messages = message[to].iter().zip(&weights[from.clone()]);
            for (kept, (m, weight)) in kept[from].iter_mut().zip(messages) {
                *kept += m * weight;
            }
        }
        kept.map(|kept| (1.0 - self.jump) * kept + self.jump * jumped)
    }
}

/// The states from which, and those to which, a shift stays on the grid.
pub(crate) fn shifted(shift: isize) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
    let size = STATES - shift.unsigned_abs();
    if shift < 0 {
        (STATES - size..STATES, 0..size)
    } else {
        (0..size, STATES - size..STATES)
    }
}
