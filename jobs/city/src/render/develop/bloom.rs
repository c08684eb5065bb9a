//! Light of very bright pixels that spills over their surroundings.

use crate::render::picture::Film;
use crate::render::vector::{Rgb, grey};

/// Pixels of a side that are taken together.
const COARSE: usize = 4;
/// Share of the light that spills, and the reach as a share of the picture's width.
const SHARE: f32 = 0.35;
const REACH: f32 = 0.012;
/// A pixel spills no more than this times the threshold.
const MOST: f32 = 40.0;

/// Adds the spill of pixels brighter than `threshold`.
pub(super) fn add(film: &mut Film, threshold: f32) {
    let (wide, high) = (film.width.div_ceil(COARSE), film.height.div_ceil(COARSE));
    let mut spill = vec![grey(0.0); wide * high];
    let mut any = false;
    for (index, color) in film.color.iter().enumerate() {
        let luma = color.luma();
        if luma > threshold {
            any = true;
            let most = MOST * threshold;
            let over = (luma.min(most) - threshold) / luma;
            let at = index / film.width / COARSE * wide + index % film.width / COARSE;
            spill[at] += *color * (over / (COARSE * COARSE) as f32);
        }
    }
    if !any {
        return;
    }
    let reach = ((film.width as f32 * REACH / COARSE as f32) as usize).max(1);
    for _ in 0..3 {
        spill = blurred(&blurred(&spill, wide, reach), high, reach);
    }
    let width = film.width;
    for (index, color) in film.color.iter_mut().enumerate() {
        let at = [index % width, index / width].map(|px| (px as f32 + 0.5) / COARSE as f32 - 0.5);
        *color += between(&spill, [wide, high], at) * SHARE;
    }
}

/// The spill between coarse pixels.
fn between(spill: &[Rgb], [wide, high]: [usize; 2], [x, y]: [f32; 2]) -> Rgb {
    let (x, y) = (x.max(0.0), y.max(0.0));
    let (x0, y0) = ((x as usize).min(wide - 1), (y as usize).min(high - 1));
    let (x1, y1) = ((x0 + 1).min(wide - 1), (y0 + 1).min(high - 1));
    let (sx, sy) = (x - x0 as f32, y - y0 as f32);
    let low = spill[y0 * wide + x0].mix(spill[y0 * wide + x1], sx);
    let high = spill[y1 * wide + x0].mix(spill[y1 * wide + x1], sx);
    low.mix(high, sy)
}

/// Running mean along the rows, written as columns.
fn blurred(from: &[Rgb], wide: usize, reach: usize) -> Vec<Rgb> {
    let high = from.len() / wide;
    let mut to = vec![grey(0.0); from.len()];
    let scale = 1.0 / (2 * reach + 1) as f32;
    for (y, row) in from.chunks_exact(wide).enumerate() {
        let mut sum = row[..reach.min(wide)]
            .iter()
            .fold(grey(0.0), |sum, color| sum + *color);
        for x in 0..wide {
            if x + reach < wide {
                sum += row[x + reach];
            }
            if x > reach {
                sum = sum - row[x - reach - 1];
            }
            to[x * high + y] = sum * scale;
        }
    }
    to
}
