//! OSM XML as nodes, ways and relations, in one pass over the file and in linear time.
//!
//! Nothing is judged here but the XML itself: a node with a bad number stays in the list together
//! with its complaint, so that only what uses it is set aside.

use std::collections::{BTreeMap, HashMap};
use std::io::Read;

use quick_xml::XmlVersion;
use quick_xml::escape::EscapeError;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use tilefold_schemas::limits::{
    MAX_MAP_BYTES, MAX_MAP_DEPTH, MAX_POINTS_PER_ELEMENT, MAX_TAG_BYTES, MAX_TAGS_PER_ELEMENT,
    MAX_XML_ATTRIBUTES,
};

use super::error::MapError;
use super::fence::{Bound, Fence, MAX_PIECE_BYTES, Place};

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
    /// Marked as deleted.
    Deleted,
    /// Not usable, for a reason that says where.
    Wrong(Box<str>),
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

/// Reads the whole of `source`; `file` is its name in errors.
pub(super) fn read(source: impl Read, file: &str) -> Result<Osm, MapError> {
    let mut reader = Reader::from_reader(Fence::new(source));
    reader.config_mut().expand_empty_elements = true;
    let mut parser = Parser::new(file);
    let mut buffer = Vec::new();
    loop {
        buffer.clear();
        parser.place = reader.get_mut().next_piece();
        let event = match reader.read_event_into(&mut buffer) {
            Ok(event) => event,
            Err(error) => return Err(parser.broken(reader.get_ref(), &error)),
        };
        if matches!(event, Event::Eof) {
            return parser.finish();
        }
        parser.take(&event)?;
    }
}

/// Attributes of one XML element that mean something here, unescaped.
type Attributes = HashMap<String, String>;

/// What is open between its start and its end.
enum Open {
    Node { thing: Thing, at: Box<Attributes> },
    Way(Way),
    Relation(Relation),
}

struct Parser<'a> {
    file: &'a str,
    place: Place,
    depth: usize,
    has_root: bool,
    open: Option<Open>,
    osm: Osm,
}

impl<'a> Parser<'a> {
    fn new(file: &'a str) -> Self {
        Self {
            file,
            place: Place { line: 1, column: 1 },
            depth: 0,
            has_root: false,
            open: None,
            osm: Osm::default(),
        }
    }

    fn take(&mut self, event: &Event<'_>) -> Result<(), MapError> {
        match event {
            Event::Start(start) => self.start(start),
            Event::End(_) => {
                self.end();
                Ok(())
            }
            Event::DocType(_) => Err(self.forbidden("a document type (DOCTYPE)".to_owned())),
            Event::GeneralRef(reference) if !reference.is_char_ref() => {
                self.check_entity(reference)
            }
            Event::Decl(declaration) => match declaration.encoding() {
                Some(Ok(name)) if !is_utf8(&name) => {
                    Err(self.damaged(format!("its encoding is {name:?}, only UTF-8 is read")))
                }
                _ => Ok(()),
            },
            Event::Text(text) if self.depth == 0 && !text.trim().is_empty() => {
                Err(self.damaged("text stands outside of the root element".to_owned()))
            }
            _ => Ok(()),
        }
    }

    fn check_entity(&self, name: &str) -> Result<(), MapError> {
        match name {
            "lt" | "gt" | "amp" | "apos" | "quot" => Ok(()),
            _ => Err(self.forbidden(format!("the entity &{};", shown(name)))),
        }
    }

    fn start(&mut self, start: &BytesStart<'_>) -> Result<(), MapError> {
        if self.depth >= MAX_MAP_DEPTH {
            return Err(self.limit("the depth of XML", MAX_MAP_DEPTH, "MAX_MAP_DEPTH"));
        }
        let attributes = self.attributes(start)?;
        let name = start.name();
        match (self.depth, name.as_ref()) {
            (0, root) => self.root(root, attributes)?,
            (1, "node" | "way" | "relation") => self.open(name.as_ref(), attributes),
            (1, "MetaInfo") => self.osm.about.extend(attributes),
            (2, "tag") => self.tag(attributes),
            (2, "nd") => self.node_of_way(&attributes),
            (2, "member") => self.member(&attributes),
            _ => {}
        }
        self.depth += 1;
        Ok(())
    }

    fn root(&mut self, root: &str, mut attributes: Attributes) -> Result<(), MapError> {
        if self.has_root {
            return Err(self.damaged("a second root element follows the first".to_owned()));
        }
        self.has_root = true;
        if root != "osm" {
            return Err(MapError::Format {
                file: self.file.to_owned(),
                looks_like: match root {
                    "OpenDRIVE" => "OpenDRIVE".to_owned(),
                    other => format!("XML with the root element <{}>", shown(other)),
                },
            });
        }
        if let Some(generator) = attributes.remove("generator") {
            self.osm.about.insert("generator".to_owned(), generator);
        }
        Ok(())
    }

    fn end(&mut self) {
        self.depth = self.depth.saturating_sub(1);
        if self.depth != 1 {
            return;
        }
        match self.open.take() {
            Some(Open::Node { thing, at }) => self.close_node(thing, &at),
            Some(Open::Way(way)) => self.osm.ways.push(way),
            Some(Open::Relation(relation)) => self.osm.relations.push(relation),
            None => {}
        }
    }

    fn open(&mut self, name: &str, attributes: Attributes) {
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
            place: self.place,
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
            None => position(at, &thing.tags),
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

    /// At most [`MAX_XML_ATTRIBUTES`], so that looking for doubles stays cheap.
    fn attributes(&self, start: &BytesStart<'_>) -> Result<Attributes, MapError> {
        let mut found = Attributes::new();
        for (index, attribute) in start.attributes().with_checks(false).enumerate() {
            if index >= MAX_XML_ATTRIBUTES {
                return Err(self.limit(
                    "the number of attributes",
                    MAX_XML_ATTRIBUTES,
                    "MAX_XML_ATTRIBUTES",
                ));
            }
            let attribute =
                attribute.map_err(|error| self.damaged(format!("bad attribute: {error}")))?;
            let value = attribute
                .normalized_value(XmlVersion::Implicit1_0)
                .map_err(|error| self.bad_value(&error))?;
            let key = attribute.key.as_ref().to_owned();
            if found.insert(key, value.into_owned()).is_some() {
                return Err(self.damaged(format!(
                    "the attribute {:?} appears twice",
                    shown(attribute.key.as_ref())
                )));
            }
        }
        Ok(found)
    }

    fn finish(self) -> Result<Osm, MapError> {
        if !self.has_root {
            return Err(self.damaged("it ends before its root element".to_owned()));
        }
        if self.depth > 0 {
            return Err(self.damaged("it ends in the middle: elements are still open".to_owned()));
        }
        Ok(self.osm)
    }

    fn broken<R: Read>(&self, fence: &Fence<R>, error: &quick_xml::Error) -> MapError {
        match (fence.hit(), error) {
            (Some(Bound::Piece), _) => self.limit(
                "one piece of XML",
                MAX_PIECE_BYTES,
                "MAX_XML_ATTRIBUTES * MAX_TAG_BYTES",
            ),
            (Some(Bound::File), _) => MapError::TooLarge {
                file: self.file.to_owned(),
                bytes: MAX_MAP_BYTES + 1,
                limit: MAX_MAP_BYTES,
            },
            (None, quick_xml::Error::Io(source)) => MapError::Io {
                file: self.file.to_owned(),
                source: std::io::Error::new(source.kind(), source.to_string()),
            },
            (None, error) => self.damaged(format!("{error} (noticed at {})", fence.place())),
        }
    }

    fn bad_value(&self, error: &quick_xml::Error) -> MapError {
        match error {
            quick_xml::Error::Escape(EscapeError::UnrecognizedEntity(_, name)) => {
                self.forbidden(format!("the entity &{};", shown(name)))
            }
            other => self.damaged(format!("bad attribute value: {other}")),
        }
    }

    fn damaged(&self, what: String) -> MapError {
        MapError::Xml {
            file: self.file.to_owned(),
            line: self.place.line,
            column: self.place.column,
            what,
        }
    }

    fn forbidden(&self, what: String) -> MapError {
        MapError::Forbidden {
            file: self.file.to_owned(),
            line: self.place.line,
            column: self.place.column,
            what,
        }
    }

    fn limit(&self, what: &'static str, limit: usize, name: &'static str) -> MapError {
        MapError::Limit {
            file: self.file.to_owned(),
            line: self.place.line,
            column: self.place.column,
            what,
            limit: limit as u64,
            name,
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

fn position(at: &Attributes, tags: &BTreeMap<String, String>) -> Result<Node, String> {
    let text = |key: &str| at.get(key).map_or("", |value| value.trim());
    if text("lat").is_empty() && text("lon").is_empty() && tags.contains_key("local_x") {
        return Err(
            "it has local_x and local_y but no lat and lon; local coordinates are not read yet: \
             export the map with lat and lon"
                .to_owned(),
        );
    }
    let longitude_deg = coordinate("lon", text("lon"), 180.0)?;
    let latitude_deg = coordinate("lat", text("lat"), 90.0)?;
    let elevation = tags.get("ele").map_or("", |value| value.trim());
    if elevation.is_empty() {
        return Ok(Node::Flat([longitude_deg, latitude_deg]));
    }
    let elevation_m = coordinate("ele", elevation, MAX_ELEVATION_M)?;
    Ok(Node::At([longitude_deg, latitude_deg, elevation_m]))
}

/// No road is higher or deeper than this.
const MAX_ELEVATION_M: f64 = 20_000.0;

fn coordinate(name: &str, text: &str, limit: f64) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.abs() <= limit => Ok(value),
        Ok(value) => Err(format!("{name} is {value}, outside of -{limit}..={limit}")),
        Err(_) => Err(format!("{name} is {:?}, not a number", shown(text))),
    }
}

fn is_utf8(encoding: &str) -> bool {
    ["utf-8", "utf8", "us-ascii", "ascii"].contains(&encoding.to_ascii_lowercase().as_str())
}

/// Text from outside, short enough for a message.
fn shown(text: &str) -> String {
    text.chars().take(60).collect()
}
