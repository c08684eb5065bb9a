//! A city drawn by seed: a bent grid of junctions, roads of arcs between them, and their paint.
//!
//! `plan` sets the junctions and joins them -> `section` says which lanes and lines a road has at
//! each station -> `lines`, `signs` and `junction` paint them -> `lanes` joins them for driving ->
//! `buildings` stand along them.

mod buildings;
mod junction;
mod lanes;
mod lines;
mod plan;
mod section;
mod signs;

use std::sync::Arc;

use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_tiler::geodesy::LocalFrame;

use crate::random::Random;
use crate::relief::Relief;
use crate::world::{Paint, Point, World};

/// The id of the first paint.
const FIRST_ID: i64 = 1_000;

/// Draws a city with about `km` kilometres of road around `anchor` (degrees of longitude and
/// latitude, metres).
pub(crate) fn draw(seed: u64, km: f64, anchor: [f64; 3]) -> World {
    let mut random = Random::new(seed, "network", 0);
    let plan = plan::Plan::draw(km, &mut random);
    let relief = Arc::new(Relief::draw(&mut Random::new(seed, "relief", 0)));
    let mut painter = Painter {
        relief: &relief,
        paint: Vec::new(),
    };
    let mut kerbs = Vec::new();
    let mut built = Vec::new();
    for (index, road) in (0..).zip(&plan.roads) {
        lines::paint(road, &mut painter);
        signs::paint(
            &plan,
            road,
            &mut Random::new(seed, "signs", index),
            &mut painter,
        );
        kerbs.extend(lines::kerbs(road, &relief));
        let lots = &mut Random::new(seed, "buildings", index);
        built.extend(buildings::along(road, lots, &relief));
    }
    for (index, node) in (0..).zip(&plan.nodes) {
        let lots = &mut Random::new(seed, "junction", index);
        junction::paint(&plan, node, lots, &mut painter);
    }
    let paint = painter.paint;
    World {
        frame: LocalFrame::new(anchor),
        lanes: lanes::join(&plan, &relief),
        relief,
        paint,
        kerbs,
        buildings: built,
    }
}

/// Lays paint on the ground and numbers it.
struct Painter<'a> {
    relief: &'a Relief,
    paint: Vec<Paint>,
}

/// How a line is painted.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Style {
    marking: Marking,
    color: Color,
}

impl Painter<'_> {
    fn line(&mut self, kind: ElementKind, style: Style, points: &[[f64; 2]], phase_m: f64) {
        self.lay(kind, style, SignClass::Unknown, points, phase_m);
    }

    fn sign(&mut self, sign: SignClass, corners: &[[f64; 2]]) {
        let style = Style {
            marking: Marking::Unknown,
            color: Color::White,
        };
        self.lay(ElementKind::GroundSign, style, sign, corners, 0.0);
    }

    fn lay(
        &mut self,
        kind: ElementKind,
        style: Style,
        sign: SignClass,
        points: &[[f64; 2]],
        phase_m: f64,
    ) {
        self.paint.push(Paint {
            id: FIRST_ID + self.paint.len() as i64,
            kind,
            marking: style.marking,
            color: style.color,
            sign,
            points: on_ground(self.relief, points),
            phase_m,
            wear: 0.0,
            since_ns: i64::MIN,
            until_ns: i64::MAX,
        });
    }
}

/// Points of the plane with the height of the ground.
fn on_ground(relief: &Relief, points: &[[f64; 2]]) -> Vec<Point> {
    let lift =
        |&[east_m, north_m]: &[f64; 2]| [east_m, north_m, relief.height_m([east_m, north_m])];
    points.iter().map(lift).collect()
}

#[cfg(test)]
mod tests;
