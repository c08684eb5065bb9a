//! What stands on the ground: where a ray meets a vehicle, building, tree or lamp, and what the
//! surface is like there. Light falls on it elsewhere.

use super::marks::Pattern;
use super::noise::{Texture, hash, share};
use super::roadside::{LAMP_ARM_M, LAMP_HEIGHT_M};
use super::vector::{Rgb, V2, V3, grey, smooth, v2, v3};

mod convex;
use convex::{Plane, clip};

/// What a solid is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SolidKind {
    Car,
    /// A bus, truck or van: a box on wheels.
    Hauler,
    Building,
    Tree,
    Lamp,
}

/// Something that stands on the ground.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solid {
    pub(super) kind: SolidKind,
    /// Its foot: the middle of its base.
    pub(super) foot: V3,
    /// Direction of its length, a unit vector.
    pub(super) ahead: V2,
    /// Length, width, height in metres. A tree's length is the diameter of its crown.
    pub(super) size: V3,
    pub(super) color: Rgb,
    pub(super) lots: u32,
    /// Metres per second, for motion blur.
    pub(super) velocity: V3,
    /// Which vehicle of the traffic it is.
    pub(super) vehicle: Option<usize>,
    /// Share of the sun that reaches it.
    pub(super) in_sun: f32,
}

/// What a surface is like where a ray meets it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// Metres along the ray.
    pub(super) depth_m: f32,
    /// Share of the pixel that it fills.
    pub(super) cover: f32,
    pub(super) normal: V3,
    pub(super) albedo: Rgb,
    /// Light of its own.
    pub(super) glow: Rgb,
    /// 0 dull to 1 mirror.
    pub(super) gloss: f32,
}

/// A ray in the local frame, and how wide a pixel is at one metre.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) from: V3,
    pub(super) to: V3,
    pub(super) pixel_rad: f32,
}

/// What decides how surfaces look besides themselves.
pub(super) struct Surroundings<'a> {
    pub(super) noise: &'a Texture,
    /// Whether lamps are lit.
    pub(super) lamps: bool,
    /// Whether it is night: windows are lit.
    pub(super) night: bool,
}

const BODY: [Plane; 10] = [
    Plane(v3(1.0, 0.0, 0.0), 0.5),
    Plane(v3(-1.0, 0.0, 0.0), 0.5),
    Plane(v3(0.0, 1.0, 0.0), 0.5),
    Plane(v3(0.0, -1.0, 0.0), 0.5),
    Plane(v3(0.0, 0.0, 1.0), 0.64),
    Plane(v3(0.0, 0.0, -1.0), 0.0),
    // Bonnet, boot, and sides that lean in.
    Plane(v3(0.15, 0.0, 0.30), 0.215),
    Plane(v3(-0.07, 0.0, 0.06), 0.071),
    Plane(v3(0.0, 0.24, 0.05), 0.142),
    Plane(v3(0.0, -0.24, 0.05), 0.142),
];
const CABIN: [Plane; 6] = [
    Plane(v3(0.0, 0.0, 1.0), 1.0),
    Plane(v3(0.0, 0.0, -1.0), -0.55),
    Plane(v3(0.36, 0.0, 0.20), 0.205),
    Plane(v3(-0.36, 0.0, 0.17), 0.272),
    Plane(v3(0.0, 0.38, 0.11), 0.247),
    Plane(v3(0.0, -0.38, 0.11), 0.247),
];
const BOX: [Plane; 6] = [
    Plane(v3(1.0, 0.0, 0.0), 0.5),
    Plane(v3(-1.0, 0.0, 0.0), 0.5),
    Plane(v3(0.0, 1.0, 0.0), 0.5),
    Plane(v3(0.0, -1.0, 0.0), 0.5),
    Plane(v3(0.0, 0.0, 1.0), 1.0),
    Plane(v3(0.0, 0.0, -1.0), 0.0),
];
const FRONT: usize = 0;
const REAR: usize = 1;
const TOP: usize = 4;

const GLASS: Rgb = grey(0.025);
const RUBBER: Rgb = grey(0.022);
/// Metres: a wheel, its rim, and how far below a body one sees through.
const WHEEL_M: f32 = 0.33;
const RIM_M: f32 = 0.21;
const CLEARANCE_M: f32 = 0.2;

impl Solid {
    /// Where a ray meets it first, if it does before `most_m`.
    pub(super) fn hit(&self, ray: &Ray, around: &Surroundings, most_m: f32) -> Option<Hit> {
        match self.kind {
            SolidKind::Tree => self.tree(ray, around.noise, most_m),
            SolidKind::Lamp => self.lamp(ray, around),
            SolidKind::Car => self.car(ray, around),
            SolidKind::Hauler => self.hauler(ray, around, most_m),
            SolidKind::Building => self.building(ray, around, most_m),
        }
    }

    /// Corners of the box around it.
    pub(super) fn corners(&self) -> [V3; 8] {
        let left = self.ahead.left();
        let width_m = if self.kind == SolidKind::Lamp {
            2.0 * LAMP_ARM_M as f32
        } else {
            self.size.y
        };
        std::array::from_fn(|corner| {
            let side = |bit: usize| if corner >> bit & 1 == 1 { 0.5 } else { -0.5 };
            let flat = self.ahead * (self.size.x * side(0)) + left * (width_m * side(1));
            self.foot + v3(flat.x, flat.y, self.size.z * (side(2) + 0.5))
        })
    }

    /// A direction or offset in its own frame: ahead, left, up.
    fn own(&self, away: V3) -> V3 {
        let (x, y) = (self.ahead.x, self.ahead.y);
        v3(away.x * x + away.y * y, away.y * x - away.x * y, away.z)
    }

    fn world(&self, own: V3) -> V3 {
        let (x, y) = (self.ahead.x, self.ahead.y);
        v3(own.x * x - own.y * y, own.x * y + own.y * x, own.z)
    }

    /// The ray in its own frame, in shares of its size.
    fn scaled(&self, ray: &Ray) -> (V3, V3) {
        let by = v3(1.0 / self.size.x, 1.0 / self.size.y, 1.0 / self.size.z);
        (self.own(ray.from - self.foot) * by, self.own(ray.to) * by)
    }

    /// A plane's normal in the local frame, from that in shares of its size.
    fn normal(&self, normal: V3) -> V3 {
        let by = v3(1.0 / self.size.x, 1.0 / self.size.y, 1.0 / self.size.z);
        self.world((normal * by).unit())
    }

    fn car(&self, ray: &Ray, around: &Surroundings) -> Option<Hit> {
        let (from, to) = self.scaled(ray);
        let body = clip(&BODY, from, to)
            .filter(|&(depth_m, face)| !self.sees_through(from + to * depth_m, face, 0.3));
        let cabin = clip(&CABIN, from, to);
        // Sheet metal is bent: normals lean outwards from the middle of each face.
        let bent = |depth_m: f32, normal: V3| {
            let at = from + to * depth_m;
            let size = self.size;
            let lean = v3(at.x * 0.25, at.y * 0.5, (at.z - 0.42) * 0.7);
            let square = v3(normal.x / size.x, normal.y / size.y, normal.z / size.z).unit();
            self.world((square + lean).unit())
        };
        let surface = |depth_m: f32, normal: V3, (albedo, glow, gloss): (Rgb, Rgb, f32)| Hit {
            depth_m,
            cover: 1.0,
            normal: bent(depth_m, normal),
            albedo,
            glow,
            gloss,
        };
        match (body, cabin) {
            (Some((near_m, face)), other) if other.is_none_or(|(cabin_m, _)| near_m < cabin_m) => {
                let look = self.body(from + to * near_m, face, around);
                Some(surface(near_m, BODY[face].0, look))
            }
            (_, Some((near_m, face))) => {
                let look = self.cabin(from + to * near_m, face);
                Some(surface(near_m, CABIN[face].0, look))
            }
            _ => None,
        }
    }

    /// Between wheels, below the body.
    fn sees_through(&self, at: V3, face: usize, axle: f32) -> bool {
        let height_m = at.z * self.size.z;
        if height_m > CLEARANCE_M {
            return false;
        }
        if face == FRONT || face == REAR {
            return at.y.abs() < 0.36;
        }
        self.axle_away_m(at, axle) > WHEEL_M
    }

    fn axle_away_m(&self, at: V3, axle: f32) -> f32 {
        let along_m = (at.x.abs() - axle).abs() * self.size.x;
        along_m.hypot(at.z * self.size.z - WHEEL_M)
    }

    /// Tyre, rim or the dark of the arch; none where there is no wheel.
    fn wheel(&self, at: V3, axle: f32) -> Option<(Rgb, Rgb, f32)> {
        let away_m = self.axle_away_m(at, axle);
        let look = |albedo, gloss| Some((albedo, grey(0.0), gloss));
        match away_m {
            away_m if away_m < RIM_M => look(grey(0.22), 0.3),
            away_m if away_m < WHEEL_M => look(RUBBER, 0.0),
            away_m if away_m < WHEEL_M + 0.06 => look(grey(0.008), 0.0),
            _ => None,
        }
    }

    fn body(&self, at: V3, face: usize, around: &Surroundings) -> (Rgb, Rgb, f32) {
        let is_side = at.y.abs() > 0.44 && !matches!(face, FRONT | REAR);
        if is_side {
            if let Some(wheel) = self.wheel(at, 0.3) {
                return wheel;
            }
            if at.z < 0.2 {
                return (grey(0.03), grey(0.0), 0.1);
            }
        }
        match face {
            FRONT | REAR if at.z * self.size.z < CLEARANCE_M => (RUBBER, grey(0.0), 0.0),
            REAR | 7 => self.tail(at, around),
            FRONT => self.nose(at, around),
            _ => (self.color, grey(0.0), 0.35),
        }
    }

    fn tail(&self, at: V3, around: &Surroundings) -> (Rgb, Rgb, f32) {
        let (y, z) = (at.y.abs(), at.z);
        if y > 0.3 && (0.4..0.54).contains(&z) {
            let brakes = share(self.lots) < 0.3;
            let light = if around.lamps { 0.3 } else { 0.0 } + if brakes { 0.5 } else { 0.0 };
            let scale = if around.night { 0.12 } else { 1.0 };
            return (
                v3(0.32, 0.012, 0.012),
                v3(1.0, 0.03, 0.02) * (light * scale),
                0.4,
            );
        }
        if y < 0.14 && (0.3..0.39).contains(&z) {
            return (grey(0.6), grey(0.0), 0.1);
        }
        let is_bumper = z < 0.24 || y > 0.485;
        (
            if is_bumper { grey(0.03) } else { self.color },
            grey(0.0),
            0.3,
        )
    }

    fn nose(&self, at: V3, around: &Surroundings) -> (Rgb, Rgb, f32) {
        let (y, z) = (at.y.abs(), at.z);
        if y > 0.28 && (0.34..0.46).contains(&z) {
            let light = if around.lamps { 1.3 } else { 0.0 };
            return (grey(0.5), v3(1.0, 0.95, 0.85) * light, 0.6);
        }
        if y < 0.3 && (0.14..0.4).contains(&z) {
            let is_plate = y < 0.14 && (0.22..0.3).contains(&z);
            return (
                if is_plate { grey(0.6) } else { grey(0.02) },
                grey(0.0),
                0.2,
            );
        }
        (self.color, grey(0.0), 0.35)
    }

    fn cabin(&self, at: V3, face: usize) -> (Rgb, Rgb, f32) {
        let is_frame = match face {
            0 => true,
            2 | 3 => at.z > 0.955 || at.y.abs() > 0.43 - 0.1 * (at.z - 0.6),
            _ => {
                let pillar = (at.x + 0.1).abs() < 0.012;
                let slope = at.x > 0.205 - 0.5 * (at.z - 0.6) || at.x < -0.42 + 0.4 * (at.z - 0.6);
                pillar || slope || !(0.66..0.94).contains(&at.z)
            }
        };
        if is_frame {
            (self.color, grey(0.0), 0.35)
        } else {
            (GLASS, grey(0.0), 0.8)
        }
    }

    fn hauler(&self, ray: &Ray, around: &Surroundings, most_m: f32) -> Option<Hit> {
        let (from, to) = self.scaled(ray);
        let (depth_m, face) = clip(&BOX, from, to).filter(|(depth_m, _)| *depth_m < most_m)?;
        let at = from + to * depth_m;
        if self.sees_through(at, face, 0.32) {
            return None;
        }
        let (albedo, glow, gloss) = self.hauler_look(at, face, around);
        Some(Hit {
            depth_m,
            cover: 1.0,
            normal: self.normal(BOX[face].0),
            albedo,
            glow,
            gloss,
        })
    }

    fn hauler_look(&self, at: V3, face: usize, around: &Surroundings) -> (Rgb, Rgb, f32) {
        let is_bus = self.size.x > 9.0 && self.lots & 1 == 0;
        let plain = (self.color, grey(0.0), 0.2);
        match face {
            FRONT | REAR if at.z * self.size.z < CLEARANCE_M => (RUBBER, grey(0.0), 0.0),
            FRONT if at.z > 0.45 && at.z < 0.85 && at.y.abs() < 0.45 => (GLASS, grey(0.0), 0.8),
            FRONT if at.z < 0.3 => self.nose(v3(at.x, at.y, at.z * 2.0), around),
            // The frame below the box.
            REAR if at.z < 0.165 => (grey(0.035), grey(0.0), 0.1),
            REAR if at.z < 0.3 => self.tail(v3(at.x, at.y, at.z * 2.4), around),
            REAR if !is_bus => {
                let seam = at.y.abs() < 0.012 || at.y.abs() > 0.47 || at.z > 0.97;
                (
                    if seam { self.color * 0.35 } else { self.color },
                    grey(0.0),
                    0.15,
                )
            }
            REAR if (0.5..0.8).contains(&at.z) && at.y.abs() < 0.42 => (GLASS, grey(0.0), 0.8),
            2 | 3 => {
                if let Some(wheel) = self.wheel(at, 0.32) {
                    return wheel;
                }
                let is_cab = at.x > 0.5 - 1.6 / self.size.x;
                let has_window = (0.5..0.8).contains(&at.z) && (is_bus || is_cab);
                let is_post = ((at.x * self.size.x / 1.5).fract().abs() - 0.5).abs() > 0.45;
                if has_window && !is_post {
                    return (GLASS, grey(0.0), 0.8);
                }
                if at.z < 0.14 {
                    (grey(0.04), grey(0.0), 0.1)
                } else {
                    plain
                }
            }
            _ => plain,
        }
    }

    fn building(&self, ray: &Ray, around: &Surroundings, most_m: f32) -> Option<Hit> {
        let (from, to) = self.scaled(ray);
        let (depth_m, face) = clip(&BOX, from, to).filter(|(depth_m, _)| *depth_m < most_m)?;
        let at = from + to * depth_m;
        let (albedo, glow, gloss) = self.facade(at, face, depth_m * ray.pixel_rad, around);
        Some(Hit {
            depth_m,
            cover: 1.0,
            normal: self.normal(BOX[face].0),
            albedo,
            glow,
            gloss,
        })
    }

    fn facade(&self, at: V3, face: usize, pixel_m: f32, around: &Surroundings) -> (Rgb, Rgb, f32) {
        if face == TOP {
            return (grey(0.2), grey(0.0), 0.0);
        }
        let along_m = if face < 2 {
            at.y * self.size.y
        } else {
            at.x * self.size.x
        };
        let up_m = at.z * self.size.z;
        let lot = |salt: i32| share(hash(salt, 7, self.lots));
        let floor_m = 2.9 + 0.7 * lot(1);
        let bay_m = 1.9 + 2.2 * lot(2);
        let is_shop = up_m < 3.6;
        let (wide, high, base_m) = if is_shop {
            (0.82, 0.72, 0.0)
        } else {
            (0.38 + 0.3 * lot(3), 0.5 + 0.12 * lot(4), 3.6)
        };
        let storey_m = if is_shop { 3.6 } else { floor_m };
        let share_of = |period_m: f32, part: f32, at_m: f32| {
            let pattern = Pattern {
                on_m: period_m * part,
                off_m: period_m * (1.0 - part),
            };
            pattern.share_at(at_m, pixel_m.max(0.03))
        };
        let sill_m = storey_m * (1.0 - high) * 0.6;
        let window = share_of(bay_m, wide, along_m + 500.0 * bay_m)
            * share_of(storey_m, high, up_m - base_m - sill_m + 10.0 * storey_m)
            * smooth(self.size.z - 0.3, self.size.z - 0.6, up_m);
        let pane = hash(
            (along_m / bay_m).floor() as i32,
            ((up_m - base_m) / storey_m).floor() as i32,
            self.lots + face as u32,
        );
        let stain = 0.85 + 0.3 * around.noise.at(v2(along_m, up_m), 16.0, pixel_m);
        let ledge = 1.0 - 0.25 * share_of(storey_m, 0.06, up_m - base_m + 10.0 * storey_m);
        let wall = self.color * (stain * ledge);
        let is_lit = around.night && share(pane) < if is_shop { 0.5 } else { 0.22 };
        let glow = if is_lit {
            v3(1.0, 0.78, 0.45) * (0.03 * window)
        } else {
            grey(0.0)
        };
        (
            wall.mix(GLASS * (0.6 + 1.8 * share(pane)), window),
            glow,
            0.5 * window,
        )
    }

    fn tree(&self, ray: &Ray, noise: &Texture, most_m: f32) -> Option<Hit> {
        let crown = self.crown(ray, noise, most_m);
        // Leaves before the trunk hide most of it.
        if crown.is_some_and(|crown| crown.cover > 0.6) {
            return crown;
        }
        self.trunk(ray, noise).or(crown)
    }

    fn trunk(&self, ray: &Ray, noise: &Texture) -> Option<Hit> {
        let top = self.foot + v3(0.0, 0.0, self.size.z * 0.5);
        let (depth_m, cover) = rod(ray, self.foot, top, 0.04 + 0.014 * self.size.z)?;
        let up_m = (ray.from + ray.to * depth_m).z;
        Some(Hit {
            depth_m,
            cover,
            normal: -ray.to,
            albedo: v3(0.10, 0.075, 0.055) * (0.6 + 0.8 * noise.at(v2(up_m, 0.3), 4.0, 0.02)),
            glow: grey(0.0),
            gloss: 0.0,
        })
    }

    fn crown(&self, ray: &Ray, noise: &Texture, most_m: f32) -> Option<Hit> {
        let radii = v3(self.size.x / 2.0, self.size.x / 2.0, self.size.z * 0.36);
        let middle = self.foot + v3(0.0, 0.0, self.size.z * 0.64);
        let by = v3(1.0 / radii.x, 1.0 / radii.y, 1.0 / radii.z);
        let (from, to) = ((ray.from - middle) * by, ray.to * by);
        let (a, b, c) = (to.dot(to), from.dot(to), from.dot(from) - 1.0);
        let root = b * b - a * c;
        if root <= 0.0 {
            return None;
        }
        let depth_m = (-b - root.sqrt()) / a;
        if depth_m <= 0.1 || depth_m >= most_m {
            return None;
        }
        let at = from + to * depth_m;
        // Leaves: noise around the crown thins its rim out; lumps are lit from above.
        let round = v2(at.y.atan2(at.x) * radii.x, at.z * radii.z) + v2(self.foot.x, self.foot.y);
        let pixel_m = depth_m * ray.pixel_rad;
        let lumps = noise.at(round, 8.0, pixel_m);
        let leaves = noise.at(round * 1.7, 2.0, pixel_m);
        // Half of the way through the crown, in radii.
        let half_way = (root / a).sqrt();
        let thick = half_way + 0.9 * (lumps - 0.5) + 0.7 * (leaves - 0.5);
        let cover = smooth(0.22, 0.48, thick);
        if cover < 0.02 {
            return None;
        }
        let tint = v3(0.075, 0.125, 0.035).mix(v3(0.13, 0.15, 0.05), share(self.lots));
        let bump = (lumps - 0.5) * 1.3;
        let normal = (at + v3(bump, -bump, 0.35 + 0.6 * (leaves - 0.5))).unit();
        Some(Hit {
            depth_m,
            cover,
            normal,
            albedo: tint * (0.45 + 0.55 * lumps + 0.5 * leaves),
            glow: grey(0.0),
            gloss: 0.0,
        })
    }

    fn lamp(&self, ray: &Ray, around: &Surroundings) -> Option<Hit> {
        let top = self.foot + v3(0.0, 0.0, LAMP_HEIGHT_M as f32);
        let head = top + v3(self.ahead.x, self.ahead.y, 0.0) * LAMP_ARM_M as f32;
        let near_head = head - v3(self.ahead.x, self.ahead.y, 0.0) * 0.5;
        let iron = |(depth_m, cover): (f32, f32)| Hit {
            depth_m,
            cover,
            normal: -ray.to,
            albedo: grey(0.13),
            glow: grey(0.0),
            gloss: 0.2,
        };
        let light = rod(ray, near_head, head, 0.1).map(|(depth_m, cover)| Hit {
            glow: v3(1.0, 0.82, 0.55) * if around.night { 1.2 } else { 0.0 },
            ..iron((depth_m, cover))
        });
        let pole = rod(ray, self.foot, top, 0.07).map(iron);
        light
            .or(pole)
            .or_else(|| rod(ray, top, head, 0.05).map(iron))
    }
}

/// Where a ray passes a rod, and the share of the pixel that the rod fills.
fn rod(ray: &Ray, from: V3, to: V3, radius_m: f32) -> Option<(f32, f32)> {
    let along = to - from;
    let away = ray.from - from;
    let (a, b, c) = (along.dot(along), along.dot(ray.to), away.dot(along));
    let (d, e) = (ray.to.dot(ray.to), away.dot(ray.to));
    let denominator = a * d - b * b;
    if denominator.abs() < 1e-9 {
        return None;
    }
    let share = ((d * c - b * e) / denominator).clamp(0.0, 1.0);
    let depth_m = (b * share - e) / d;
    if depth_m < 0.2 {
        return None;
    }
    let miss_m = (ray.from + ray.to * depth_m - from - along * share).norm();
    let pixel_m = depth_m * ray.pixel_rad;
    let cover = ((radius_m + pixel_m / 2.0 - miss_m) / pixel_m).clamp(0.0, 1.0);
    let thin = (2.0 * radius_m / pixel_m).min(1.0);
    (cover > 0.0).then_some((depth_m, cover * thin))
}
