//! An OpenDRIVE document as a tree of those elements that say where paint is.

use crate::map::fence::Place;
use crate::map::xml::{Attributes, Take, shown};

/// One XML element and what is within it.
#[derive(Debug)]
pub(super) struct Node {
    pub(super) name: String,
    pub(super) place: Place,
    pub(super) attributes: Attributes,
    pub(super) children: Vec<Node>,
    /// Only of a `geoReference`.
    pub(super) text: String,
}

/// What is kept; everything else is passed over with all that is in it.
const KEPT: &[&str] = &[
    "OpenDRIVE",
    "header",
    "geoReference",
    "offset",
    "road",
    "planView",
    "geometry",
    "line",
    "arc",
    "spiral",
    "poly3",
    "paramPoly3",
    "elevationProfile",
    "elevation",
    "lateralProfile",
    "superelevation",
    "lanes",
    "laneOffset",
    "laneSection",
    "left",
    "center",
    "right",
    "lane",
    "width",
    "border",
    "roadMark",
    "type",
    "objects",
    "object",
    "outlines",
    "outline",
    "cornerRoad",
    "cornerLocal",
    "signals",
    "signal",
    "validity",
];

impl Node {
    /// The children called `name`, in the order of the file.
    pub(super) fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Self> {
        self.children.iter().filter(move |child| child.name == name)
    }

    /// Those called `name` within the children called `outer`.
    pub(super) fn all_in<'a>(
        &'a self,
        outer: &'a str,
        name: &'a str,
    ) -> impl Iterator<Item = &'a Self> {
        self.all(outer).flat_map(move |child| child.all(name))
    }

    /// An attribute, empty if there is none.
    pub(super) fn attribute(&self, key: &str) -> &str {
        self.attributes.get(key).map_or("", |value| value.trim())
    }

    /// An attribute that has to be there, as a finite number.
    pub(super) fn number(&self, key: &str) -> Result<f64, String> {
        let text = self.attribute(key);
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(format!(
                "the {key} of its <{}> ({}) is {:?}, not a number",
                self.name,
                self.place,
                shown(text)
            )),
        }
    }

    /// An attribute as a finite number, or `default` if there is none.
    pub(super) fn number_or(&self, key: &str, default: f64) -> Result<f64, String> {
        match self.attribute(key) {
            "" => Ok(default),
            _ => self.number(key),
        }
    }

    /// Several attributes as finite numbers.
    pub(super) fn numbers<const N: usize>(&self, keys: [&str; N]) -> Result<[f64; N], String> {
        let mut values = [0.0; N];
        for (value, key) in values.iter_mut().zip(keys) {
            *value = self.number(key)?;
        }
        Ok(values)
    }
}

/// Takes an OpenDRIVE document.
#[derive(Default)]
pub(in crate::map) struct Parser {
    root: Option<Node>,
    open: Vec<Node>,
    /// How many open elements are passed over.
    passed_over: usize,
}

impl Parser {
    /// The root; none if the document had none.
    pub(super) fn root(self) -> Option<Node> {
        self.root
    }
}

impl Take for Parser {
    fn start(
        &mut self,
        _depth: usize,
        name: &str,
        attributes: Attributes,
        place: Place,
    ) -> Result<(), String> {
        if self.passed_over > 0 || !KEPT.contains(&name) {
            self.passed_over += 1;
            return Ok(());
        }
        self.open.push(Node {
            name: name.to_owned(),
            place,
            attributes,
            children: Vec::new(),
            text: String::new(),
        });
        Ok(())
    }

    fn end(&mut self, _depth: usize) {
        if self.passed_over > 0 {
            self.passed_over -= 1;
            return;
        }
        let Some(closed) = self.open.pop() else {
            return;
        };
        match self.open.last_mut() {
            Some(parent) => parent.children.push(closed),
            None => self.root = Some(closed),
        }
    }

    fn text(&mut self, text: &str) {
        if self.passed_over > 0 {
            return;
        }
        if let Some(node) = self
            .open
            .last_mut()
            .filter(|node| node.name == "geoReference")
        {
            node.text.push_str(text);
        }
    }
}
