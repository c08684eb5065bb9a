//! What stands along the road without being in any map: street lamps and trees, behind the kerbs.

use super::noise::{hash, share};
use super::terrain::RoadTest;
use crate::world::{Point, World};

/// Metres between the kerb and a lamp or a tree.
const LAMP_BEHIND_M: f64 = 0.9;
const TREE_BEHIND_M: (f64, f64) = (1.6, 5.0);
/// Metres along the kerb from one to the next.
const LAMP_EVERY_M: f64 = 28.0;
const TREE_EVERY_M: f64 = 9.0;
/// A lamp's height, how far it reaches over the road, and how far its light goes, in metres.
pub(super) const LAMP_HEIGHT_M: f64 = 7.5;
pub(super) const LAMP_ARM_M: f64 = 1.6;
const LIGHT_REACH_M: f64 = 32.0;
/// Light right below a lamp, as a share of daylight.
const LAMP_LIGHT: f64 = 0.05;

/// A street lamp.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lamp {
    /// Its foot, on the ground.
    pub(super) at: Point,
    /// Unit vector (east, north) towards the road.
    pub(super) towards_road: [f64; 2],
}

impl Lamp {
    fn head(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.at[axis] + LAMP_ARM_M * self.towards_road[axis])
    }

    /// Whether its light reaches a square.
    pub(super) fn reaches(&self, corner: [f64; 2], side_m: f64) -> bool {
        let head = self.head();
        (0..2).all(|axis| {
            let beyond_m = (corner[axis] - head[axis]).max(head[axis] - corner[axis] - side_m);
            beyond_m < LIGHT_REACH_M
        })
    }

    /// Its light on the ground, as a share of daylight: it falls with the square of the distance
    /// and the slant, and ends softly.
    pub(super) fn light(&self, place: [f64; 2]) -> f64 {
        let head = self.head();
        let away_m = (place[0] - head[0]).hypot(place[1] - head[1]);
        let end = (1.0 - (away_m / LIGHT_REACH_M).powi(2)).max(0.0);
        let slant = LAMP_HEIGHT_M / (away_m * away_m + LAMP_HEIGHT_M * LAMP_HEIGHT_M).sqrt();
        LAMP_LIGHT * slant.powi(3) * end
    }
}

/// A tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tree {
    /// Its foot, on the ground.
    pub(super) at: Point,
    /// Height in metres.
    pub(super) height_m: f64,
    /// Radius of its crown in metres.
    pub(super) crown_m: f64,
    /// A lot from 0 to 1: it stands where conditions have at least so many trees.
    pub(super) lot: f32,
}

/// What stands along the roads of a city.
pub(super) struct Roadside {
    pub(super) lamps: Vec<Lamp>,
    pub(super) trees: Vec<Tree>,
}

impl Roadside {
    pub(super) fn new(world: &World) -> Self {
        let planter = Planter {
            world,
            road: RoadTest::new(world),
        };
        let edges = edges(world);
        let mut roadside = Self {
            lamps: Vec::new(),
            trees: Vec::new(),
        };
        for (number, edge) in (0_u32..).zip(&edges) {
            let lamps = walk(edge, LAMP_EVERY_M).into_iter();
            roadside
                .lamps
                .extend(lamps.filter_map(|step| planter.lamp(step)));
            let trees = (0_i32..).zip(walk(edge, TREE_EVERY_M));
            roadside.trees.extend(
                trees.filter_map(|(index, step)| planter.tree(step, hash(index, 5, number))),
            );
        }
        roadside
    }
}

/// The lines behind which things stand: kerbs, or else the borders of the lanes at either side.
fn edges(world: &World) -> Vec<Vec<Point>> {
    if !world.kerbs.is_empty() {
        return world.kerbs.clone();
    }
    let outer = world.lanes.iter().filter(|lane| !lane.is_junction);
    let outer = outer.filter(|lane| lane.left.is_none() || lane.right.is_none());
    outer
        .flat_map(|lane| [1.0, -1.0].map(|side| beside(&lane.centre, side * lane.width_m * 0.6)))
        .collect()
}

fn beside(line: &[Point], left_m: f64) -> Vec<Point> {
    let points = line.windows(2).map(|pair| {
        let (de, dn) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let scale = left_m / de.hypot(dn).max(1e-6);
        [pair[0][0] - dn * scale, pair[0][1] + de * scale, pair[0][2]]
    });
    points.collect()
}

/// A place on an edge, and the direction of its left.
struct EdgeStep {
    at: [f64; 2],
    left: [f64; 2],
}

fn walk(edge: &[Point], every_m: f64) -> Vec<EdgeStep> {
    let mut steps = Vec::new();
    let mut until_next_m = every_m / 2.0;
    for pair in edge.windows(2) {
        let (de, dn) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let length_m = de.hypot(dn);
        while until_next_m < length_m {
            let share = until_next_m / length_m;
            steps.push(EdgeStep {
                at: [pair[0][0] + de * share, pair[0][1] + dn * share],
                left: [-dn / length_m, de / length_m],
            });
            until_next_m += every_m;
        }
        until_next_m -= length_m;
    }
    steps
}

/// Finds places to stand.
struct Planter<'a> {
    world: &'a World,
    road: RoadTest,
}

impl Planter<'_> {
    fn lamp(&self, step: EdgeStep) -> Option<Lamp> {
        let (at, towards_road) = self.behind(&step, LAMP_BEHIND_M)?;
        Some(Lamp { at, towards_road })
    }

    fn tree(&self, step: EdgeStep, lots: u32) -> Option<Tree> {
        let lot = |salt: i32| f64::from(share(hash(salt, 0, lots)));
        let behind_m = TREE_BEHIND_M.0 + (TREE_BEHIND_M.1 - TREE_BEHIND_M.0) * lot(1);
        let (at, _) = self.behind(&step, behind_m)?;
        let height_m = 5.0 + 6.0 * lot(2);
        Some(Tree {
            at,
            height_m,
            crown_m: height_m * (0.22 + 0.12 * lot(3)),
            lot: lot(4) as f32,
        })
    }

    /// The place behind the kerb, and the direction from there to the road; none if that is road
    /// again or built upon.
    fn behind(&self, step: &EdgeStep, behind_m: f64) -> Option<(Point, [f64; 2])> {
        let place = |side: f64| {
            let east_m = step.at[0] + step.left[0] * side * behind_m;
            let north_m = step.at[1] + step.left[1] * side * behind_m;
            [
                east_m,
                north_m,
                self.world.relief.height_m([east_m, north_m]),
            ]
        };
        let beyond = [1.0, -1.0].map(|side| self.road.off_road_m(place(side)));
        let side = if beyond[0] > beyond[1] { 1.0 } else { -1.0 };
        let at = place(side);
        let is_free = beyond[0].max(beyond[1]) > behind_m * 0.7 && !self.is_built(at);
        is_free.then_some((at, step.left.map(|axis| -axis * side)))
    }

    fn is_built(&self, at: Point) -> bool {
        self.world.buildings.iter().any(|building| {
            let (sin, cos) = building.yaw_rad.sin_cos();
            let (de, dn) = (at[0] - building.at[0], at[1] - building.at[1]);
            let along_m = (de * cos + dn * sin).abs() - building.size_m[0] / 2.0;
            let across_m = (dn * cos - de * sin).abs() - building.size_m[1] / 2.0;
            along_m.max(across_m) < 1.0
        })
    }
}
