//! How a heading, a yaw rate and a wheel speed err.

use crate::drift::Drifting;
use crate::noise::{ImuNoise, WheelNoise};
use crate::random::Random;

/// The errors of the inertial sensor in one drive.
#[derive(Debug, Clone)]
pub struct Inertial {
    random: Random,
    yaw_bias_rad: f64,
    yaw_drift_deg: Drifting,
    yaw_white_rad: f64,
    rate_bias_rad_s: f64,
    rate_white_rad_s: f64,
}

impl Inertial {
    /// Draws the errors that stay, and where the others begin.
    #[must_use]
    pub fn draw(noise: &ImuNoise, mut random: Random) -> Self {
        Self {
            yaw_bias_rad: random.normal(noise.yaw_bias_deg.to_radians()),
            yaw_drift_deg: Drifting::draw(&noise.yaw_drift, &mut random),
            yaw_white_rad: noise.yaw_white_deg.to_radians(),
            rate_bias_rad_s: random.normal(noise.rate_bias_deg_s.to_radians()),
            rate_white_rad_s: noise.rate_white_deg_s.to_radians(),
            random,
        }
    }

    /// The error of the heading, in radians, `seconds` after the one before.
    pub fn yaw_error_rad(&mut self, seconds: f64) -> f64 {
        let drift_deg = self.yaw_drift_deg.step(seconds, &mut self.random);
        self.yaw_bias_rad + drift_deg.to_radians() + self.random.normal(self.yaw_white_rad)
    }

    /// The error of the next yaw rate, in radians per second.
    pub fn yaw_rate_error_rad_s(&mut self) -> f64 {
        self.rate_bias_rad_s + self.random.normal(self.rate_white_rad_s)
    }
}

/// The errors of the wheels' speed in one drive.
#[derive(Debug, Clone)]
pub struct Wheels {
    random: Random,
    scale: f64,
    white_m_s: f64,
}

impl Wheels {
    /// Draws the scale from `vehicle`, which is the same in all drives of a vehicle, and the rest
    /// from `drive`.
    #[must_use]
    pub fn draw(noise: &WheelNoise, vehicle: &mut Random, drive: Random) -> Self {
        Self {
            scale: 1.0 + vehicle.normal(noise.scale_spread),
            white_m_s: noise.white_m_s,
            random: drive,
        }
    }

    /// What the wheels say of a true speed, in metres per second; standing is seen exactly.
    pub fn measured_m_s(&mut self, speed_m_s: f64) -> f64 {
        let noise_m_s = self.random.normal(self.white_m_s);
        if speed_m_s == 0.0 {
            return 0.0;
        }
        self.scale * speed_m_s + noise_m_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::NoiseProfile;

    #[test]
    fn drives_differ_by_their_bias_and_messages_by_what_is_white() {
        let mut noise = NoiseProfile::load("good_gnss").unwrap().of(0).imu.clone();
        noise.yaw_bias_deg = 2.0;
        noise.yaw_drift.clear();
        noise.yaw_white_deg = 0.1;
        let drives: Vec<Vec<f64>> = (0..400)
            .map(|drive| {
                let mut inertial = Inertial::draw(&noise, Random::new(1, "inertial", drive));
                (0..50)
                    .map(|_| inertial.yaw_error_rad(0.1).to_degrees())
                    .collect()
            })
            .collect();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let spread = |values: &[f64]| {
            let middle = mean(values);
            let squares = values.iter().map(|v| (v - middle).powi(2));
            (squares.sum::<f64>() / values.len() as f64).sqrt()
        };
        let means: Vec<f64> = drives.iter().map(|drive| mean(drive)).collect();
        let within: Vec<f64> = drives.iter().map(|drive| spread(drive)).collect();
        assert!((spread(&means) - 2.0).abs() < 0.2, "{}", spread(&means));
        assert!((mean(&within) - 0.1).abs() < 0.01, "{}", mean(&within));
    }

    #[test]
    fn a_vehicle_keeps_its_scale() {
        let noise = WheelNoise {
            rate_hz: 50.0,
            scale_spread: 0.02,
            white_m_s: 0.0,
        };
        let speed = |vehicle, drive| {
            let mut vehicle = Random::new(1, "wheels of a vehicle", vehicle);
            let mut wheels = Wheels::draw(&noise, &mut vehicle, Random::new(1, "wheels", drive));
            wheels.measured_m_s(10.0)
        };
        assert_eq!(speed(0, 0), speed(0, 1));
        assert_ne!(speed(0, 0), speed(1, 0));
    }
}
