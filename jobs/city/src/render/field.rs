//! The ground within sight of one picture, and where rays meet it.

use std::sync::Arc;

use super::eye::Pose;
use super::terrain::{Ground, TILES_M, Terrain, Tile, TileKey};
use super::vector::{V2, V3, floor, v2};

/// Metres around the eye that the near and the far table cover.
const REACHES_M: [f32; 2] = [88.0, 400.0];
/// Tiles whose middle is nearer than this are taken wherever the camera looks, in tile sides.
const AROUND: f32 = 1.5;
/// How much further every step along a flat ray goes, and steps that close in on the ground.
const STRIDE: f32 = 1.16;
const NEWTON_STEPS: usize = 3;
/// A ray has met the ground when it is this close to it, in metres.
const CLOSE_M: f32 = 1e-4;
/// Directions and distances (metres) in which slopes are measured.
const DIRECTIONS: usize = 48;
const DISTANCES_M: [f32; 9] = [6.0, 12.0, 20.0, 32.0, 50.0, 85.0, 140.0, 230.0, 380.0];

/// A square of tiles.
struct Window {
    tile_m: f32,
    /// The local number of its first tile.
    first: [i32; 2],
    side: usize,
    tiles: Vec<Option<Arc<Tile>>>,
}

impl Window {
    fn tile(&self, place: V2) -> Option<(&Tile, V2)> {
        let at = place * (1.0 / self.tile_m);
        let (x, y) = (floor(at.x), floor(at.y));
        let (column, row) = (x - self.first[0], y - self.first[1]);
        let side = self.side as i32;
        if column < 0 || row < 0 || column >= side || row >= side {
            return None;
        }
        let tile = self.tiles[row as usize * self.side + column as usize].as_deref()?;
        Some((tile, v2(at.x - x as f32, at.y - y as f32)))
    }
}

/// The ground around one picture's eye, in its local frame.
pub(super) struct Field {
    near: Window,
    far: Window,
    /// What is known of places outside of both tables.
    elsewhere: Ground,
    origin_up_m: f32,
    /// The steepest way down to the ground's highest place, and the ground's steepest slope.
    horizon: f32,
    steepest: f32,
}

impl Field {
    /// The ground that a camera of this pose can see, whose rays are at most an angle off its axis.
    pub(super) fn new(terrain: &Terrain, origin: [f64; 3], pose: &Pose, widest_cos: f32) -> Self {
        let window = |table: usize| window(terrain, origin, pose, widest_cos, table);
        let eye = pose.at;
        let below = terrain.height_m([origin[0] + f64::from(eye.x), origin[1] + f64::from(eye.y)]);
        let mut field = Self {
            near: window(0),
            far: window(1),
            elsewhere: Ground {
                height_m: below as f32,
                off_road_m: 60.0,
                ..Ground::default()
            },
            origin_up_m: origin[2] as f32,
            horizon: 0.0,
            steepest: 0.0,
        };
        field.measure(eye);
        field
    }

    fn measure(&mut self, eye: V3) {
        let (mut horizon, mut steepest) = (f32::NEG_INFINITY, 0.0_f32);
        for step in 0..DIRECTIONS {
            let angle = step as f32 / DIRECTIONS as f32 * std::f32::consts::TAU;
            let way = v2(angle.cos(), angle.sin());
            let (mut last_m, mut last_up) = (0.0, self.height_m(eye.flat()));
            for distance_m in DISTANCES_M {
                let up = self.height_m(eye.flat() + way * distance_m);
                horizon = horizon.max((up - eye.z) / distance_m);
                steepest = steepest.max(((up - last_up) / (distance_m - last_m)).abs());
                (last_m, last_up) = (distance_m, up);
            }
        }
        self.horizon = horizon + 0.003;
        self.steepest = steepest;
    }

    /// What the tables say of a place; its height is in the local frame.
    pub(super) fn at(&self, place: V2) -> Ground {
        let tile = self.near.tile(place).or_else(|| self.far.tile(place));
        let ground = tile.map_or(self.elsewhere, |(tile, at)| tile.at(at.x, at.y));
        Ground {
            height_m: ground.height_m - self.origin_up_m,
            ..ground
        }
    }

    /// Metres up, in the local frame.
    pub(super) fn height_m(&self, place: V2) -> f32 {
        let tile = self.near.tile(place).or_else(|| self.far.tile(place));
        let up_m = tile.map_or(self.elsewhere.height_m, |(tile, at)| {
            tile.height_m(at.x, at.y)
        });
        up_m - self.origin_up_m
    }

    /// How far along a ray of length 1 the ground is; none if it is the sky's or too far.
    pub(super) fn cast(&self, from: V3, to: V3) -> Option<f32> {
        let level = (1.0 - to.z * to.z).max(1e-9).sqrt();
        let slope = to.z / level;
        if slope > self.horizon {
            return None;
        }
        let above_m = from.z - self.height_m(from.flat());
        if slope < -1.5 * self.steepest - 0.02 {
            return Some(self.close_in(from, to, above_m / -to.z));
        }
        self.march(from, to, level, above_m)
    }

    /// Newton's method, for rays that are steeper than the ground.
    fn close_in(&self, from: V3, to: V3, start_m: f32) -> f32 {
        let mut depth_m = start_m;
        for _ in 0..NEWTON_STEPS {
            let at = from + to * depth_m;
            let above_m = at.z - self.height_m(at.flat());
            depth_m += above_m / -to.z;
            if above_m.abs() < CLOSE_M {
                break;
            }
        }
        depth_m
    }

    /// Steps along a flat ray until it is below the ground, then narrows down where it went in.
    fn march(&self, from: V3, to: V3, level: f32, above_m: f32) -> Option<f32> {
        let most_m = REACHES_M[1] / level;
        // No ground before this: it would have to be steeper than it is.
        let start_m = above_m / (self.steepest * 1.5 + 0.005 - to.z / level).max(1e-3) / level;
        let above = |depth_m: f32| {
            let at = from + to * depth_m;
            at.z - self.height_m(at.flat())
        };
        let (mut low_m, mut high_m) = (0.0, start_m.max(1.0));
        while above(high_m) > 0.0 {
            low_m = high_m;
            high_m *= STRIDE;
            if high_m > most_m {
                return None;
            }
        }
        let (mut low_above, mut high_above) = (above(low_m), above(high_m));
        for _ in 0..NEWTON_STEPS {
            let share = low_above / (low_above - high_above).max(1e-9);
            let middle_m = low_m + (high_m - low_m) * share.clamp(0.05, 0.95);
            let middle_above = above(middle_m);
            if middle_above > 0.0 {
                (low_m, low_above) = (middle_m, middle_above);
            } else {
                (high_m, high_above) = (middle_m, middle_above);
            }
        }
        let share = low_above / (low_above - high_above).max(1e-9);
        Some(low_m + (high_m - low_m) * share.clamp(0.0, 1.0))
    }
}

fn window(
    terrain: &Terrain,
    origin: [f64; 3],
    pose: &Pose,
    widest_cos: f32,
    table: usize,
) -> Window {
    let tile_m = TILES_M[table] as f32;
    let first = [pose.at.x, pose.at.y].map(|at| ((at - REACHES_M[table]) / tile_m).floor() as i32);
    let side = (2.0 * REACHES_M[table] / tile_m) as usize + 2;
    // The origin lies on a tile's corner.
    let offset = [0, 1].map(|axis| (origin[axis] / TILES_M[table]).round() as i32);
    let mut wanted: Vec<(usize, TileKey)> = Vec::new();
    for index in 0..side * side {
        let (column, row) = (
            first[0] + (index % side) as i32,
            first[1] + (index / side) as i32,
        );
        let middle = v2(column as f32 + 0.5, row as f32 + 0.5) * tile_m;
        if is_seen(middle, tile_m, pose, widest_cos) {
            wanted.push((index, (table, column + offset[0], row + offset[1])));
        }
    }
    let keys: Vec<TileKey> = wanted.iter().map(|(_, key)| *key).collect();
    let mut tiles = vec![None; side * side];
    for ((index, _), tile) in wanted.into_iter().zip(terrain.tiles(&keys)) {
        tiles[index] = Some(tile);
    }
    Window {
        tile_m,
        first,
        side,
        tiles,
    }
}

/// Whether a tile can be in the picture: near the eye, or within the cone around the axis.
fn is_seen(middle: V2, tile_m: f32, pose: &Pose, widest_cos: f32) -> bool {
    let away = middle - pose.at.flat();
    let away_m = away.norm();
    if away_m < AROUND * tile_m {
        return true;
    }
    let angle = away.dot(pose.ahead.flat().unit()).clamp(-away_m, away_m) / away_m;
    let half_tile_rad = (0.75 * tile_m / away_m).min(1.0).asin();
    angle.acos() < widest_cos.clamp(-1.0, 1.0).acos() + half_tile_rad
}

#[cfg(test)]
mod tests;
