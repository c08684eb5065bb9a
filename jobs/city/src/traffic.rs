//! Other vehicles around one that drives: what hides paint from its camera.
//!
//! Traffic is made for one drive at a time and stays near it: a vehicle that falls too far behind
//! comes in again far ahead, out of sight.

use std::f64::consts::TAU;

use crate::course::Course;
use crate::curve::Place;
use crate::noise;
use crate::random::Random;

/// Vehicles are within this many metres ahead or behind.
const REACH_M: f64 = 120.0;
/// Speeds of vehicles that come towards us, in metres per second.
const ONCOMING_M_S: (f64, f64) = (9.0, 14.0);
/// The vehicle before us: mean distance between the middles, and how it swings.
const LEADER_M: (f64, f64) = (16.0, 45.0);
const LEADER_SWING: f64 = 0.25;
const SWING_S: (f64, f64) = (30.0, 90.0);
/// Sideways from our lane: neighbours and oncoming, in lanes of this width.
const LANE_M: f64 = 3.4;
/// A vehicle's height by its length: cars are low, lorries high.
const CAR_HEIGHT_M: f64 = 1.5;
const LORRY_HEIGHT_M: f64 = 3.6;
/// Most vehicles are cars: lengths are drawn with this power of a lot.
const MOSTLY_SHORT: f64 = 4.0;

/// Another vehicle, at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vehicle {
    /// Its middle: metres east, north and up (on the ground).
    pub at: [f64; 3],
    /// Where it points, radians counter-clockwise from east.
    pub yaw_rad: f64,
    /// Length, width and height in metres.
    pub size_m: [f64; 3],
    /// Which of the vehicles around a drive it is.
    pub number: usize,
}

/// How one vehicle keeps to ours.
#[derive(Debug, Clone, Copy)]
enum Way {
    /// In the same lane, ahead.
    Leads {
        mean_m: f64,
        rate: f64,
        phase_rad: f64,
    },
    /// In a lane beside ours.
    Beside {
        first_m: f64,
        gain_m_s: f64,
        lanes: f64,
    },
    /// Towards us.
    Comes {
        first_m: f64,
        speed_m_s: f64,
        lanes: f64,
    },
}

/// The vehicles around one drive.
pub(crate) struct Traffic {
    vehicles: Vec<(Way, [f64; 3])>,
}

impl Traffic {
    pub(crate) fn draw(noise: &noise::Traffic, random: &mut Random) -> Self {
        let in_reach = noise.per_lane_km * 2.0 * REACH_M / 1_000.0;
        let mut vehicles = Vec::new();
        if random.chance(1.0 - (-in_reach).exp()) {
            vehicles.push((leader(random), size(noise, random)));
        }
        for lanes in [-1.0, 1.0] {
            for _ in 0..random.count(in_reach) {
                let way = Way::Beside {
                    first_m: random.between(-REACH_M, REACH_M),
                    gain_m_s: random.normal(noise.speed_spread_m_s),
                    lanes,
                };
                vehicles.push((way, size(noise, random)));
            }
        }
        for lanes in [2.0, 3.0] {
            for _ in 0..random.count(in_reach) {
                let way = Way::Comes {
                    first_m: random.between(-REACH_M, REACH_M),
                    speed_m_s: random.between(ONCOMING_M_S.0, ONCOMING_M_S.1),
                    lanes,
                };
                vehicles.push((way, size(noise, random)));
            }
        }
        Self { vehicles }
    }

    /// Where all are, `seconds` after the drive's begin.
    pub(crate) fn at(&self, course: &Course, seconds: f64) -> Vec<Vehicle> {
        let station_m = course.station_m(seconds);
        let place = |(number, (way, size_m)): (usize, &(Way, [f64; 3]))| {
            let (ahead_m, left_m, turned) = way.relative(station_m, seconds);
            let on_path = course.place(station_m + ahead_m);
            let [east_m, north_m] = on_path.left(left_m);
            let place = Place {
                east_m,
                north_m,
                ..on_path
            };
            Vehicle {
                at: [east_m, north_m, course.point(station_m + ahead_m)[2]],
                yaw_rad: place.yaw_rad + if turned { TAU / 2.0 } else { 0.0 },
                size_m: *size_m,
                number,
            }
        };
        let is_on_the_way = |vehicle: &Vehicle| {
            // Before the begin and behind the end of the path there is no road to stand on.
            let [east_m, north_m, _] = vehicle.at;
            let own = course.place(station_m);
            (east_m - own.east_m).hypot(north_m - own.north_m) > vehicle.size_m[0] / 2.0 + 1.0
        };
        self.vehicles
            .iter()
            .enumerate()
            .map(place)
            .filter(is_on_the_way)
            .collect()
    }
}

impl Way {
    /// Metres ahead and to the left, and whether it comes towards us.
    fn relative(&self, station_m: f64, seconds: f64) -> (f64, f64, bool) {
        match *self {
            Self::Leads {
                mean_m,
                rate,
                phase_rad,
            } => {
                let swing = 1.0 + LEADER_SWING * (rate * seconds + phase_rad).sin();
                (mean_m * swing, 0.0, false)
            }
            Self::Beside {
                first_m,
                gain_m_s,
                lanes,
            } => (
                wrapped_m(first_m + gain_m_s * seconds),
                lanes * LANE_M,
                false,
            ),
            Self::Comes {
                first_m,
                speed_m_s,
                lanes,
            } => {
                let ahead_m = wrapped_m(first_m - speed_m_s * seconds - station_m);
                (ahead_m, lanes * LANE_M, true)
            }
        }
    }
}

fn leader(random: &mut Random) -> Way {
    Way::Leads {
        mean_m: random.between(LEADER_M.0, LEADER_M.1),
        rate: TAU / random.between(SWING_S.0, SWING_S.1),
        phase_rad: random.between(0.0, TAU),
    }
}

fn size(noise: &noise::Traffic, random: &mut Random) -> [f64; 3] {
    let share = random.unit().powf(MOSTLY_SHORT);
    let between = |[least, most]: [f64; 2]| least + share * (most - least);
    let height_m = CAR_HEIGHT_M + share * (LORRY_HEIGHT_M - CAR_HEIGHT_M);
    [between(noise.length_m), between(noise.width_m), height_m]
}

fn wrapped_m(ahead_m: f64) -> f64 {
    (ahead_m + REACH_M).rem_euclid(2.0 * REACH_M) - REACH_M
}
