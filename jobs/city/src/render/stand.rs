//! What stands around one picture's eye, in its local frame, and which of it a pixel can see.

use super::buckets::Buckets;
use super::eye::{Rays, Way};
use super::noise::{hash, share};
use super::roadside::{LAMP_HEIGHT_M, Roadside};
use super::solids::{Solid, SolidKind};
use super::traffic::TrafficVehicle;
use super::vector::{V3, v2, v3};
use crate::world::{Building, Point, World};

/// How far away buildings, trees and lamps are drawn, in metres.
const BUILDINGS_M: f64 = 320.0;
const TREES_M: f64 = 190.0;
const LAMPS_M: f64 = 150.0;
/// Pixels of a square of the picture whose solids are listed together, and of its margin.
const SQUARE_PX: usize = 16;
const MARGIN_PX: f64 = 2.0;
/// Points along every edge of a solid's box at which its outline is sought: lenses bend edges.
const EDGE_POINTS: usize = 4;

/// Where solids of the whole city are.
pub(super) struct Standing {
    roadside: Roadside,
    buildings: Buckets,
    trees: Buckets,
    lamps: Buckets,
}

impl Standing {
    pub(super) fn new(world: &World, roadside: Roadside) -> Self {
        let bucketed = |places: &mut dyn Iterator<Item = Point>| {
            let mut buckets = Buckets::default();
            for (index, [east_m, north_m, _]) in (0..).zip(places) {
                buckets.add(index, [east_m, north_m]);
            }
            buckets
        };
        Self {
            buildings: bucketed(&mut world.buildings.iter().map(|building| building.at)),
            trees: bucketed(&mut roadside.trees.iter().map(|tree| tree.at)),
            lamps: bucketed(&mut roadside.lamps.iter().map(|lamp| lamp.at)),
            roadside,
        }
    }

    /// Everything near a place, the nearest first; `trees` is the share of trees that stand.
    pub(super) fn around(
        &self,
        world: &World,
        traffic: &[TrafficVehicle],
        eye: Point,
        origin: Point,
        trees: f64,
    ) -> Vec<Solid> {
        let place = [eye[0], eye[1]];
        let local = |at: Point| {
            let [x, y, z] = [0, 1, 2].map(|axis| (at[axis] - origin[axis]) as f32);
            v3(x, y, z)
        };
        let mut solids: Vec<Solid> = (0..)
            .zip(traffic)
            .map(|(number, vehicle)| vehicle.solid(number, origin))
            .collect();
        for index in self.buildings.near(place, BUILDINGS_M) {
            let building = &world.buildings[index as usize];
            solids.push(house(building, local(building.at), index));
        }
        for index in self.trees.near(place, TREES_M) {
            let tree = &self.roadside.trees[index as usize];
            if f64::from(tree.lot) < trees {
                let (wide, high) = (2.0 * tree.crown_m as f32, tree.height_m as f32);
                solids.push(plain(
                    SolidKind::Tree,
                    local(tree.at),
                    v3(wide, wide, high),
                    index,
                ));
            }
        }
        for index in self.lamps.near(place, LAMPS_M) {
            let lamp = &self.roadside.lamps[index as usize];
            let size = v3(3.4, 0.4, LAMP_HEIGHT_M as f32 + 0.2);
            let towards = v2(lamp.towards_road[0] as f32, lamp.towards_road[1] as f32);
            solids.push(Solid {
                ahead: towards,
                ..plain(SolidKind::Lamp, local(lamp.at), size, index)
            });
        }
        let eye = local(eye);
        let away =
            |solid: &Solid| (solid.foot - eye).flat().norm() - solid.size.flat().norm() / 2.0;
        solids.sort_by(|a, b| away(a).total_cmp(&away(b)));
        solids
    }
}

fn plain(kind: SolidKind, foot: V3, size: V3, index: u32) -> Solid {
    Solid {
        kind,
        foot,
        ahead: v2(1.0, 0.0),
        size,
        color: v3(0.3, 0.3, 0.3),
        lots: hash(index as i32, kind as i32, 31),
        velocity: v3(0.0, 0.0, 0.0),
        vehicle: None,
        in_sun: 1.0,
    }
}

/// Plaster, brick, concrete.
const WALLS: [V3; 7] = [
    v3(0.46, 0.43, 0.37),
    v3(0.38, 0.26, 0.19),
    v3(0.52, 0.50, 0.46),
    v3(0.30, 0.17, 0.12),
    v3(0.42, 0.42, 0.43),
    v3(0.50, 0.42, 0.28),
    v3(0.27, 0.29, 0.32),
];

fn house(building: &Building, foot: V3, index: u32) -> Solid {
    let [length, width, height] = building.size_m.map(|metres| metres.max(0.5) as f32);
    let (sin, cos) = building.yaw_rad.sin_cos();
    let lots = hash(index as i32, 1, 32);
    // It goes a little into the ground, which is not level.
    Solid {
        ahead: v2(cos as f32, sin as f32),
        color: WALLS[lots as usize % WALLS.len()] * (0.8 + 0.3 * share(lots)),
        ..plain(
            SolidKind::Building,
            foot - v3(0.0, 0.0, 1.0),
            v3(length, width, height + 1.0),
            index,
        )
    }
}

/// Which solids each square of the picture can see, the nearest first.
pub(super) struct Squares {
    columns: usize,
    lists: Vec<Vec<u32>>,
    /// Left, top, right and bottom of every solid, in pixels.
    bounds: Vec<[f32; 4]>,
}

impl Squares {
    pub(super) fn new(solids: &[Solid], way: &Way, rays: &Rays) -> Self {
        let columns = rays.width.div_ceil(SQUARE_PX);
        let rows = rays.height.div_ceil(SQUARE_PX);
        let mut lists = vec![Vec::new(); columns * rows];
        let cameras = [0.0, 1.0].map(|share| way.local_from_camera(share).inverse());
        let mut bounds = vec![[f32::INFINITY; 4]; solids.len()];
        for (index, solid) in (0_u32..).zip(solids) {
            let Some([left, top, right, bottom]) = outline(solid, way, rays.limit, &cameras) else {
                continue;
            };
            let square =
                |pixel: f64, most: usize| (pixel.max(0.0) as usize / SQUARE_PX).min(most - 1);
            if right < 0.0 || bottom < 0.0 || left > rays.width as f64 || top > rays.height as f64 {
                continue;
            }
            bounds[index as usize] = [left, top, right, bottom].map(|px| px as f32);
            for row in square(top, rows)..=square(bottom, rows) {
                for column in square(left, columns)..=square(right, columns) {
                    lists[row * columns + column].push(index);
                }
            }
        }
        Self {
            columns,
            lists,
            bounds,
        }
    }

    /// Solids that the pixel may see.
    pub(super) fn at(&self, x: usize, y: usize) -> impl Iterator<Item = u32> {
        let list = &self.lists[y / SQUARE_PX * self.columns + x / SQUARE_PX];
        let (x, y) = (x as f32, y as f32);
        list.iter().copied().filter(move |&index| {
            let [left, top, right, bottom] = self.bounds[index as usize];
            x >= left && x <= right && y >= top && y <= bottom
        })
    }
}

/// The pixels (left, top, right, bottom) between which a solid lies; none if it is behind.
fn outline(
    solid: &Solid,
    way: &Way,
    limit: f64,
    cameras: &[nalgebra::Isometry3<f64>; 2],
) -> Option<[f64; 4]> {
    let corners = solid.corners();
    let mut bounds: Option<[f64; 4]> = None;
    for camera_from_local in cameras {
        let seen = corners.map(|at| {
            let point = nalgebra::Point3::new(f64::from(at.x), f64::from(at.y), f64::from(at.z));
            camera_from_local.transform_point(&point).coords
        });
        for (from, to) in edges() {
            for [x, y] in edge_pixels(way, limit, seen[from], seen[to]) {
                let [left, top, right, bottom] = bounds.unwrap_or([x, y, x, y]);
                bounds = Some([left.min(x), top.min(y), right.max(x), bottom.max(y)]);
            }
        }
    }
    let [left, top, right, bottom] = bounds?;
    Some([
        left - MARGIN_PX,
        top - MARGIN_PX,
        right + MARGIN_PX,
        bottom + MARGIN_PX,
    ])
}

/// Pairs of corners that differ in one direction.
fn edges() -> impl Iterator<Item = (usize, usize)> {
    (0..8_usize).flat_map(|corner| {
        let others = [1, 2, 4].map(|bit| corner | bit).into_iter();
        others
            .filter(move |&other| other != corner)
            .map(move |other| (corner, other))
    })
}

/// Pixels along an edge (camera frame), as far as it lies before the camera.
fn edge_pixels(
    way: &Way,
    limit: f64,
    from: nalgebra::Vector3<f64>,
    to: nalgebra::Vector3<f64>,
) -> Vec<[f64; 2]> {
    let near_m = super::camera::NEAR_M * 1.01;
    if from.z < near_m && to.z < near_m {
        return Vec::new();
    }
    // Cut where it passes the near plane.
    let cut = |a: nalgebra::Vector3<f64>, b: nalgebra::Vector3<f64>| {
        if a.z >= near_m {
            a
        } else {
            a + (b - a) * ((near_m - a.z) / (b.z - a.z))
        }
    };
    let (from, to) = (cut(from, to), cut(to, from));
    let pixels = (0..=EDGE_POINTS).map(|step| {
        let at = from + (to - from) * (step as f64 / EDGE_POINTS as f64);
        let seen = way.camera.pixel_within([at.x, at.y, at.z], limit);
        // Beyond the lens model: far outside, in the direction in which it lies.
        seen.unwrap_or_else(|| {
            let scale = 1e5 / at.x.hypot(at.y).max(1e-9);
            [at.x * scale, at.y * scale]
        })
    });
    pixels.collect()
}
