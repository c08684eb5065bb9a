//! Light that falls on things: sun, sky, street lamps, and the vehicle's own headlights.

use super::sky::Sky;
use super::solids::Hit;
use super::vector::{Rgb, V3, grey, v3};

/// Height of the headlights and half of the distance between them, and how far ahead of the
/// vehicle's origin they sit, in metres.
const HEADLIGHT_UP_M: f32 = 0.65;
const HEADLIGHT_AHEAD_M: f32 = 2.2;
/// Strength of both: light on a sheet at one metre, where daylight is 1.
const HEADLIGHT: f32 = 16.0;
/// Half width of the beam, as a tangent.
const BEAM: f32 = 0.42;
/// What street lamps give to upright surfaces, as a share of daylight.
const LAMP_HAZE: f32 = 0.012;

/// The vehicle's frame within the local one: where it is, and its axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct VehicleFrame {
    pub(super) at: V3,
    pub(super) ahead: V3,
    pub(super) left: V3,
    pub(super) up: V3,
}

/// All light of one picture.
pub(super) struct Light {
    pub(super) sky: Sky,
    pub(super) lamps: bool,
    pub(super) vehicle: VehicleFrame,
}

impl Light {
    /// Light of the headlights on a sheet that faces them.
    pub(super) fn headlights(&self, at: V3) -> Rgb {
        if !self.lamps {
            return grey(0.0);
        }
        let away = at - self.vehicle.at;
        let x = away.dot(self.vehicle.ahead) - HEADLIGHT_AHEAD_M;
        if x < 0.3 {
            return grey(0.0);
        }
        let (side, rise) = (
            away.dot(self.vehicle.left) / x,
            (away.dot(self.vehicle.up) - HEADLIGHT_UP_M) / x,
        );
        // Low beam: bright just below the cut-off, a little spill above.
        let below = rise + 0.012;
        let profile = if below < 0.0 {
            (-(below / 0.11).powi(2)).exp()
        } else {
            0.96 * (-(below / 0.014).powi(2)).exp() + 0.04
        };
        let beam = (-(side / BEAM).powi(2)).exp();
        v3(1.0, 0.95, 0.86) * (HEADLIGHT * beam * profile / (x * x + 2.0))
    }

    /// The light that a solid's surface sends along a ray.
    pub(super) fn on_solid(&self, hit: &Hit, to: V3, at: V3, in_sun: f32, mirrored: Rgb) -> Rgb {
        let facing = hit.normal.dot(self.sky.to_sun).max(0.0) * in_sun;
        let up = 0.5 + 0.5 * hit.normal.z;
        // From below comes what the ground sends back.
        let mut light = self.sky.sunlight * facing
            + self.sky.skylight * (0.25 + 0.75 * up)
            + (self.sky.sunlight * in_sun + self.sky.skylight) * (0.10 * (1.0 - up));
        if self.lamps {
            light += self.headlights(at) * hit.normal.dot(-to).max(0.0);
            light += v3(1.0, 0.8, 0.55) * LAMP_HAZE;
        }
        let facing_eye = hit.normal.dot(-to).max(0.0);
        let fresnel = 0.04 + 0.96 * (1.0 - facing_eye).powi(5);
        let sheen = hit.gloss * fresnel.max(hit.gloss * 0.16);
        hit.albedo * light * (1.0 - 0.5 * sheen) + mirrored * sheen + hit.glow
    }
}
