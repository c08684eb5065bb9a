//! Which map an XML document is: its root element says so.

use std::io::Read;

use super::error::MapError;
use super::fence::Place;
use super::opendrive::{self, OpenDrive};
use super::osm::{self, Osm};
use super::xml::{self, Attributes, Take, shown};

/// A map's content, in the terms of its format.
pub(super) enum Document {
    Osm(Osm),
    OpenDrive(OpenDrive),
}

/// Reads the whole of `source`; `file` is its name in errors.
pub(super) fn read(source: impl Read, file: &str) -> Result<Document, MapError> {
    let mut reading = Reading::Unknown;
    xml::read(source, file, &mut reading)?;
    match reading {
        Reading::Osm(parser) => Ok(Document::Osm(parser.finish())),
        Reading::OpenDrive(parser) => Ok(Document::OpenDrive(parser.finish())),
        Reading::Unknown => Err(MapError::Format {
            file: file.to_owned(),
            looks_like: "an empty document".to_owned(),
        }),
    }
}

enum Reading {
    Unknown,
    Osm(osm::Parser),
    OpenDrive(opendrive::Parser),
}

impl Take for Reading {
    fn start(
        &mut self,
        depth: usize,
        name: &str,
        attributes: Attributes,
        place: Place,
    ) -> Result<(), String> {
        if depth == 0 {
            *self = match name {
                "osm" => Self::Osm(osm::Parser::default()),
                "OpenDRIVE" => Self::OpenDrive(opendrive::Parser::default()),
                other => return Err(format!("XML with the root element <{}>", shown(other))),
            };
        }
        match self {
            Self::Osm(parser) => parser.start(depth, name, attributes, place),
            Self::OpenDrive(parser) => parser.start(depth, name, attributes, place),
            Self::Unknown => Ok(()),
        }
    }

    fn end(&mut self, depth: usize) {
        match self {
            Self::Osm(parser) => parser.end(depth),
            Self::OpenDrive(parser) => parser.end(depth),
            Self::Unknown => {}
        }
    }

    fn text(&mut self, text: &str) {
        if let Self::OpenDrive(parser) = self {
            parser.text(text);
        }
    }
}
