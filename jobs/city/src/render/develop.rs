//! From light to bytes: what lens, shutter and sensor make of it.

use rayon::prelude::*;

use super::conditions::Conditions;
use super::noise::{hash, share};
use super::picture::{Film, SKY};
use super::vector::{Rgb, V2, floor, grey, v2, v3};

mod bloom;
mod drops;

/// Most samples along a motion.
const MOST_TAPS: f32 = 14.0;
/// Where the mean of the picture comes to lie, and how far exposure goes for that.
const MEAN: f32 = 0.17;
const GAINS: (f32, f32) = (0.35, 120.0);
/// Light from here on is squeezed.
const SHOULDER: f32 = 0.62;
/// Share of its light that a pixel gives to each neighbour, in a picture that is not measured.
const UNSHARP: f32 = 0.09;
/// Darkness of the corners.
const VIGNETTE: f32 = 0.28;
/// Contrast that is added.
const CONTRAST: f32 = 0.25;
/// Entries of the table of the transfer curve.
const CURVE: usize = 4_096;

/// Where the sun stands in the picture, and its light.
pub(super) struct SunImage {
    pub(super) pixel: V2,
    pub(super) light: Rgb,
}

/// The picture's bytes: red, green, blue, row by row.
pub(super) fn develop(
    mut film: Film,
    conditions: &Conditions,
    sun: Option<SunImage>,
    seed: u32,
) -> Vec<u8> {
    if !film.motion.is_empty() {
        film.color = moved(&film);
    }
    let mut gain = 1.0;
    if conditions.lens_marks {
        film.color = unsharp(&film);
        if let Some(sun) = &sun {
            veil(&mut film, sun, conditions.veil as f32);
        }
        gain = exposure(&film);
        bloom::add(&mut film, 1.3 / gain);
        if conditions.rain > 0.0 {
            drops::streaks(&mut film, conditions.rain as f32, seed);
            drops::on_glass(&mut film, conditions.rain as f32, seed);
        }
        vignette(&mut film);
    }
    print(&film, gain, conditions.noise as f32, seed)
}

/// The mean along every pixel's way during the exposure.
fn moved(film: &Film) -> Vec<Rgb> {
    let pixel = |index: usize| {
        let motion = film.motion[index];
        let length = motion.norm();
        if length < 0.6 {
            return film.color[index];
        }
        let taps = (length * 1.2).ceil().clamp(2.0, MOST_TAPS);
        let (x, y) = ((index % film.width) as f32, (index / film.width) as f32);
        let tap = |tap: u32| {
            let share = (tap as f32 + 0.5) / taps - 0.5;
            film.between(x + motion.x * share, y + motion.y * share)
        };
        (0..taps as u32).fold(grey(0.0), |sum, number| sum + tap(number)) * (1.0 / taps)
    };
    (0..film.color.len()).into_par_iter().map(pixel).collect()
}

impl Film {
    fn clamped(&self, x: i32, y: i32) -> Rgb {
        let x = x.clamp(0, self.width as i32 - 1) as usize;
        let y = y.clamp(0, self.height as i32 - 1) as usize;
        self.color[y * self.width + x]
    }

    /// The colour between pixels.
    fn between(&self, x: f32, y: f32) -> Rgb {
        let (x0, y0) = (floor(x), floor(y));
        let (sx, sy) = (x - x0 as f32, y - y0 as f32);
        let low = self.clamped(x0, y0).mix(self.clamped(x0 + 1, y0), sx);
        let high = self
            .clamped(x0, y0 + 1)
            .mix(self.clamped(x0 + 1, y0 + 1), sx);
        low.mix(high, sy)
    }
}

fn unsharp(film: &Film) -> Vec<Rgb> {
    let pixel = |index: usize| {
        let (x, y) = ((index % film.width) as i32, (index / film.width) as i32);
        let around = film.clamped(x - 1, y)
            + film.clamped(x + 1, y)
            + film.clamped(x, y - 1)
            + film.clamped(x, y + 1);
        film.color[index] * (1.0 - 4.0 * UNSHARP) + around * UNSHARP
    };
    (0..film.color.len()).into_par_iter().map(pixel).collect()
}

/// Light that the lens scatters: over the whole picture, more around the sun, and its images on the
/// way through the picture's middle.
fn veil(film: &mut Film, sun: &SunImage, veil: f32) {
    let (width, height) = (film.width as f32, film.height as f32);
    let (x, y) = (sun.pixel.x as i32, sun.pixel.y as i32);
    let is_in = x >= 0 && y >= 0 && x < film.width as i32 && y < film.height as i32;
    let is_open = !is_in || film.seen[y as usize * film.width + x as usize] == SKY;
    let strength = veil * if is_open { 1.0 } else { 0.3 };
    let middle = v2(width, height) * 0.5;
    let images = [(-0.35, 0.030), (0.45, 0.055), (1.25, 0.085)].map(|(share, radius)| {
        (
            sun.pixel + (middle - sun.pixel) * (1.0 + share),
            radius * width,
        )
    });
    let shines = is_in && is_open;
    let rows = film.color.par_chunks_mut(film.width).enumerate();
    rows.for_each(|(y, row)| {
        for (x, color) in row.iter_mut().enumerate() {
            let at = v2(x as f32, y as f32);
            let away = (at - sun.pixel).norm() / width;
            let near = (-away * away * 9.0).exp() + 1.6 * (-away * 12.0).exp();
            *color += sun.light * (strength * (0.12 + 0.75 * near));
            if shines {
                for (number, (middle, radius)) in images.iter().enumerate() {
                    if (at - *middle).norm() < *radius {
                        let tint = [v3(0.4, 0.9, 0.5), v3(0.9, 0.6, 0.3), v3(0.4, 0.5, 1.0)];
                        *color += tint[number] * (strength * 0.045);
                    }
                }
            }
        }
    });
}

/// Gain that brings the picture's mean to where cameras bring it. Summed in one order.
fn exposure(film: &Film) -> f32 {
    let lit = film
        .color
        .iter()
        .zip(&film.seen)
        .filter(|(_, seen)| **seen != 0);
    let (mut sum, mut count) = (0.0_f64, 0_u32);
    for (color, _) in lit.step_by(13) {
        // The brightest parts do not make the rest black.
        sum += f64::from(color.luma().min(1.6));
        count += 1;
    }
    let mean = (sum / f64::from(count.max(1))) as f32;
    (MEAN / mean.max(1e-6)).powf(0.93).clamp(GAINS.0, GAINS.1)
}

fn vignette(film: &mut Film) {
    let (width, height) = (film.width as f32, film.height as f32);
    let corner2 = (width * width + height * height) / 4.0;
    let rows = film.color.par_chunks_mut(film.width).enumerate();
    rows.for_each(|(y, row)| {
        for (x, color) in row.iter_mut().enumerate() {
            let away = v2(x as f32 - width / 2.0, y as f32 - height / 2.0);
            let share = away.dot(away) / corner2;
            *color = *color * (1.0 - VIGNETTE * share * (0.5 + 0.5 * share));
        }
    });
}

fn print(film: &Film, gain: f32, noise: f32, seed: u32) -> Vec<u8> {
    let curve: Vec<f32> = (0..CURVE)
        .map(|step| transfer(step as f32 / (CURVE - 1) as f32))
        .collect();
    let mut bytes = vec![0; film.color.len() * 3];
    let rows = bytes.par_chunks_mut(film.width * 3).enumerate();
    rows.for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            let color = film.color[y * film.width + x] * gain;
            let grain = grain(x as i32, y as i32, seed);
            let channels = [color.x, color.y, color.z];
            for ((byte, light), grain) in pixel.iter_mut().zip(channels).zip(grain) {
                let light = squeezed(light);
                let level = curve[(light * (CURVE - 1) as f32) as usize];
                // Few photons, much noise: dark parts are lifted by the curve.
                let spread = noise * 255.0 * (1.25 - 0.6 * level / 255.0);
                *byte = (level + grain * spread + 0.5).clamp(0.0, 255.0) as u8;
            }
        }
    });
    bytes
}

/// Soft in the highlights.
fn squeezed(light: f32) -> f32 {
    if light <= SHOULDER {
        return light.max(0.0);
    }
    let room = 1.0 - SHOULDER;
    (SHOULDER + room * (1.0 - (-(light - SHOULDER) / room).exp())).min(1.0)
}

/// The transfer curve of sRGB (IEC 61966-2-1) with some contrast, to 0..255.
fn transfer(light: f32) -> f32 {
    let level = if light <= 0.003_130_8 {
        12.92 * light
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    };
    // Cameras deepen the shadows and lift the lights a little.
    let deep = level * level * (3.0 - 2.0 * level);
    (level + CONTRAST * (deep - level)) * 255.0
}

/// Nearly normal noise of mean 0 and spread 1 for three channels, mostly alike.
fn grain(x: i32, y: i32, seed: u32) -> [f32; 3] {
    let lots = hash(x, y, seed);
    let more = hash(y, x, seed ^ 0x5bd1);
    // The sum of four bytes has a spread of 147.8.
    let normal = |bits: u32| {
        let bytes = bits.to_le_bytes();
        (bytes.iter().map(|&byte| f32::from(byte)).sum::<f32>() - 510.0) / 147.8
    };
    let common = normal(lots);
    [0, 8, 16].map(|turn| 0.85 * common + 0.5 * normal(more.rotate_left(turn) ^ lots))
}

/// A lot from 0 to 1 of the picture's `number`th drop or streak.
fn lot(number: u32, salt: u32, seed: u32) -> f32 {
    share(hash(number as i32, salt as i32, seed))
}
