//! The height of the ground: waves for a drawn city, a fitted grid for a mapped one.

mod grid;

use std::f64::consts::TAU;

use crate::random::Random;
use grid::Grid;

/// A point of the ground: metres east, north and up.
pub(crate) type Ground = [f64; 3];

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
    grid: Option<Grid>,
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
            grid: None,
        }
    }

    /// The ground through points of it; flat without any.
    pub(crate) fn through(points: &[Ground]) -> Self {
        Self {
            waves: Vec::new(),
            grid: Grid::fit(points),
        }
    }

    /// Metres up at a place (metres east and north).
    #[must_use]
    pub fn height_m(&self, [east_m, north_m]: [f64; 2]) -> f64 {
        let wave = |wave: &Wave| {
            let angle_rad = wave.rate[0] * east_m + wave.rate[1] * north_m + wave.phase_rad;
            wave.height_m * (angle_rad.sin() - wave.phase_rad.sin())
        };
        let waves_m: f64 = self.waves.iter().map(wave).sum();
        let place = [east_m, north_m];
        waves_m + self.grid.as_ref().map_or(0.0, |grid| grid.height_m(place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_is_met_where_it_was_seen_and_filled_where_not() {
        let slope = |east_m: f64, north_m: f64| 40.0 + 0.03 * east_m - 0.02 * north_m;
        // Two roads that cross, with vertices at odd distances.
        let along = |step: i32| f64::from(step) * 7.3 - 200.0;
        let roads = (0..55).flat_map(|step| [[along(step), 3.0], [-5.0, along(step)]]);
        let points: Vec<Ground> = roads.map(|[e, n]| [e, n, slope(e, n)]).collect();
        let relief = Relief::through(&points);
        for [east_m, north_m, up_m] in &points {
            let off_m = relief.height_m([*east_m, *north_m]) - up_m;
            assert!(off_m.abs() < 0.02, "{off_m} m at {east_m}, {north_m}");
        }
        let corner_m = relief.height_m([150.0, 150.0]);
        assert!((35.0..50.0).contains(&corner_m), "{corner_m}");
        assert!(relief.height_m([1e9, f64::MIN]).is_finite());
    }

    #[test]
    fn one_point_is_a_plain_and_none_is_flat() {
        let plain = Relief::through(&[[5.0, 6.0, 7.0]]);
        assert_eq!(plain.height_m([-300.0, 90.0]), 7.0);
        assert_eq!(Relief::through(&[]), Relief::flat());
    }
}
