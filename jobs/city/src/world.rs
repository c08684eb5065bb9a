//! What stands and what is painted in a city, at any time, and where vehicles can drive.
//!
//! Two sources make worlds: `network` draws one by seed, `mapped` takes a Lanelet2 map. Edits,
//! drives, detections and pictures do not know which.
//!
//! Frame: the city's plane, metres east and north of the anchor, and metres up from the ellipsoid's
//! height at the anchor. A city of 20 km is flat in it: heights follow the ground, not the plane.

use std::sync::Arc;

use tilefold_schemas::element::{Color, Element, ElementKind, Marking, SignClass};
use tilefold_schemas::id::ElementId;
use tilefold_tiler::geodesy::LocalFrame;

use crate::relief::Relief;

/// Metres east, north and up.
pub type Point = [f64; 3];

/// Something painted on the road, for as long as it is there.
#[derive(Debug, Clone, PartialEq)]
pub struct Paint {
    /// The element's id in the maps of this city.
    pub id: i64,
    /// What it is.
    pub kind: ElementKind,
    /// How a line is painted.
    pub marking: Marking,
    /// Its colour.
    pub color: Color,
    /// Which sign it is.
    pub sign: SignClass,
    /// A line's vertices; or the corners of a sign or crosswalk, counter-clockwise from the rear
    /// right one as the driver sees it.
    pub points: Vec<Point>,
    /// Where a dashed line's pattern stands at its first vertex, in metres.
    pub phase_m: f64,
    /// Share of the paint that is worn off, 0 to 1.
    pub wear: f64,
    /// First nanosecond (Unix epoch) at which it is there.
    pub since_ns: i64,
    /// First nanosecond at which it is gone.
    pub until_ns: i64,
}

impl Paint {
    /// Whether it is there at a time.
    #[must_use]
    pub fn is_there(&self, time_ns: i64) -> bool {
        (self.since_ns..self.until_ns).contains(&time_ns)
    }
}

/// A lane that vehicles drive along, from its first point to its last.
#[derive(Debug, Clone, PartialEq)]
pub struct Lane {
    /// Its middle.
    pub centre: Vec<Point>,
    /// Its mean width in metres.
    pub width_m: f64,
    /// How fast vehicles drive there at most, in metres per second.
    pub speed_m_s: f64,
    /// Lanes that begin where it ends.
    pub next: Vec<usize>,
    /// The lane of the same direction to its left.
    pub left: Option<usize>,
    /// The lane of the same direction to its right.
    pub right: Option<usize>,
    /// Whether it leads through a junction.
    pub is_junction: bool,
}

/// A building: an upright box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Building {
    /// Its middle, on the ground.
    pub at: Point,
    /// Direction of its length, radians counter-clockwise from east.
    pub yaw_rad: f64,
    /// Length, width and height in metres.
    pub size_m: [f64; 3],
}

/// A city.
#[derive(Debug, Clone)]
pub struct World {
    /// Where the plane lies on the earth.
    pub frame: LocalFrame,
    /// The height of the ground.
    pub relief: Arc<Relief>,
    /// All paint of all times, by id.
    pub paint: Vec<Paint>,
    /// All lanes; the graph's indices are places in here.
    pub lanes: Vec<Lane>,
    /// Borders of the road surface.
    pub kerbs: Vec<Vec<Point>>,
    /// Buildings.
    pub buildings: Vec<Building>,
}

impl World {
    /// A point of the plane on WGS 84: degrees of longitude and latitude, metres above the
    /// ellipsoid. The plane leaves the ellipsoid by 8 cm at a kilometre, which heights ignore.
    #[must_use]
    pub fn on_earth(&self, [east_m, north_m, up_m]: Point) -> [f64; 3] {
        let [longitude_deg, latitude_deg, _] = self.frame.to_wgs84([east_m, north_m, 0.0]);
        [longitude_deg, latitude_deg, self.frame.anchor()[2] + up_m]
    }

    /// The map element of a paint.
    #[must_use]
    pub fn element(&self, paint: &Paint) -> Element {
        let points = paint.points.iter().map(|&point| self.on_earth(point));
        Element {
            id: ElementId(paint.id),
            kind: paint.kind,
            marking: paint.marking,
            color: paint.color,
            sign: paint.sign,
            points: points.collect(),
            tags: tilefold_formats::map_write::lanelet2_tags(
                paint.kind,
                paint.marking,
                paint.color,
                paint.sign,
            ),
        }
    }
}
