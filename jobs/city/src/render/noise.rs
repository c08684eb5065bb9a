//! Textures of the ground: tileable noise with mip levels, anchored to the city's plane, so that a
//! stain stays where it is from frame to frame and from drive to drive.
//!
//! Coordinates are metres of the plane, reduced to `0..REPEAT_M` (single precision then keeps half a
//! millimetre); every period divides it.

use super::vector::{V2, floor, log2_floor, v2};

/// Metres after which every texture has repeated.
pub(super) const REPEAT_M: f64 = 4096.0;
/// Texels of a side.
const SIDE: usize = 256;

/// A well-mixed hash of a cell.
pub(super) fn hash(x: i32, y: i32, salt: u32) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x9E37_79B1)
        ^ (y as u32).wrapping_mul(0x85EB_CA77)
        ^ salt.wrapping_mul(0xC2B2_AE3D);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    h ^ (h >> 15)
}

/// A hash as a share in `[0, 1)`.
pub(super) fn share(hash: u32) -> f32 {
    (hash >> 8) as f32 / (1_u32 << 24) as f32
}

/// Tileable noise with values in `[0, 1]`, evenly spread at its finest level.
pub(super) struct Texture {
    /// From fine to coarse, in 65,535ths: half the memory of floats stays in the processor's cache.
    levels: Vec<Vec<u16>>,
}

impl Texture {
    /// Noise of several octaves, the first with `cycles` waves along a side; each next octave has
    /// twice as many and `gain` of the height.
    pub(super) fn fractal(cycles: usize, gain: f32, salt: u32) -> Self {
        let mut values = vec![0.0; SIDE * SIDE];
        let (mut cycles, mut height) = (cycles, 1.0);
        while cycles <= SIDE {
            for (index, value) in values.iter_mut().enumerate() {
                *value += height * lattice(index % SIDE, index / SIDE, cycles, salt);
            }
            cycles *= 2;
            height *= gain;
        }
        Self::with_levels(even(&values))
    }

    /// Dark veins on light ground: what cracks and seams follow.
    pub(super) fn veins(cycles: usize, salt: u32) -> Self {
        let bend = |x: usize, y: usize, salt: u32| {
            lattice(x, y, cycles, salt) + 0.5 * lattice(x, y, cycles * 3, salt + 1)
        };
        let values = (0..SIDE * SIDE).map(|index| {
            let (x, y) = (index % SIDE, index / SIDE);
            (bend(x, y, salt) - 0.75).abs()
        });
        Self::with_levels(even(&values.collect::<Vec<f32>>()))
    }

    fn with_levels(finest: Vec<u16>) -> Self {
        let mut levels = vec![finest];
        let mut side = SIDE;
        while side > 1 {
            let finer = &levels[levels.len() - 1];
            let coarser = halved(finer, side);
            levels.push(coarser);
            side /= 2;
        }
        Self { levels }
    }

    /// The value at a place, for a picture whose pixels see `foot_m` of the ground there.
    pub(super) fn at(&self, place: V2, period_m: f32, foot_m: f32) -> f32 {
        let texel_m = period_m / SIDE as f32;
        let level = log2_floor((foot_m / texel_m).max(1.0));
        let level = level.min(self.levels.len() - 1);
        let side = SIDE >> level;
        let scale = side as f32 / period_m;
        bilinear(
            &self.levels[level],
            side,
            v2(place.x * scale, place.y * scale),
        )
    }
}

/// Bilinear look-up of a square table that repeats; its side is a power of two.
fn bilinear(table: &[u16], side: usize, at: V2) -> f32 {
    let (x, y) = (at.x - 0.5, at.y - 0.5);
    let (fx, fy) = (floor(x), floor(y));
    let (sx, sy) = (x - fx as f32, y - fy as f32);
    let mask = side - 1;
    let (x0, y0) = (fx as usize & mask, fy as usize & mask);
    let (x1, y1) = ((x0 + 1) & mask, (y0 + 1) & mask);
    let at = |x: usize, y: usize| f32::from(table[y * side + x]);
    let low = at(x0, y0) * (1.0 - sx) + at(x1, y0) * sx;
    let high = at(x0, y1) * (1.0 - sx) + at(x1, y1) * sx;
    (low * (1.0 - sy) + high * sy) * (1.0 / 65_535.0)
}

/// Value noise of one octave, in `[0, 1]`.
fn lattice(x: usize, y: usize, cycles: usize, salt: u32) -> f32 {
    let scale = cycles as f32 / SIDE as f32;
    let (x, y) = ((x as f32 + 0.5) * scale, (y as f32 + 0.5) * scale);
    let ease = |share: f32| share * share * (3.0 - 2.0 * share);
    let (sx, sy) = (ease(x.fract()), ease(y.fract()));
    let corner = |dx: usize, dy: usize| {
        let (cx, cy) = ((x as usize + dx) % cycles, (y as usize + dy) % cycles);
        share(hash(cx as i32, cy as i32, salt + cycles as u32))
    };
    let low = corner(0, 0) * (1.0 - sx) + corner(1, 0) * sx;
    let high = corner(0, 1) * (1.0 - sx) + corner(1, 1) * sx;
    low * (1.0 - sy) + high * sy
}

/// Every value replaced by its rank, so that a threshold of 0.3 takes 30 % of the area.
fn even(values: &[f32]) -> Vec<u16> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0; values.len()];
    for (rank, index) in order.into_iter().enumerate() {
        ranks[index] = (rank * 65_536 / values.len()) as u16;
    }
    ranks
}

fn halved(finer: &[u16], side: usize) -> Vec<u16> {
    let half = side / 2;
    let mean = |index: usize| {
        let at = (index / half) * 2 * side + (index % half) * 2;
        let sum: u32 = [at, at + 1, at + side, at + side + 1]
            .map(|at| u32::from(finer[at]))
            .iter()
            .sum();
        (sum / 4) as u16
    };
    (0..half * half).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_threshold_takes_its_share_of_the_area() {
        let texture = Texture::fractal(8, 0.6, 1);
        let places = (0..10_000).map(|i| v2((i % 100) as f32 * 0.04, (i / 100) as f32 * 0.04));
        let below = places
            .filter(|&place| texture.at(place, 4.0, 0.0) < 0.3)
            .count();
        assert!((2_700..3_300).contains(&below), "{below}");
    }

    #[test]
    fn textures_repeat_and_blur_towards_their_mean() {
        let texture = Texture::fractal(8, 0.6, 1);
        let (here, there) = (v2(1.3, 2.7), v2(5.3, 2.7));
        assert!((texture.at(here, 4.0, 0.01) - texture.at(there, 4.0, 0.01)).abs() < 1e-3);
        assert!((texture.at(here, 4.0, 100.0) - 0.5).abs() < 0.01);
    }
}
