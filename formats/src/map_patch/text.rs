//! Where in an OSM file each thing stands: spans of bytes, so that all others can stay as they are.

use std::collections::BTreeMap;
use std::ops::Range;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use super::PatchError;
use crate::map::LocalFrames;

/// An OSM file and where its nodes, ways and relations stand.
#[derive(Debug)]
pub struct OsmText {
    pub(crate) text: String,
    pub(crate) nodes: BTreeMap<i64, Thing>,
    pub(crate) ways: BTreeMap<i64, Thing>,
    pub(crate) relations: BTreeMap<i64, Thing>,
    /// Where things of each kind are added: behind the last of them.
    pub(crate) end_of_nodes: usize,
    pub(crate) end_of_ways: usize,
    /// `[longitude_deg, latitude_deg]` of nodes that have local coordinates only.
    located: BTreeMap<i64, [f64; 2]>,
}

/// A node, way or relation.
#[derive(Debug, Default, Clone)]
pub(crate) struct Thing {
    pub(crate) span: Range<usize>,
    pub(crate) attributes: BTreeMap<String, Said>,
    pub(crate) tags: BTreeMap<String, Said>,
    pub(crate) nodes: Vec<i64>,
    /// From the first `nd` to the last.
    pub(crate) nodes_span: Option<Range<usize>>,
    pub(crate) members: Vec<(String, i64, String)>,
    /// Where another child would stand.
    pub(crate) end_of_children: usize,
}

/// A value, and where it stands: between its quotes, and as a whole child.
#[derive(Debug, Default, Clone)]
pub(crate) struct Said {
    pub(crate) value: String,
    pub(crate) span: Range<usize>,
    pub(crate) child: Range<usize>,
}

impl Thing {
    pub(crate) fn number(&self, attribute: &str) -> Option<f64> {
        self.attributes.get(attribute)?.value.trim().parse().ok()
    }

    pub(crate) fn tag(&self, key: &str) -> &str {
        self.tags.get(key).map_or("", |said| said.value.trim())
    }

    /// Whether latitude and longitude are left empty.
    pub(crate) fn is_local(&self) -> bool {
        let is_empty = |key: &str| {
            let said = self.attributes.get(key);
            said.is_none_or(|said| said.value.trim().is_empty())
        };
        is_empty("lat") && is_empty("lon") && self.tags.contains_key("local_x")
    }

    pub(crate) fn plain_tags(&self) -> BTreeMap<String, String> {
        let pairs = self.tags.iter();
        pairs
            .map(|(key, said)| (key.clone(), said.value.clone()))
            .collect()
    }

    fn is_deleted(&self) -> bool {
        let says = |key: &str, value: &str| {
            self.attributes
                .get(key)
                .is_some_and(|said| said.value == value)
        };
        says("action", "delete") || says("visible", "false")
    }
}

impl OsmText {
    /// Reads a file that [`crate::map::read`] took: entities and limits are its affair.
    ///
    /// # Errors
    /// The bytes are no UTF-8, no XML, or not OSM.
    pub fn read(bytes: Vec<u8>, file: &str) -> Result<Self, PatchError> {
        let wrong = |offset: u64, what: String| PatchError::Text {
            file: file.to_owned(),
            offset,
            what,
        };
        let text = String::from_utf8(bytes).map_err(|error| {
            wrong(
                error.utf8_error().valid_up_to() as u64,
                "it is no UTF-8".to_owned(),
            )
        })?;
        let mut found = Self {
            text: String::new(),
            nodes: BTreeMap::new(),
            ways: BTreeMap::new(),
            relations: BTreeMap::new(),
            end_of_nodes: 0,
            end_of_ways: 0,
            located: BTreeMap::new(),
        };
        found
            .scan(&text)
            .map_err(|(offset, what)| wrong(offset, what))?;
        found.text = text;
        Ok(found)
    }

    /// The file with its local nodes on the Earth, as [`crate::map::read`] puts them there.
    #[must_use]
    pub fn located(mut self, frames: &mut LocalFrames) -> Self {
        for (id, node) in &self.nodes {
            let local = |axis| node.tag(axis).parse().ok();
            if !node.is_local() {
                continue;
            }
            let code = Some(node.tag("mgrs_code")).filter(|code| !code.is_empty());
            if let (Some(x), Some(y)) = (local("local_x"), local("local_y"))
                && let Ok(point) = frames.wgs84_from([x, y], code)
            {
                self.located.insert(*id, point);
            }
        }
        self
    }

    /// Whether nodes leave latitude and longitude empty.
    pub(crate) fn is_local(&self) -> bool {
        !self.located.is_empty()
    }

    fn scan(&mut self, text: &str) -> Result<(), (u64, String)> {
        let mut reader = Reader::from_str(text);
        let mut depth = 0;
        let mut open: Option<(String, Thing)> = None;
        loop {
            let start = reader.buffer_position() as usize;
            let event = reader
                .read_event()
                .map_err(|error| (start as u64, error.to_string()))?;
            let span = start..reader.buffer_position() as usize;
            let place = (start as u64, String::new());
            match &event {
                Event::Eof => return Ok(()),
                Event::Start(tag) | Event::Empty(tag) => {
                    let is_empty = matches!(event, Event::Empty(_));
                    let name: &str = tag.name().into_inner();
                    match (depth, &mut open) {
                        (0, _) if name != "osm" => {
                            return Err((place.0, format!("its root element is <{name}>")));
                        }
                        (0, _) => self.begin(span.end),
                        (1, _) => {
                            let thing = thing(tag, text, span.clone()).map_err(|w| (place.0, w))?;
                            match is_empty {
                                true => self.keep(name, thing),
                                false => open = Some((name.to_owned(), thing)),
                            }
                        }
                        (2, Some((_, thing))) => {
                            child(thing, tag, text, span).map_err(|w| (place.0, w))?;
                        }
                        _ => {}
                    }
                    depth += usize::from(!is_empty);
                }
                Event::End(_) => {
                    depth = depth.saturating_sub(1);
                    if depth == 1
                        && let Some((name, mut thing)) = open.take()
                    {
                        thing.span.end = span.end;
                        self.keep(&name, thing);
                    }
                }
                _ => {}
            }
        }
    }

    fn begin(&mut self, offset: usize) {
        self.end_of_nodes = offset;
        self.end_of_ways = offset;
    }

    /// Of one id, the first counts; what is deleted does not.
    fn keep(&mut self, name: &str, thing: Thing) {
        let end = thing.span.end;
        let id = thing.attributes.get("id");
        let id = id.and_then(|said| said.value.trim().parse().ok());
        let kept = match name {
            "node" => {
                self.end_of_nodes = end;
                self.end_of_ways = self.end_of_ways.max(end);
                &mut self.nodes
            }
            "way" => {
                self.end_of_ways = end;
                &mut self.ways
            }
            "relation" => &mut self.relations,
            _ => return,
        };
        if let Some(id) = id
            && !thing.is_deleted()
        {
            kept.entry(id).or_insert(thing);
        }
    }

    /// All ids of its nodes, ways and relations.
    pub(crate) fn ids(&self) -> impl Iterator<Item = i64> {
        let things = [&self.nodes, &self.ways, &self.relations];
        things.into_iter().flat_map(BTreeMap::keys).copied()
    }

    /// The vertices of a way, as far as its nodes are in the file.
    pub(crate) fn points(&self, way: &Thing) -> Vec<(i64, [f64; 3])> {
        let at = |id: &i64| Some((*id, self.position(*id)?));
        way.nodes.iter().filter_map(at).collect()
    }

    /// `[longitude_deg, latitude_deg, elevation_m]`.
    pub(crate) fn position(&self, id: i64) -> Option<[f64; 3]> {
        let node = self.nodes.get(&id)?;
        let elevation_m = node.tag("ele").parse().unwrap_or(0.0);
        let [longitude_deg, latitude_deg] = match self.located.get(&id) {
            Some(point) => *point,
            None => [node.number("lon")?, node.number("lat")?],
        };
        Some([longitude_deg, latitude_deg, elevation_m])
    }
}

type Wrong = String;

fn thing(tag: &BytesStart<'_>, text: &str, span: Range<usize>) -> Result<Thing, Wrong> {
    Ok(Thing {
        attributes: attributes(tag, text, &span)?,
        end_of_children: span.end,
        span,
        ..Thing::default()
    })
}

fn child(
    thing: &mut Thing,
    tag: &BytesStart<'_>,
    text: &str,
    span: Range<usize>,
) -> Result<(), Wrong> {
    let mut said = attributes(tag, text, &span)?;
    let number = |said: &BTreeMap<String, Said>| {
        let text = said.get("ref").map_or("", |said| said.value.trim());
        text.parse::<i64>()
            .map_err(|_| format!("{text:?} is no id"))
    };
    let name: &str = tag.name().into_inner();
    match name {
        "tag" => {
            if let (Some(key), Some(value)) = (said.remove("k"), said.remove("v")) {
                thing.tags.entry(key.value).or_insert(value);
            }
        }
        "nd" => {
            thing.nodes.push(number(&said)?);
            let begin = thing.nodes_span.as_ref().map_or(span.start, |s| s.start);
            thing.nodes_span = Some(begin..span.end);
        }
        "member" => {
            let mut text = |key: &str| said.remove(key).map(|s| s.value).unwrap_or_default();
            let (kind, role) = (text("type"), text("role"));
            thing.members.push((kind, number(&said)?, role));
        }
        _ => {}
    }
    thing.end_of_children = span.end;
    Ok(())
}

/// Values stand in the text itself, so their places follow from their addresses.
fn attributes(
    tag: &BytesStart<'_>,
    text: &str,
    child: &Range<usize>,
) -> Result<BTreeMap<String, Said>, Wrong> {
    let mut found = BTreeMap::new();
    let mut from = child.start;
    for attribute in tag.attributes().with_checks(false) {
        let attribute = attribute.map_err(|error| error.to_string())?;
        let raw: &str = attribute.value.as_ref();
        let name: &str = attribute.key.into_inner();
        // Attributes come in the order of the text: each is found behind the one before.
        let key_at = text[from..child.end]
            .find(name)
            .ok_or("an attribute is nowhere")?
            + from
            + name.len();
        let quote_at = text[key_at..child.end]
            .find(['"', '\''])
            .ok_or("an attribute has no quotes")?
            + key_at;
        let span = quote_at + 1..quote_at + 1 + raw.len();
        from = span.end;
        let value = attribute
            .normalized_value(XmlVersion::Implicit1_0)
            .map_err(|error| error.to_string())?
            .into_owned();
        let said = Said {
            value,
            span,
            child: child.clone(),
        };
        found.insert(name.to_owned(), said);
    }
    Ok(found)
}
