//! What lies flat on the road: paint, its ghosts, repairs, sealed cracks, manhole covers; and how
//! much of a pixel each covers.
//!
//! A pixel sees a parallelogram of the ground (its [`Footprint`]). A straight border is filtered
//! with that parallelogram's spread across it, so that lines keep their place to a fraction of a
//! pixel however thin they are drawn.

use super::glyph::Glyph;
use super::vector::{V2, floor, v2};

/// The sharpest border, in metres: paint frays.
const FRAY_M: f32 = 0.012;
/// Most look-ups of a glyph along a footprint.
const MOST_TAPS: f32 = 8.0;

/// The ground that a pixel sees: how far its right and lower neighbours' places are away.
#[derive(Debug, Clone, Copy)]
pub(super) struct Footprint {
    pub(super) du: V2,
    pub(super) dv: V2,
}

impl Footprint {
    /// Width in a direction of a box that spreads as far as the footprint does.
    fn width_m(&self, direction: V2) -> f32 {
        let (a, b) = (self.du.dot(direction), self.dv.dot(direction));
        (a * a + b * b + FRAY_M * FRAY_M).sqrt()
    }

    /// The larger of its sides.
    pub(super) fn long_m(&self) -> f32 {
        self.du.norm().max(self.dv.norm())
    }

    /// The side of a square of the same area.
    pub(super) fn mean_m(&self) -> f32 {
        self.du.cross(self.dv).abs().sqrt()
    }
}

/// Share of the box of width `width` around `at` that lies within `from..to`.
fn overlap(at: f32, width: f32, from: f32, to: f32) -> f32 {
    let low = (at - width / 2.0).max(from);
    let high = (at + width / 2.0).min(to);
    ((high - low) / width).max(0.0)
}

/// Metres on and off of a pattern that repeats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pattern {
    pub(super) on_m: f32,
    pub(super) off_m: f32,
}

impl Pattern {
    /// Painted metres from 0 to `at_m`.
    fn painted_m(self, at_m: f32) -> f32 {
        let period_m = self.on_m + self.off_m;
        let periods = floor(at_m / period_m) as f32;
        periods * self.on_m + (at_m - periods * period_m).min(self.on_m)
    }

    /// Share of the box of width `width` around `at` that is painted, within `from..to`.
    fn share(self, at: f32, width: f32, from: f32, to: f32) -> f32 {
        let low = (at - width / 2.0).max(from);
        let high = (at + width / 2.0).min(to);
        if high <= low {
            return 0.0;
        }
        (self.painted_m(high) - self.painted_m(low)) / width
    }

    /// Share of the box of width `width` around `at` that is painted.
    pub(super) fn share_at(self, at: f32, width: f32) -> f32 {
        self.share(at, width, f32::MIN, f32::MAX)
    }
}

/// A straight piece of a line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stroke {
    pub(super) from: V2,
    /// Unit vector, and how far along it the piece goes.
    pub(super) along: V2,
    pub(super) length_m: f32,
    pub(super) half_width_m: f32,
    /// Dashes, and where the pattern stands where the piece begins.
    pub(super) pattern: Option<(Pattern, f32)>,
}

impl Stroke {
    fn cover(&self, place: V2, foot: &Footprint) -> f32 {
        let away = place - self.from;
        let across = self.along.left();
        let half_m = self.half_width_m;
        let across_cover = overlap(away.dot(across), foot.width_m(across), -half_m, half_m);
        if across_cover <= 0.0 {
            return 0.0;
        }
        let (at, width) = (away.dot(self.along), foot.width_m(self.along));
        let along_cover = match self.pattern {
            None => overlap(at, width, 0.0, self.length_m),
            Some((pattern, phase_m)) => {
                pattern.share(at + phase_m, width, phase_m, phase_m + self.length_m)
            }
        };
        across_cover * along_cover
    }
}

/// A parallelogram: metres to the right and ahead of its rear left corner.
#[derive(Debug, Clone, Copy)]
pub(super) struct Panel {
    pub(super) corner: V2,
    /// Unit vectors to the right and ahead.
    pub(super) right: V2,
    pub(super) ahead: V2,
    pub(super) width_m: f32,
    pub(super) length_m: f32,
    pub(super) fill: Fill,
}

/// What a panel is filled with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fill {
    /// Everything.
    Plain,
    /// Bars that go ahead, one beside the other.
    BarsAcross(Pattern),
    /// Bars that go to the right, one behind the other.
    BarsAlong(Pattern),
    /// A yellow box: a frame and crossed diagonals.
    Hatched,
    /// A disc.
    Disc,
    /// The glyph with this number.
    Glyph(usize),
}

/// Box junctions: width of the frame, and pattern of the diagonals.
const FRAME_M: f32 = 0.3;
const DIAGONALS: Pattern = Pattern {
    on_m: 0.2,
    off_m: 1.9,
};

impl Panel {
    fn cover(&self, place: V2, foot: &Footprint, glyphs: &[Glyph]) -> f32 {
        // The corner's sides need not be square to each other.
        let skew = self.right.cross(self.ahead);
        let local = |away: V2| v2(away.cross(self.ahead) / skew, self.right.cross(away) / skew);
        let at = local(place - self.corner);
        let foot = Footprint {
            du: local(foot.du),
            dv: local(foot.dv),
        };
        let (wide, long) = (foot.width_m(v2(1.0, 0.0)), foot.width_m(v2(0.0, 1.0)));
        let across = overlap(at.x, wide, 0.0, self.width_m);
        let along = overlap(at.y, long, 0.0, self.length_m);
        if across * along <= 0.0 {
            return 0.0;
        }
        match self.fill {
            Fill::Plain => across * along,
            Fill::BarsAcross(pattern) => pattern.share(at.x, wide, 0.0, self.width_m) * along,
            Fill::BarsAlong(pattern) => pattern.share(at.y, long, 0.0, self.length_m) * across,
            Fill::Hatched => across * along * self.hatched(at, &foot),
            Fill::Disc => self.disc(at, &foot),
            Fill::Glyph(number) => glyphs
                .get(number)
                .map_or(0.0, |glyph| self.glyph(at, &foot, glyph)),
        }
    }

    fn hatched(&self, at: V2, foot: &Footprint) -> f32 {
        let (wide, long) = (foot.width_m(v2(1.0, 0.0)), foot.width_m(v2(0.0, 1.0)));
        let inner = overlap(at.x, wide, FRAME_M, self.width_m - FRAME_M)
            * overlap(at.y, long, FRAME_M, self.length_m - FRAME_M);
        let diagonal = |direction: V2| {
            let width = foot.width_m(direction);
            DIAGONALS.share(at.dot(direction), width, -1e3, 1e3)
        };
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let (rising, falling) = (diagonal(v2(half, -half)), diagonal(v2(half, half)));
        1.0 - inner * (1.0 - rising) * (1.0 - falling)
    }

    fn disc(&self, at: V2, foot: &Footprint) -> f32 {
        let radius_m = self.width_m / 2.0;
        let away = at - v2(radius_m, radius_m);
        let width = foot.width_m(away.unit());
        overlap(away.norm(), width, -radius_m, radius_m)
    }

    /// Looks the glyph up at several places along the footprint's longer side.
    fn glyph(&self, at: V2, foot: &Footprint, glyph: &Glyph) -> f32 {
        let (longer, shorter) = if foot.du.norm() > foot.dv.norm() {
            (foot.du, foot.dv)
        } else {
            (foot.dv, foot.du)
        };
        let taps = (longer.norm() / shorter.norm().max(FRAY_M))
            .ceil()
            .clamp(1.0, MOST_TAPS);
        let blur_m = shorter.norm().max(longer.norm() / taps);
        let tap = |index: u32| {
            let share = (index as f32 + 0.5) / taps - 0.5;
            let place = at + longer * share;
            glyph.at(
                place.x / self.width_m,
                place.y / self.length_m,
                blur_m / self.length_m,
            )
        };
        (0..taps as u32).map(tap).sum::<f32>() / taps
    }
}

/// A shape on the ground.
#[derive(Debug, Clone, Copy)]
pub(super) enum Shape {
    Stroke(Stroke),
    Panel(Panel),
}

impl Shape {
    /// Share of a pixel that it covers.
    pub(super) fn cover(&self, place: V2, foot: &Footprint, glyphs: &[Glyph]) -> f32 {
        match self {
            Self::Stroke(stroke) => stroke.cover(place, foot),
            Self::Panel(panel) => panel.cover(place, foot, glyphs),
        }
    }

    /// A line through it and how far it reaches from there: where to list it.
    pub(super) fn spine(&self) -> (V2, V2, f32) {
        match self {
            Self::Stroke(stroke) => (
                stroke.from,
                stroke.from + stroke.along * stroke.length_m,
                stroke.half_width_m,
            ),
            Self::Panel(panel) => {
                let right = panel.right * (panel.width_m / 2.0);
                let ahead = panel.ahead * panel.length_m;
                let rear = panel.corner + right;
                (rear, rear + ahead, right.norm())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOOT: Footprint = Footprint {
        du: v2(0.05, 0.0),
        dv: v2(0.0, 0.4),
    };

    fn dashed() -> Shape {
        Shape::Stroke(Stroke {
            from: v2(0.0, 0.0),
            along: v2(0.0, 1.0),
            length_m: 90.0,
            half_width_m: 0.075,
            pattern: Some((
                Pattern {
                    on_m: 3.0,
                    off_m: 6.0,
                },
                0.0,
            )),
        })
    }

    #[test]
    fn a_dashed_line_covers_a_third_of_its_length_and_its_width() {
        let places = (0..9_000).map(|step| v2(0.0, step as f32 * 0.01));
        let mean = places.map(|p| dashed().cover(p, &FOOT, &[])).sum::<f32>() / 9_000.0;
        assert!((mean - 1.0 / 3.0).abs() < 0.003, "{mean}");
        let across = (-100..100).map(|step| v2(step as f32 * 0.01, 1.5));
        let width_m = across.map(|p| dashed().cover(p, &FOOT, &[])).sum::<f32>() * 0.01;
        assert!((width_m - 0.15).abs() < 0.003, "{width_m}");
    }

    #[test]
    fn panels_may_be_skewed() {
        let panel = Shape::Panel(Panel {
            corner: v2(0.0, 0.0),
            right: v2(1.0, 0.0),
            ahead: v2(0.6, 0.8),
            width_m: 2.0,
            length_m: 5.0,
            fill: Fill::Plain,
        });
        assert!(panel.cover(v2(4.0, 3.2), &FOOT, &[]) > 0.99);
        assert!(panel.cover(v2(1.0, 3.2), &FOOT, &[]) < 0.01);
    }
}
