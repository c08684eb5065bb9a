//! What the vehicle's receiver and inertial sensor say of its motion.
//!
//! A receiver's error is not white: most of it is the sky's and drifts over half a minute, and some
//! of it stays for the whole drive.

use crate::random::Random;

/// Spread (metres) and time constant (seconds) of the drifting error, per axis.
const DRIFT_SIGMA_M: f64 = 1.2;
const DRIFT_TAU_S: f64 = 30.0;
/// Spread of the error that stays, per axis, and of what is white, in metres.
const BIAS_SIGMA_M: f64 = 0.4;
const WHITE_SIGMA_M: f64 = 0.03;
/// Heights are worse by this factor.
const HEIGHT_FACTOR: f64 = 2.0;
/// Spread of the heading's constant and white errors, in radians.
const YAW_BIAS_SIGMA_RAD: f64 = 0.005;
const YAW_WHITE_SIGMA_RAD: f64 = 0.004;
/// Spread of the yaw rate's error, in radians per second.
const RATE_SIGMA_RAD_S: f64 = 0.002;

/// What receivers claim of themselves: row-major east-north-up covariance in square metres.
pub(crate) const CLAIMED_COVARIANCE_M2: [f64; 9] = [2.25, 0.0, 0.0, 0.0, 2.25, 0.0, 0.0, 0.0, 9.0];
/// What inertial sensors claim of their yaw, in square radians.
pub(crate) const CLAIMED_YAW_VARIANCE_RAD2: f64 = 1e-4;

/// The errors of one drive.
pub(crate) struct Receiver {
    random: Random,
    bias_m: [f64; 3],
    drift_m: [f64; 3],
    yaw_bias_rad: f64,
}

impl Receiver {
    /// Draws the errors that stay, and where the others begin.
    pub(crate) fn draw(mut random: Random) -> Self {
        let mut draw = |sigma_m: f64| [1.0, 1.0, HEIGHT_FACTOR].map(|f| random.normal(f * sigma_m));
        let (bias_m, drift_m) = (draw(BIAS_SIGMA_M), draw(DRIFT_SIGMA_M));
        Self {
            yaw_bias_rad: random.normal(YAW_BIAS_SIGMA_RAD),
            bias_m,
            drift_m,
            random,
        }
    }

    /// The error of the next position, east, north and up in metres, `seconds` after the one before
    /// (a Gauss-Markov process of first order).
    pub(crate) fn position_error_m(&mut self, seconds: f64) -> [f64; 3] {
        let kept = (-seconds / DRIFT_TAU_S).exp();
        let fresh = DRIFT_SIGMA_M * (1.0 - kept * kept).sqrt();
        let mut error_m = [0.0; 3];
        for (axis, factor) in [1.0, 1.0, HEIGHT_FACTOR].into_iter().enumerate() {
            self.drift_m[axis] = kept * self.drift_m[axis] + self.random.normal(factor * fresh);
            let white_m = self.random.normal(factor * WHITE_SIGMA_M);
            error_m[axis] = self.bias_m[axis] + self.drift_m[axis] + white_m;
        }
        error_m
    }

    /// The error of the next heading, in radians.
    pub(crate) fn yaw_error_rad(&mut self) -> f64 {
        self.yaw_bias_rad + self.random.normal(YAW_WHITE_SIGMA_RAD)
    }

    /// The error of the next yaw rate, in radians per second.
    pub(crate) fn yaw_rate_error_rad_s(&mut self) -> f64 {
        self.random.normal(RATE_SIGMA_RAD_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drift_keeps_its_spread_and_is_correlated() {
        let mut receiver = Receiver::draw(Random::new(5, "receiver", 0));
        receiver.bias_m = [0.0; 3];
        let errors: Vec<f64> = (0..200_000)
            .map(|_| receiver.position_error_m(0.2)[0])
            .collect();
        let mean_product = |lag: usize| {
            let products = errors.iter().zip(&errors[lag..]).map(|(a, b)| a * b);
            products.sum::<f64>() / (errors.len() - lag) as f64
        };
        let variance = mean_product(0);
        assert!((variance.sqrt() - DRIFT_SIGMA_M).abs() < 0.15, "{variance}");
        // After one time constant, 1/e of it is left.
        let left = mean_product(150) / variance;
        assert!((left - (-1.0_f64).exp()).abs() < 0.12, "{left}");
    }
}
