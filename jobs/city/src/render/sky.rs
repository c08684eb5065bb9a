//! The sky, the sun in it, and the silhouettes along the horizon.

use super::conditions::Conditions;
use super::noise::Texture;
use super::vector::{Rgb, V2, V3, grey, smooth, v2, v3};

/// The sun's radius with its aureole, as a cosine of the angle to its middle.
const DISC: f32 = 0.9996;

/// The sky of one picture.
pub(super) struct Sky {
    pub(super) to_sun: V3,
    /// The sun's light on a sheet that faces it.
    pub(super) sunlight: Rgb,
    /// The sky's light on a level sheet.
    pub(super) skylight: Rgb,
    zenith: Rgb,
    horizon: Rgb,
    clouds: f32,
    sun: f32,
    night: bool,
    drift: V2,
}

impl Sky {
    pub(super) fn new(conditions: &Conditions, drift: V2) -> Self {
        let (sin, cos) = (conditions.sun_elevation_rad as f32).sin_cos();
        let (east, north) = (
            conditions.sun_yaw_rad.cos() as f32,
            conditions.sun_yaw_rad.sin() as f32,
        );
        let strength = conditions.sky as f32;
        let clouds = conditions.clouds as f32;
        let night = conditions.lamps && strength < 0.1;
        // A low sun is yellow, and so is the sky around it.
        let low = 1.0 - smooth(0.05, 0.5, sin);
        let sun_color = v3(1.0, 0.95, 0.88).mix(v3(1.0, 0.72, 0.42), low);
        let blue = v3(0.16, 0.30, 0.62).mix(grey(0.62), smooth(0.6, 1.0, clouds));
        let pale = v3(0.62, 0.72, 0.84).mix(grey(0.78), smooth(0.5, 1.0, clouds));
        let glow = if night { v3(1.3, 0.9, 0.6) } else { grey(1.0) };
        Self {
            to_sun: v3(east * cos, north * cos, sin),
            sunlight: sun_color * conditions.sun as f32,
            skylight: v3(0.13, 0.155, 0.20).mix(grey(0.55), clouds) * strength,
            zenith: blue * strength,
            horizon: pale * glow * strength,
            clouds,
            sun: conditions.sun as f32,
            night,
            drift,
        }
    }

    /// What is seen in a direction above the horizon; `is_sharp` shows the sun's disc.
    pub(super) fn at(&self, direction: V3, noise: &Texture, is_sharp: bool) -> Rgb {
        let up = direction.z.max(0.0);
        let mut color = self
            .air(direction)
            .mix(self.zenith, 1.0 - (1.0 - up).powi(5));
        let toward = direction.dot(self.to_sun).max(0.0);
        let cover = self.cover(direction, noise);
        let lit = self.skylight.luma() * 1.5 + self.sun * 0.55;
        let cloud = grey(lit).mix(self.horizon, 0.35) * (0.72 + 0.28 * (1.0 - cover));
        color = color.mix(cloud, cover * smooth(0.0, 0.12, up));
        if is_sharp && toward > DISC {
            color += self.sunlight * (60.0 * (1.0 - 0.9 * cover));
        }
        color
    }

    /// The glow of the air along a direction: what haze and fog look like there.
    pub(super) fn air(&self, direction: V3) -> Rgb {
        let toward = direction.dot(self.to_sun).max(0.0);
        let near = toward.powi(6) * 0.25 + toward.powi(48) * 0.8 + toward.powi(400) * 3.0;
        self.horizon + self.sunlight * near
    }

    fn cover(&self, direction: V3, noise: &Texture) -> f32 {
        if self.clouds <= 0.02 || self.night {
            return self.clouds * 0.5;
        }
        let scale = 1.0 / (direction.z.max(0.0) + 0.12);
        let place = v2(direction.x, direction.y) * scale + self.drift;
        let wisps = 0.7 * noise.at(place, 6.0, 0.01) + 0.3 * noise.at(place, 2.0, 0.01);
        let edge = 1.0 - self.clouds;
        smooth(edge - 0.15, edge + 0.22, wisps)
    }

    /// Trees, roofs and hills far away: the share of a pixel that they cover, and their colour.
    pub(super) fn skyline(&self, direction: V3, pixel_rad: f32, noise: &Texture) -> (f32, Rgb) {
        let bearing = direction.y.atan2(direction.x);
        let round = |scale: f32| v2(bearing * scale + 40.0, 3.0);
        let hills = 0.012 + 0.022 * noise.at(round(10.0), 16.0, 0.01);
        let woods = 0.006
            + 0.020 * noise.at(round(30.0), 8.0, 0.01)
            + 0.008 * noise.at(round(140.0), 4.0, 0.01);
        let below = |height: f32| smooth(height + pixel_rad, height - pixel_rad, direction.z);
        let light = self.skylight + self.sunlight * 0.25;
        let (far, near) = (below(hills), below(woods));
        let color = (light * v3(0.16, 0.19, 0.19)).mix(light * v3(0.055, 0.075, 0.04), near);
        (
            far.max(near),
            color.mix(self.horizon, 0.45 * (1.0 - 0.6 * near)),
        )
    }
}
