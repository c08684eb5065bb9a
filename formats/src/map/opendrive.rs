//! OpenDRIVE 1.4 to 1.8: the road marks of its lanes, and what of its objects and signals is paint.
//!
//! A file has no lines, but formulas for them: `curve` is the reference line of a road, `profile`
//! everything that changes along it, `road` puts both together with the lanes, and `sample` makes
//! polylines of that. `marks` and `objects` say what is paint, `frame` where on Earth it is.
//! `tree` is the document itself.
//!
//! OpenDRIVE has no ids for marks: an element's id is the hash of where the mark stands in the file
//! (`road 7, section 0, lane -2, mark 1`), which is kept as the tag `source_id`.

mod curve;
mod frame;
mod marks;
mod objects;
mod profile;
mod road;
mod sample;
mod tree;

use std::collections::{BTreeMap, BTreeSet};

use tilefold_schemas::limits::MAX_MAP_SAMPLES;
use tilefold_schemas::{Element, SetAside, SetAsideKind};

use self::frame::Frame;
use self::marks::{Found, Mark, Of};
use self::objects::Painted;
use self::road::{Across, Road, Section, Side};
use self::sample::Sampler;
use self::tree::Node;
use super::error::MapError;
use super::make::{Kind, checked};
use super::xml::shown;
use super::{MapCounts, MapFile, MapFormat};

pub(super) use self::tree::Parser;

/// A document, not yet judged.
pub(super) struct OpenDrive {
    root: Option<Node>,
}

impl Parser {
    pub(super) fn finish(self) -> OpenDrive {
        OpenDrive { root: self.root() }
    }
}

/// The elements of a document; `file` is its name in losses and errors.
pub(super) fn read(document: OpenDrive, file: &str) -> Result<MapFile, MapError> {
    let Some(root) = document.root else {
        return Err(MapError::Format {
            file: file.to_owned(),
            looks_like: "an empty document".to_owned(),
        });
    };
    let frame = Frame::of(&root).map_err(|(place, what)| MapError::Damaged {
        file: file.to_owned(),
        line: place.line,
        column: place.column,
        what,
    })?;
    let mut gathering = Gathering::new(frame, file);
    for node in root.all("road") {
        gathering.take_road(node);
        if gathering.sampler.is_exhausted() {
            return Err(MapError::Limit {
                file: file.to_owned(),
                line: node.place.line,
                column: node.place.column,
                what: "the number of points that its lines take",
                limit: MAX_MAP_SAMPLES as u64,
                name: "MAX_MAP_SAMPLES",
            });
        }
    }
    Ok(gathering.finish(about(&root)))
}

fn about(root: &Node) -> BTreeMap<String, String> {
    let header = root.all("header").next();
    let said = header.into_iter().flat_map(|header| &header.attributes);
    said.map(|(key, value)| (key.clone(), value.clone()))
        .collect()
}

struct Gathering<'a> {
    file: &'a str,
    frame: Frame,
    sampler: Sampler,
    roads: BTreeSet<String>,
    elements: BTreeMap<i64, Element>,
    set_aside: Vec<SetAside>,
    counts: MapCounts,
    not_paint: BTreeMap<String, u64>,
}

/// A mark ends before what begins at its end: there, lanes may be counted from another line.
const JUST_BEFORE_M: f64 = 1e-6;

/// Where something stands in the file.
struct Source<'a> {
    /// Its address, which its id is made of.
    id: String,
    node: &'a Node,
}

impl<'a> Gathering<'a> {
    fn new(frame: Frame, file: &'a str) -> Self {
        Self {
            file,
            frame,
            sampler: Sampler::new(),
            roads: BTreeSet::new(),
            elements: BTreeMap::new(),
            set_aside: Vec::new(),
            counts: MapCounts::default(),
            not_paint: BTreeMap::new(),
        }
    }

    fn take_road(&mut self, node: &Node) {
        let name = node.attribute("id").to_owned();
        let source = Source {
            id: format!("road {}", shown(&name)),
            node,
        };
        if !self.roads.insert(name) {
            return self.lose(&source, "another road has the same id");
        }
        self.counts.relations += 1;
        let read = Road::read(node).and_then(|road| Ok((road.sections(node)?, road)));
        match read {
            Err(why) => self.lose(&source, &why),
            Ok((sections, road)) => {
                for (index, section) in sections.iter().enumerate() {
                    let id = format!("{}, section {index}", source.id);
                    self.take_section(&road, section, &id);
                }
                self.take_objects(&road, &source);
                self.take_signals(&road, &sections, &source);
            }
        }
    }

    fn take_section(&mut self, road: &Road, section: &Section<'_>, id: &str) {
        let span = [section.start, section.end];
        if let Some(center) = section.center {
            let border = |s: f64| Across::banked(road.lane_offset(s));
            self.take_marks(road, center, Of::Center, span, id, border, |_, _| {
                Vec::new()
            });
        }
        for (side, of) in [(&section.left, Of::Left), (&section.right, Of::Right)] {
            self.take_side(road, side, of, span, id);
        }
    }

    fn take_side(&mut self, road: &Road, side: &Side<'_>, of: Of, span: [f64; 2], id: &str) {
        for (node, why) in &side.lost {
            let id = format!("{id}, lane {}", shown(node.attribute("id")));
            self.lose(&Source { id, node }, why);
        }
        for (index, lane) in side.lanes.iter().enumerate() {
            self.counts.lanelets += 1;
            let border = |s: f64| side.outer_border(index, s - span[0], road.lane_offset(s));
            let breaks = |from, to| side.breaks(index, span[0], from, to);
            self.take_marks(road, lane.node, of, span, id, border, breaks);
        }
    }

    /// Takes the marks on a border: `border` says where it is, `breaks` where its formula changes.
    #[expect(clippy::too_many_arguments, reason = "a border is all of that")]
    fn take_marks(
        &mut self,
        road: &Road,
        lane: &Node,
        of: Of,
        span: [f64; 2],
        id: &str,
        border: impl Fn(f64) -> Across,
        breaks: impl Fn(f64, f64) -> Vec<f64>,
    ) {
        for Found { index, node, mark } in marks::of_lane(lane, span, of) {
            self.counts.ways += 1;
            let id = format!("{id}, lane {}, mark {index}", shown(lane.attribute("id")));
            let source = Source { id, node };
            let drawn = match mark {
                Ok(None) => {
                    self.pass(node.attribute("type"));
                    continue;
                }
                Ok(Some(mark)) => self.draw(road, &mark, &border, &breaks),
                Err(why) => Err(why),
            };
            match drawn {
                Ok((points, mark)) => self.take(&source, mark, points),
                Err(why) => self.lose(&source, &why),
            }
        }
    }

    /// A mark as a polyline in the frame of the file.
    fn draw(
        &mut self,
        road: &Road,
        mark: &Mark<'_>,
        border: impl Fn(f64) -> Across,
        breaks: impl Fn(f64, f64) -> Vec<f64>,
    ) -> Result<(Vec<[f64; 3]>, Kind), String> {
        let [from, to] = mark.span;
        let last = to - JUST_BEFORE_M;
        if last <= from {
            return Err("it ends where it begins: another one follows at once".to_owned());
        }
        let mut changes = road.breaks(from, to);
        changes.extend(breaks(from, to));
        let curve = |s: f64| {
            let Across { t, banked } = border(s);
            let shifted = Across {
                t: t + mark.shift_m,
                banked: banked + mark.shift_m,
            };
            road.point(s, shifted)
        };
        let points = self.sampler.sample(curve, [from, last], changes)?;
        Ok((points, Kind::line(mark.marking, marks::color(mark.node))))
    }

    fn take_objects(&mut self, road: &Road, of: &Source<'_>) {
        for node in of.node.all_in("objects", "object") {
            let id = format!("{}, object {}", of.id, shown(node.attribute("id")));
            let source = Source { id, node };
            match objects::of_object(road, node) {
                Err(why) => self.lose(&source, &why),
                Ok(painted) if painted.is_empty() => {
                    self.pass(&format!("object {}", node.attribute("type")));
                }
                Ok(painted) => {
                    for (index, painted) in painted.into_iter().enumerate() {
                        let id = match index {
                            0 => source.id.clone(),
                            _ => format!("{}, outline {index}", source.id),
                        };
                        self.take_painted(&Source { id, node }, painted);
                    }
                }
            }
        }
    }

    fn take_signals(&mut self, road: &Road, sections: &[Section<'_>], of: &Source<'_>) {
        for node in of.node.all_in("signals", "signal") {
            let id = format!("{}, signal {}", of.id, shown(node.attribute("id")));
            let source = Source { id, node };
            let lanes = |s: f64, ids: [i64; 2]| across_lanes(road, sections, s, ids);
            match objects::of_signal(road, node, lanes) {
                Err(why) => self.lose(&source, &why),
                Ok(None) => self.pass(&format!("signal {}", node.attribute("type"))),
                Ok(Some(painted)) => self.take_painted(&source, painted),
            }
        }
    }

    fn take_painted(&mut self, source: &Source<'_>, painted: Painted) {
        let kind = Kind {
            kind: painted.kind,
            marking: painted.marking,
            color: marks::color(source.node),
            sign: painted.sign,
        };
        self.take(source, kind, painted.points);
    }

    /// Makes an element of points in the frame of the file.
    fn take(&mut self, source: &Source<'_>, kind: Kind, points: Vec<[f64; 3]>) {
        let placed = points.into_iter().map(|point| self.frame.wgs84_from(point));
        let made = placed
            .collect::<Result<Vec<_>, _>>()
            .and_then(|points| checked(&source.id, kind, points, tags(source)));
        match made {
            Err(why) => self.lose(source, &why),
            Ok(element) if self.elements.contains_key(&element.id.0) => {
                self.lose(source, "another element has the same id");
            }
            Ok(element) => drop(self.elements.insert(element.id.0, element)),
        }
    }

    fn pass(&mut self, what: &str) {
        *self.not_paint.entry(shown(what)).or_default() += 1;
    }

    fn lose(&mut self, source: &Source<'_>, why: &str) {
        let place = source.node.place;
        let reason = format!("{} ({place}): {why}", source.id);
        let lost = SetAside::new(SetAsideKind::Element, self.file, reason).at(place.line);
        self.set_aside.push(lost);
    }

    fn finish(mut self, about: BTreeMap<String, String>) -> MapFile {
        self.set_aside.sort();
        MapFile {
            format: MapFormat::OpenDrive,
            elements: self.elements.into_values().collect(),
            set_aside: self.set_aside,
            counts: self.counts,
            not_paint: self.not_paint,
            about,
        }
    }
}

/// What a mark, an object or a signal says of itself.
fn tags(source: &Source<'_>) -> BTreeMap<String, String> {
    let said = source.node.attributes.iter();
    let mut tags: BTreeMap<_, _> = said
        .map(|(key, value)| (key.clone(), value.clone()))
        .collect();
    tags.insert("source_id".to_owned(), source.id.clone());
    tags
}

/// The span of the lanes between two ids, across the road at a station.
fn across_lanes(
    road: &Road,
    sections: &[Section<'_>],
    s: f64,
    [one, other]: [i64; 2],
) -> Option<[Across; 2]> {
    let begun = sections.partition_point(|section| section.start <= s);
    let section = sections.get(begun.checked_sub(1)?)?;
    let border = |id: i64| {
        let side = if id > 0 {
            &section.left
        } else {
            &section.right
        };
        let lane_offset = road.lane_offset(s);
        match usize::try_from(id.unsigned_abs()).ok()?.checked_sub(1) {
            None => Some(Across::banked(lane_offset)),
            Some(index) if index < side.lanes.len() => {
                Some(side.outer_border(index, s - section.start, lane_offset))
            }
            Some(_) => None,
        }
    };
    // The lanes -3 to -1 reach from the border of -3 to the middle.
    let [low, high] = [one.min(other), one.max(other)];
    let left = if high < 0 { high + 1 } else { high };
    let right = if low > 0 { low - 1 } else { low };
    Some([border(left)?, border(right)?])
}
