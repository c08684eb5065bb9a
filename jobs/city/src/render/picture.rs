//! One picture: what each pixel sees, row by row, on all cores. No pixel depends on another, so
//! neither do the bytes on the number of threads.

use rayon::prelude::*;

use super::eye::{Pose, Rays, Way};
use super::field::Field;
use super::ground::GroundPicture;
use super::marks::Footprint;
use super::noise::{hash, share};
use super::solids::{Hit, Ray, Solid, SolidKind, Surroundings};
use super::stand::Squares;
use super::vector::{Rgb, V2, V3, grey, v2, v3};

/// What a pixel sees: nothing (no ray), the sky, the ground, or a solid with this number added.
pub(super) const SKY: u32 = 1;
pub(super) const GROUND: u32 = 2;
pub(super) const FIRST_SOLID: u32 = 3;
/// Most half-transparent things before one pixel.
const MOST_HITS: usize = 7;
/// From here on a wet road mirrors solids.
const MIRRORING: f32 = 0.06;
/// A pixel's footprint on the ground is cut off here, in metres.
const MOST_FOOT_M: f32 = 40.0;

/// Light, distance and motion of every pixel.
pub(super) struct Film {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) color: Vec<Rgb>,
    /// Metres along the ray.
    pub(super) depth_m: Vec<f32>,
    pub(super) seen: Vec<u32>,
    /// Pixels by which what is seen moves during the exposure; empty if nothing does.
    pub(super) motion: Vec<V2>,
}

/// What a ray sees.
#[derive(Debug, Clone, Copy)]
struct Look {
    color: Rgb,
    depth_m: f32,
    seen: u32,
}

/// Everything that one picture needs.
pub(super) struct Picture<'a> {
    pub(super) way: &'a Way<'a>,
    pub(super) rays: &'a Rays,
    pub(super) field: &'a Field,
    pub(super) ground: GroundPicture<'a>,
    pub(super) solids: &'a [Solid],
    pub(super) squares: &'a Squares,
    /// Solids that a wet road can mirror.
    pub(super) mirrored: &'a [u32],
    pub(super) around: Surroundings<'a>,
    pub(super) haze_per_m: f32,
    pub(super) seed: u32,
}

impl Picture<'_> {
    pub(super) fn take(&self) -> Film {
        let (width, height) = (self.rays.width, self.rays.height);
        let rows: Vec<Vec<Look>> = (0..height).into_par_iter().map(|y| self.row(y)).collect();
        let looks: Vec<Look> = rows.into_iter().flatten().collect();
        let seen: Vec<u32> = looks.iter().map(|look| look.seen).collect();
        let smoothed = (0..height)
            .into_par_iter()
            .map(|y| self.smoothed(y, &looks));
        let color: Vec<Rgb> = smoothed.flatten_iter().collect();
        let depth_m: Vec<f32> = looks.iter().map(|look| look.depth_m).collect();
        let motion = self.motion(&depth_m, &seen);
        Film {
            width,
            height,
            color,
            depth_m,
            seen,
            motion,
        }
    }

    fn row(&self, y: usize) -> Vec<Look> {
        let pose = self.way.pose(y as f64, 0.5);
        (0..self.rays.width)
            .map(|x| self.look(&pose, x, y, v2(0.0, 0.0)))
            .collect()
    }

    /// The row with its solids' outlines looked at four times a pixel.
    fn smoothed(&self, y: usize, looks: &[Look]) -> Vec<Rgb> {
        let pose = self.way.pose(y as f64, 0.5);
        let width = self.rays.width;
        let pixel = |x: usize| {
            let at = y * width + x;
            if !self.is_outline(x, y, looks) {
                return looks[at].color;
            }
            let parts = [
                (-0.25, -0.125),
                (0.125, -0.25),
                (0.25, 0.125),
                (-0.125, 0.25),
            ];
            let sum = parts.into_iter().fold(grey(0.0), |sum, (right, down)| {
                sum + self.look(&pose, x, y, v2(right, down)).color
            });
            sum * 0.25
        };
        (0..width).map(pixel).collect()
    }

    fn is_outline(&self, x: usize, y: usize, looks: &[Look]) -> bool {
        let (width, height) = (self.rays.width, self.rays.height);
        let here = looks[y * width + x].seen;
        let differs = |x: usize, y: usize| {
            let there = looks[y * width + x].seen;
            there != here && (self.is_hard(here) || self.is_hard(there))
        };
        (x > 0 && differs(x - 1, y))
            || (x + 1 < width && differs(x + 1, y))
            || (y > 0 && differs(x, y - 1))
            || (y + 1 < height && differs(x, y + 1))
    }

    /// Whether what is seen ends sharply: leaves and lamps are half-transparent at their rims.
    fn is_hard(&self, seen: u32) -> bool {
        seen.checked_sub(FIRST_SOLID).is_some_and(|index| {
            let kind = self.solids[index as usize].kind;
            !matches!(kind, SolidKind::Tree | SolidKind::Lamp)
        })
    }

    fn look(&self, pose: &Pose, x: usize, y: usize, aside: V2) -> Look {
        let (right, down) = self.rays.slopes(x, y);
        let direction = self.rays.at(x, y) + right * aside.x + down * aside.y;
        if !direction.x.is_finite() {
            return Look {
                color: grey(0.0),
                depth_m: 0.0,
                seen: 0,
            };
        }
        let pixel_rad = right.norm().max(down.norm()).clamp(1e-5, 0.1);
        let ray = Ray {
            from: pose.at,
            to: pose.turn(direction),
            pixel_rad,
        };
        let slopes = (pose.turn(right), pose.turn(down));
        let ground_m = self.field.cast(ray.from, ray.to);
        let mut hits = Hits::default();
        hits.gather(
            &ray,
            self.squares.at(x, y),
            self.solids,
            &self.around,
            ground_m,
        );
        self.compose(&ray, slopes, ground_m, &hits, (x, y))
    }

    /// From near to far, until nothing more can be seen.
    fn compose(
        &self,
        ray: &Ray,
        slopes: (V3, V3),
        ground_m: Option<f32>,
        hits: &Hits,
        (x, y): (usize, usize),
    ) -> Look {
        let (mut color, mut open) = (grey(0.0), 1.0_f32);
        let mut first: Option<(f32, u32)> = None;
        for (hit, index) in hits.sorted() {
            let light = self.solid_light(ray, hit, *index);
            color += self.hazed(ray, light, hit.depth_m) * (open * hit.cover);
            open *= 1.0 - hit.cover;
            if first.is_none() && open < 0.5 {
                first = Some((hit.depth_m, FIRST_SOLID + index));
            }
            if open < 0.02 {
                break;
            }
        }
        if open >= 0.02 {
            let behind = match ground_m {
                Some(depth_m) => {
                    let light = self.ground_light(ray, slopes, depth_m, (x, y));
                    self.hazed(ray, light, depth_m)
                }
                None => self.sky_light(ray),
            };
            color += behind * open;
        }
        let (depth_m, seen) = first
            .unwrap_or_else(|| ground_m.map_or((f32::INFINITY, SKY), |depth_m| (depth_m, GROUND)));
        Look {
            color,
            depth_m,
            seen,
        }
    }

    fn hazed(&self, ray: &Ray, light: Rgb, depth_m: f32) -> Rgb {
        if self.haze_per_m <= 0.0 {
            return light;
        }
        let clear = (-self.haze_per_m * depth_m).exp();
        self.ground.light.sky.air(ray.to).mix(light, clear)
    }

    fn sky_light(&self, ray: &Ray) -> Rgb {
        let sky = &self.ground.light.sky;
        let blots = &self.ground.textures.blots;
        let mut color = sky.at(ray.to, blots, true);
        if ray.to.z < 0.09 {
            let (cover, land) = sky.skyline(ray.to, ray.pixel_rad, blots);
            color = color.mix(land, cover);
        }
        // Fog hides the sky near the horizon first.
        let air_m = 40.0 / (ray.to.z.max(0.0) + 0.02);
        self.hazed(ray, color, air_m)
    }

    fn solid_light(&self, ray: &Ray, hit: &Hit, index: u32) -> Rgb {
        let at = ray.from + ray.to * hit.depth_m;
        let mirrored = if hit.gloss > 0.05 {
            self.mirror_sky(ray.to - hit.normal * (2.0 * hit.normal.dot(ray.to)))
        } else {
            grey(0.0)
        };
        let in_sun = self.solids[index as usize].in_sun;
        self.ground
            .light
            .on_solid(hit, ray.to, at, in_sun, mirrored)
    }

    /// What shines from a direction into a mirror: sky above, the dim street below.
    fn mirror_sky(&self, direction: V3) -> Rgb {
        let sky = &self.ground.light.sky;
        let street = (sky.skylight + sky.sunlight * 0.5) * 0.12;
        if direction.z < 0.0 {
            return street;
        }
        let above = sky.at(direction, &self.ground.textures.blots, false);
        // Houses and trees hide the lowest part.
        street.mix(above, (direction.z * 4.0 + 0.25).min(1.0))
    }

    fn ground_light(
        &self,
        ray: &Ray,
        slopes: (V3, V3),
        depth_m: f32,
        (x, y): (usize, usize),
    ) -> Rgb {
        let at = ray.from + ray.to * depth_m;
        let ground = self.field.at(at.flat());
        let foot = footprint(ray, slopes, depth_m);
        let light = self.ground.at(at, ray.to, &foot, &ground);
        if light.mirror < 0.01 {
            return light.color;
        }
        let lots = hash(x as i32, y as i32, self.seed ^ 77);
        let tilt = |bits: u32| (share(bits << 8) - 0.5) * 2.0 * light.rough;
        let up = v3(tilt(lots & 0xFFFF) * 0.25, tilt(lots >> 16) * 0.25, 1.0);
        let bounced = ray.to - up * (2.0 * ray.to.dot(up) / up.dot(up));
        let bounced = v3(
            bounced.x,
            bounced.y,
            bounced.z.abs() + light.rough * share(lots) * 0.6,
        )
        .unit();
        let image = self.mirror(at, bounced, light.mirror);
        light.color * (1.0 - light.mirror) + image * light.mirror
    }

    fn mirror(&self, at: V3, direction: V3, strength: f32) -> Rgb {
        if strength > MIRRORING {
            let ray = Ray {
                from: at,
                to: direction,
                pixel_rad: 0.01,
            };
            let mut hits = Hits::default();
            hits.gather(
                &ray,
                self.mirrored.iter().copied(),
                self.solids,
                &self.around,
                None,
            );
            if let Some((hit, index)) = hits.sorted().first() {
                return self
                    .mirror_sky(direction)
                    .mix(self.solid_light(&ray, hit, *index), hit.cover);
            }
        }
        self.mirror_sky(direction)
    }

    /// How far everything moves in the picture while its row is exposed, in pixels.
    fn motion(&self, depth_m: &[f32], seen: &[u32]) -> Vec<V2> {
        if self.way.exposure_s <= 0.0 {
            return Vec::new();
        }
        let width = self.rays.width;
        let row = |y: usize| {
            let poses = [0.0, 1.0].map(|part| self.way.pose(y as f64, part));
            let middle = self.way.pose(y as f64, 0.5);
            (0..width)
                .map(|x| {
                    let at = y * width + x;
                    self.pixel_motion((x, y), &middle, &poses, depth_m[at], seen[at])
                })
                .collect::<Vec<V2>>()
        };
        (0..self.rays.height)
            .into_par_iter()
            .flat_map_iter(row)
            .collect()
    }

    fn pixel_motion(
        &self,
        (x, y): (usize, usize),
        middle: &Pose,
        poses: &[Pose; 2],
        depth_m: f32,
        seen: u32,
    ) -> V2 {
        let direction = self.rays.at(x, y);
        if seen == 0 {
            return v2(0.0, 0.0);
        }
        let to = middle.turn(direction);
        let velocity = match seen.checked_sub(FIRST_SOLID) {
            Some(index) => self.solids[index as usize].velocity,
            None => grey(0.0),
        };
        let moved = velocity * (self.way.exposure_s as f32 * 0.5);
        let view = |pose: &Pose, moved: V3| {
            if depth_m.is_finite() {
                pose.turn_back(middle.at + to * depth_m + moved - pose.at)
                    .unit()
            } else {
                pose.turn_back(to)
            }
        };
        let shift = view(&poses[1], moved) - view(&poses[0], -moved);
        let (right, down) = self.rays.slopes(x, y);
        v2(
            shift.dot(right) / right.dot(right).max(1e-12),
            shift.dot(down) / down.dot(down).max(1e-12),
        )
    }
}

/// The ground that a pixel sees.
fn footprint(ray: &Ray, (right, down): (V3, V3), depth_m: f32) -> Footprint {
    let fall = ray.to.z.min(-1e-3);
    let shift = |slope: V3| {
        let way = (slope - ray.to * (slope.z / fall)) * depth_m;
        let flat = way.flat();
        flat * (MOST_FOOT_M / flat.norm().max(MOST_FOOT_M))
    };
    Footprint {
        du: shift(right),
        dv: shift(down),
    }
}

/// What a ray meets before the ground, as far as it has room.
struct Hits {
    count: usize,
    hits: [(Hit, u32); MOST_HITS],
}

impl Default for Hits {
    fn default() -> Self {
        let none = Hit {
            depth_m: f32::INFINITY,
            cover: 0.0,
            normal: grey(0.0),
            albedo: grey(0.0),
            glow: grey(0.0),
            gloss: 0.0,
        };
        Self {
            count: 0,
            hits: [(none, 0); MOST_HITS],
        }
    }
}

impl Hits {
    fn gather(
        &mut self,
        ray: &Ray,
        candidates: impl Iterator<Item = u32>,
        solids: &[Solid],
        around: &Surroundings,
        ground_m: Option<f32>,
    ) {
        let mut nearest_m = ground_m.unwrap_or(f32::INFINITY);
        for index in candidates {
            let Some(hit) = solids[index as usize].hit(ray, around, nearest_m) else {
                continue;
            };
            if hit.depth_m >= nearest_m {
                continue;
            }
            if hit.cover > 0.98 {
                nearest_m = hit.depth_m;
            }
            self.insert(hit, index);
        }
    }

    /// Keeps them in order of depth; the farthest give way.
    fn insert(&mut self, hit: Hit, index: u32) {
        let before =
            self.hits[..self.count].partition_point(|(other, _)| other.depth_m <= hit.depth_m);
        if before == MOST_HITS {
            return;
        }
        self.count = (self.count + 1).min(MOST_HITS);
        self.hits[before..self.count].rotate_right(1);
        self.hits[before] = (hit, index);
    }

    fn sorted(&self) -> &[(Hit, u32)] {
        &self.hits[..self.count]
    }
}

/// Solids near enough to be mirrored by a wet road: vehicles, and what is large.
pub(super) fn mirrored(solids: &[Solid], wet: f32) -> Vec<u32> {
    if wet <= 0.2 {
        return Vec::new();
    }
    let all = (0_u32..).zip(solids);
    let shining = all.filter(|(_, solid)| solid.size.z > 1.0);
    shining.map(|(index, _)| index).take(24).collect()
}
