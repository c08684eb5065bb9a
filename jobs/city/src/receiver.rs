//! How a receiver's positions err.
//!
//! Most of the error drifts over half a minute and more, some of it stays for the drive, and hardly
//! any is white; between buildings it jumps. What looks like an error along the road is mostly one of
//! time: positions are stamped late, by a delay that wavers, and at times they hang for a moment.
//! (Both real sources say so: `docs/results/simulator.md`.)

use crate::drift::Drifting;
use crate::noise::GnssNoise;
use crate::random::Random;

/// Exponent of the distribution of how late positions come while they hang.
const STALL_EXPONENT: f64 = 1.2;

/// The errors of one drive.
#[derive(Debug, Clone)]
pub struct Receiver {
    noise: GnssNoise,
    random: Random,
    bias_m: [f64; 3],
    drift_m: [Drifting; 3],
    delay_s: f64,
    delay_drift: Drifting,
    stall: Spell<f64>,
    jump: Spell<[f64; 3]>,
    outage: Spell<()>,
}

/// How a fix errs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixError {
    /// Error of the position: metres east, north and up.
    pub error_m: [f64; 3],
    /// How old the position is: it is that of this many seconds before its stamp.
    pub delay_s: f64,
    /// Whether there is a fix.
    pub has_fix: bool,
    /// Whether it is the fix before it once more, whatever the error.
    pub is_repeated: bool,
}

impl Receiver {
    /// Draws the errors that stay, and where the others begin.
    #[must_use]
    pub fn draw(noise: &GnssNoise, mut random: Random) -> Self {
        let axes = [1.0, 1.0, noise.height_factor];
        Self {
            bias_m: axes.map(|factor| random.normal(factor * noise.bias_m)),
            drift_m: axes.map(|_| Drifting::draw(&noise.drift, &mut random)),
            delay_s: noise.delay_s + random.normal(noise.delay_spread_s),
            delay_drift: Drifting::draw(&noise.delay_drift, &mut random),
            stall: Spell::default(),
            jump: Spell::default(),
            outage: Spell::default(),
            noise: noise.clone(),
            random,
        }
    }

    /// How the next fix errs, `seconds` after the one before. `near_buildings` is 0 under an open sky and 1
    /// in a street canyon.
    pub fn next_fix(&mut self, seconds: f64, near_buildings: f64) -> FixError {
        FixError {
            error_m: self.position_error_m(seconds, near_buildings),
            delay_s: self.delay_s(seconds),
            has_fix: !self.is_out(seconds, near_buildings),
            is_repeated: self.random.chance(self.noise.repeated),
        }
    }

    /// What receivers claim of themselves: row-major east-north-up covariance in square metres.
    #[must_use]
    pub fn claimed_covariance_m2(&self) -> [f64; 9] {
        let across_m2 = self.noise.claimed_m.powi(2);
        let up_m2 = across_m2 * self.noise.height_factor.powi(2);
        [across_m2, 0.0, 0.0, 0.0, across_m2, 0.0, 0.0, 0.0, up_m2]
    }

    fn position_error_m(&mut self, seconds: f64, near_buildings: f64) -> [f64; 3] {
        let jump_m = self.jump_m(seconds, near_buildings);
        let axes = [1.0, 1.0, self.noise.height_factor];
        let mut error_m = self.bias_m;
        for (axis, factor) in axes.into_iter().enumerate() {
            let drift_m = factor * self.drift_m[axis].step(seconds, &mut self.random);
            let white_m = self.random.normal(factor * self.noise.white_m);
            error_m[axis] += drift_m + jump_m[axis] + white_m;
        }
        error_m
    }

    /// A reflected signal moves the position to one side until it is lost again.
    fn jump_m(&mut self, seconds: f64, near_buildings: f64) -> [f64; 3] {
        let noise = &self.noise;
        let open = noise.jumps_per_minute;
        let canyon = noise.jumps_near_buildings_per_minute;
        let per_minute = between(open, canyon, near_buildings);
        let (size, lasts) = (noise.jump_m, noise.jump_seconds);
        let height_factor = noise.height_factor;
        let drawn = self
            .jump
            .step(seconds, per_minute, &mut self.random, |random| {
                let length_m = random.between(size[0], size[1]);
                let towards = random.between(0.0, std::f64::consts::TAU);
                let up_m = random.normal(height_factor * length_m / 2.0);
                let jump_m = [length_m * towards.cos(), length_m * towards.sin(), up_m];
                (jump_m, random.between(lasts[0], lasts[1]))
            });
        drawn.unwrap_or_default()
    }

    fn delay_s(&mut self, seconds: f64) -> f64 {
        let (late, lasts) = (self.noise.stall_s, self.noise.stall_seconds);
        let per_minute = self.noise.stalls_per_minute;
        let stall = self
            .stall
            .step(seconds, per_minute, &mut self.random, |random| {
                let stall_s = pareto(late, random.unit());
                let lasts_s = lasts[0] * (lasts[1] / lasts[0]).powf(random.unit());
                (stall_s, lasts_s)
            });
        self.delay_s + self.delay_drift.step(seconds, &mut self.random) + stall.unwrap_or_default()
    }

    fn is_out(&mut self, seconds: f64, near_buildings: f64) -> bool {
        let noise = &self.noise;
        let open = noise.outages_per_minute;
        let canyon = noise.outages_near_buildings_per_minute;
        let (per_minute, lasts) = (between(open, canyon, near_buildings), noise.outage_seconds);
        let out = self
            .outage
            .step(seconds, per_minute, &mut self.random, |random| {
                ((), random.between(lasts[0], lasts[1]))
            });
        out.is_some()
    }
}

/// Something that begins by chance and lasts for a while.
#[derive(Debug, Clone, Default)]
struct Spell<T> {
    /// What it is, and the seconds that are left of it.
    now: Option<(T, f64)>,
}

impl<T: Copy> Spell<T> {
    /// Goes on by `seconds`; where one begins, `draw` says what it is and how many seconds it lasts.
    fn step(
        &mut self,
        seconds: f64,
        per_minute: f64,
        random: &mut Random,
        draw: impl FnOnce(&mut Random) -> (T, f64),
    ) -> Option<T> {
        self.now = match self.now {
            Some((what, left_s)) if left_s > seconds => Some((what, left_s - seconds)),
            _ => {
                let begins = 1.0 - (-per_minute * seconds / 60.0).exp();
                random.chance(begins).then(|| draw(random))
            }
        };
        self.now.map(|(what, _)| what)
    }
}

fn between(open: f64, canyon: f64, near_buildings: f64) -> f64 {
    open + (canyon - open) * near_buildings.clamp(0.0, 1.0)
}

/// A lot from a Pareto distribution that is cut at its end.
fn pareto([least, most]: [f64; 2], lot: f64) -> f64 {
    let beyond = 1.0 - lot * (1.0 - (least / most).powf(STALL_EXPONENT));
    least * beyond.powf(-1.0 / STALL_EXPONENT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Drift, NoiseProfile};

    fn quiet() -> GnssNoise {
        let mut noise = NoiseProfile::load("good_gnss").unwrap().of(0).gnss.clone();
        noise.bias_m = 0.0;
        noise.drift.clear();
        noise.white_m = 0.0;
        noise.delay_s = 0.0;
        noise.delay_spread_s = 0.0;
        noise.delay_drift.clear();
        noise.stalls_per_minute = 0.0;
        noise.jumps_per_minute = 0.0;
        noise.jumps_near_buildings_per_minute = 0.0;
        noise.outages_per_minute = 0.0;
        noise.outages_near_buildings_per_minute = 0.0;
        noise.repeated = 0.0;
        noise
    }

    fn fixes(noise: &GnssNoise, near_buildings: f64) -> Vec<FixError> {
        let mut receiver = Receiver::draw(noise, Random::new(3, "receiver", 0));
        (0..100_000)
            .map(|_| receiver.next_fix(0.1, near_buildings))
            .collect()
    }

    #[test]
    fn without_noise_there_is_no_error() {
        let exact = FixError {
            error_m: [0.0; 3],
            delay_s: 0.0,
            has_fix: true,
            is_repeated: false,
        };
        assert!(fixes(&quiet(), 1.0).iter().all(|fix| *fix == exact));
    }

    #[test]
    fn bias_drift_and_white_noise_add_up() {
        let mut noise = quiet();
        noise.drift = vec![Drift {
            sigma: 0.8,
            seconds: 2.0,
        }];
        noise.white_m = 0.3;
        let errors = fixes(&noise, 0.0);
        for (axis, factor) in [1.0, 1.0, noise.height_factor].into_iter().enumerate() {
            let squares = errors.iter().map(|fix| fix.error_m[axis].powi(2));
            let spread = (squares.sum::<f64>() / errors.len() as f64).sqrt() / factor;
            assert!(
                (spread - 0.73_f64.sqrt()).abs() < 0.04,
                "axis {axis}: {spread}"
            );
        }
    }

    #[test]
    fn it_jumps_between_buildings_only() {
        let mut noise = quiet();
        noise.jumps_near_buildings_per_minute = 2.0;
        noise.jump_m = [3.0, 4.0];
        noise.jump_seconds = [5.0, 5.0];
        assert!(fixes(&noise, 0.0).iter().all(|fix| fix.error_m == [0.0; 3]));
        let lengths: Vec<f64> = fixes(&noise, 1.0)
            .iter()
            .map(|fix| fix.error_m[0].hypot(fix.error_m[1]))
            .collect();
        assert!(
            lengths
                .iter()
                .all(|m| *m == 0.0 || (2.999..4.001).contains(m))
        );
        // Every 30 s for 5 s: the share is 5 of 35.
        let away = lengths.iter().filter(|m| **m > 0.0).count() as f64 / 1e5;
        assert!((away - 5.0 / 35.0).abs() < 0.02, "{away}");
    }

    #[test]
    fn stalls_come_as_often_and_as_late_as_is_said() {
        let mut noise = quiet();
        noise.stalls_per_minute = 10.0;
        noise.stall_s = [0.1, 2.0];
        noise.stall_seconds = [0.1, 0.1];
        let delays: Vec<f64> = fixes(&noise, 0.0).iter().map(|r| r.delay_s).collect();
        let mut late: Vec<f64> = delays.into_iter().filter(|delay| *delay > 0.0).collect();
        late.sort_by(f64::total_cmp);
        // 10,000 s are 167 minutes.
        assert!((1_500..1_850).contains(&late.len()), "{}", late.len());
        let (least, median, most) = (late[0], late[late.len() / 2], late[late.len() - 1]);
        assert!(
            least >= 0.1 && (0.16..0.19).contains(&median) && most <= 2.0,
            "{median}"
        );
    }

    #[test]
    fn fixes_are_lost_and_repeated() {
        let mut noise = quiet();
        noise.outages_per_minute = 1.0;
        noise.outage_seconds = [6.0, 6.0];
        noise.repeated = 0.1;
        let fixes = fixes(&noise, 0.0);
        let share = |is: fn(&FixError) -> bool| fixes.iter().filter(|r| is(r)).count() as f64 / 1e5;
        assert!((share(|r| !r.has_fix) - 6.0 / 66.0).abs() < 0.02);
        assert!((share(|r| r.is_repeated) - 0.1).abs() < 0.01);
    }
}
