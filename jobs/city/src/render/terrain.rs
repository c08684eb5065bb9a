//! The ground as tables: its height, how far the road's border is, where wheels run, and how much
//! light the street lamps give. Tables are made tile by tile when a picture first needs them.
//!
//! The road surface is what lies on the lanes' side of the kerbs, or within the lanes' widths where
//! there are no kerbs; junction lanes count.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::roadside::Lamp;
use crate::relief::Relief;
use crate::world::{Point, World};

mod border;
use border::Borders;

/// Samples along a tile's side; one more closes it.
const SAMPLES: usize = 64;
/// Metres between samples of the near and the far table.
const STEPS_M: [f64; 2] = [0.5, 2.0];
/// Metres of a tile's side, per table.
pub(super) const TILES_M: [f64; 2] = [32.0, 128.0];
/// Tiles that are kept; 16 bytes a sample, so about 70 MB.
const MOST_TILES: usize = 1_024;

/// What the tables say of a place.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Ground {
    /// Metres up.
    pub(super) height_m: f32,
    /// Metres beyond the road's border; negative on the road.
    pub(super) off_road_m: f32,
    /// 1 where wheels run, 0 between.
    pub(super) track: f32,
    /// Light of the street lamps.
    pub(super) lamps: f32,
}

impl Ground {
    fn mix(self, other: Self, share: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * share;
        Self {
            height_m: mix(self.height_m, other.height_m),
            off_road_m: mix(self.off_road_m, other.off_road_m),
            track: mix(self.track, other.track),
            lamps: mix(self.lamps, other.lamps),
        }
    }
}

/// One square of a table.
pub(super) struct Tile {
    samples: Vec<Ground>,
}

impl Tile {
    /// Looks up a place by its share of the tile's side.
    pub(super) fn at(&self, east: f32, north: f32) -> Ground {
        let (x, y) = (east * SAMPLES as f32, north * SAMPLES as f32);
        let last = SAMPLES as f32 - 1.0;
        let (x0, y0) = (x.clamp(0.0, last) as usize, y.clamp(0.0, last) as usize);
        let (sx, sy) = (x - x0 as f32, y - y0 as f32);
        let at = y0 * (SAMPLES + 1) + x0;
        let above = at + SAMPLES + 1;
        let low = self.samples[at].mix(self.samples[at + 1], sx);
        let high = self.samples[above].mix(self.samples[above + 1], sx);
        low.mix(high, sy)
    }

    /// The height alone.
    pub(super) fn height_m(&self, east: f32, north: f32) -> f32 {
        let (x, y) = (east * SAMPLES as f32, north * SAMPLES as f32);
        let last = SAMPLES as f32 - 1.0;
        let (x0, y0) = (x.clamp(0.0, last) as usize, y.clamp(0.0, last) as usize);
        let (sx, sy) = (x - x0 as f32, y - y0 as f32);
        let at = y0 * (SAMPLES + 1) + x0;
        let above = at + SAMPLES + 1;
        let mix = |a: usize| {
            let (a, b) = (self.samples[a].height_m, self.samples[a + 1].height_m);
            a + (b - a) * sx
        };
        let (low, high) = (mix(at), mix(above));
        low + (high - low) * sy
    }
}

/// Table (0 near, 1 far), east and north number of a tile.
pub(super) type TileKey = (usize, i32, i32);

/// The ground of a city.
pub(super) struct Terrain {
    relief: Arc<Relief>,
    borders: Borders,
    lamps: Vec<Lamp>,
    tiles: Mutex<BTreeMap<TileKey, Arc<Tile>>>,
}

impl Terrain {
    pub(super) fn new(world: &World, lamps: Vec<Lamp>) -> Self {
        Self {
            relief: Arc::clone(&world.relief),
            borders: Borders::new(world),
            lamps,
            tiles: Mutex::default(),
        }
    }

    /// The height of the ground.
    pub(super) fn height_m(&self, place: [f64; 2]) -> f64 {
        self.relief.height_m(place)
    }

    /// The tiles of these keys, made where they are not at hand. What is at hand never changes what
    /// comes back, only how soon.
    pub(super) fn tiles(&self, keys: &[TileKey]) -> Vec<Arc<Tile>> {
        let mut kept = self.tiles.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() + keys.len() > MOST_TILES {
            kept.clear();
        }
        let tile = |&key: &TileKey| {
            let made = || Arc::new(self.make(key));
            Arc::clone(kept.entry(key).or_insert_with(made))
        };
        keys.iter().map(tile).collect()
    }

    fn make(&self, (table, east, north): TileKey) -> Tile {
        let (side_m, step_m) = (TILES_M[table], STEPS_M[table]);
        let corner = [f64::from(east) * side_m, f64::from(north) * side_m];
        let lamps: Vec<&Lamp> = self
            .lamps
            .iter()
            .filter(|lamp| lamp.reaches(corner, side_m))
            .collect();
        let mut borders = self.borders.near(corner, side_m);
        let mut samples = vec![Ground::default(); (SAMPLES + 1) * (SAMPLES + 1)];
        for block in 0..BLOCKS * BLOCKS {
            let (bx, by) = ((block % BLOCKS) * BLOCK, (block / BLOCKS) * BLOCK);
            let at =
                |x: usize, y: usize| [corner[0] + x as f64 * step_m, corner[1] + y as f64 * step_m];
            let half_m = BLOCK as f64 * step_m / 2.0;
            let low = at(bx, by);
            borders.narrow([low[0] + half_m, low[1] + half_m], half_m * 1.5);
            for y in by..(by + BLOCK).min(SAMPLES + 1) {
                for x in bx..(bx + BLOCK).min(SAMPLES + 1) {
                    let place = at(x, y);
                    let (off_road_m, track) = borders.at(place);
                    samples[y * (SAMPLES + 1) + x] = Ground {
                        height_m: self.relief.height_m(place) as f32,
                        off_road_m: off_road_m as f32,
                        track: track as f32,
                        lamps: lamps.iter().map(|lamp| lamp.light(place)).sum::<f64>() as f32,
                    };
                }
            }
        }
        Tile { samples }
    }
}

/// Samples of a block, whose nearest borders are sought together, and blocks of a side.
const BLOCK: usize = 9;
const BLOCKS: usize = SAMPLES.div_ceil(BLOCK);

/// Whether a place lies off the road, and by how much: for whoever plants trees before there are
/// tables.
pub(super) struct RoadTest {
    borders: Borders,
}

impl RoadTest {
    pub(super) fn new(world: &World) -> Self {
        Self {
            borders: Borders::new(world),
        }
    }

    /// Metres beyond the road's border; negative on the road.
    pub(super) fn off_road_m(&self, [east_m, north_m, _]: Point) -> f64 {
        let mut near = self.borders.near([east_m, north_m], 0.0);
        near.narrow([east_m, north_m], 0.0);
        near.at([east_m, north_m]).0
    }
}

#[cfg(test)]
mod tests;
