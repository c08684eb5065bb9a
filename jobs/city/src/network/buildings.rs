//! Buildings along roads: what shadows the road and the sky.

use super::plan::Road;
use super::section::Heading;
use crate::random::Random;
use crate::relief::Relief;
use crate::world::Building;

/// From the edge of the road to the front of a building, in metres.
const SETBACK_M: (f64, f64) = (5.0, 12.0);
/// Length along the road, depth and height, in metres.
const LENGTH_M: (f64, f64) = (12.0, 34.0);
const DEPTH_M: (f64, f64) = (9.0, 15.0);
const HEIGHT_M: (f64, f64) = (5.0, 32.0);
/// Between two lots, and from the road's ends, in metres.
const GAP_M: f64 = 5.0;
const END_M: f64 = 28.0;

/// The buildings on both sides of a road.
pub(super) fn along(road: &Road, random: &mut Random, relief: &Relief) -> Vec<Building> {
    let mut buildings = Vec::new();
    for heading in Heading::BOTH {
        let mut station_m = END_M;
        loop {
            let length_m = random.between(LENGTH_M.0, LENGTH_M.1);
            let lot = building(road, heading, station_m, length_m, random, relief);
            station_m += length_m + GAP_M;
            if station_m + END_M > road.curve.length_m {
                break;
            }
            if random.chance(road.urban) {
                buildings.push(lot);
            }
        }
    }
    buildings
}

fn building(
    road: &Road,
    heading: Heading,
    from_m: f64,
    length_m: f64,
    random: &mut Random,
    relief: &Relief,
) -> Building {
    let depth_m = random.between(DEPTH_M.0, DEPTH_M.1);
    let setback_m = random.between(SETBACK_M.0, SETBACK_M.1) + depth_m / 2.0;
    let middle_m = from_m + length_m / 2.0;
    let left_m = road.section.edge_m(heading, middle_m) + heading.sign() * setback_m;
    let [east_m, north_m] = road.point(middle_m, left_m);
    Building {
        at: [east_m, north_m, relief.height_m([east_m, north_m])],
        yaw_rad: road.curve.at(middle_m).yaw_rad,
        size_m: [
            length_m,
            depth_m,
            random.between(HEIGHT_M.0, HEIGHT_M.1) * (0.5 + 0.5 * road.urban),
        ],
    }
}
