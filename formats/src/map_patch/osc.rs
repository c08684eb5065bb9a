//! A patch as an OsmChange: what is created, modified and deleted, each object whole and with the
//! version that it gets.

use std::collections::BTreeMap;
use std::io::{self, Write};

use super::lanelet2::{degrees, metres};
use super::local_grid::LocalGrid;
use super::plan::{Patch, WayBody};
use super::text::{OsmText, Thing};
use crate::map_write::escape;

type Tags = BTreeMap<String, String>;

impl Patch {
    /// Writes the patch as an OsmChange 0.6. A block that would be empty is left out.
    ///
    /// # Errors
    /// If `out` does not take the bytes.
    pub fn osc(&self, text: &OsmText, out: &mut impl Write) -> io::Result<()> {
        let grid = LocalGrid::of(text);
        let mut blocks = [
            ("create", self.created(&grid)),
            ("modify", self.modified(text, &grid)),
            ("delete", self.deleted(text)),
        ];
        writeln!(out, "<?xml version='1.0' encoding='UTF-8'?>")?;
        writeln!(out, "<osmChange version='0.6' generator='tilefold'>")?;
        for (name, objects) in &mut blocks {
            if !objects.is_empty() {
                writeln!(out, "  <{name}>\n{objects}  </{name}>")?;
            }
        }
        writeln!(out, "</osmChange>")
    }

    fn created(&self, grid: &LocalGrid) -> String {
        let mut objects = String::new();
        for (id, point) in &self.new_nodes {
            let mut tags = grid.tags(*point);
            if self.has_elevations {
                tags.insert("ele".to_owned(), metres(point[2]));
            }
            if let Some(code) = grid.mgrs_code() {
                tags.insert("mgrs_code".to_owned(), code.to_owned());
            }
            objects.push_str(&node(*id, 1, *point, &tags));
        }
        for (id, body) in &self.new_ways {
            objects.push_str(&way(*id, 1, body));
        }
        objects
    }

    fn modified(&self, text: &OsmText, grid: &LocalGrid) -> String {
        let mut objects = String::new();
        for (id, point) in &self.moved_nodes {
            let Some(known) = text.nodes.get(id) else {
                continue;
            };
            let mut tags = known.plain_tags();
            let mut said = grid.tags(*point);
            said.insert("ele".to_owned(), metres(point[2]));
            said.retain(|key, _| tags.contains_key(key));
            tags.extend(said);
            objects.push_str(&node(*id, next_version(known), *point, &tags));
        }
        for (id, body) in &self.changed_ways {
            if let Some(known) = text.ways.get(id) {
                objects.push_str(&way(*id, next_version(known), body));
            }
        }
        objects
    }

    /// Ways first: nothing may refer to a node that is gone.
    fn deleted(&self, text: &OsmText) -> String {
        let mut objects = String::new();
        for id in &self.deleted_ways {
            if let Some(known) = text.ways.get(id) {
                let version = next_version(known);
                objects.push_str(&format!("    <way id='{id}' version='{version}'/>\n"));
            }
        }
        for id in &self.deleted_nodes {
            if let (Some(known), Some(point)) = (text.nodes.get(id), text.position(*id)) {
                objects.push_str(&node(*id, next_version(known), point, &Tags::new()));
            }
        }
        objects
    }
}

/// A map that does not count versions is at its first.
fn next_version(thing: &Thing) -> u64 {
    let version = thing.attributes.get("version");
    let version = version.and_then(|said| said.value.parse::<u64>().ok());
    version.unwrap_or(1).saturating_add(1)
}

fn node(id: i64, version: u64, point: [f64; 3], tags: &Tags) -> String {
    let [lon, lat] = [point[0], point[1]].map(degrees);
    let open = format!("    <node id='{id}' version='{version}' lat='{lat}' lon='{lon}'");
    match tags.is_empty() {
        true => format!("{open}/>\n"),
        false => format!("{open}>{}</node>\n", children(&[], tags)),
    }
}

fn way(id: i64, version: u64, body: &WayBody) -> String {
    let children = children(&body.nodes, &body.tags);
    format!("    <way id='{id}' version='{version}'>{children}</way>\n")
}

fn children(nodes: &[i64], tags: &Tags) -> String {
    let nodes = nodes.iter().map(|node| format!("<nd ref='{node}'/>"));
    let tags = tags
        .iter()
        .map(|(key, value)| format!("<tag k='{}' v='{}'/>", escape(key), escape(value)));
    nodes.chain(tags).collect()
}
