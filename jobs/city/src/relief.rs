//! The height of the ground: waves for a drawn city, a grid of means for a mapped one.

use std::f64::consts::TAU;

use crate::random::Random;

/// Lengths of the waves, in metres, and how steep the steepest place of each is.
const WAVE_LENGTHS_M: [f64; 3] = [2_400.0, 1_100.0, 520.0];
const WAVE_SLOPE: f64 = 0.012;

/// A plane wave of height.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wave {
    height_m: f64,
    /// Radians per metre east and north.
    rate: [f64; 2],
    phase_rad: f64,
}

/// The height of the ground over the city's plane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Relief {
    waves: Vec<Wave>,
}

impl Relief {
    /// Flat ground.
    #[must_use]
    pub fn flat() -> Self {
        Self::default()
    }

    /// Gentle hills.
    pub(crate) fn draw(random: &mut Random) -> Self {
        let wave = |length_m: f64| {
            let direction_rad = random.between(0.0, TAU);
            let rate = TAU / length_m;
            Wave {
                height_m: WAVE_SLOPE / rate,
                rate: [rate * direction_rad.cos(), rate * direction_rad.sin()],
                phase_rad: random.between(0.0, TAU),
            }
        };
        Self {
            waves: WAVE_LENGTHS_M.map(wave).to_vec(),
        }
    }

    /// Metres up at a place (metres east and north).
    #[must_use]
    pub fn height_m(&self, [east_m, north_m]: [f64; 2]) -> f64 {
        let wave = |wave: &Wave| {
            let angle_rad = wave.rate[0] * east_m + wave.rate[1] * north_m + wave.phase_rad;
            wave.height_m * (angle_rad.sin() - wave.phase_rad.sin())
        };
        self.waves.iter().map(wave).sum()
    }
}
