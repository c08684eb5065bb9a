//! Lanelet2: which of an OSM file's ways and relations are paint, as elements.
//!
//! * A way that is paint (`paint`) is one element with the way's id.
//! * A lanelet of the subtype `crosswalk` (older maps: `crossway`) is a crosswalk with the relation's
//!   id: the area between its two borders. It is painted unless a border is a thing that is no paint
//!   (a curbstone, a wall, a virtual line). Its painted borders are then no elements of their own.
//!
//! Everything else is counted, by type. Ids of ways and relations are two spaces in OSM; where an
//! element's id appears a second time, the second is set aside.

use std::collections::{BTreeMap, HashMap, HashSet};

use tilefold_schemas::{Element, ElementId, ElementKind, SetAside, SetAsideKind};

use super::border_uses::BorderUses;
use super::make::{between, check_shape, is_outline, open_ring};
use super::osm::{Node, Osm, Relation, Thing, Way};
use super::paint::{self, Paint, tag};
use super::{MapCounts, MapFile, MapFormat};

pub(super) fn read(osm: &Osm, file: &str) -> MapFile {
    let mut gathering = Gathering::new(osm, file);
    for relation in &osm.relations {
        gathering.take_relation(relation);
    }
    for way in &osm.ways {
        gathering.take_way(way);
    }
    gathering.finish()
}

struct Gathering<'a> {
    osm: &'a Osm,
    file: &'a str,
    /// The first way of each id.
    ways: HashMap<i64, &'a Way>,
    uses: BorderUses,
    /// Borders that were drawn into a crosswalk.
    borders: HashSet<i64>,
    /// Elements and where they stand, in the order of the file.
    elements: Vec<(Element, &'a Thing)>,
    set_aside: Vec<SetAside>,
    counts: MapCounts,
    not_paint: BTreeMap<String, u64>,
}

impl<'a> Gathering<'a> {
    fn new(osm: &'a Osm, file: &'a str) -> Self {
        let mut ways = HashMap::with_capacity(osm.ways.len());
        for way in &osm.ways {
            ways.entry(way.thing.id).or_insert(way);
        }
        let deleted_node = |node: &&Node| **node == Node::Deleted;
        let deleted_nodes = osm.nodes.values().filter(deleted_node).count();
        Self {
            osm,
            file,
            ways,
            uses: BorderUses::default(),
            borders: HashSet::new(),
            elements: Vec::new(),
            set_aside: Vec::new(),
            counts: MapCounts {
                nodes: (osm.nodes.len() - deleted_nodes) as u64,
                ways: osm.ways.len() as u64,
                relations: osm.relations.len() as u64,
                deleted: osm.deleted,
                ..MapCounts::default()
            },
            not_paint: BTreeMap::new(),
        }
    }

    fn take_relation(&mut self, relation: &'a Relation) {
        let tags = &relation.thing.tags;
        match tag(tags, "type") {
            "lanelet" => self.counts.lanelets += 1,
            "multipolygon" => self.counts.areas += 1,
            "regulatory_element" => self.counts.regulatory_elements += 1,
            _ => {}
        }
        let crosses = matches!(tag(tags, "subtype"), "crosswalk" | "crossway");
        if tag(tags, "type") != "lanelet" || !crosses {
            return;
        }
        match self.crosswalk(relation) {
            Ok(Some(element)) => self.elements.push((element, &relation.thing)),
            Ok(None) => {}
            Err(why) => self.lose(&relation.thing, "relation", &why),
        }
    }

    /// The area of a crosswalk lanelet; none if it is not painted.
    fn crosswalk(&mut self, relation: &Relation) -> Result<Option<Element>, String> {
        if let Some(wrong) = &relation.thing.wrong {
            return Err(wrong.clone());
        }
        let left = self.border(relation, "left")?;
        let right = self.border(relation, "right")?;
        if ![left, right]
            .iter()
            .all(|way| paint::may_border_crosswalk(&way.thing.tags))
        {
            return Ok(None);
        }
        self.uses.count(&[left, right])?;
        let ring = between(&self.osm.points(left)?, self.osm.points(right)?);
        let element = element(&relation.thing, paint::crosswalk(), ring)?;
        for way in [left, right] {
            if paint::is_crosswalk_border(tag(&way.thing.tags, "type")) {
                self.borders.insert(way.thing.id);
            }
        }
        Ok(Some(element))
    }

    fn border(&self, relation: &Relation, role: &str) -> Result<&'a Way, String> {
        let mut members = relation.members.iter().filter(|member| member.role == role);
        let (Some(member), None) = (members.next(), members.next()) else {
            return Err(format!("it needs exactly one {role} border"));
        };
        match self.ways.get(&member.id) {
            Some(way) if member.is_way => Ok(way),
            _ => Err(format!(
                "its {role} border, way {}, is not in the file",
                member.id
            )),
        }
    }

    fn take_way(&mut self, way: &'a Way) {
        let tags = &way.thing.tags;
        let Some(paint) = paint::of_way(tags, is_area(way)) else {
            *self
                .not_paint
                .entry(tag(tags, "type").to_owned())
                .or_default() += 1;
            return;
        };
        if self.borders.contains(&way.thing.id) && paint.kind == ElementKind::LaneMarking {
            return;
        }
        let made = match &way.thing.wrong {
            Some(wrong) => Err(wrong.clone()),
            None => self
                .osm
                .points(way)
                .and_then(|points| element(&way.thing, paint, points)),
        };
        match made {
            Ok(element) => self.elements.push((element, &way.thing)),
            Err(why) => self.lose(&way.thing, "way", &why),
        }
    }

    fn lose(&mut self, thing: &Thing, what: &str, why: &str) {
        let reason = format!("{what} {} ({}): {why}", thing.id, thing.place);
        let lost = SetAside::new(SetAsideKind::Element, self.file, reason).at(thing.place.line);
        self.set_aside.push(lost);
    }

    fn finish(mut self) -> MapFile {
        let mut gathered = std::mem::take(&mut self.elements);
        // Stable: of one id, the one that comes first in the file stays first.
        gathered.sort_by_key(|(element, thing)| (element.id, thing.place.line, thing.place.column));
        let mut elements: Vec<Element> = Vec::with_capacity(gathered.len());
        for (element, thing) in gathered {
            if elements.last().is_some_and(|last| last.id == element.id) {
                self.lose(
                    thing,
                    element.kind.name(),
                    "another element has the same id",
                );
            } else {
                elements.push(element);
            }
        }
        self.set_aside.sort();
        MapFile {
            format: MapFormat::Lanelet2,
            elements,
            set_aside: self.set_aside,
            counts: self.counts,
            not_paint: self.not_paint,
            about: self.osm.about.clone(),
        }
    }
}

/// An area says so, or ends where it begins.
fn is_area(way: &Way) -> bool {
    let closed = way.nodes.len() > 3 && way.nodes.first() == way.nodes.last();
    closed || matches!(tag(&way.thing.tags, "area"), "yes" | "true" | "1")
}

fn element(thing: &Thing, paint: Paint, points: Vec<[f64; 3]>) -> Result<Element, String> {
    let points = match is_outline(paint.kind) {
        true => open_ring(points),
        false => points,
    };
    check_shape(paint.kind, &points)?;
    Ok(Element {
        id: ElementId(thing.id),
        kind: paint.kind,
        marking: paint.marking,
        color: paint::color(&thing.tags),
        sign: paint.sign,
        points,
        tags: thing.tags.clone(),
    })
}
