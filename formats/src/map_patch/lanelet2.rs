//! A patch as a map: the bytes of the file, but for what the patch is about.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::Range;

use super::local_grid::LocalGrid;
use super::plan::{Patch, WayBody};
use super::text::{OsmText, Thing};
use crate::map_write::escape;

impl Patch {
    /// The map with the patch in it. A patch of nothing gives the bytes of the file.
    #[must_use]
    pub fn lanelet2(&self, text: &OsmText) -> Vec<u8> {
        let mut edits = Edits::new(text);
        let grid = LocalGrid::of(text);
        for (id, point) in &self.moved_nodes {
            if let Some(node) = text.nodes.get(id) {
                edits.move_node(node, *point, &grid);
            }
        }
        for (id, body) in &self.changed_ways {
            if let Some(way) = text.ways.get(id) {
                edits.change_way(way, body);
            }
        }
        let gone = (self.deleted_nodes.iter().map(|id| text.nodes.get(id)))
            .chain(self.deleted_ways.iter().map(|id| text.ways.get(id)));
        for thing in gone.flatten() {
            edits.delete(&thing.span);
        }
        let mut nodes = String::new();
        for (id, point) in &self.new_nodes {
            nodes.push_str(&edits.style.node(*id, *point, self.has_elevations, &grid));
        }
        edits.put(text.end_of_nodes..text.end_of_nodes, nodes);
        let mut ways = String::new();
        for (id, body) in &self.new_ways {
            ways.push_str(&edits.style.way(*id, body));
        }
        edits.put(text.end_of_ways..text.end_of_ways, ways);
        edits.apply()
    }
}

/// How the file is written, so that what is added looks like the rest.
struct Style {
    quote: char,
    line: &'static str,
    indent: String,
    /// Latitude and longitude stay empty.
    is_local: bool,
}

impl Style {
    fn of(text: &OsmText) -> Self {
        let first = text
            .nodes
            .values()
            .map(|node| &node.span)
            .min_by_key(|span| span.start);
        let before = first.map_or("", |span| &text.text[..span.start]);
        let indent = before.rsplit('\n').next().unwrap_or("");
        let is_blank = indent.chars().all(|c| c == ' ' || c == '\t');
        let said = first.map_or("", |span| &text.text[span.clone()]);
        Self {
            quote: if said.contains('"') { '"' } else { '\'' },
            line: if text.text.contains("\r\n") {
                "\r\n"
            } else {
                "\n"
            },
            indent: if is_blank {
                indent.to_owned()
            } else {
                String::new()
            },
            is_local: text.is_local(),
        }
    }

    fn attribute(&self, name: &str, value: &str) -> String {
        format!(" {name}={q}{}{q}", self.escaped(value), q = self.quote)
    }

    fn escaped(&self, value: &str) -> String {
        match self.quote {
            '"' => escape(value).replace('"', "&quot;"),
            _ => escape(value),
        }
    }

    fn tag(&self, key: &str, value: &str) -> String {
        let [key, value] = [("k", key), ("v", value)].map(|(n, v)| self.attribute(n, v));
        format!("<tag{key}{value}/>")
    }

    fn child(&self) -> String {
        format!("{}{}{}", self.line, self.indent, self.indent)
    }

    fn node(&self, id: i64, point: [f64; 3], with_elevation: bool, grid: &LocalGrid) -> String {
        let written = |degree| match self.is_local {
            true => String::new(),
            false => degrees(degree),
        };
        let [id, lat, lon] = [
            ("id", id.to_string()),
            ("lat", written(point[1])),
            ("lon", written(point[0])),
        ]
        .map(|(name, value)| self.attribute(name, &value));
        let mut tags = grid.tags(point);
        if with_elevation {
            tags.insert("ele".to_owned(), metres(point[2]));
        }
        if let Some(code) = grid.mgrs_code() {
            tags.insert("mgrs_code".to_owned(), code.to_owned());
        }
        let version = self.attribute("version", "1");
        let open = format!("{}{}<node{id}{version}{lat}{lon}", self.line, self.indent);
        self.closed(
            open,
            "node",
            tags.iter().map(|(key, value)| self.tag(key, value)),
        )
    }

    fn way(&self, id: i64, body: &WayBody) -> String {
        let id = self.attribute("id", &id.to_string());
        let version = self.attribute("version", "1");
        let open = format!("{}{}<way{id}{version}", self.line, self.indent);
        let nodes = body.nodes.iter().map(|node| self.nd(*node));
        let tags = body.tags.iter().map(|(key, value)| self.tag(key, value));
        self.closed(open, "way", nodes.chain(tags))
    }

    fn nd(&self, node: i64) -> String {
        format!("<nd{}/>", self.attribute("ref", &node.to_string()))
    }

    fn closed(
        &self,
        mut open: String,
        name: &str,
        children: impl Iterator<Item = String>,
    ) -> String {
        let children: Vec<String> = children.collect();
        if children.is_empty() {
            open.push_str("/>");
            return open;
        }
        open.push('>');
        for child in children {
            open.push_str(&self.child());
            open.push_str(&child);
        }
        // Writing to a string does not fail.
        let _ = write!(open, "{}{}</{name}>", self.line, self.indent);
        open
    }
}

/// Replacements of spans that do not overlap.
struct Edits<'a> {
    text: &'a OsmText,
    style: Style,
    edits: Vec<(Range<usize>, String)>,
}

impl<'a> Edits<'a> {
    fn new(text: &'a OsmText) -> Self {
        Self {
            text,
            style: Style::of(text),
            edits: Vec::new(),
        }
    }

    fn put(&mut self, span: Range<usize>, text: String) {
        if !(span.is_empty() && text.is_empty()) {
            self.edits.push((span, text));
        }
    }

    fn apply(mut self) -> Vec<u8> {
        // Stable: what is added in one place stays in its order.
        self.edits.sort_by_key(|(span, _)| (span.start, span.end));
        let text = &self.text.text;
        let mut out = String::with_capacity(text.len() + 1024);
        let mut from = 0;
        for (span, new) in &self.edits {
            out.push_str(text.get(from..span.start).unwrap_or_default());
            out.push_str(new);
            from = from.max(span.end);
        }
        out.push_str(&text[from..]);
        out.into_bytes()
    }

    fn set(&mut self, thing: &Thing, attribute: &str, value: &str) {
        if let Some(said) = thing.attributes.get(attribute) {
            let escaped = escape(value).replace('"', "&quot;");
            self.put(said.span.clone(), escaped);
        }
    }

    fn bump(&mut self, thing: &Thing) {
        let version = thing.attributes.get("version");
        if let Some(version) = version.and_then(|said| said.value.parse::<u64>().ok()) {
            self.set(thing, "version", &version.saturating_add(1).to_string());
        }
    }

    fn move_node(&mut self, node: &Thing, point: [f64; 3], grid: &LocalGrid) {
        self.bump(node);
        if !node.is_local() {
            self.set(node, "lon", &degrees(point[0]));
            self.set(node, "lat", &degrees(point[1]));
        }
        let mut said = grid.tags(point);
        said.insert("ele".to_owned(), metres(point[2]));
        for (key, value) in said {
            if let Some(tag) = node.tags.get(&key) {
                self.put(tag.span.clone(), value);
            }
        }
    }

    fn change_way(&mut self, way: &Thing, body: &WayBody) {
        self.bump(way);
        if way.nodes != body.nodes
            && let Some(span) = &way.nodes_span
        {
            let nodes: Vec<String> = body.nodes.iter().map(|node| self.style.nd(*node)).collect();
            self.put(span.clone(), nodes.join(&self.style.child()));
        }
        self.change_tags(way, &body.tags);
    }

    fn change_tags(&mut self, way: &Thing, tags: &BTreeMap<String, String>) {
        for (key, said) in &way.tags {
            match tags.get(key) {
                Some(value) if *value == said.value => {}
                Some(value) => {
                    let escaped = escape(value).replace('"', "&quot;");
                    self.put(said.span.clone(), escaped);
                }
                None => self.delete(&said.child),
            }
        }
        let mut added = String::new();
        for (key, value) in tags.iter().filter(|(key, _)| !way.tags.contains_key(*key)) {
            added.push_str(&self.style.child());
            added.push_str(&self.style.tag(key, value));
        }
        self.put(way.end_of_children..way.end_of_children, added);
    }

    /// Takes the blank before it along, and one end of line.
    fn delete(&mut self, span: &Range<usize>) {
        let before = &self.text.text[..span.start];
        let kept = before.trim_end_matches([' ', '\t']);
        let kept = kept
            .strip_suffix("\r\n")
            .or_else(|| kept.strip_suffix('\n'))
            .unwrap_or(before);
        self.put(kept.len()..span.end, String::new());
    }
}

/// A hundredth of a millimetre.
pub(super) fn degrees(value: f64) -> String {
    format!("{value:.10}")
}

pub(super) fn metres(value: f64) -> String {
    format!("{value:.3}")
}
