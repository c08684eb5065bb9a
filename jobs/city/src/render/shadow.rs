//! Shadows on the ground: of boxes as the hull of their corners along the light, of crowns as mottled
//! discs, and the dark below vehicles whatever the light.

use super::cells::{Cells, CellsBuilder};
use super::noise::Texture;
use super::solids::{Solid, SolidKind};
use super::vector::{V2, V3, smooth, v2};

const CELL_M: f32 = 6.0;
const CELLS: usize = 54;
/// Longest shadow, in metres.
const REACH_M: f32 = 90.0;
/// Width of a shadow's soft border, as a share of its length: the sun is no point.
const SOFT: f32 = 0.008;

#[derive(Debug, Clone)]
enum Caster {
    /// The corners of a convex outline, each with the direction that leads outwards from the side
    /// that begins there; and the width of the soft border.
    Hull(Vec<(V2, V2)>, f32),
    /// A crown: its middle, the direction in which it is stretched, and its two radii.
    Crown(V2, V2, V2),
}

/// All shadows of one picture.
pub(super) struct Shadows {
    casters: Vec<Caster>,
    cells: Cells,
    /// Boxes of vehicles, for the dark below them: middle, direction, half of length and width.
    below: Vec<(V2, V2, V2)>,
    below_cells: Cells,
}

impl Shadows {
    pub(super) fn new(solids: &[Solid], to_sun: Option<V3>, eye: V2) -> Self {
        let mut casters = Vec::new();
        let mut cells = CellsBuilder::new(eye, CELL_M, CELLS);
        if let Some(to_sun) = to_sun {
            for solid in solids {
                if let Some((caster, spine)) = cast(solid, to_sun) {
                    cells.add(casters.len() as u32, spine.0, spine.1, spine.2);
                    casters.push(caster);
                }
            }
        }
        let mut below = Vec::new();
        let mut below_cells = CellsBuilder::new(eye, CELL_M, CELLS);
        for solid in solids.iter().filter(|solid| solid.vehicle.is_some()) {
            let (middle, half) = (solid.foot.flat(), v2(solid.size.x, solid.size.y) * 0.5);
            below_cells.add(below.len() as u32, middle, middle, half.norm() + 0.8);
            below.push((middle, solid.ahead, half));
        }
        Self {
            casters,
            cells: cells.finish(),
            below,
            below_cells: below_cells.finish(),
        }
    }

    /// Share of the sun that reaches a place on the ground.
    pub(super) fn sun(&self, place: V2, foot_m: f32, noise: &Texture) -> f32 {
        let mut sun = 1.0;
        for &index in self.cells.at(place) {
            sun *= 1.0 - self.casters[index as usize].cover(place, foot_m, noise);
            if sun < 0.01 {
                return 0.0;
            }
        }
        sun
    }

    /// Share of the sky that vehicles leave to a place on the ground.
    pub(super) fn sky(&self, place: V2) -> f32 {
        let mut sky = 1.0;
        for &index in self.below_cells.at(place) {
            let (middle, ahead, half) = self.below[index as usize];
            let away = place - middle;
            let out = v2(
                away.dot(ahead).abs() - half.x,
                away.dot(ahead.left()).abs() - half.y,
            );
            let outside_m = v2(out.x.max(0.0), out.y.max(0.0)).norm();
            let inside_m = out.x.max(out.y).min(0.0);
            sky *= 0.1 + 0.9 * smooth(-0.45, 0.75, outside_m + inside_m);
        }
        sky
    }
}

impl Caster {
    fn cover(&self, place: V2, foot_m: f32, noise: &Texture) -> f32 {
        match self {
            Self::Hull(outline, soft_m) => {
                let width_m = foot_m.max(*soft_m);
                let outside = outline
                    .iter()
                    .map(|(corner, outwards)| (place - *corner).dot(*outwards));
                let outside_m = outside.fold(f32::NEG_INFINITY, f32::max);
                (0.5 - outside_m / width_m).clamp(0.0, 1.0)
            }
            Self::Crown(middle, along, radii) => {
                let away = place - *middle;
                let at = v2(away.dot(*along) / radii.x, away.dot(along.left()) / radii.y);
                let radius = at.norm();
                if radius > 1.15 {
                    return 0.0;
                }
                let leaves =
                    0.6 * noise.at(place, 8.0, foot_m) + 0.4 * noise.at(place, 4.0, foot_m);
                0.94 * smooth(0.25, 0.5, 1.05 - radius + 0.9 * (leaves - 0.5))
            }
        }
    }
}

/// A solid's shadow; and a line through it and how far it reaches from there.
fn cast(solid: &Solid, to_sun: V3) -> Option<(Caster, (V2, V2, f32))> {
    let slant = v2(-to_sun.x, -to_sun.y) * (1.0 / to_sun.z.max(0.05));
    let thrown = |height_m: f32| {
        let way = slant * height_m;
        way * (REACH_M / way.norm().max(REACH_M))
    };
    let foot = solid.foot.flat();
    if solid.kind == SolidKind::Lamp {
        return None;
    }
    if solid.kind == SolidKind::Tree {
        let middle = foot + thrown(solid.size.z * 0.64);
        let radius_m = solid.size.x / 2.0;
        let tall_m = solid.size.z * 0.36;
        // The height of the crown stretches its shadow.
        let long_m = (radius_m * radius_m + (tall_m * slant.norm()).powi(2)).sqrt();
        let radii = v2(long_m.min(REACH_M / 3.0), radius_m);
        let reach = (middle, middle, radii.x * 1.15);
        return Some((Caster::Crown(middle, slant.unit(), radii), reach));
    }
    // Vehicles are narrower above.
    let narrow = if solid.kind == SolidKind::Car {
        0.82
    } else {
        1.0
    };
    let half = v2(solid.size.x, solid.size.y) * 0.5;
    let corner =
        |x: f32, y: f32| foot + solid.ahead * (half.x * x) + solid.ahead.left() * (half.y * y);
    let way = thrown(solid.size.z);
    let mut points = Vec::with_capacity(8);
    for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        points.push(corner(x, y));
        points.push(corner(x * narrow, y * narrow) + way);
    }
    let soft_m = (way.norm() * SOFT).max(0.02);
    Some((
        Caster::Hull(sided(&hull(points)), soft_m),
        (foot, foot + way, half.norm() + soft_m),
    ))
}

/// Corners of an outline that goes counter-clockwise, with the direction outwards of the side after
/// each.
fn sided(outline: &[V2]) -> Vec<(V2, V2)> {
    let next = outline.iter().cycle().skip(1);
    let sides = outline.iter().zip(next);
    sides
        .map(|(&from, &to)| (from, -(to - from).unit().left()))
        .collect()
}

/// The convex hull, counter-clockwise (Andrew, 1979).
fn hull(mut points: Vec<V2>) -> Vec<V2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut outline = half_hull(points.iter().copied());
    let upper = half_hull(points.iter().rev().copied());
    outline.extend(upper);
    outline
}

/// One half, without its last point.
fn half_hull(points: impl Iterator<Item = V2>) -> Vec<V2> {
    let mut chain: Vec<V2> = Vec::new();
    for point in points {
        while let [.., before, last] = chain[..] {
            if (last - before).cross(point - last) > 0.0 {
                break;
            }
            chain.pop();
        }
        chain.push(point);
    }
    chain.pop();
    chain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::vector::{grey, v3};

    #[test]
    fn a_tower_throws_its_shadow_away_from_the_sun() {
        let tower = Solid {
            kind: SolidKind::Building,
            foot: v3(0.0, 0.0, 0.0),
            ahead: v2(1.0, 0.0),
            size: v3(4.0, 4.0, 10.0),
            color: grey(0.5),
            lots: 0,
            velocity: v3(0.0, 0.0, 0.0),
            vehicle: None,
            in_sun: 1.0,
        };
        let to_sun = v3(-1.0, 0.0, 1.0).unit();
        let shadows = Shadows::new(&[tower], Some(to_sun), v2(0.0, 0.0));
        let noise = Texture::fractal(8, 0.6, 1);
        let sun = |x: f32, y: f32| shadows.sun(v2(x, y), 0.01, &noise);
        assert_eq!((sun(8.0, 0.0), sun(11.9, 1.9)), (0.0, 0.0));
        assert_eq!(
            (sun(-3.0, 0.0), sun(12.2, 0.0), sun(8.0, 2.2)),
            (1.0, 1.0, 1.0)
        );
    }
}
