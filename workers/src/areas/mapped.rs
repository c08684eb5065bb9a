//! The map's stop lines, crosswalks and ground signs around one chunk, in its plane.

use tilefold_schemas::{ElementKind, SignClass};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::{MapIndex, MappedElement};

use super::shape;
use crate::local_map::degrees_around;

/// A sign is read by who drives within this of its direction (cosine of 45 degrees).
const READABLE_COS: f64 = 0.707;

/// An area of the map in the plane of the chunk.
#[derive(Debug, Clone)]
pub struct LocalArea<'a> {
    /// The element.
    pub mapped: &'a MappedElement,
    /// Vertices, in metres.
    pub points_m: Vec<[f64; 2]>,
    /// Centre.
    pub centre_m: [f64; 2],
    /// Unit vector along the first side, or along the line.
    pub along: [f64; 2],
}

impl LocalArea<'_> {
    /// Whether a vehicle with this heading can read it. A sign is drawn with its first side in the
    /// direction in which it is read; where that side lies across the road the map does not say, and
    /// nobody is expected to read it.
    #[must_use]
    pub fn is_readable(&self, yaw_rad: f64) -> bool {
        let element = &self.mapped.element;
        if element.kind != ElementKind::GroundSign || element.sign == SignClass::BoxJunction {
            return true;
        }
        let (sin, cos) = yaw_rad.sin_cos();
        self.along[0] * cos + self.along[1] * sin > READABLE_COS
    }
}

/// Areas whose bounding box comes within `reach_m` of the box of `places`, by element id.
#[must_use]
pub fn around<'a>(
    map: &'a MapIndex,
    frame: &LocalFrame,
    places: impl Iterator<Item = [f64; 2]>,
    reach_m: f64,
) -> Vec<LocalArea<'a>> {
    let (low, high) = degrees_around(frame, places, reach_m);
    let near = map.within(low, high).into_iter();
    near.filter(|mapped| mapped.element.kind != ElementKind::LaneMarking)
        .filter_map(|mapped| local(mapped, frame))
        .collect()
}

fn local<'a>(mapped: &'a MappedElement, frame: &LocalFrame) -> Option<LocalArea<'a>> {
    let points = mapped.element.points.iter();
    let plane = points.map(|&[lon, lat, _]| {
        let [east, north, _] = frame.to_enu([lon, lat, 0.0]);
        [east, north]
    });
    let points_m: Vec<[f64; 2]> = plane.collect();
    let first = *points_m.first()?;
    let to = match mapped.element.kind {
        ElementKind::StopLine => *points_m.last()?,
        _ => *points_m.get(1)?,
    };
    let (east, north) = (to[0] - first[0], to[1] - first[1]);
    let length = east.hypot(north);
    Some(LocalArea {
        mapped,
        centre_m: shape::centre(mapped.element.kind, &points_m)?,
        along: (length > 1e-6).then(|| [east / length, north / length])?,
        points_m,
    })
}
