//! The vector map of Argoverse 2 (`log_map_archive_*.json`): the painted boundaries of lane segments
//! and the pedestrian crossings.
//!
//! A boundary stands in the file once for each lane segment beside it; the same vertices (to the
//! millimetre, in either direction) are one element. It belongs to the segment with the smallest id,
//! left before right, and has that one's direction; its id is the hash of `lane 7 left`, which is
//! kept as the tag `source_id`. `archive` is the file, `city` where on Earth it is.

mod archive;
mod city;

use std::collections::{BTreeMap, HashMap};
use std::io::Read;

use tilefold_schemas::limits::MAX_POINTS_PER_ELEMENT;
use tilefold_schemas::{Color, Element, ElementKind, Marking, SetAside, SetAsideKind, SignClass};

use self::archive::{Archive, Crossing, Item, Place, Point, Segment};
use self::city::City;
use super::error::MapError;
use super::make::{Kind, between, checked};
use super::{MapCounts, MapFile, MapFormat};

pub(super) fn read(source: impl Read, file: &str) -> Result<MapFile, MapError> {
    let text = archive::text(source, file)?;
    let archive = Archive::read(&text, file)?;
    let city = City::of(file)?;
    let mut gathering = Gathering::new(&city, file);
    gathering.set_aside.extend(archive.lost);
    for segment in archive.segments.values() {
        gathering.take_segment(segment);
    }
    gathering.finish_boundaries();
    for crossing in archive.crossings.values() {
        gathering.take_crossing(crossing);
    }
    gathering.counts.lanelets = archive.segments.len() as u64;
    gathering.counts.relations = archive.crossings.len() as u64;
    Ok(gathering.finish())
}

/// A boundary of one or more lane segments.
struct Boundary<'a> {
    source_id: String,
    place: Place,
    points: &'a [Point],
    /// What the segments beside it say is painted there, in its direction: the first that says any.
    mark_type: &'a str,
    paint: Option<(Marking, Color)>,
    /// `7 left, 8 right`.
    lanes: String,
}

struct Gathering<'a> {
    city: &'a City,
    file: &'a str,
    boundaries: Vec<Boundary<'a>>,
    /// Boundaries by their vertices in millimetres.
    known: HashMap<Vec<[i64; 3]>, usize>,
    elements: BTreeMap<i64, Element>,
    set_aside: Vec<SetAside>,
    counts: MapCounts,
    not_paint: BTreeMap<String, u64>,
}

impl<'a> Gathering<'a> {
    fn new(city: &'a City, file: &'a str) -> Self {
        Self {
            city,
            file,
            boundaries: Vec::new(),
            known: HashMap::new(),
            elements: BTreeMap::new(),
            set_aside: Vec::new(),
            counts: MapCounts::default(),
            not_paint: BTreeMap::new(),
        }
    }

    fn take_segment(&mut self, segment: &'a Item<Segment>) {
        let Segment {
            id,
            left_lane_boundary,
            right_lane_boundary,
            left_lane_mark_type,
            right_lane_mark_type,
        } = &segment.value;
        let left = (left_lane_boundary, left_lane_mark_type, "left");
        let right = (right_lane_boundary, right_lane_mark_type, "right");
        for (points, mark_type, side) in [left, right] {
            self.take_boundary(segment.place, points, mark_type, &format!("{id} {side}"));
        }
    }

    fn take_boundary(&mut self, place: Place, points: &'a [Point], mark_type: &'a str, lane: &str) {
        let (key, is_reversed) = key(points);
        let said = paint(mark_type);
        // What has no length is shared with nobody.
        let known = self.known.get(&key).filter(|_| points.len() > 1);
        if let Some(&at) = known {
            let boundary = &mut self.boundaries[at];
            boundary.lanes.push_str(", ");
            boundary.lanes.push_str(lane);
            if boundary.paint.is_none() && said.is_some() {
                let (_, was_reversed) = self::key(boundary.points);
                boundary.paint = said.map(|(marking, color)| match is_reversed == was_reversed {
                    true => (marking, color),
                    false => (reversed(marking), color),
                });
                boundary.mark_type = mark_type;
            }
            return;
        }
        self.known.insert(key, self.boundaries.len());
        self.boundaries.push(Boundary {
            source_id: format!("lane {lane}"),
            place,
            points,
            mark_type,
            paint: said,
            lanes: lane.to_owned(),
        });
    }

    fn finish_boundaries(&mut self) {
        self.counts.ways = self.boundaries.len() as u64;
        for boundary in std::mem::take(&mut self.boundaries) {
            let Some((marking, color)) = boundary.paint else {
                let name = boundary.mark_type.chars().take(60).collect();
                *self.not_paint.entry(name).or_default() += 1;
                continue;
            };
            let tags = [
                ("mark_type", boundary.mark_type),
                ("lanes", &boundary.lanes),
            ];
            let points = self.placed(boundary.points);
            let kind = Kind::line(marking, color);
            self.take(&boundary.source_id, boundary.place, kind, points, &tags);
        }
    }

    fn take_crossing(&mut self, crossing: &Item<Crossing>) {
        let Crossing { id, edge1, edge2 } = &crossing.value;
        let ring = self
            .placed(edge1)
            .and_then(|edge1| Ok(between(&edge1, self.placed(edge2)?)));
        let kind = Kind {
            kind: ElementKind::Crosswalk,
            marking: Marking::Unknown,
            color: Color::Unknown,
            sign: SignClass::Unknown,
        };
        self.take(&format!("crossing {id}"), crossing.place, kind, ring, &[]);
    }

    fn placed(&self, points: &[Point]) -> Result<Vec<[f64; 3]>, String> {
        if points.len() > MAX_POINTS_PER_ELEMENT {
            return Err(format!(
                "it has over {MAX_POINTS_PER_ELEMENT} points (MAX_POINTS_PER_ELEMENT)"
            ));
        }
        points
            .iter()
            .map(|&Point { x, y, z }| self.city.wgs84_from([x, y, z]))
            .collect()
    }

    fn take(
        &mut self,
        source_id: &str,
        place: Place,
        kind: Kind,
        points: Result<Vec<[f64; 3]>, String>,
        tags: &[(&str, &str)],
    ) {
        let own = [("source_id", source_id)];
        let said = tags.iter().chain(&own);
        let tags = said
            .map(|&(key, value)| (key.to_owned(), value.to_owned()))
            .collect();
        match points.and_then(|points| checked(source_id, kind, points, tags)) {
            Ok(element) => drop(self.elements.insert(element.id.0, element)),
            Err(why) => {
                let reason = format!("{source_id} ({place}): {why}");
                let lost = SetAside::new(SetAsideKind::Element, self.file, reason);
                self.set_aside.push(lost.at(place.line));
            }
        }
    }

    fn finish(mut self) -> MapFile {
        self.set_aside.sort();
        MapFile {
            format: MapFormat::Argoverse2,
            elements: self.elements.into_values().collect(),
            set_aside: self.set_aside,
            counts: self.counts,
            not_paint: self.not_paint,
            about: BTreeMap::from([("city".to_owned(), self.city.name.to_owned())]),
        }
    }
}

/// The vertices in millimetres in that direction which comes first, and whether it is not their own.
fn key(points: &[Point]) -> (Vec<[i64; 3]>, bool) {
    let millimetres = |value: f64| (value * 1e3).round() as i64;
    let rounded = |point: &Point| [point.x, point.y, point.z].map(millimetres);
    let forward: Vec<_> = points.iter().map(rounded).collect();
    let backward: Vec<_> = forward.iter().rev().copied().collect();
    match backward < forward {
        true => (backward, true),
        false => (forward, false),
    }
}

/// What is painted; nothing for `NONE`, and for `UNKNOWN`, which does not even say that.
fn paint(mark_type: &str) -> Option<(Marking, Color)> {
    let (pattern, color) = mark_type.rsplit_once('_')?;
    let color = match color {
        "WHITE" => Color::White,
        "YELLOW" => Color::Yellow,
        _ => Color::Other,
    };
    let marking = match pattern {
        "SOLID" => Marking::Solid,
        "DASHED" => Marking::Dashed,
        "DOUBLE_SOLID" => Marking::SolidSolid,
        "DOUBLE_DASH" => Marking::DashedDashed,
        "SOLID_DASH" => Marking::SolidDashed,
        "DASH_SOLID" => Marking::DashedSolid,
        _ => Marking::Other,
    };
    Some((marking, color))
}

fn reversed(marking: Marking) -> Marking {
    match marking {
        Marking::SolidDashed => Marking::DashedSolid,
        Marking::DashedSolid => Marking::SolidDashed,
        other => other,
    }
}
