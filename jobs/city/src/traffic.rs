//! Other vehicles around one that drives: what hides paint from its camera.
//!
//! Traffic is made for one leg of a drive at a time and stays near it: a vehicle that falls too far
//! behind comes in again far ahead, out of sight. It drives in the lanes that there are beside the
//! course (`alongside`); where its lane ends, it has turned off.

use std::f64::consts::{PI, TAU};

use crate::alongside::{Alongside, Beside};
use crate::course::Course;
use crate::ground::Ground;
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
/// From our middle to another vehicle's end at least, in metres.
const CLEAR_M: f64 = 1.0;
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
    /// In the next lane of the same direction.
    Beside {
        first_m: f64,
        gain_m_s: f64,
        lane: Beside,
    },
    /// Towards us.
    Comes {
        first_m: f64,
        speed_m_s: f64,
        lane: Beside,
    },
}

/// The vehicles around one leg of a drive.
pub(crate) struct Traffic<'a> {
    course: &'a Course,
    alongside: Alongside,
    vehicles: Vec<(Way, [f64; 3])>,
}

impl<'a> Traffic<'a> {
    pub(crate) fn draw(
        noise: &noise::Traffic,
        ground: &Ground<'_>,
        course: &'a Course,
        random: &mut Random,
    ) -> Self {
        let in_reach = noise.per_lane_km * 2.0 * REACH_M / 1_000.0;
        let mut vehicles = Vec::new();
        if random.chance(1.0 - (-in_reach).exp()) {
            vehicles.push((leader(random), size(noise, random)));
        }
        for lane in [Beside::Right, Beside::Left] {
            for _ in 0..random.count(in_reach) {
                let way = Way::Beside {
                    first_m: random.between(-REACH_M, REACH_M),
                    gain_m_s: random.normal(noise.speed_spread_m_s),
                    lane,
                };
                vehicles.push((way, size(noise, random)));
            }
        }
        for lane in [Beside::Oncoming(0), Beside::Oncoming(1)] {
            for _ in 0..random.count(in_reach) {
                let way = Way::Comes {
                    first_m: random.between(-REACH_M, REACH_M),
                    speed_m_s: random.between(ONCOMING_M_S.0, ONCOMING_M_S.1),
                    lane,
                };
                vehicles.push((way, size(noise, random)));
            }
        }
        Self {
            course,
            alongside: Alongside::new(ground, course),
            vehicles,
        }
    }

    /// Where all are, `seconds` after the leg's begin.
    pub(crate) fn at(&self, seconds: f64) -> Vec<Vehicle> {
        let station_m = self.course.station_m(seconds);
        let place = |(number, (way, size_m)): (usize, &(Way, [f64; 3]))| {
            let (ahead_m, turned_rad) = way.ahead(station_m, seconds);
            let there_m = station_m + ahead_m;
            let left_m = match *way {
                Way::Leads { .. } => 0.0,
                Way::Beside { lane, .. } | Way::Comes { lane, .. } => {
                    self.alongside.left_m(lane, there_m)?
                }
            };
            // Before the begin of the course and behind its end no lanes are known.
            let is_on_course = (0.0..=self.course.length_m()).contains(&there_m);
            let clear_m = ahead_m.hypot(left_m) - size_m[0] / 2.0;
            (is_on_course && clear_m > CLEAR_M).then(|| {
                let on_path = self.course.place(there_m);
                let [east_m, north_m] = on_path.left(left_m);
                Vehicle {
                    at: [east_m, north_m, self.course.point(there_m)[2]],
                    yaw_rad: on_path.yaw_rad + turned_rad,
                    size_m: *size_m,
                    number,
                }
            })
        };
        self.vehicles.iter().enumerate().filter_map(place).collect()
    }
}

impl Way {
    /// Metres ahead of us along the course, and how far it is turned against it.
    fn ahead(&self, station_m: f64, seconds: f64) -> (f64, f64) {
        match *self {
            Self::Leads {
                mean_m,
                rate,
                phase_rad,
            } => {
                let swing = 1.0 + LEADER_SWING * (rate * seconds + phase_rad).sin();
                (mean_m * swing, 0.0)
            }
            Self::Beside {
                first_m, gain_m_s, ..
            } => (wrapped_m(first_m + gain_m_s * seconds), 0.0),
            Self::Comes {
                first_m, speed_m_s, ..
            } => (wrapped_m(first_m - speed_m_s * seconds - station_m), PI),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network;
    use crate::noise::NoiseProfile;
    use crate::reach::Reach;
    use crate::route::Routes;

    /// Metres from a place to the nearest middle of a lane, and that lane's direction there.
    fn nearest(ground: &Ground<'_>, at: [f64; 3]) -> Option<(f64, f64)> {
        let lanes = ground.lanes_near([at[0], at[1]], 10.0);
        let sides = lanes.flat_map(|lane| lane.centre.windows(2));
        let apart = sides.map(|side| {
            let (east, north) = (side[1][0] - side[0][0], side[1][1] - side[0][1]);
            let (to_e, to_n) = (at[0] - side[0][0], at[1] - side[0][1]);
            let square = east * east + north * north;
            let share = ((to_e * east + to_n * north) / square).clamp(0.0, 1.0);
            let apart_m = (to_e - share * east).hypot(to_n - share * north);
            (apart_m, north.atan2(east))
        });
        apart.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    #[test]
    fn others_drive_in_lanes_and_in_their_direction() {
        let world = network::draw(3, 4.0, [10.0, 50.0, 300.0]);
        let (ground, reach) = (Ground::new(&world), Reach::new(&world));
        let noise = NoiseProfile::load("paper_like").unwrap();
        let (mut seen, mut oncoming, mut astray, mut turned) = (0, 0, 0, 0);
        for seed in 0..6 {
            let mut random = Random::new(seed, "test", 0);
            let steps = Routes::new(&world, &reach).draw(1_500.0, &mut random);
            let course = Course::draw(steps, &mut random);
            let around = &noise.of(0).detector.traffic;
            let traffic = Traffic::draw(around, &ground, &course, &mut random);
            for second in 0..course.seconds() as usize {
                for vehicle in traffic.at(second as f64) {
                    let (apart_m, yaw_rad) = nearest(&ground, vehicle.at).unwrap();
                    let is_against =
                        matches!(traffic.vehicles[vehicle.number].0, Way::Comes { .. });
                    seen += 1;
                    oncoming += u32::from(is_against);
                    // One wanders in one's lane, and changes it.
                    astray += u32::from(apart_m > 1.0);
                    turned += u32::from((vehicle.yaw_rad - yaw_rad).cos() < 0.8);
                }
            }
        }
        assert!(seen > 1_000 && oncoming * 5 > seen, "{oncoming} of {seen}");
        assert!(astray * 20 < seen, "{astray} of {seen} in no lane");
        assert!(turned * 20 < seen, "{turned} of {seen} against their lane");
    }
}
