//! How far along its way a vehicle really was, told by the areas that it passed.
//!
//! The error is a process that forgets (Ornstein-Uhlenbeck); every area that is passed measures it
//! once. What one area says of its own place must not come from itself: its residual is taken against
//! the error as all the others tell it, with the uncertainty that this leaves. A stop line that was
//! painted anew two metres on is then not explained by its vehicle being two metres off.

use super::Glimpse;
use super::pair::Pair;

/// Standard deviation of the error, in metres, and the time over which it forgets, in seconds: those of
/// an ordinary receiver.
const SIGMA_M: f64 = 1.4;
const MEMORY_S: f64 = 30.0;
/// Noise of a place along the way, in metres, and its growth with the square of the distance: pitch
/// moves what is far ahead.
const NEAR_SIGMA_M: f64 = 0.2;
const SIGMA_GROWTH_PER_M: f64 = 0.002;
/// An area not seen for this long is passed anew.
const PASS_GAP_NS: i64 = 10_000_000_000;

/// Noise of the place of an area seen `range_m` ahead, in metres along the way.
#[must_use]
pub fn along_sigma_m(range_m: f64) -> f64 {
    NEAR_SIGMA_M + SIGMA_GROWTH_PER_M * range_m * range_m
}

/// An estimate with its standard deviation, in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ahead {
    /// How far ahead of its pose the vehicle really was.
    pub offset_m: f64,
    /// Standard deviation.
    pub sigma_m: f64,
}

/// One passing of an area, as a measurement of the error.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Passing {
    mapped: usize,
    last_ns: i64,
    weight: f64,
    /// Weighted sums of the error and of the time since the first passing's start.
    error: f64,
    time_s: f64,
    frames: f64,
    first_ns: i64,
}

impl Passing {
    fn error_m(&self) -> f64 {
        self.error / self.weight
    }

    /// Frames of a passing err alike: many are as good as one.
    fn variance_m2(&self) -> f64 {
        self.frames / self.weight
    }

    fn at_s(&self) -> f64 {
        self.time_s / self.weight
    }
}

/// The error along the way over a chunk.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Drift {
    origin_ns: i64,
    /// In order of their time.
    passings: Vec<Passing>,
}

impl Drift {
    /// Measures it by what was paired in each glimpse (capture order).
    #[must_use]
    pub fn measure(glimpses: &[Glimpse<'_>], pairs: &[Vec<Pair>]) -> Self {
        let origin_ns = glimpses.first().map_or(0, |g| g.look.pose.stamp_ns);
        let mut drift = Self {
            origin_ns,
            passings: Vec::new(),
        };
        for (glimpse, pairs) in glimpses.iter().zip(pairs) {
            for pair in pairs {
                let range_m = glimpse.areas[pair.seen].centre_m[0];
                drift.add(glimpse.look.pose.stamp_ns, pair, range_m);
            }
        }
        drift
            .passings
            .sort_by(|a, b| a.at_s().total_cmp(&b.at_s()).then(a.mapped.cmp(&b.mapped)));
        drift
    }

    fn add(&mut self, stamp_ns: i64, pair: &Pair, range_m: f64) {
        let is_same = |passing: &Passing| {
            passing.mapped == pair.mapped && stamp_ns - passing.last_ns <= PASS_GAP_NS
        };
        let known = self.passings.iter().rposition(is_same);
        let index = known.unwrap_or_else(|| {
            self.passings.push(Passing {
                mapped: pair.mapped,
                last_ns: stamp_ns,
                weight: 0.0,
                error: 0.0,
                time_s: 0.0,
                frames: 0.0,
                first_ns: stamp_ns,
            });
            self.passings.len() - 1
        });
        let weight = along_sigma_m(range_m).powi(-2);
        let time_s = self.seconds(stamp_ns);
        let passing = &mut self.passings[index];
        passing.last_ns = stamp_ns;
        passing.weight += weight;
        passing.error -= weight * pair.ahead_m;
        passing.time_s += weight * time_s;
        passing.frames += 1.0;
    }

    fn seconds(&self, stamp_ns: i64) -> f64 {
        (stamp_ns - self.origin_ns) as f64 * 1e-9
    }

    /// The error at a time as all areas tell it, but for the passing of `without` that is going on.
    #[must_use]
    pub fn at(&self, stamp_ns: i64, without: Option<usize>) -> Ahead {
        let time_s = self.seconds(stamp_ns);
        let is_other = |passing: &&Passing| {
            let is_near = stamp_ns >= passing.first_ns - PASS_GAP_NS
                && stamp_ns <= passing.last_ns + PASS_GAP_NS;
            without != Some(passing.mapped) || !is_near
        };
        let others = || self.passings.iter().filter(&is_other);
        let before = filter(others().filter(|p| p.at_s() <= time_s), time_s);
        let after = filter(others().rev().filter(|p| p.at_s() > time_s), time_s);
        // Both know what the error is in general: that counts once.
        let precision = 1.0 / before.1 + 1.0 / after.1 - 1.0 / (SIGMA_M * SIGMA_M);
        Ahead {
            offset_m: (before.0 / before.1 + after.0 / after.1) / precision,
            sigma_m: precision.recip().sqrt(),
        }
    }
}

/// Mean and variance at a time, from passings in the order in which they are met on the way to it.
fn filter<'a>(passings: impl Iterator<Item = &'a Passing>, time_s: f64) -> (f64, f64) {
    let prior = SIGMA_M * SIGMA_M;
    let mut belief = (0.0, prior);
    let mut now_s = None;
    for passing in passings {
        let seconds = now_s.map_or(0.0, |now_s: f64| passing.at_s() - now_s);
        let (mean, variance) = forget(belief, seconds);
        let gain = variance / (variance + passing.variance_m2());
        belief = (
            mean + gain * (passing.error_m() - mean),
            (1.0 - gain) * variance,
        );
        now_s = Some(passing.at_s());
    }
    forget(belief, now_s.map_or(0.0, |now_s| time_s - now_s))
}

fn forget((mean, variance): (f64, f64), seconds: f64) -> (f64, f64) {
    let kept = (-seconds.abs() / MEMORY_S).exp();
    let rest = SIGMA_M * SIGMA_M * (1.0 - kept * kept);
    (kept * mean, kept * kept * variance + rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drift(errors: &[(usize, f64, f64)]) -> Drift {
        let mut drift = Drift::default();
        for &(mapped, second, error_m) in errors {
            let pair = Pair {
                seen: 0,
                mapped,
                ahead_m: -error_m,
                left_m: 0.0,
            };
            for frame in 0..5_i64 {
                drift.add((second * 1e9) as i64 + frame * 100_000_000, &pair, 8.0);
            }
        }
        drift
    }

    #[test]
    fn others_tell_what_one_is_off() {
        // Two neighbours say that the vehicle is a metre ahead; the one between says minus one.
        let drift = drift(&[(0, 0.0, 1.0), (1, 2.0, -1.0), (2, 4.0, 1.0)]);
        let all = drift.at(2_200_000_000, None);
        let others = drift.at(2_200_000_000, Some(1));
        assert!(all.offset_m < others.offset_m, "{all:?} {others:?}");
        assert!((others.offset_m - 0.95).abs() < 0.1, "{others:?}");
        assert!(all.sigma_m < others.sigma_m);
    }

    /// The same by solving the joint normal distribution, without any recursion.
    #[test]
    fn agrees_with_the_joint_distribution() {
        let drift = drift(&[(0, 0.0, 1.0), (1, 7.0, -0.4), (2, 30.0, 2.0)]);
        let time_s = 12.0;
        let times: Vec<f64> = drift.passings.iter().map(Passing::at_s).collect();
        let kernel = |a: f64, b: f64| SIGMA_M.powi(2) * (-(a - b).abs() / MEMORY_S).exp();
        let covariance = nalgebra::Matrix3::from_fn(|i, j| {
            let noise = if i == j {
                drift.passings[i].variance_m2()
            } else {
                0.0
            };
            kernel(times[i], times[j]) + noise
        });
        let cross = nalgebra::Vector3::from_fn(|i, _| kernel(times[i], time_s));
        let errors = nalgebra::Vector3::from_fn(|i, _| drift.passings[i].error_m());
        let solved = covariance.try_inverse().unwrap();
        let found = drift.at((time_s * 1e9) as i64, None);
        assert!((found.offset_m - (cross.transpose() * solved * errors)[0]).abs() < 1e-9);
        let variance = SIGMA_M.powi(2) - (cross.transpose() * solved * cross)[0];
        assert!((found.sigma_m - variance.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn nothing_passed_is_nothing_known() {
        let ahead = Drift::default().at(5, None);
        assert_eq!((ahead.offset_m, ahead.sigma_m), (0.0, SIGMA_M));
    }
}
