//! Whether two elements of two maps are the same paint at the same place.

use tilefold_reducers::elements::SECTION_M;
use tilefold_schemas::{Element, ElementKind};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::station::{Polyline, section_count};

/// Two drawings of one line differ by less than this, in metres: half of what a line is wide.
pub(crate) const TOLERANCE_M: f64 = 0.05;

/// Whether evidence of `old` is evidence of `new`: one kind, marking, colour and class; drawn in the
/// same direction; nowhere farther apart than [`TOLERANCE_M`]; with as many sections. Elevation is
/// left aside, as the road is worked on as a plane.
#[must_use]
pub(crate) fn is_same(old: &Element, new: &Element) -> bool {
    let what = |e: &Element| (e.kind, e.marking, e.color, e.sign);
    if what(old) != what(new) {
        return false;
    }
    let Some(&[lon, lat, _]) = old.points.first() else {
        return false;
    };
    let frame = LocalFrame::new([lon, lat, 0.0]);
    let (old_m, new_m) = (plane(&frame, old), plane(&frame, new));
    match old.kind {
        ElementKind::LaneMarking | ElementKind::StopLine => is_same_line(&old_m, &new_m),
        ElementKind::Crosswalk | ElementKind::GroundSign => is_same_outline(&old_m, &new_m),
    }
}

/// Vertices `[east_m, north_m]`.
pub(crate) fn plane(frame: &LocalFrame, element: &Element) -> Vec<[f64; 2]> {
    let points = element.points.iter();
    points
        .map(|&[lon, lat, _]| place(frame, lon, lat))
        .collect()
}

pub(crate) fn place(frame: &LocalFrame, lon: f64, lat: f64) -> [f64; 2] {
    let [east_m, north_m, _] = frame.to_enu([lon, lat, 0.0]);
    [east_m, north_m]
}

/// The line through vertices of the plane.
pub(crate) fn line(points: &[[f64; 2]]) -> Option<Polyline> {
    Polyline::new(
        points
            .iter()
            .map(|&[east_m, north_m]| [east_m, north_m, 0.0]),
    )
    .ok()
}

fn is_near(a: [f64; 2], b: [f64; 2]) -> bool {
    (a[0] - b[0]).hypot(a[1] - b[1]) <= TOLERANCE_M
}

fn is_same_line(old: &[[f64; 2]], new: &[[f64; 2]]) -> bool {
    let ends = [(old.first(), new.first()), (old.last(), new.last())];
    let are_ends_near = ends
        .into_iter()
        .all(|(a, b)| a.zip(b).is_some_and(|(&a, &b)| is_near(a, b)));
    let (Some(old_line), Some(new_line), true) = (line(old), line(new), are_ends_near) else {
        return false;
    };
    let sections = |line: &Polyline| section_count(line.length_m(), SECTION_M);
    let runs_along = |points: &[[f64; 2]], line: &Polyline| {
        let mut all = points.iter();
        all.all(|&point| line.project(point).distance_m <= TOLERANCE_M)
    };
    sections(&old_line) == sections(&new_line)
        && runs_along(old, &new_line)
        && runs_along(new, &old_line)
}

fn is_same_outline(old: &[[f64; 2]], new: &[[f64; 2]]) -> bool {
    old.len() == new.len() && old.iter().zip(new).all(|(&a, &b)| is_near(a, b))
}
