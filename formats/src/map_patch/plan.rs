//! What becomes of a map's nodes and ways when changes are written into it.
//!
//! Ways are edited one at a time (`Edited`): first what moved, then what is gone or repainted.
//! Afterwards the vertices that no node has get one: those of nodes that fell out of the same way
//! first, so that a moved line keeps its nodes.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_schemas::element::Color;
use tilefold_schemas::{ChangeRecord, ElementKind, Marking, SignClass, Verdict, wkb};

use super::PatchError;
use super::line::{Place, Vertex, cut, vertices};
use super::text::{OsmText, Thing};
use crate::heights::Heights;
use crate::map_write::lanelet2_tags;

/// The tag that names the change by which something came into the map.
const PROVENANCE: &str = "tilefold_change";
/// A stretch that begins or ends this near the line's end reaches to it.
const END_M: f64 = 1.0;
/// Where a stretch moved aside, the line goes over to it within this length.
const RAMP_M: f64 = 5.0;
/// A line that was repainted and moved by less has only been repainted.
const REPAINTED_SHIFT_M: f64 = 0.3;

/// A change that cannot be written into the map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NotApplied {
    /// The change.
    pub change: i64,
    /// The element that it is about.
    pub element: Option<i64>,
    /// Why not, and what to do.
    pub reason: String,
}

/// A way with its nodes and tags.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct WayBody {
    pub(super) nodes: Vec<i64>,
    pub(super) tags: BTreeMap<String, String>,
}

/// What becomes of a map.
#[derive(Debug, Default)]
pub struct Patch {
    pub(super) new_nodes: BTreeMap<i64, [f64; 3]>,
    pub(super) moved_nodes: BTreeMap<i64, [f64; 3]>,
    pub(super) deleted_nodes: BTreeSet<i64>,
    pub(super) new_ways: BTreeMap<i64, WayBody>,
    pub(super) changed_ways: BTreeMap<i64, WayBody>,
    pub(super) deleted_ways: BTreeSet<i64>,
    /// Whether the map's nodes say their elevation: then new ones do too.
    pub(super) has_elevations: bool,
    /// Changes that are in the patch.
    pub applied: usize,
    /// Changes that are not, with the reason.
    pub not_applied: Vec<NotApplied>,
}

/// The ids that new nodes and ways get: none of a map's, nor of any other map that is patched with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NewIds {
    next: i64,
    step: i64,
}

impl NewIds {
    /// Behind the largest id: for maps that are used as they are.
    pub fn behind<'a>(maps: impl IntoIterator<Item = &'a OsmText>) -> Self {
        let largest = maps.into_iter().flat_map(OsmText::ids).max();
        Self {
            next: largest.unwrap_or(0).max(0).saturating_add(1),
            step: 1,
        }
    }

    /// Before the smallest, and negative: what OsmChange calls things that have no id yet.
    pub fn before<'a>(maps: impl IntoIterator<Item = &'a OsmText>) -> Self {
        let smallest = maps.into_iter().flat_map(OsmText::ids).min();
        Self {
            next: smallest.unwrap_or(0).min(0).saturating_sub(1),
            step: -1,
        }
    }

    fn draw(&mut self) -> i64 {
        let id = self.next;
        self.next = id.saturating_add(self.step);
        id
    }
}

impl Patch {
    /// What `records` make of the map. All of them are taken: choose the claims before.
    ///
    /// # Errors
    /// A record's geometry is none.
    pub fn plan(
        text: &OsmText,
        records: &[ChangeRecord],
        ids: &mut NewIds,
    ) -> Result<Self, PatchError> {
        let mut by_element: BTreeMap<i64, Vec<&ChangeRecord>> = BTreeMap::new();
        let mut planner = Planner::new(text, ids);
        for record in records {
            match record.element {
                Some(element) => by_element.entry(element).or_default().push(record),
                None => planner.add(record)?,
            }
        }
        planner.meet(&by_element)?;
        for (element, records) in by_element {
            planner.edit(element, &records)?;
        }
        Ok(planner.finish())
    }
}

struct Planner<'a> {
    text: &'a OsmText,
    ids: &'a mut NewIds,
    /// Ways (and relations) that use a node.
    users: BTreeMap<i64, BTreeSet<i64>>,
    /// Ways that a relation names.
    named: BTreeSet<i64>,
    /// Where shared ends go, if all ways that share them move.
    ends: BTreeMap<i64, [f64; 3]>,
    heights: Heights,
    patch: Patch,
}

/// A way while it is edited.
struct Edited {
    line: Vec<Vertex>,
    tags: BTreeMap<String, String>,
    /// Stretches of the line with other paint than its tags say; none: no paint.
    repainted: Vec<([f64; 2], Option<Marking>)>,
}

impl<'a> Planner<'a> {
    fn new(text: &'a OsmText, ids: &'a mut NewIds) -> Self {
        let mut users: BTreeMap<i64, BTreeSet<i64>> = BTreeMap::new();
        for (id, way) in &text.ways {
            for node in &way.nodes {
                users.entry(*node).or_default().insert(*id);
            }
        }
        let mut named = BTreeSet::new();
        for (id, relation) in &text.relations {
            for (kind, member, _) in &relation.members {
                match kind.as_str() {
                    "way" => {
                        named.insert(*member);
                    }
                    "node" => {
                        users.entry(*member).or_default().insert(*id);
                    }
                    _ => {}
                }
            }
        }
        let has_height = |(_, node): &(&i64, &Thing)| node.tags.contains_key("ele");
        let raised = text.nodes.iter().filter(has_height).map(|(id, _)| id);
        let has_elevations = text
            .nodes
            .values()
            .any(|node| node.tags.contains_key("ele"));
        Self {
            text,
            ids,
            users,
            named,
            ends: BTreeMap::new(),
            heights: Heights::new(raised.filter_map(|id| text.position(*id))),
            patch: Patch {
                has_elevations,
                ..Patch::default()
            },
        }
    }

    fn finish(mut self) -> Patch {
        // A node that one way let go and another took up stays.
        let kept = |way: &WayBody| way.nodes.clone();
        let used: BTreeSet<i64> = (self.patch.changed_ways.values())
            .chain(self.patch.new_ways.values())
            .flat_map(kept)
            .collect();
        self.patch.deleted_nodes.retain(|node| !used.contains(node));
        self.patch
    }

    fn new_id(&mut self) -> i64 {
        self.ids.draw()
    }

    fn refuse(&mut self, record: &ChangeRecord, reason: impl Into<String>) {
        self.patch.not_applied.push(NotApplied {
            change: record.change,
            element: record.element,
            reason: reason.into(),
        });
    }

    /// Something that the map lacks.
    fn add(&mut self, record: &ChangeRecord) -> Result<(), PatchError> {
        let Some(geometry) = geometry(record)? else {
            self.refuse(record, "it has no geometry");
            return Ok(());
        };
        let kind = ElementKind::from_code(record.kind).unwrap_or_default();
        let mut tags = lanelet2_tags(kind, marking(record), Color::Unknown, sign(record));
        tags.insert(PROVENANCE.to_owned(), format!("{:016x}", record.change));
        let mut nodes = Vec::with_capacity(geometry.points.len() + 1);
        for point in self.heights.complete(&geometry.points) {
            let id = self.new_id();
            self.patch.new_nodes.insert(id, point);
            nodes.push(id);
        }
        if geometry.is_area {
            nodes.extend(nodes.first().copied());
        }
        let id = self.new_id();
        self.patch.new_ways.insert(id, WayBody { nodes, tags });
        self.patch.applied += 1;
        Ok(())
    }

    /// Where lines that meet in a node all move there, the node goes to the middle of where they say.
    fn meet(&mut self, by_element: &BTreeMap<i64, Vec<&ChangeRecord>>) -> Result<(), PatchError> {
        let mut said: BTreeMap<i64, Vec<[f64; 3]>> = BTreeMap::new();
        for (element, records) in by_element {
            let Some(way) = self.text.ways.get(element).filter(|way| !is_ring(way)) else {
                continue;
            };
            let line = vertices(&self.text.points(way));
            let Some(last) = line.last() else { continue };
            for record in records {
                let Some(new) = moved(record, way)? else {
                    continue;
                };
                let [starts, ends] = reach(record, last.station_m);
                let ends = [
                    (starts, way.nodes.first(), new.first()),
                    (ends, way.nodes.last(), new.last()),
                ];
                for (reached, node, point) in ends {
                    if let (true, Some(node), Some(point)) = (reached, node, point) {
                        said.entry(*node).or_default().push(*point);
                    }
                }
            }
        }
        for (node, points) in said {
            let users = self.users.get(&node).map_or(0, BTreeSet::len);
            if points.len() >= users {
                let count = points.len() as f64;
                let mean =
                    [0, 1, 2].map(|axis| points.iter().map(|p| p[axis]).sum::<f64>() / count);
                self.ends.insert(node, mean);
            }
        }
        Ok(())
    }

    fn edit(&mut self, element: i64, records: &[&ChangeRecord]) -> Result<(), PatchError> {
        let text = self.text;
        if let Some(way) = text.ways.get(&element) {
            return match is_ring(way) {
                true => self.edit_ring(element, way, records),
                false => self.edit_line(element, way, records),
            };
        }
        for record in records {
            match text.relations.get(&element) {
                Some(relation) => self.edit_crossing(relation, record),
                None => self.refuse(record, format!("element {element} is not in the map")),
            }
        }
        Ok(())
    }

    /// A crosswalk that is drawn as a lanelet: its paint is that of its borders.
    fn edit_crossing(&mut self, relation: &Thing, record: &ChangeRecord) {
        if Verdict::from_code(record.verdict) != Some(Verdict::Removed) {
            self.refuse(
                record,
                "it is a lanelet between two borders, and where each of them went is not known: move them by hand",
            );
            return;
        }
        for (kind, member, role) in &relation.members {
            if kind == "way"
                && matches!(role.as_str(), "left" | "right")
                && let Some(way) = self.text.ways.get(member)
            {
                let body = WayBody {
                    nodes: way.nodes.clone(),
                    tags: without_paint(way.plain_tags(), record.change),
                };
                self.patch.changed_ways.insert(*member, body);
            }
        }
        self.patch.applied += 1;
    }

    /// A sign or a crosswalk: it is there as a whole or not at all.
    fn edit_ring(
        &mut self,
        id: i64,
        way: &Thing,
        records: &[&ChangeRecord],
    ) -> Result<(), PatchError> {
        let Some((record, more)) = records.split_first() else {
            return Ok(());
        };
        for record in more {
            self.refuse(record, "another change of the same area was applied");
        }
        self.patch.applied += 1;
        if Verdict::from_code(record.verdict) == Some(Verdict::Removed) {
            self.remove(id, way, record.change);
            return Ok(());
        }
        let mut tags = way.plain_tags();
        let seen = sign(record);
        if record.kind == ElementKind::GroundSign.code() && seen != SignClass::Unknown {
            let said = lanelet2_tags(
                ElementKind::GroundSign,
                Marking::Unknown,
                Color::Unknown,
                seen,
            );
            if way.tag("subtype") != seen.name() {
                tags.extend(said.into_iter().filter(|(key, _)| key != "area"));
            }
        }
        tags.insert(PROVENANCE.to_owned(), format!("{:016x}", record.change));
        let mut line = vertices(&self.text.points(way));
        line.pop();
        if let Some(new) = geometry(record)? {
            let points = self.heights.complete(&new.points);
            line = points.iter().map(|&point| new_vertex(point, 0.0)).collect();
        }
        let mut nodes = self.settle(way, &line);
        nodes.extend(nodes.first().copied());
        self.patch.changed_ways.insert(id, WayBody { nodes, tags });
        Ok(())
    }

    /// A line that is gone as a whole.
    fn remove(&mut self, id: i64, way: &Thing, change: i64) {
        if self.named.contains(&id) {
            let body = WayBody {
                nodes: way.nodes.clone(),
                tags: without_paint(way.plain_tags(), change),
            };
            self.patch.changed_ways.insert(id, body);
            return;
        }
        self.patch.deleted_ways.insert(id);
        self.settle(way, &[]);
    }

    fn edit_line(
        &mut self,
        id: i64,
        way: &Thing,
        records: &[&ChangeRecord],
    ) -> Result<(), PatchError> {
        let line = vertices(&self.text.points(way));
        let Some(length_m) = line.last().map(|vertex| vertex.station_m) else {
            return Ok(());
        };
        if line.len() != way.nodes.len() {
            for record in records {
                self.refuse(
                    record,
                    format!("way {id} has nodes that are not in the map"),
                );
            }
            return Ok(());
        }
        let mut edited = Edited {
            line,
            tags: way.plain_tags(),
            repainted: Vec::new(),
        };
        for record in records {
            let reach = reach(record, length_m);
            self.patch.applied += 1;
            match Verdict::from_code(record.verdict) {
                Some(Verdict::Removed) if reach == [true, true] => {
                    self.remove(id, way, record.change);
                    return Ok(());
                }
                Some(Verdict::Removed) => {
                    let stretch = stretch(record, reach, length_m);
                    edited.repainted.push((stretch, None));
                }
                _ => self.change(&mut edited, way, record, reach, length_m)?,
            }
            let change = format!("{:016x}", record.change);
            edited.tags.insert(PROVENANCE.to_owned(), change);
        }
        self.write_line(id, way, edited);
        Ok(())
    }

    fn change(
        &self,
        edited: &mut Edited,
        way: &Thing,
        record: &ChangeRecord,
        reach: [bool; 2],
        length_m: f64,
    ) -> Result<(), PatchError> {
        let seen = marking(record);
        let stretch = stretch(record, reach, length_m);
        if is_repainted(record, way) {
            match reach {
                [true, true] => {
                    let subtype = seen.name().to_owned();
                    edited.tags.insert("subtype".to_owned(), subtype);
                }
                _ => edited.repainted.push((stretch, Some(seen))),
            }
        }
        if let Some(new) = moved(record, way)? {
            let new = self.heights.complete(&new);
            self.shift(&mut edited.line, stretch, reach, &new);
        }
        Ok(())
    }

    /// Puts `new` in the place of a stretch; shared ends stay, or go where all agree.
    fn shift(&self, line: &mut Vec<Vertex>, stretch: [f64; 2], reach: [bool; 2], new: &[[f64; 3]]) {
        let ends = [line.first().copied(), line.last().copied()];
        let length_m = ends[1].map_or(0.0, |vertex| vertex.station_m);
        if !reach[0] {
            cut(line, (stretch[0] - RAMP_M).max(0.0));
        }
        if !reach[1] {
            cut(line, (stretch[1] + RAMP_M).min(length_m));
        }
        let from = line.partition_point(|vertex| vertex.station_m < stretch[0] - 1e-6);
        let to = line.partition_point(|vertex| vertex.station_m <= stretch[1] + 1e-6);
        let mut inside: Vec<Vertex> = spread(new, stretch);
        for (reached, end, is_first) in [(reach[0], ends[0], true), (reach[1], ends[1], false)] {
            let (true, Some(end)) = (reached, end) else {
                continue;
            };
            if let Some(kept) = self.end(end) {
                let at = if is_first {
                    0
                } else {
                    inside.len().saturating_sub(1)
                };
                inside.splice(at..(at + 1).min(inside.len()), [kept]);
            }
        }
        line.splice(from.min(to)..to, inside);
    }

    /// The end of a moved line, if its node is shared or the line keeps it.
    fn end(&self, end: Vertex) -> Option<Vertex> {
        let Place::Node(node) = end.place else {
            return None;
        };
        let users = self.users.get(&node).map_or(0, BTreeSet::len);
        match self.ends.get(&node) {
            Some(&point) if users > 1 => Some(Vertex { point, ..end }),
            None if users > 1 => Some(end),
            _ => None,
        }
    }

    /// The line as a way; where its paint is not of one piece, as several.
    fn write_line(&mut self, id: i64, way: &Thing, mut edited: Edited) {
        for (stretch, _) in &edited.repainted {
            for station_m in stretch {
                cut(&mut edited.line, *station_m);
            }
        }
        for vertex in &edited.line {
            if let Place::Node(node) = vertex.place
                && self.ends.get(&node) == Some(&vertex.point)
            {
                self.patch.moved_nodes.insert(node, vertex.point);
            }
        }
        let pieces = pieces(&edited);
        let is_whole = edited.repainted.is_empty();
        if is_whole || self.named.contains(&id) {
            let nodes = self.settle(way, &edited.line);
            let change = edited.tags.get(PROVENANCE).cloned().unwrap_or_default();
            let tags = match is_whole {
                true => edited.tags.clone(),
                false => virtual_tags(edited.tags.clone(), change),
            };
            for (range, marking) in pieces.into_iter().filter(|_| !is_whole) {
                if let Some(nodes) = nodes.get(range.0..=range.1) {
                    let body = piece(nodes.to_vec(), &edited.tags, marking);
                    let id = self.new_id();
                    self.patch.new_ways.insert(id, body);
                }
            }
            self.patch.changed_ways.insert(id, WayBody { nodes, tags });
            return;
        }
        let mut is_kept = vec![false; edited.line.len()];
        for ((from, to), _) in &pieces {
            is_kept[*from..=*to].fill(true);
        }
        let kept = edited.line.iter().zip(&is_kept);
        let kept: Vec<Vertex> = kept.filter(|(_, kept)| **kept).map(|(v, _)| *v).collect();
        let nodes = self.settle(way, &kept);
        let before = |index: usize| is_kept[..index].iter().filter(|kept| **kept).count();
        let mut own = Some(id);
        for ((from, to), marking) in pieces {
            let Some(nodes) = nodes.get(before(from)..=before(to)) else {
                continue;
            };
            let body = piece(nodes.to_vec(), &edited.tags, marking);
            match own.take() {
                Some(id) => self.patch.changed_ways.insert(id, body),
                None => {
                    let id = self.new_id();
                    self.patch.new_ways.insert(id, body)
                }
            };
        }
        if own.is_some() {
            self.patch.deleted_ways.insert(id);
        }
    }

    /// Gives every vertex a node. Nodes of `way` that only it used and that fell out of it are moved
    /// to where a vertex needs one; those left over are deleted.
    fn settle(&mut self, way: &Thing, line: &[Vertex]) -> Vec<i64> {
        let stays: BTreeSet<i64> = line
            .iter()
            .filter_map(|vertex| match vertex.place {
                Place::Node(node) => Some(node),
                Place::New(_) => None,
            })
            .collect();
        let mut seen = BTreeSet::new();
        let mut free: Vec<i64> = (way.nodes.iter().copied())
            .filter(|node| !stays.contains(node) && seen.insert(*node))
            .filter(|node| self.users.get(node).is_none_or(|users| users.len() < 2))
            .filter(|node| self.text.nodes.contains_key(node))
            .collect();
        free.reverse();
        let nodes = line
            .iter()
            .map(|vertex| match vertex.place {
                Place::Node(node) => node,
                Place::New(point) => match free.pop() {
                    Some(node) => {
                        self.patch.moved_nodes.insert(node, point);
                        node
                    }
                    None => {
                        let node = self.new_id();
                        self.patch.new_nodes.insert(node, point);
                        node
                    }
                },
            })
            .collect();
        self.patch.deleted_nodes.extend(free);
        nodes
    }
}

fn geometry(record: &ChangeRecord) -> Result<Option<wkb::Geometry>, PatchError> {
    let read = record.geometry_new.as_deref().map(wkb::read).transpose();
    read.map_err(|source| PatchError::Geometry {
        change: record.change,
        source,
    })
}

/// Where a line went, if the record says that it moved.
fn moved(record: &ChangeRecord, way: &Thing) -> Result<Option<Vec<[f64; 3]>>, PatchError> {
    let is_modified = Verdict::from_code(record.verdict) == Some(Verdict::Modified);
    let shift_m = record.shift_m.map_or(f64::INFINITY, f64::abs);
    if !is_modified || (is_repainted(record, way) && shift_m < REPAINTED_SHIFT_M) {
        return Ok(None);
    }
    let geometry = geometry(record)?.filter(|geometry| geometry.points.len() > 1);
    Ok(geometry.map(|geometry| geometry.points))
}

/// Whether a line's paint is another than the map says.
fn is_repainted(record: &ChangeRecord, way: &Thing) -> bool {
    let seen = marking(record);
    record.kind == ElementKind::LaneMarking.code()
        && !matches!(seen, Marking::Unknown | Marking::Other)
        && crate::map::marking_of(way.tag("subtype")) != seen
}

fn marking(record: &ChangeRecord) -> Marking {
    let is_line = record.kind == ElementKind::LaneMarking.code();
    let code = record.class_observed.filter(|_| is_line);
    code.and_then(Marking::from_code).unwrap_or_default()
}

fn sign(record: &ChangeRecord) -> SignClass {
    let is_sign = record.kind == ElementKind::GroundSign.code();
    let code = record.class_observed.filter(|_| is_sign);
    code.and_then(SignClass::from_code).unwrap_or_default()
}

/// Whether a change reaches the line's beginning, and its end.
fn reach(record: &ChangeRecord, length_m: f64) -> [bool; 2] {
    [record.from_m <= END_M, record.to_m >= length_m - END_M]
}

fn stretch(record: &ChangeRecord, [starts, ends]: [bool; 2], length_m: f64) -> [f64; 2] {
    [
        if starts { 0.0 } else { record.from_m },
        if ends { length_m } else { record.to_m },
    ]
}

fn is_ring(way: &Thing) -> bool {
    way.nodes.len() > 3 && way.nodes.first() == way.nodes.last()
}

fn new_vertex(point: [f64; 3], station_m: f64) -> Vertex {
    Vertex {
        place: Place::New(point),
        point,
        station_m,
    }
}

/// New vertices with the stations of the stretch that they stand for.
fn spread(new: &[[f64; 3]], stretch: [f64; 2]) -> Vec<Vertex> {
    let steps = new.len().saturating_sub(1).max(1) as f64;
    let station_m = |index: usize| stretch[0] + (stretch[1] - stretch[0]) * index as f64 / steps;
    let points = new.iter().enumerate();
    points
        .map(|(index, &point)| new_vertex(point, station_m(index)))
        .collect()
}

type Piece = ((usize, usize), Option<Marking>);

/// The painted pieces of a line: from one vertex to another, with their paint if it is another.
fn pieces(edited: &Edited) -> Vec<Piece> {
    let paint = |station_m: f64| {
        let within = |range: &[f64; 2]| range[0] <= station_m && station_m <= range[1];
        let found = edited.repainted.iter().find(|(range, _)| within(range));
        found.map(|(_, marking)| *marking)
    };
    let mut pieces: Vec<(Piece, bool)> = Vec::new();
    for (index, pair) in edited.line.windows(2).enumerate() {
        let state = paint(pair[0].station_m.midpoint(pair[1].station_m));
        let is_gone = state == Some(None);
        let marking = state.flatten();
        match pieces.last_mut() {
            Some((((_, to), of), gone)) if *of == marking && *gone == is_gone => *to = index + 1,
            _ => pieces.push((((index, index + 1), marking), is_gone)),
        }
    }
    let painted = pieces.into_iter().filter(|(_, is_gone)| !is_gone);
    painted.map(|(piece, _)| piece).collect()
}

fn piece(nodes: Vec<i64>, tags: &BTreeMap<String, String>, marking: Option<Marking>) -> WayBody {
    let mut tags = tags.clone();
    if let Some(marking) = marking {
        tags.insert("subtype".to_owned(), marking.name().to_owned());
    }
    WayBody { nodes, tags }
}

fn without_paint(tags: BTreeMap<String, String>, change: i64) -> BTreeMap<String, String> {
    virtual_tags(tags, format!("{change:016x}"))
}

/// The tags of a border that is no paint any more, but still a border.
fn virtual_tags(mut tags: BTreeMap<String, String>, change: String) -> BTreeMap<String, String> {
    for key in ["subtype", "color", "colour", "width"] {
        tags.remove(key);
    }
    tags.insert("type".to_owned(), "virtual".to_owned());
    tags.insert(PROVENANCE.to_owned(), change);
    tags
}
