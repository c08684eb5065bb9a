//! The road's age: repaired patches, sealed cracks and manhole covers along every lane, the same in
//! every picture of a city.

use super::buckets::Buckets;
use super::marks::{Fill, Panel, Shape, Stroke};
use super::noise::{hash, share};
use super::vector::{V2, v2};
use crate::world::{Lane, Point, World};

/// Metres of lane from one chance of a repair to the next.
const EVERY_M: f64 = 11.0;
/// Chances of each kind there.
const PATCH: f32 = 0.16;
const CRACK: f32 = 0.42;
const COVER: f32 = 0.06;
/// Metres between a crack's bends, and its width.
const BEND_M: f32 = 0.55;
const SEAL_M: f32 = 0.035;

/// What was done to the road.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RepairKind {
    /// Newer, darker asphalt.
    Patch,
    /// A crack filled with bitumen.
    Crack,
    /// A manhole cover.
    Cover,
}

/// One repair of a lane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Repair {
    pub(super) kind: RepairKind,
    at: [f64; 2],
    /// The lane's direction, as a unit vector (east, north).
    along: [f64; 2],
    lane_m: f64,
    pub(super) lots: u32,
}

/// All repairs of a city.
pub(super) struct Repairs {
    repairs: Vec<Repair>,
    buckets: Buckets,
}

impl Repairs {
    pub(super) fn new(world: &World) -> Self {
        let lanes = (0_u32..).zip(&world.lanes);
        let repairs: Vec<Repair> = lanes
            .flat_map(|(number, lane)| of_lane(lane, number))
            .collect();
        let mut buckets = Buckets::default();
        for (index, repair) in (0..).zip(&repairs) {
            buckets.add(index, repair.at);
        }
        Self { repairs, buckets }
    }

    /// Those near a place (metres east and north).
    pub(super) fn near(&self, place: [f64; 2], reach_m: f64) -> impl Iterator<Item = &Repair> {
        let near = self.buckets.near(place, reach_m).into_iter();
        near.map(|index| &self.repairs[index as usize])
    }
}

fn of_lane(lane: &Lane, number: u32) -> Vec<Repair> {
    let mut repairs = Vec::new();
    let mut until_next_m = 0.0;
    let mut step = 0;
    for pair in lane.centre.windows(2) {
        let (along, length_m) = direction(pair);
        while until_next_m < length_m {
            step += 1;
            let lots = hash(step, 11, number);
            if let Some(kind) = kind(share(lots)) {
                let at = [0, 1].map(|axis| pair[0][axis] + along[axis] * until_next_m);
                repairs.push(Repair {
                    kind,
                    at,
                    along,
                    lane_m: lane.width_m,
                    lots,
                });
            }
            until_next_m += EVERY_M * f64::from(0.6 + 0.8 * share(hash(step, 12, number)));
        }
        until_next_m -= length_m;
    }
    repairs
}

fn direction(pair: &[Point]) -> ([f64; 2], f64) {
    let (de, dn) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
    let length_m = de.hypot(dn).max(1e-9);
    ([de / length_m, dn / length_m], length_m)
}

fn kind(lot: f32) -> Option<RepairKind> {
    match lot {
        lot if lot < PATCH => Some(RepairKind::Patch),
        lot if lot < PATCH + CRACK => Some(RepairKind::Crack),
        lot if lot < PATCH + CRACK + COVER => Some(RepairKind::Cover),
        _ => None,
    }
}

impl Repair {
    /// Its shapes, in the local frame with this origin.
    pub(super) fn shapes(&self, origin: [f64; 3]) -> Vec<Shape> {
        let lot = |salt: i32| share(hash(salt, 1, self.lots));
        let ahead = v2(self.along[0] as f32, self.along[1] as f32);
        let at = v2(
            (self.at[0] - origin[0]) as f32,
            (self.at[1] - origin[1]) as f32,
        );
        let lane_m = self.lane_m as f32;
        let panel = |width_m: f32, length_m: f32, offset_m: f32, fill: Fill| {
            let right = ahead.left() * -1.0;
            Shape::Panel(Panel {
                corner: at + right * (offset_m - width_m / 2.0),
                right,
                ahead,
                width_m,
                length_m,
                fill,
            })
        };
        match self.kind {
            RepairKind::Patch => {
                let width_m = lane_m * (0.25 + 0.6 * lot(1));
                let offset_m = (lane_m - width_m) * (lot(2) - 0.5);
                vec![panel(
                    width_m,
                    0.8 + 6.0 * lot(3) * lot(3),
                    offset_m,
                    Fill::Plain,
                )]
            }
            RepairKind::Cover => {
                vec![panel(
                    0.65,
                    0.65,
                    (lane_m - 1.0) * (lot(2) - 0.5),
                    Fill::Disc,
                )]
            }
            RepairKind::Crack => {
                self.crack(at + ahead.left() * (lane_m * 0.9 * (lot(1) - 0.5)), ahead)
            }
        }
    }

    /// A crack wanders along the lane, or across it.
    fn crack(&self, start: V2, ahead: V2) -> Vec<Shape> {
        let lot = |salt: i32| share(hash(salt, 2, self.lots));
        let course = if lot(1) < 0.7 { ahead } else { ahead.left() };
        let bends = 3 + (lot(2) * 12.0) as i32;
        let mut shapes = Vec::new();
        let mut from = start;
        for bend in 0..bends {
            let aside = course.left() * (1.3 * (lot(10 + bend) - 0.5));
            let along = (course + aside).unit();
            shapes.push(Shape::Stroke(Stroke {
                from,
                along,
                length_m: BEND_M,
                half_width_m: SEAL_M * (0.3 + 0.5 * lot(40 + bend)),
                pattern: None,
            }));
            from = from + along * BEND_M;
        }
        shapes
    }
}
