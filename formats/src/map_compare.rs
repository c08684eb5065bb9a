//! What differs between two maps: things with the same id first, then the rest by geometry, because a
//! map that was exported anew often has new ids for the same lines.
//!
//! Of OSM files all nodes, ways and relations are compared, whether they are paint or not; of other
//! formats the elements that are read from them.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_schemas::ElementKind;

use crate::map::MapFile;
use crate::map_patch::{OsmText, Thing, distance_m, offset_m};

/// One side of a comparison.
#[derive(Debug, Default)]
pub struct Comparable {
    features: BTreeMap<(Class, i64), Feature>,
}

/// What kind of thing differs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// A node of an OSM file.
    Node,
    /// A way of an OSM file.
    Way,
    /// A relation of an OSM file: a lanelet, an area, a rule.
    Relation,
    /// An element of another format.
    Element,
}

impl Class {
    /// Its name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Node => "node",
            Self::Way => "way",
            Self::Relation => "relation",
            Self::Element => "element",
        }
    }
}

#[derive(Debug, Default)]
struct Feature {
    points: Vec<[f64; 3]>,
    tags: BTreeMap<String, String>,
    members: Vec<(String, i64, String)>,
}

/// How something differs.
#[derive(Debug, Clone, PartialEq)]
pub enum How {
    /// Only in the second map.
    Added,
    /// Only in the first.
    Removed,
    /// In both, elsewhere: the farthest that a vertex of one is from the line of the other, metres.
    Moved(f64),
    /// In both, of another type, subtype or colour: the tags that differ, `key: old -> new`.
    Retyped(String),
    /// In both, with other tags: those that differ.
    Retagged(String),
    /// In both, with this id in the second map.
    Renumbered(i64),
    /// A relation with other members: how many of the first map's it lost, and how many it gained.
    Rewired(usize, usize),
}

impl How {
    /// Its name in reports.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Added => "added",
            Self::Removed => "removed",
            Self::Moved(_) => "moved",
            Self::Retyped(_) => "retyped",
            Self::Retagged(_) => "retagged",
            Self::Renumbered(_) => "renumbered",
            Self::Rewired(..) => "rewired",
        }
    }
}

/// One difference.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// What kind of thing.
    pub class: Class,
    /// Its id in the first map; in the second if it is only there.
    pub id: i64,
    /// Its type and subtype, as that map says them.
    pub kind: String,
    /// How it differs.
    pub how: How,
}

/// Tags that say what a thing is.
const TYPE_TAGS: [&str; 4] = ["type", "subtype", "color", "colour"];
/// Tags that are positions: they are compared as such.
const POSITION_TAGS: [&str; 3] = ["ele", "local_x", "local_y"];

impl Comparable {
    /// All of an OSM file.
    #[must_use]
    pub fn osm(text: &OsmText) -> Self {
        let mut features = BTreeMap::new();
        for (id, node) in &text.nodes {
            let point = text.position(*id);
            let feature = feature(node, point.into_iter().collect());
            features.insert((Class::Node, *id), feature);
        }
        for (id, way) in &text.ways {
            let points = text.points(way).into_iter().map(|(_, point)| point);
            features.insert((Class::Way, *id), feature(way, points.collect()));
        }
        for (id, relation) in &text.relations {
            features.insert((Class::Relation, *id), feature(relation, Vec::new()));
        }
        Self { features }
    }

    /// The elements of a map in any format.
    #[must_use]
    pub fn elements(map: &MapFile) -> Self {
        let feature = |element: &tilefold_schemas::Element| {
            let mut points = element.points.clone();
            if matches!(
                element.kind,
                ElementKind::Crosswalk | ElementKind::GroundSign
            ) {
                points.extend(points.first().copied());
            }
            let mut tags = element.tags.clone();
            tags.insert("type".to_owned(), element.kind.name().to_owned());
            tags.insert("subtype".to_owned(), element.marking.name().to_owned());
            Feature {
                points,
                tags,
                members: Vec::new(),
            }
        };
        let features = map.elements.iter();
        Self {
            features: features
                .map(|element| ((Class::Element, element.id.0), feature(element)))
                .collect(),
        }
    }

    /// How `other` differs from this, in the order of class and id. What lies within `tolerance_m` is
    /// in the same place.
    #[must_use]
    pub fn differences(&self, other: &Self, tolerance_m: f64) -> Vec<Difference> {
        let renumbered = self.renumbered(other, tolerance_m);
        let taken: BTreeSet<(Class, i64)> = renumbered
            .iter()
            .map(|((class, _), new)| (*class, *new))
            .collect();
        let mut found = Vec::new();
        for (key, feature) in &self.features {
            let mut note = |how| found.push(difference(*key, feature, how));
            if let Some(same) = other.features.get(key) {
                feature.compare(same, tolerance_m, &mut note);
            } else if let Some(new) = renumbered.get(key) {
                note(How::Renumbered(*new));
                if let Some(same) = other.features.get(&(key.0, *new)) {
                    feature.compare(same, tolerance_m, &mut note);
                }
            } else if key.0 != Class::Node || feature.is_thing() {
                note(How::Removed);
            }
        }
        for (key, feature) in &other.features {
            let is_new = !self.features.contains_key(key) && !taken.contains(key);
            if is_new && (key.0 != Class::Node || feature.is_thing()) {
                found.push(difference(*key, feature, How::Added));
            }
        }
        found.sort_by_key(|difference| (difference.class, difference.id));
        found
    }

    /// What is in the other map under another id: the same type in the same place, or the same
    /// members.
    fn renumbered(&self, other: &Self, tolerance_m: f64) -> BTreeMap<(Class, i64), i64> {
        let lone = |of: &Self, class: Class, than: &Self| -> Vec<i64> {
            let ids = of.features.keys().filter(|key| key.0 == class);
            let lone = ids.filter(|key| !than.features.contains_key(key));
            lone.map(|key| key.1).collect()
        };
        let mut found = BTreeMap::new();
        for class in [Class::Way, Class::Element, Class::Relation] {
            let mut free = lone(other, class, self);
            for id in lone(self, class, other) {
                let Some(feature) = self.features.get(&(class, id)) else {
                    continue;
                };
                let is_same = |new: &i64| {
                    let candidate = other.features.get(&(class, *new));
                    candidate.is_some_and(|new| feature.is_same(new, &found, tolerance_m))
                };
                if let Some(index) = free.iter().position(is_same) {
                    found.insert((class, id), free.remove(index));
                }
            }
        }
        found
    }
}

fn feature(thing: &Thing, points: Vec<[f64; 3]>) -> Feature {
    Feature {
        points,
        tags: thing.plain_tags(),
        members: thing.members.clone(),
    }
}

fn difference((class, id): (Class, i64), feature: &Feature, how: How) -> Difference {
    let said = |key: &str| feature.tags.get(key).map_or("", String::as_str);
    let kind = [said("type"), said("subtype")].join("/");
    Difference {
        class,
        id,
        kind: kind.trim_matches('/').to_owned(),
        how,
    }
}

impl Feature {
    /// A node that means something by itself, and is not only a vertex.
    fn is_thing(&self) -> bool {
        self.tags.get("type").is_some_and(|kind| !kind.is_empty())
    }

    fn compare(&self, other: &Self, tolerance_m: f64, note: &mut impl FnMut(How)) {
        let moved_m = apart_m(&self.points, &other.points);
        if moved_m > tolerance_m {
            note(How::Moved(moved_m));
        }
        let keys: BTreeSet<&String> = self.tags.keys().chain(other.tags.keys()).collect();
        let (mut types, mut others) = (Vec::new(), Vec::new());
        for key in keys {
            // Some editors write empty tags where others write none.
            let value = |side: &Self| side.tags.get(key).cloned().unwrap_or_default();
            let [old, new] = [self, other].map(value);
            if old == new || POSITION_TAGS.contains(&key.as_str()) {
                continue;
            }
            let [old, new] = [old, new].map(|value| match value.is_empty() {
                true => "-".to_owned(),
                false => value,
            });
            let said = format!("{key}: {old} -> {new}");
            match TYPE_TAGS.contains(&key.as_str()) {
                true => types.push(said),
                false => others.push(said),
            }
        }
        if !types.is_empty() {
            note(How::Retyped(types.join(", ")));
        }
        if !others.is_empty() {
            note(How::Retagged(others.join(", ")));
        }
        let [old, new]: [BTreeSet<_>; 2] = [self, other].map(|side| side.members.iter().collect());
        let (lost, gained) = (old.difference(&new).count(), new.difference(&old).count());
        if lost + gained > 0 {
            note(How::Rewired(lost, gained));
        }
    }

    fn is_same(
        &self,
        other: &Self,
        renumbered: &BTreeMap<(Class, i64), i64>,
        tolerance_m: f64,
    ) -> bool {
        if self.tags.get("type") != other.tags.get("type") {
            return false;
        }
        if self.points.is_empty() && other.points.is_empty() {
            let renamed = |(kind, id, role): &(String, i64, String)| {
                let id = renumbered.get(&(Class::Way, *id)).unwrap_or(id);
                (kind.clone(), *id, role.clone())
            };
            let members = self.members.iter().map(renamed);
            return !self.members.is_empty() && members.eq(other.members.iter().cloned());
        }
        // The ends are looked at first: nearly all pairs are told apart by them.
        let near = |(a, b): (Option<&[f64; 3]>, Option<&[f64; 3]>)| match (a, b) {
            (Some(a), Some(b)) => distance_m(*a, *b) <= tolerance_m,
            _ => false,
        };
        near((self.points.first(), other.points.first()))
            && near((self.points.last(), other.points.last()))
            && apart_m(&self.points, &other.points) <= tolerance_m
    }
}

/// The farthest that a vertex of one line is from the other line, in metres (Hausdorff's distance of
/// the vertices); heights count by themselves. Infinite where only one has vertices.
fn apart_m(one: &[[f64; 3]], other: &[[f64; 3]]) -> f64 {
    if one.is_empty() && other.is_empty() {
        return 0.0;
    }
    let farthest = |from: &[[f64; 3]], to: &[[f64; 3]]| {
        let far = from.iter().map(|point| beside_m(*point, to));
        far.fold(0.0, f64::max)
    };
    farthest(one, other).max(farthest(other, one))
}

/// Metres from a point to a line.
fn beside_m(point: [f64; 3], line: &[[f64; 3]]) -> f64 {
    if let [single] = line {
        return distance_m(point, *single).max((point[2] - single[2]).abs());
    }
    let to_segment = |pair: &[[f64; 3]]| {
        let along = offset_m(pair[0], pair[1]);
        let aside = offset_m(pair[0], point);
        let length2 = along[0].powi(2) + along[1].powi(2);
        let dot = along[0] * aside[0] + along[1] * aside[1];
        let share = if length2 > 0.0 {
            (dot / length2).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let plane_m = (aside[0] - share * along[0]).hypot(aside[1] - share * along[1]);
        let height_m = pair[0][2] + share * (pair[1][2] - pair[0][2]);
        plane_m.max((point[2] - height_m).abs())
    };
    let segments = line.windows(2).map(to_segment);
    segments.fold(f64::INFINITY, f64::min)
}
