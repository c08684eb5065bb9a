//! What is in each picture, as the simulator writes it beside a log (`*.frames.jsonl`), and what of it
//! is asked for.

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::Path;

use serde::Deserialize;
use tilefold_schemas::observation::Seen;

/// Paint that is worn more than this is neither asked for nor wrong.
const WORN: f64 = 0.7;
/// Lines and areas are asked for if they begin nearer than this, in metres.
const LINE_FAR_M: f64 = 60.0;
const AREA_FAR_M: f64 = 40.0;
/// Share of an area that is to be seen, and its height and a vehicle's size, in pixels.
const AREA_SHARE: f64 = 0.4;
const AREA_PX: f64 = 4.0;
const VEHICLE_PX: u32 = 60;
const VEHICLE_SIDE_PX: f64 = 6.0;
/// Rows this close below the farthest paint are left out: lines run together there.
const HORIZON_PX: f64 = 10.0;

/// What one picture holds.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Picture {
    pub(super) category: String,
    pub(super) lines: Vec<Line>,
    pub(super) boxes: Vec<Box>,
    /// First row in which lines are asked for.
    pub(super) top_px: f64,
}

/// A line in a picture.
#[derive(Debug, PartialEq)]
pub(super) struct Line {
    pub(super) id: i64,
    pub(super) marking: String,
    /// The parts that are in the picture, in pixels.
    pub(super) parts: Vec<Vec<[f64; 2]>>,
    pub(super) is_asked: bool,
}

/// A box in a picture.
#[derive(Debug, PartialEq)]
pub(super) struct Box {
    /// Paint by its element, a vehicle by its number.
    pub(super) id: i64,
    /// None for a sign that no network of ours knows.
    pub(super) seen: Option<Seen>,
    /// Left, top, right, bottom, in pixels.
    pub(super) edges: [f64; 4],
    pub(super) is_asked: bool,
}

#[derive(Deserialize)]
struct Row {
    time_ns: i64,
    category: String,
    paint: Vec<Paint>,
    vehicles: Vec<Vehicle>,
}

#[derive(Deserialize)]
struct Paint {
    id: i64,
    kind: String,
    marking: String,
    sign: String,
    lines_px: Vec<Vec<[f64; 2]>>,
    box_px: Option<[f64; 4]>,
    nearest_m: f64,
    visible_share: f64,
    occluded_share: f64,
    wear: f64,
}

#[derive(Deserialize)]
struct Vehicle {
    number: i64,
    box_px: [f64; 4],
    visible_px: u32,
}

/// The pictures of a log, by the time of their first row.
pub(super) fn read(path: &Path) -> Result<BTreeMap<i64, Picture>, std::boxed::Box<dyn Error>> {
    let mut pictures = BTreeMap::new();
    for (number, line) in fs::read_to_string(path)?.lines().enumerate() {
        let row: Row = serde_json::from_str(line)
            .map_err(|error| format!("{}, line {}: {error}", path.display(), number + 1))?;
        pictures.insert(row.time_ns, row.picture());
    }
    Ok(pictures)
}

impl Row {
    fn picture(self) -> Picture {
        let rows = self
            .paint
            .iter()
            .flat_map(|paint| paint.lines_px.iter().flatten());
        let top_px = rows.map(|[_, y]| *y).fold(f64::INFINITY, f64::min);
        let mut picture = Picture {
            category: self.category,
            top_px: if top_px.is_finite() { top_px } else { 0.0 } + HORIZON_PX,
            ..Picture::default()
        };
        for paint in self.paint {
            match paint.kind.as_str() {
                "lane_marking" => picture.lines.push(paint.line()),
                _ => picture.boxes.extend(paint.area()),
            }
        }
        picture
            .boxes
            .extend(self.vehicles.iter().map(Vehicle::area));
        picture
    }
}

impl Paint {
    fn line(self) -> Line {
        let is_seen = self.visible_share > 0.0 && self.occluded_share < 0.9;
        Line {
            id: self.id,
            marking: self.marking,
            parts: self.lines_px,
            is_asked: is_seen && self.nearest_m < LINE_FAR_M && self.wear < WORN,
        }
    }

    fn area(&self) -> Option<Box> {
        let name = if self.kind == "ground_sign" {
            &self.sign
        } else {
            &self.kind
        };
        let edges = self.box_px?;
        Some(Box {
            id: self.id,
            seen: Seen::from_name(name),
            edges,
            is_asked: self.visible_share >= AREA_SHARE
                && self.nearest_m < AREA_FAR_M
                && self.wear < WORN
                && edges[3] - edges[1] >= AREA_PX,
        })
    }
}

impl Vehicle {
    fn area(&self) -> Box {
        let [left, top, right, bottom] = self.box_px;
        let side_px = (right - left).min(bottom - top);
        Box {
            id: self.number,
            seen: Some(Seen::Vehicle),
            edges: self.box_px,
            is_asked: self.visible_px >= VEHICLE_PX && side_px >= VEHICLE_SIDE_PX,
        }
    }
}
