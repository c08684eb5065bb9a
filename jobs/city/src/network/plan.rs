//! Where the junctions are and which roads join them.

use std::f64::consts::TAU;

use super::section::Section;
use crate::curve::{Curve, Place};
use crate::random::Random;

/// Mean distance of neighbouring junctions, and how far each strays from the grid, in metres.
const BLOCK_M: f64 = 420.0;
const STRAY_M: f64 = 55.0;
/// How far a junction's arms are turned from the grid, in radians.
const TURN_RAD: f64 = 0.22;
/// Distance of a road's end from the middle of its junction, in metres.
pub(super) const MOUTH_M: f64 = 22.0;
/// The directions of a junction's arms, in quarter turns: east, north, west, south.
pub(super) const ARMS: usize = 4;

/// A junction.
#[derive(Debug, Clone)]
pub(super) struct Node {
    /// Its middle; the direction is that of its first arm.
    pub(super) place: Place,
    /// The roads of its arms; none where the city ends.
    pub(super) arms: [Option<Arm>; ARMS],
}

/// A road's end at a junction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Arm {
    pub(super) road: usize,
    /// Whether the road begins here.
    pub(super) is_begin: bool,
}

impl Node {
    pub(super) fn degree(&self) -> usize {
        self.arms.iter().flatten().count()
    }

    /// The place at an arm's mouth, looking out of the junction.
    fn mouth(&self, arm: usize) -> Place {
        let yaw_rad = self.place.yaw_rad + TAU / ARMS as f64 * arm as f64;
        Place {
            yaw_rad,
            ..self.place
        }
        .ahead(MOUTH_M)
    }
}

/// A road from one junction's mouth to another's.
#[derive(Debug, Clone)]
pub(super) struct Road {
    pub(super) curve: Curve,
    pub(super) section: Section,
    /// How densely buildings stand along it, 0 to 1.
    pub(super) urban: f64,
    /// The nodes and arms that it joins: of its begin and its end.
    pub(super) ends: [(usize, usize); 2],
}

impl Road {
    /// The point (east, north) at a station, metres to the left of the line between the directions.
    pub(super) fn point(&self, station_m: f64, left_m: f64) -> [f64; 2] {
        self.curve.point(station_m, left_m)
    }
}

/// The whole plan.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) nodes: Vec<Node>,
    pub(super) roads: Vec<Road>,
}

impl Plan {
    pub(super) fn draw(km: f64, random: &mut Random) -> Self {
        let (rows, columns) = grid(km * 1_000.0 / BLOCK_M);
        let mut nodes = Vec::with_capacity(rows * columns);
        for row in 0..rows {
            for column in 0..columns {
                nodes.push(node(row, column, (rows, columns), random));
            }
        }
        let mut plan = Self {
            nodes,
            roads: Vec::new(),
        };
        for row in 0..rows {
            for column in 0..columns {
                let here = row * columns + column;
                if column + 1 < columns {
                    plan.join((here, 0), (here + 1, 2), random);
                }
                if row + 1 < rows {
                    plan.join((here, 1), (here + columns, 3), random);
                }
            }
        }
        plan.close(random);
        plan
    }

    fn join(&mut self, from: (usize, usize), to: (usize, usize), random: &mut Random) {
        let begin = self.nodes[from.0].mouth(from.1);
        let mut end = self.nodes[to.0].mouth(to.1);
        end.yaw_rad += TAU / 2.0;
        let curve = Curve::between(begin, end);
        for (end, is_begin) in [(from, true), (to, false)] {
            self.nodes[end.0].arms[end.1] = Some(Arm {
                road: self.roads.len(),
                is_begin,
            });
        }
        self.roads.push(Road {
            curve,
            section: Section::draw(random),
            urban: random.unit(),
            ends: [from, to],
        });
    }

    /// Says which of a road's ends have traffic lights, once all arms are known.
    fn close(&mut self, random: &mut Random) {
        for road in &mut self.roads {
            let degrees = road.ends.map(|(node, _)| self.nodes[node].degree());
            let length_m = road.curve.length_m;
            road.section.fit(length_m, degrees, random);
        }
    }
}

/// Rows and columns of a grid with about this many roads, as square as it goes; at least 2 each.
fn grid(roads: f64) -> (usize, usize) {
    let rows = (2..).find(|&rows| count(rows + 1, rows + 1) as f64 > roads);
    let rows = rows.unwrap_or(2);
    let columns = (rows..).find(|&columns| count(rows, columns) as f64 >= roads);
    (rows, columns.unwrap_or(rows))
}

fn count(rows: usize, columns: usize) -> usize {
    rows * (columns - 1) + columns * (rows - 1)
}

fn node(row: usize, column: usize, grid: (usize, usize), random: &mut Random) -> Node {
    let along = |at: usize, of: usize| (at as f64 - (of - 1) as f64 / 2.0) * BLOCK_M;
    let mut stray_m = || random.between(-STRAY_M, STRAY_M);
    let (stray_east_m, stray_north_m) = (stray_m(), stray_m());
    Node {
        place: Place {
            east_m: along(column, grid.1) + stray_east_m,
            north_m: along(row, grid.0) + stray_north_m,
            yaw_rad: random.between(-TURN_RAD, TURN_RAD),
        },
        arms: [None; ARMS],
    }
}
