//! A world from any Lanelet2 map: its paint, and the lanes that its lanelets make.
//!
//! `ground` is the plane and its heights; `course` lays lanelets on it, one course per direction; `graph` joins courses to lanes;
//! `junction` finds the lanes that lead through one; `kerbs` and `paint` take the rest of the map.
//! `places` finds what is near.
//!
//! * The anchor is the middle of the box around all lanelets; the plane's heights are the map's
//!   elevations less that of the anchor.
//! * The ground runs through the borders whose vertices all have elevations, where they are most of
//!   them, and is flat otherwise. Everything is laid on it: what the map has in the air comes down,
//!   and a bridge and the road below it are one.
//! * Lanes follow the ids of their lanelets. A lanelet of both directions is two lanes, the second
//!   against it, along the same middle: whoever keeps to its right half steers there.
//! * There are no buildings: a Lanelet2 map has none.

mod course;
mod graph;
mod ground;
mod junction;
mod kerbs;
mod paint;
mod places;

use std::path::Path;

use tilefold_formats::map::{self, Roads};

use crate::error::CityError;
use crate::world::World;
use course::Course;
use ground::Ground;

/// How far from the anchor a map may reach: beyond it, the plane is no picture of the earth.
const MOST_REACH_M: f64 = 25_000.0;
/// Length of all lanes together.
const MOST_LANES_M: f64 = 1_000_000.0;

impl World {
    /// The world of a Lanelet2 map. Lanelets and elements that the reader sets aside are not in it.
    ///
    /// ```no_run
    /// # fn main() -> Result<(), tilefold_city::CityError> {
    /// let world = tilefold_city::World::from_lanelet2("town.osm".as_ref())?;
    /// println!("{} lanes, {} lines and signs", world.lanes.len(), world.paint.len());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// If the map cannot be read, has no lanelet that cars may drive through, or is too large or too
    /// tangled to be simulated.
    pub fn from_lanelet2(path: &Path) -> Result<Self, CityError> {
        let map = map::read(path)?;
        let roads = map::read_roads(path)?;
        let ground = Ground::under(&roads)?.ok_or_else(|| no_lanes(path, &map, &roads))?;
        let courses = courses(&roads, &ground)?;
        let lanes = graph::lanes(&courses, &ground)?;
        let middles = places::middles(&lanes)?;
        Ok(Self {
            paint: paint::paint(&map.elements, &ground, &lanes, &middles),
            kerbs: kerbs::kerbs(&courses, &ground, &lanes, &middles),
            lanes: junction::marked(lanes, &courses, &middles),
            frame: ground.frame,
            relief: ground.relief,
            buildings: Vec::new(),
        })
    }
}

fn courses<'a>(roads: &'a Roads, ground: &Ground) -> Result<Vec<Course<'a>>, CityError> {
    let mut courses = Vec::new();
    let mut length_m = 0.0;
    for lanelet in &roads.lanelets {
        for is_reversed in [false, true] {
            if is_reversed && lanelet.is_one_way {
                continue;
            }
            let course = Course::new(lanelet, is_reversed, ground)?;
            length_m += course.length_m;
            within(
                "length of all lanes together, in metres,",
                length_m,
                MOST_LANES_M,
            )?;
            courses.push(course);
        }
    }
    Ok(courses)
}

fn within(what: &'static str, value: f64, most: f64) -> Result<(), CityError> {
    match value <= most {
        true => Ok(()),
        false => Err(CityError::MapSize { what, value, most }),
    }
}

fn no_lanes(path: &Path, map: &map::MapFile, roads: &Roads) -> CityError {
    let lost = roads.set_aside.first().or(map.set_aside.first());
    CityError::NoLanes {
        path: path.to_owned(),
        lanelets: map.counts.lanelets,
        hint: lost.map_or_else(String::new, |lost| format!(" (set aside: {})", lost.reason)),
    }
}
