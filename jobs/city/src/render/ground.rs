//! How the ground looks: asphalt with its age, kerbs, pavement and grass, and what lies on them.

use super::glyph::Glyph;
use super::layout::Layout;
use super::light::Light;
use super::marks::{Footprint, Pattern};
use super::noise::Texture;
use super::shadow::Shadows;
use super::terrain::Ground;
use super::vector::{Rgb, V2, V3, grey, smooth, v2, v3};

/// Width of the kerb stone and of the pavement behind it, in metres.
const KERB_M: f32 = 0.16;
const PAVEMENT_M: f32 = 2.7;
/// Slabs of the pavement, in metres, with their joints.
const SLAB: Pattern = Pattern {
    on_m: 0.03,
    off_m: 0.57,
};
/// Blur (metres of ground per pixel) from which worn paint is even.
const EVEN_WEAR_M: f32 = 0.25;
/// Headlights sent back by bare road.
const ROAD_RETRO: f32 = 0.05;

/// Textures of all pictures.
pub(super) struct Textures {
    /// Stones of the asphalt.
    pub(super) grain: Texture,
    /// Stains and clouds: larger and larger blots.
    pub(super) blots: Texture,
    /// Where paint goes first.
    pub(super) wear: Texture,
    /// Hair cracks.
    pub(super) veins: Texture,
}

impl Textures {
    pub(super) fn new() -> Self {
        Self {
            grain: Texture::fractal(64, 0.9, 1),
            blots: Texture::fractal(4, 0.62, 2),
            wear: Texture::fractal(24, 0.95, 3),
            veins: Texture::veins(5, 4),
        }
    }
}

/// The surface at a place.
#[derive(Debug, Clone, Copy)]
struct Surface {
    albedo: Rgb,
    gloss: f32,
    retro: f32,
}

/// What a pixel of the ground is made from.
pub(super) struct GroundPicture<'a> {
    pub(super) textures: &'a Textures,
    pub(super) glyphs: &'a [Glyph],
    pub(super) layout: &'a Layout,
    pub(super) shadows: &'a Shadows,
    pub(super) light: &'a Light,
    /// The place of the local origin within the textures.
    pub(super) anchor: V2,
    /// How wet it is, 0 to 1.
    pub(super) wet: f32,
}

/// Light that leaves the ground, and how much of the mirrored surroundings joins it.
pub(super) struct GroundLight {
    pub(super) color: Rgb,
    pub(super) mirror: f32,
    /// How much the mirror blurs what it shows, as a slope.
    pub(super) rough: f32,
}

impl GroundPicture<'_> {
    /// The ground at `at` as seen along `to`.
    pub(super) fn at(&self, at: V3, to: V3, foot: &Footprint, ground: &Ground) -> GroundLight {
        let place = at.flat();
        let texel = place + self.anchor;
        let foot_m = foot.mean_m();
        let mut surface = self.bare(texel, foot_m, foot.long_m(), ground);
        if ground.off_road_m < 0.3 {
            self.layout.covers(place, foot, self.glyphs, |look, cover| {
                let wear = (look.wear + 0.12 * ground.track * look.wear).min(1.0);
                let share = cover * look.strength * self.left(texel, foot_m, wear);
                surface.albedo = surface.albedo.mix(look.albedo, share);
                surface.gloss += (look.gloss - surface.gloss) * share;
                surface.retro += (look.retro - surface.retro) * share;
            });
        }
        self.lit(&surface, at, to, foot_m, ground)
    }

    /// Share of worn paint that is left at a place.
    fn left(&self, texel: V2, foot_m: f32, wear: f32) -> f32 {
        if wear <= 0.0 {
            return 1.0;
        }
        let even = smooth(0.03, EVEN_WEAR_M, foot_m);
        let noise = self.textures.wear.at(texel, 4.0, foot_m);
        let sharp = smooth(wear - 0.07, wear + 0.07, noise);
        sharp + (1.0 - wear - sharp) * even
    }

    fn bare(&self, texel: V2, foot_m: f32, long_m: f32, ground: &Ground) -> Surface {
        let off_m = ground.off_road_m;
        let edge_m = foot_m.max(0.02);
        let beyond = |border_m: f32| smooth(border_m - edge_m, border_m + edge_m, off_m);
        let off_road = beyond(0.0);
        if off_road <= 0.0 {
            return self.asphalt(texel, foot_m, ground);
        }
        let blots = self.textures.blots.at(texel, 16.0, foot_m);
        let kerb = v3(0.30, 0.29, 0.27) * (0.8 + 0.4 * blots);
        let slabs = self.pavement(texel, long_m, blots);
        let lawn = self.grass(texel, foot_m, blots);
        let edge = beyond(PAVEMENT_M + 0.5 * (blots - 0.5));
        let verge = kerb.mix(slabs.mix(lawn, edge), beyond(KERB_M));
        let road = if off_road < 1.0 {
            self.asphalt(texel, foot_m, ground)
        } else {
            Surface {
                albedo: verge,
                gloss: 0.0,
                retro: 0.02,
            }
        };
        Surface {
            albedo: road.albedo.mix(verge, off_road),
            ..road
        }
    }

    fn asphalt(&self, texel: V2, foot_m: f32, ground: &Ground) -> Surface {
        let t = self.textures;
        // A second look-up askew hides that the first repeats.
        let askew = v2(texel.x - texel.y * 2.0, texel.y + texel.x * 2.0);
        let grain = t.grain.at(texel, 1.0, foot_m) - 0.5;
        let fine = t.blots.at(texel, 4.0, foot_m) - 0.5;
        let broad = t.blots.at(askew, 128.0, foot_m * 2.2) - 0.5;
        let mut shade = 0.112 * (1.0 + 0.6 * grain + 0.16 * fine + 0.5 * broad);
        shade *= 1.0 - 0.13 * ground.track;
        // Hair cracks where the road is old.
        let old = smooth(0.08, 0.35, broad);
        if old > 0.0 && foot_m < 0.4 {
            let vein = 1.0
                - smooth(
                    0.012,
                    0.035 + foot_m * 0.1,
                    t.veins.at(texel, 8.0, foot_m * 0.5),
                );
            shade *= 1.0 - 0.55 * old * vein * (1.0 - foot_m / 0.4);
        }
        // Dirt gathers in the gutter.
        let gutter = smooth(-0.55, -0.05, ground.off_road_m);
        shade *= 1.0 - 0.25 * gutter * (0.6 + 0.8 * fine);
        let tint = v3(1.0, 0.985, 0.955);
        Surface {
            albedo: tint * shade.max(0.015),
            gloss: 0.05 + 0.1 * ground.track,
            retro: ROAD_RETRO,
        }
    }

    fn pavement(&self, texel: V2, long_m: f32, blots: f32) -> Rgb {
        let width = long_m.max(0.02);
        let joint = SLAB.share_at(texel.x, width) + SLAB.share_at(texel.y, width);
        v3(0.25, 0.24, 0.225) * ((0.8 + 0.4 * blots) * (1.0 - 0.4 * joint.min(1.0)))
    }

    fn grass(&self, texel: V2, foot_m: f32, blots: f32) -> Rgb {
        let blades = self.textures.grain.at(texel, 4.0, foot_m);
        let dry = self.textures.blots.at(texel, 64.0, foot_m);
        let green = v3(0.062, 0.105, 0.028).mix(v3(0.16, 0.14, 0.06), smooth(0.45, 0.95, dry));
        green * (0.45 + 0.7 * blades + 0.4 * blots)
    }

    fn lit(&self, surface: &Surface, at: V3, to: V3, foot_m: f32, ground: &Ground) -> GroundLight {
        let light = self.light;
        let sky = &light.sky;
        let place = at.flat();
        let is_sunny = sky.sunlight.luma() > 0.0;
        let sun = if is_sunny {
            self.shadows.sun(place, foot_m, &self.textures.blots)
        } else {
            0.0
        };
        let open = self.shadows.sky(place);
        let sunlight = sky.sunlight * (sun * sky.to_sun.z.max(0.0));
        let mut falling = sunlight + sky.skylight * open;
        let mut returned = grey(0.0);
        if light.lamps {
            let beam = light.headlights(at);
            let slant = 0.65 / ((at - light.vehicle.at).norm() + 0.65);
            falling += beam * slant + v3(1.0, 0.80, 0.52) * (ground.lamps * open);
            returned = beam * (surface.retro * (1.0 - 0.75 * self.wet));
        }
        let puddle = self.puddle(place + self.anchor, foot_m, ground);
        // Water darkens what it soaks.
        let soaked = 1.0 - self.wet * (0.5 + 0.2 * puddle);
        let grazing = (1.0 - (-to.z).clamp(0.0, 1.0)).powi(5);
        let fresnel = 0.02 + 0.98 * grazing;
        let dry = (0.10 + 0.5 * surface.gloss) * fresnel * 0.5;
        let mirror =
            open * (dry * (1.0 - self.wet) + self.wet * fresnel.max(0.08) * (0.35 + 0.65 * puddle));
        let glint = self.glint(to, surface, puddle) * sun;
        GroundLight {
            color: surface.albedo * falling * soaked + returned + sky.sunlight * glint,
            mirror: mirror.min(0.9),
            rough: (0.12 * (1.0 - puddle)).max(0.01),
        }
    }

    /// Where water stands: in tracks and hollows.
    fn puddle(&self, texel: V2, foot_m: f32, ground: &Ground) -> f32 {
        if self.wet <= 0.0 || ground.off_road_m > 0.0 {
            return 0.0;
        }
        let hollow = self.textures.blots.at(texel, 32.0, foot_m);
        let deep = hollow + 0.22 * ground.track + 0.45 * (self.wet - 1.0);
        smooth(0.5, 0.85, deep)
    }

    /// The sun's mirror image, smeared by the road's roughness.
    fn glint(&self, to: V3, surface: &Surface, puddle: f32) -> f32 {
        let to_sun = self.light.sky.to_sun;
        let half = (to_sun - to).unit();
        let slope2 = (1.0 - half.z * half.z) / (half.z * half.z).max(1e-4);
        let dull = 0.30 - 0.1 * surface.gloss;
        let rough = dull + (0.05 - dull) * (self.wet * puddle).min(1.0);
        let lobe = (-slope2 / (rough * rough)).exp() / (rough * rough);
        let fresnel = 0.03 + 0.97 * (1.0 - half.dot(to_sun).clamp(0.0, 1.0)).powi(5);
        let gain = 0.22 + 0.5 * self.wet;
        gain * fresnel * lobe / (4.0 * (-to.z).max(0.08)) * to_sun.z.max(0.05)
    }
}
