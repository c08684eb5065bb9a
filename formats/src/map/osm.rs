//! OSM XML as nodes, ways and relations, in one pass over the file and in linear time.
//!
//! Nothing is judged here but the XML itself: a node with a bad number stays in the list together
//! with its complaint, so that only what uses it is set aside.

use std::collections::{BTreeMap, HashMap};

use tilefold_schemas::limits::{MAX_POINTS_PER_ELEMENT, MAX_TAG_BYTES, MAX_TAGS_PER_ELEMENT};

use super::fence::Place;
use super::local_frames::LocalFrames;
use super::xml::{Attributes, Take, shown};

/// A file's content.
#[derive(Debug, Default)]
pub(super) struct Osm {
    pub(super) nodes: HashMap<i64, Node>,
    pub(super) ways: Vec<Way>,
    pub(super) relations: Vec<Relation>,
    pub(super) about: BTreeMap<String, String>,
    pub(super) deleted: u64,
}

/// A point.
#[derive(Debug, PartialEq)]
pub(super) enum Node {
    /// `[longitude_deg, latitude_deg, elevation_m]`.
    At([f64; 3]),
    /// `[longitude_deg, latitude_deg]` of a node without an elevation.
    Flat([f64; 2]),
    /// In metres of a frame that the file does not state; see [`Osm::locate`].
    Local(Box<LocalNode>),
    /// Marked as deleted.
    Deleted,
    /// Not usable, for a reason that says where.
    Wrong(Box<str>),
}

/// A node of Autoware's without latitude and longitude.
#[derive(Debug)]
pub(super) struct LocalNode {
    local_m: [f64; 2],
    elevation_m: Option<f64>,
    mgrs_code: Option<String>,
    place: Place,
}

/// The same node may stand in a file twice.
impl PartialEq for LocalNode {
    fn eq(&self, other: &Self) -> bool {
        self.local_m == other.local_m
            && self.elevation_m == other.elevation_m
            && self.mgrs_code == other.mgrs_code
    }
}

/// What ways and relations share.
#[derive(Debug)]
pub(super) struct Thing {
    pub(super) id: i64,
    pub(super) place: Place,
    pub(super) tags: BTreeMap<String, String>,
    /// The first thing that is wrong with it.
    pub(super) wrong: Option<String>,
}

impl Osm {
    /// Puts local nodes on the Earth. One whose frame nobody knows becomes wrong.
    pub(super) fn locate(&mut self, frames: &mut LocalFrames) {
        for (id, node) in &mut self.nodes {
            let Node::Local(local) = node else { continue };
            let found = frames.wgs84_from(local.local_m, local.mgrs_code.as_deref());
            *node = match (found, local.elevation_m) {
                (Ok([longitude_deg, latitude_deg]), Some(elevation_m)) => {
                    Node::At([longitude_deg, latitude_deg, elevation_m])
                }
                (Ok(point), None) => Node::Flat(point),
                (Err(why), _) => Node::Wrong(format!("node {id} ({}): {why}", local.place).into()),
            };
        }
    }

    /// The vertices of a way, `[longitude_deg, latitude_deg, elevation_m]`; 0 m where no elevation is
    /// stated.
    pub(super) fn points(&self, way: &Way) -> Result<Vec<[f64; 3]>, String> {
        way.nodes
            .iter()
            .map(|id| match self.nodes.get(id) {
                Some(Node::At(point)) => Ok(*point),
                Some(Node::Flat([longitude_deg, latitude_deg])) => {
                    Ok([*longitude_deg, *latitude_deg, 0.0])
                }
                Some(Node::Local(_)) => Err(format!("its node {id} has local coordinates only")),
                Some(Node::Deleted) => Err(format!("its node {id} is deleted")),
                Some(Node::Wrong(why)) => Err(format!("its {why}")),
                None => Err(format!("its node {id} is not in the file")),
            })
            .collect()
    }
}

#[derive(Debug)]
pub(super) struct Way {
    pub(super) thing: Thing,
    pub(super) nodes: Vec<i64>,
}

#[derive(Debug)]
pub(super) struct Relation {
    pub(super) thing: Thing,
    pub(super) members: Vec<Member>,
}

#[derive(Debug, PartialEq)]
pub(super) struct Member {
    pub(super) is_way: bool,
    pub(super) id: i64,
    pub(super) role: String,
}

/// What is open between its start and its end.
enum Open {
    Node { thing: Thing, at: Box<Attributes> },
    Way(Way),
    Relation(Relation),
}

/// Takes an OSM document.
#[derive(Default)]
pub(super) struct Parser {
    open: Option<Open>,
    osm: Osm,
}

impl Take for Parser {
    fn start(
        &mut self,
        depth: usize,
        name: &str,
        mut attributes: Attributes,
        place: Place,
    ) -> Result<(), String> {
        match (depth, name) {
            (0, _) => {
                let generator = attributes.remove("generator");
                let named = generator.map(|generator| ("generator".to_owned(), generator));
                self.osm.about.extend(named);
            }
            (1, "node" | "way" | "relation") => self.open(name, attributes, place),
            (1, _) if name.eq_ignore_ascii_case("MetaInfo") => self.osm.about.extend(attributes),
            (2, "tag") => self.tag(attributes),
            (2, "nd") => self.node_of_way(&attributes),
            (2, "member") => self.member(&attributes),
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, depth: usize) {
        if depth != 1 {
            return;
        }
        match self.open.take() {
            Some(Open::Node { thing, at }) => self.close_node(thing, &at),
            Some(Open::Way(way)) => self.osm.ways.push(way),
            Some(Open::Relation(relation)) => self.osm.relations.push(relation),
            None => {}
        }
    }
}

impl Parser {
    /// What was read.
    pub(super) fn finish(self) -> Osm {
        self.osm
    }

    fn open(&mut self, name: &str, attributes: Attributes, place: Place) {
        let id = attributes.get("id").map_or("", String::as_str);
        let number = id.trim().parse().ok();
        let is_deleted = attributes.get("action").is_some_and(|a| a == "delete")
            || attributes.get("visible").is_some_and(|v| v == "false");
        if is_deleted {
            self.osm.deleted += 1;
            if let ("node", Some(id)) = (name, number) {
                self.osm.nodes.insert(id, Node::Deleted);
            }
            return;
        }
        let thing = Thing {
            id: number.unwrap_or(0),
            place,
            tags: BTreeMap::new(),
            wrong: (number.is_none())
                .then(|| format!("its id {:?} is not a 64-bit integer", shown(id))),
        };
        self.open = Some(match name {
            "way" => Open::Way(Way {
                thing,
                nodes: Vec::new(),
            }),
            "relation" => Open::Relation(Relation {
                thing,
                members: Vec::new(),
            }),
            _ => Open::Node {
                thing,
                at: Box::new(attributes),
            },
        });
    }

    fn close_node(&mut self, thing: Thing, at: &Attributes) {
        if thing.wrong.is_some() {
            // Without an id nobody can refer to it.
            return;
        }
        let read = match thing.wrong {
            None => position(at, &thing),
            Some(wrong) => Err(wrong),
        };
        let node = match read {
            Ok(node) => node,
            Err(why) => {
                let text = format!("node {} ({}): {why}", thing.id, thing.place);
                Node::Wrong(text.into())
            }
        };
        match self.osm.nodes.get(&thing.id) {
            Some(before) if *before != node && *before != Node::Deleted => {
                let text = format!(
                    "node {} appears twice with different positions (again at {})",
                    thing.id, thing.place
                );
                self.osm.nodes.insert(thing.id, Node::Wrong(text.into()));
            }
            _ => {
                self.osm.nodes.insert(thing.id, node);
            }
        }
    }

    fn tag(&mut self, mut attributes: Attributes) {
        let Some(thing) = self.open_thing() else {
            return;
        };
        let (Some(key), Some(value)) = (attributes.remove("k"), attributes.remove("v")) else {
            thing.complain(|| "a tag has no k or no v".to_owned());
            return;
        };
        if key.len().max(value.len()) > MAX_TAG_BYTES {
            thing.complain(|| {
                format!(
                    "a tag is over {MAX_TAG_BYTES} bytes (MAX_TAG_BYTES): {:?}",
                    shown(&key)
                )
            });
        } else if thing.tags.len() >= MAX_TAGS_PER_ELEMENT {
            thing.complain(|| {
                format!("it has over {MAX_TAGS_PER_ELEMENT} tags (MAX_TAGS_PER_ELEMENT)")
            });
        } else if thing.tags.get(&key).is_some_and(|before| *before != value) {
            thing.complain(|| format!("its tag {:?} has two values", shown(&key)));
        } else {
            thing.tags.insert(key, value);
        }
    }

    fn node_of_way(&mut self, attributes: &Attributes) {
        let Some(Open::Way(way)) = &mut self.open else {
            return;
        };
        match reference(attributes) {
            Err(why) => way.thing.complain(|| why),
            Ok(_) if way.nodes.len() >= MAX_POINTS_PER_ELEMENT => way.thing.complain(|| {
                format!("it has over {MAX_POINTS_PER_ELEMENT} points (MAX_POINTS_PER_ELEMENT)")
            }),
            Ok(node) => way.nodes.push(node),
        }
    }

    fn member(&mut self, attributes: &Attributes) {
        let Some(Open::Relation(relation)) = &mut self.open else {
            return;
        };
        match reference(attributes) {
            Err(why) => relation.thing.complain(|| why),
            Ok(_) if relation.members.len() >= MAX_POINTS_PER_ELEMENT => {
                relation.thing.complain(|| {
                    format!("it has over {MAX_POINTS_PER_ELEMENT} members (MAX_POINTS_PER_ELEMENT)")
                });
            }
            Ok(id) => relation.members.push(Member {
                is_way: attributes.get("type").is_some_and(|kind| kind == "way"),
                id,
                role: attributes.get("role").cloned().unwrap_or_default(),
            }),
        }
    }

    fn open_thing(&mut self) -> Option<&mut Thing> {
        match &mut self.open {
            Some(Open::Node { thing, .. }) => Some(thing),
            Some(Open::Way(way)) => Some(&mut way.thing),
            Some(Open::Relation(relation)) => Some(&mut relation.thing),
            None => None,
        }
    }
}

impl Thing {
    /// Keeps the first complaint.
    fn complain(&mut self, why: impl FnOnce() -> String) {
        if self.wrong.is_none() {
            self.wrong = Some(why());
        }
    }
}

fn reference(attributes: &Attributes) -> Result<i64, String> {
    let text = attributes.get("ref").map_or("", String::as_str);
    text.trim().parse().map_err(|_| {
        format!(
            "it refers to {:?}, which is not a 64-bit integer",
            shown(text)
        )
    })
}

fn position(at: &Attributes, thing: &Thing) -> Result<Node, String> {
    let text = |key: &str| at.get(key).map_or("", |value| value.trim());
    let tag = |key: &str| thing.tags.get(key).map_or("", |value| value.trim());
    let elevation_m = match tag("ele") {
        "" => None,
        elevation => Some(coordinate("ele", elevation, MAX_ELEVATION_M)?),
    };
    if text("lat").is_empty() && text("lon").is_empty() && thing.tags.contains_key("local_x") {
        let local = |axis| coordinate(axis, tag(axis), MAX_LOCAL_M);
        return Ok(Node::Local(Box::new(LocalNode {
            local_m: [local("local_x")?, local("local_y")?],
            elevation_m,
            mgrs_code: Some(tag("mgrs_code").to_owned()).filter(|code| !code.is_empty()),
            place: thing.place,
        })));
    }
    let longitude_deg = coordinate("lon", text("lon"), 180.0)?;
    let latitude_deg = coordinate("lat", text("lat"), 90.0)?;
    Ok(match elevation_m {
        Some(elevation_m) => Node::At([longitude_deg, latitude_deg, elevation_m]),
        None => Node::Flat([longitude_deg, latitude_deg]),
    })
}

/// Farther from its origin no plane is a map.
const MAX_LOCAL_M: f64 = 1_000_000.0;

/// No road is higher or deeper than this.
const MAX_ELEVATION_M: f64 = 20_000.0;

fn coordinate(name: &str, text: &str, limit: f64) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.abs() <= limit => Ok(value),
        Ok(value) => Err(format!("{name} is {value}, outside of -{limit}..={limit}")),
        Err(_) => Err(format!("{name} is {:?}, not a number", shown(text))),
    }
}
