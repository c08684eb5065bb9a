//! How a camera is mounted against what its calibration says, how the body moves on its springs, and
//! how late its frames are stamped.

use crate::drift::Drifting;
use crate::noise::{ClockNoise, MountingNoise};
use crate::random::Random;

/// What is wrong with a vehicle's calibration: true mounting minus stated mounting.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Misalignment {
    /// Roll, pitch and yaw in the vehicle frame, in radians.
    pub roll_pitch_yaw_rad: [f64; 3],
    /// Forward, left and up, in metres.
    pub position_m: [f64; 3],
}

impl Misalignment {
    /// Draws that of a vehicle.
    #[must_use]
    pub fn draw(noise: &MountingNoise, vehicle: &mut Random) -> Self {
        let angles_deg = [noise.roll_deg, noise.pitch_deg, noise.yaw_deg];
        Self {
            roll_pitch_yaw_rad: angles_deg.map(|deg| vehicle.normal(deg.to_radians())),
            position_m: [0; 3].map(|_| vehicle.normal(noise.position_m)),
        }
    }
}

/// A body on its springs.
#[derive(Debug, Clone)]
pub struct Body {
    random: Random,
    roll_deg: Drifting,
    pitch_deg: Drifting,
}

impl Body {
    /// Draws where it begins.
    #[must_use]
    pub fn draw(noise: &MountingNoise, mut random: Random) -> Self {
        Self {
            roll_deg: Drifting::draw(&noise.body_roll, &mut random),
            pitch_deg: Drifting::draw(&noise.body_pitch, &mut random),
            random,
        }
    }

    /// Roll and pitch against the road, in radians, `seconds` after the last time.
    pub fn roll_pitch_rad(&mut self, seconds: f64) -> [f64; 2] {
        [&mut self.roll_deg, &mut self.pitch_deg]
            .map(|angle| angle.step(seconds, &mut self.random).to_radians())
    }
}

/// Draws by how many seconds a drive's frames are stamped late.
#[must_use]
pub fn clock_offset_s(noise: &ClockNoise, drive: &mut Random) -> f64 {
    noise.offset_s + drive.normal(noise.offset_spread_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::NoiseProfile;

    #[test]
    fn mountings_are_spread_as_is_said() {
        let noise = NoiseProfile::load("paper_like")
            .unwrap()
            .of(0)
            .mounting
            .clone();
        let drawn: Vec<Misalignment> = (0..4_000)
            .map(|number| Misalignment::draw(&noise, &mut Random::new(1, "mounting", number)))
            .collect();
        let spread = |of: fn(&Misalignment) -> f64| {
            (drawn.iter().map(|m| of(m).powi(2)).sum::<f64>() / 4_000.0).sqrt()
        };
        let near = |found: f64, stated: f64| (found / stated - 1.0).abs() < 0.05;
        assert!(near(
            spread(|m| m.roll_pitch_yaw_rad[1].to_degrees()),
            noise.pitch_deg
        ));
        assert!(near(
            spread(|m| m.roll_pitch_yaw_rad[2].to_degrees()),
            noise.yaw_deg
        ));
        assert!(near(spread(|m| m.position_m[2]), noise.position_m));
    }

    #[test]
    fn the_body_swings_around_level() {
        let noise = NoiseProfile::load("paper_like")
            .unwrap()
            .of(0)
            .mounting
            .clone();
        let mut body = Body::draw(&noise, Random::new(1, "body", 0));
        let pitches: Vec<f64> = (0..20_000).map(|_| body.roll_pitch_rad(0.1)[1]).collect();
        let mean = pitches.iter().sum::<f64>() / 20_000.0;
        let square: f64 = pitches.iter().map(|p| p.to_degrees().powi(2)).sum::<f64>() / 20_000.0;
        let stated: f64 = noise.body_pitch.iter().map(|part| part.sigma.powi(2)).sum();
        assert!(mean.to_degrees().abs() < 0.03 && (square / stated - 1.0).abs() < 0.15);
    }
}
