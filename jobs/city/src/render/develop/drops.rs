//! Rain: streaks in the air and drops on the glass.

use super::lot;
use crate::render::picture::Film;
use crate::render::vector::{grey, v2};

/// Streaks and drops of the hardest rain, in a picture of 640 by 360.
const STREAKS: f32 = 420.0;
const DROPS: f32 = 34.0;
/// Longest streak and largest drop, as shares of the picture's width.
const STREAK: f32 = 0.05;
const DROP: f32 = 0.014;

/// Thin bright lines, nearly upright.
pub(super) fn streaks(film: &mut Film, rain: f32, seed: u32) {
    let sky = film
        .color
        .iter()
        .step_by(997)
        .fold(grey(0.0), |sum, color| sum + *color)
        * (1.0 / film.color.len().div_ceil(997) as f32);
    for number in 0..(STREAKS * rain) as u32 {
        let lot = |salt: u32| lot(number, salt, seed);
        let length = film.width as f32 * STREAK * (0.2 + 0.8 * lot(3) * lot(3));
        let start = v2(
            lot(1) * film.width as f32,
            lot(2) * film.height as f32 * 1.1 - length,
        );
        let slant = 0.12 * (lot(4) - 0.3);
        let strength = 0.05 + 0.14 * lot(5);
        for step in 0..length as u32 {
            let (x, y) = (start.x + slant * step as f32, start.y + step as f32);
            if x >= 0.0 && y >= 0.0 && x < film.width as f32 && y < film.height as f32 {
                let at = y as usize * film.width + x as usize;
                film.color[at] = film.color[at].mix(sky * 1.5, strength);
            }
        }
    }
}

/// Drops show the picture small and upside down, and their rims are dark.
pub(super) fn on_glass(film: &mut Film, rain: f32, seed: u32) {
    let before = film.color.clone();
    for number in 0..(DROPS * rain) as u32 {
        let lot = |salt: u32| lot(number, salt + 20, seed);
        let radius = film.width as f32 * DROP * (0.25 + 0.75 * lot(3) * lot(3));
        let middle = v2(lot(1) * film.width as f32, lot(2) * film.height as f32);
        let tall = 1.0 + 0.4 * lot(4);
        let reach = (radius * tall).ceil() as i32;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let away = v2(dx as f32 / radius, dy as f32 / (radius * tall));
                let out = away.norm();
                let (x, y) = (middle.x as i32 + dx, middle.y as i32 + dy);
                let is_in = x >= 0 && y >= 0 && x < film.width as i32 && y < film.height as i32;
                if out >= 1.0 || !is_in {
                    continue;
                }
                let seen = v2(middle.x - dx as f32 * 5.0, middle.y - dy as f32 * 5.0);
                let sx = (seen.x.max(0.0) as usize).min(film.width - 1);
                let sy = (seen.y.max(0.0) as usize).min(film.height - 1);
                let rim = 1.0 - 0.45 * out.powi(4);
                let share = ((1.0 - out) * 4.0).min(1.0) * 0.8;
                let at = y as usize * film.width + x as usize;
                film.color[at] = film.color[at].mix(before[sy * film.width + sx] * rim, share);
            }
        }
    }
}
