//! What lies on the road in one picture: shapes in their order from the asphalt up, how each looks,
//! and which of them touch a place.

use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};

use super::buckets::Buckets;
use super::cells::{Cells, CellsBuilder};
use super::glyph::Glyph;
use super::marks::{Fill, Panel, Pattern, Shape, Stroke};
use super::noise::{hash, share};
use super::repairs::{Repair, RepairKind, Repairs};
use super::vector::{Rgb, V2, grey, v2, v3};
use crate::world::{Paint, Point, World};

/// Paint is drawn up to here, in metres from the vehicle.
pub(super) const REACH_M: f64 = 160.0;
/// Cells of the lists.
const CELL_M: f32 = 2.0;
const CELLS: usize = 160;
/// Half of the width of lines, in metres; of each of two; and of stop lines.
const HALF_LINE_M: f32 = 0.075;
const HALF_TWIN_M: f32 = 0.06;
const HALF_STOP_M: f32 = 0.2;
/// Half of the distance between the middles of two lines, in metres.
const TWIN_M: f32 = 0.13;
/// Urban dashes: 3 m of paint, 6 m of gap. A pattern's first dash begins at phase 0.
pub(super) const DASH: Pattern = Pattern {
    on_m: 3.0,
    off_m: 6.0,
};
/// Dots and other rare lines.
const DOTS: Pattern = Pattern {
    on_m: 0.5,
    off_m: 0.5,
};
/// Bars of a zebra crossing.
const ZEBRA: Pattern = Pattern {
    on_m: 0.5,
    off_m: 0.5,
};
/// Longest piece of a stroke, in metres: what it touches is looked up by its bounding square.
const PIECE_M: f32 = 10.0;
/// How much of the road the ghost of removed paint hides.
const GHOST: f32 = 0.22;

/// How a mark looks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    pub(super) albedo: Rgb,
    /// How much of what lies below it hides, where it is whole.
    pub(super) strength: f32,
    /// Share that is worn off.
    pub(super) wear: f32,
    /// How well it sends headlights back.
    pub(super) retro: f32,
    /// How smooth it is: 0 asphalt, 1 metal.
    pub(super) gloss: f32,
}

/// A shape and the number of its look.
#[derive(Debug, Clone, Copy)]
struct Mark {
    shape: Shape,
    look: u32,
}

/// Everything that lies on the road near the vehicle.
pub(super) struct Layout {
    marks: Vec<Mark>,
    looks: Vec<Look>,
    cells: Cells,
}

/// What a layout is made from.
pub(super) struct LayoutSource<'a> {
    pub(super) world: &'a World,
    pub(super) paint: &'a Buckets,
    pub(super) repairs: &'a Repairs,
}

impl LayoutSource<'_> {
    /// The layout at a time, around a place, in the local frame of `origin`.
    ///
    /// `focal_px` and the eye's height say how far pixels reach over the ground, and so how far from
    /// a mark its light still falls into a pixel.
    pub(super) fn lay(&self, time_ns: i64, at: Point, origin: Point, focal_px: f32) -> Layout {
        let (place, eye) = ([at[0], at[1]], local(origin, &at));
        let mut builder = Builder {
            marks: Vec::new(),
            looks: Vec::new(),
            cells: CellsBuilder::new(eye, CELL_M, CELLS),
            eye,
            focal_px,
        };
        for repair in self.repairs.near(place, REACH_M / 2.0) {
            builder.add(repair_look(repair), repair.shapes(origin));
        }
        let near: Vec<&Paint> = self
            .paint
            .near(place, REACH_M)
            .into_iter()
            .map(|index| &self.world.paint[index as usize])
            .collect();
        for paint in near.iter().filter(|paint| paint.until_ns <= time_ns) {
            builder.add(ghost_look(paint), shapes(paint, origin));
        }
        for paint in near.iter().filter(|paint| paint.is_there(time_ns)) {
            builder.add(paint_look(paint), shapes(paint, origin));
        }
        builder.finish()
    }
}

/// Paint by where it lies.
pub(super) fn paint_buckets(world: &World) -> Buckets {
    let mut buckets = Buckets::default();
    for (index, paint) in (0..).zip(&world.paint) {
        for pair in paint.points.windows(2) {
            let length_m = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            let steps = (length_m / 32.0).ceil().max(1.0) as u32;
            for step in 0..=steps {
                let share = f64::from(step) / f64::from(steps);
                let at = [0, 1].map(|axis| pair[0][axis] + (pair[1][axis] - pair[0][axis]) * share);
                buckets.add(index, at);
            }
        }
    }
    buckets
}

struct Builder {
    marks: Vec<Mark>,
    looks: Vec<Look>,
    cells: CellsBuilder,
    eye: V2,
    focal_px: f32,
}

impl Builder {
    fn add(&mut self, look: Look, shapes: Vec<Shape>) {
        let number = self.looks.len() as u32;
        self.looks.push(look);
        for shape in shapes {
            let (from, to, reach_m) = shape.spine();
            let away_m = (from - self.eye).norm().max((to - self.eye).norm());
            // A pixel that looks down from 1.4 m sees this much of the ground lengthwise.
            let pixel_m = away_m * away_m / (1.4 * self.focal_px);
            let index = self.marks.len() as u32;
            self.cells
                .add(index, from, to, reach_m + pixel_m.min(8.0) * 0.6);
            self.marks.push(Mark {
                shape,
                look: number,
            });
        }
    }

    fn finish(self) -> Layout {
        Layout {
            marks: self.marks,
            looks: self.looks,
            cells: self.cells.finish(),
        }
    }
}

impl Layout {
    /// Calls `with` for every look that touches a pixel, from the asphalt up, with the share of the
    /// pixel that it covers.
    pub(super) fn covers(
        &self,
        place: V2,
        foot: &super::marks::Footprint,
        glyphs: &[Glyph],
        mut with: impl FnMut(&Look, f32),
    ) {
        let (mut last, mut cover) = (u32::MAX, 0.0_f32);
        for &index in self.cells.at(place) {
            let mark = &self.marks[index as usize];
            let share = mark.shape.cover(place, foot, glyphs);
            if share <= 0.0 {
                continue;
            }
            // The pieces of one line meet without a seam: their shares add up.
            if mark.look == last {
                cover += share;
                continue;
            }
            if cover > 0.0 {
                with(&self.looks[last as usize], cover.min(1.0));
            }
            (last, cover) = (mark.look, share);
        }
        if cover > 0.0 {
            with(&self.looks[last as usize], cover.min(1.0));
        }
    }
}

fn local(origin: Point, point: &Point) -> V2 {
    v2((point[0] - origin[0]) as f32, (point[1] - origin[1]) as f32)
}

/// A paint's lots.
fn lots(paint: &Paint) -> u32 {
    hash(paint.id as i32, (paint.id >> 32) as i32, 21)
}

fn paint_look(paint: &Paint) -> Look {
    let fresh = 0.9 + 0.1 * share(lots(paint));
    let albedo = match paint.color {
        Color::Yellow => v3(0.62, 0.40, 0.06),
        Color::White | Color::Unknown => v3(0.64, 0.64, 0.61),
        Color::Other => v3(0.12, 0.22, 0.5),
    };
    Look {
        albedo: albedo * fresh,
        strength: 0.96,
        wear: paint.wear.clamp(0.0, 1.0) as f32,
        retro: 0.4,
        gloss: 0.15,
    }
}

/// Paint that was milled off leaves lighter or darker road.
fn ghost_look(paint: &Paint) -> Look {
    let is_dark = share(lots(paint)) < 0.6;
    Look {
        albedo: grey(if is_dark { 0.03 } else { 0.26 }),
        strength: GHOST * (0.6 + 0.8 * share(lots(paint) ^ 0xA5A5)),
        wear: (0.25 + 0.5 * paint.wear).min(0.8) as f32,
        retro: 0.05,
        gloss: 0.1,
    }
}

fn repair_look(repair: &Repair) -> Look {
    let lot = share(hash(3, 3, repair.lots));
    let (albedo, strength, gloss) = match repair.kind {
        RepairKind::Patch => (grey(0.045 + 0.05 * lot), 0.75, 0.0),
        RepairKind::Crack => (grey(0.03), 0.75, 0.3),
        RepairKind::Cover => (v3(0.07, 0.065, 0.06), 0.9, 0.7),
    };
    Look {
        albedo,
        strength,
        wear: 0.0,
        retro: 0.03,
        gloss,
    }
}

fn shapes(paint: &Paint, origin: Point) -> Vec<Shape> {
    let points: Vec<V2> = paint
        .points
        .iter()
        .map(|point| local(origin, point))
        .collect();
    match paint.kind {
        ElementKind::LaneMarking => line(&points, paint.marking, paint.phase_m as f32),
        ElementKind::StopLine => strokes(&points, 0.0, HALF_STOP_M, None, 0.0),
        ElementKind::Crosswalk => panel(&points, zebra).into_iter().collect(),
        ElementKind::GroundSign => panel(&points, |_, _| sign(paint.sign, lots(paint)))
            .into_iter()
            .collect(),
    }
}

fn line(points: &[V2], marking: Marking, phase_m: f32) -> Vec<Shape> {
    let single = |pattern| strokes(points, 0.0, HALF_LINE_M, pattern, phase_m);
    let twins = |left, right| {
        let mut both = strokes(points, TWIN_M, HALF_TWIN_M, left, phase_m);
        both.extend(strokes(points, -TWIN_M, HALF_TWIN_M, right, phase_m));
        both
    };
    match marking {
        Marking::Solid | Marking::Unknown => single(None),
        Marking::Dashed => single(Some(DASH)),
        Marking::Other => single(Some(DOTS)),
        Marking::SolidSolid => twins(None, None),
        Marking::SolidDashed => twins(None, Some(DASH)),
        Marking::DashedSolid => twins(Some(DASH), None),
        Marking::DashedDashed => twins(Some(DASH), Some(DASH)),
    }
}

fn strokes(
    points: &[V2],
    left_m: f32,
    half_width_m: f32,
    pattern: Option<Pattern>,
    phase_m: f32,
) -> Vec<Shape> {
    let mut shapes = Vec::new();
    let mut at_m = phase_m;
    for pair in points.windows(2) {
        let way = pair[1] - pair[0];
        let (length_m, along) = (way.norm(), way.unit());
        let parts = (length_m / PIECE_M).ceil().max(1.0);
        let part_m = length_m / parts;
        for part in 0..parts as u32 {
            shapes.push(Shape::Stroke(Stroke {
                from: pair[0] + along * (part as f32 * part_m) + along.left() * left_m,
                along,
                length_m: part_m,
                half_width_m,
                pattern: pattern.map(|pattern| (pattern, at_m)),
            }));
            at_m += part_m;
        }
    }
    shapes
}

/// The panel of an outline; of four corners as they are, of others the smallest upright box in the
/// direction of the first side.
fn panel(points: &[V2], fill: impl Fn(f32, f32) -> Fill) -> Option<Shape> {
    let [rear_right, front_left, rear_left] = match points {
        [rear_right, _, front_left, rear_left] => [*rear_right, *front_left, *rear_left],
        _ => boxed(points)?,
    };
    let (across, along) = (rear_right - rear_left, front_left - rear_left);
    let (width_m, length_m) = (across.norm(), along.norm());
    let (right, ahead) = (across.unit(), along.unit());
    // Nothing can be filled in an outline without an area.
    (right.cross(ahead).abs() > 0.1 && width_m > 0.05 && length_m > 0.05).then(|| {
        Shape::Panel(Panel {
            corner: rear_left,
            right,
            ahead,
            width_m,
            length_m,
            fill: fill(width_m, length_m),
        })
    })
}

/// Rear right, front left and rear left corner of a box around an outline.
fn boxed(points: &[V2]) -> Option<[V2; 3]> {
    let (first, second) = (points.first()?, points.get(1)?);
    let ahead = (*second - *first).unit();
    let right = ahead.left() * -1.0;
    let extent = |axis: V2| {
        let values = points.iter().map(|point| (*point - *first).dot(axis));
        values.fold((0.0_f32, 0.0_f32), |(low, high), value| {
            (low.min(value), high.max(value))
        })
    };
    let ((left_m, right_m), (rear_m, front_m)) = (extent(right), extent(ahead));
    let corner = |across_m: f32, along_m: f32| *first + right * across_m + ahead * along_m;
    Some([
        corner(right_m, rear_m),
        corner(left_m, front_m),
        corner(left_m, rear_m),
    ])
}

/// Bars go with the traffic: across the shorter side, whichever corner the outline begins with.
fn zebra(width_m: f32, length_m: f32) -> Fill {
    if width_m >= length_m {
        Fill::BarsAcross(ZEBRA)
    } else {
        Fill::BarsAlong(ZEBRA)
    }
}

fn sign(class: SignClass, lots: u32) -> Fill {
    if class == SignClass::BoxJunction {
        return Fill::Hatched;
    }
    Fill::Glyph(Glyph::number(class, lots))
}
