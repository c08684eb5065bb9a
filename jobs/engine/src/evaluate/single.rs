//! Single vehicles beside the fleet: each vehicle of a sample judged by its own evidence alone,
//! at V = 1, against those true changes that it looked at.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use serde::Serialize;
use tilefold_schemas::Footprint;

use super::change::ChangeScores;
use super::known::Known;

/// Metres of a degree of latitude, roughly.
const METRES_PER_DEGREE: f64 = 111_320.0;
/// A look shows a place if it is in its range widened by half a sample, in metres.
const RANGE_SLACK_M: f64 = 3.0;

/// What single vehicles find.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SingleVehicle {
    /// Vehicles in the sample.
    pub vehicles: usize,
    /// Change detection, all vehicles together. A change is counted once for each vehicle that
    /// looked at it.
    pub change: ChangeScores,
}

/// `size` of the vehicles, or all if there are no more; each sample is as likely as any other.
pub(super) fn sample(mut vehicles: Vec<i64>, size: usize, seed: u64) -> Vec<i64> {
    let mut generator = Pcg64Mcg::seed_from_u64(seed);
    let size = size.min(vehicles.len());
    for next in 0..size {
        let left = (vehicles.len() - next) as u128;
        let lot = (u128::from(generator.next_u64()) * left) >> 64;
        vehicles.swap(next, next + lot as usize);
    }
    vehicles.truncate(size);
    vehicles.sort_unstable();
    vehicles
}

/// Whether looks from these footprints show at least half of a change.
pub(super) fn is_in_view(known: &Known<'_>, looks: &[Footprint]) -> bool {
    known.is_half_shown(|place| looks.iter().any(|look| shows(look, place)))
}

/// Whether a place (degrees) is in the box ahead of the vehicle that a look covers.
fn shows(look: &Footprint, [longitude_deg, latitude_deg]: [f64; 2]) -> bool {
    let shrink = latitude_deg.to_radians().cos();
    let [look_longitude_deg, look_latitude_deg] = look.place_deg();
    let east_m = (longitude_deg - look_longitude_deg) * METRES_PER_DEGREE * shrink;
    let north_m = (latitude_deg - look_latitude_deg) * METRES_PER_DEGREE;
    let (sin, cos) = look.yaw_rad().sin_cos();
    let (ahead_m, left_m) = (cos * east_m + sin * north_m, -sin * east_m + cos * north_m);
    let metres = |mm: i32| f64::from(mm) * 1e-3;
    let range_m =
        metres(look.range_from_mm) - RANGE_SLACK_M..=metres(look.range_to_mm) + RANGE_SLACK_M;
    let reach_m = metres(look.right_mm)..=metres(look.left_mm);
    range_m.contains(&ahead_m) && reach_m.contains(&left_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_seeded_and_without_repetition() {
        let all: Vec<i64> = (0..100).collect();
        let drawn = sample(all.clone(), 10, 4);
        assert_eq!(drawn, sample(all.clone(), 10, 4));
        assert_ne!(drawn, sample(all.clone(), 10, 5));
        assert!(drawn.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(sample(all.clone(), 1_000, 1), all);
        assert!(sample(Vec::new(), 3, 1).is_empty());
    }

    #[test]
    fn a_look_shows_the_box_ahead() {
        // Northwards from 50 degrees north: 3 to 20 m ahead, 6 m to the left, 4 m to the right.
        let look = Footprint {
            kinds: 0,
            tile: 0,
            vehicle: 1,
            channel: 0,
            window: 0,
            method: 1,
            model: 0,
            at_ms: 0,
            longitude_e6: 10_000_000,
            latitude_e6: 50_000_000,
            yaw_mrad: 1_571,
            frames: 1,
            range_from_mm: 3_000,
            range_to_mm: 20_000,
            left_mm: 6_000,
            right_mm: -4_000,
            v_q8: 0,
        };
        let north = |ahead_m: f64| 50.0 + ahead_m / METRES_PER_DEGREE;
        let east = |right_m: f64| 10.0 + right_m / (METRES_PER_DEGREE * 50_f64.to_radians().cos());
        assert!(shows(&look, [10.0, north(22.5)]));
        assert!(!shows(&look, [10.0, north(23.5)]));
        assert!(!shows(&look, [10.0, north(-0.5)]));
        assert!(shows(&look, [east(-5.9), north(10.0)]));
        assert!(shows(&look, [east(3.9), north(10.0)]));
        assert!(!shows(&look, [east(4.1), north(10.0)]));
    }
}
