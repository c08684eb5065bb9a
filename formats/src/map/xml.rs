//! XML in one pass and in linear time, within limits: what every XML map goes through, whatever its
//! elements mean. No document type, no entity of its own, nothing but UTF-8.

use std::collections::HashMap;
use std::io::Read;

use quick_xml::XmlVersion;
use quick_xml::escape::EscapeError;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use tilefold_schemas::limits::{MAX_MAP_BYTES, MAX_MAP_DEPTH, MAX_XML_ATTRIBUTES};

use super::error::MapError;
use super::fence::{Bound, Fence, MAX_PIECE_BYTES, Place};

/// Attributes of one XML element, unescaped.
pub(super) type Attributes = HashMap<String, String>;

/// What takes the elements of a document as they come.
pub(super) trait Take {
    /// An element begins, `depth` levels below the root (which itself is given at 0).
    ///
    /// # Errors
    /// What the document looks like, if its root is not one that is read.
    fn start(
        &mut self,
        depth: usize,
        name: &str,
        attributes: Attributes,
        place: Place,
    ) -> Result<(), String>;

    /// The element at `depth` ends.
    fn end(&mut self, depth: usize);

    /// Text within the element that was begun last.
    fn text(&mut self, _text: &str) {}
}

/// Hands the whole of `source` to `taker`; `file` is its name in errors.
pub(super) fn read(source: impl Read, file: &str, taker: &mut impl Take) -> Result<(), MapError> {
    let mut reader = Reader::from_reader(Fence::new(source));
    reader.config_mut().expand_empty_elements = true;
    let mut walk = Walk::new(file);
    let mut buffer = Vec::new();
    loop {
        buffer.clear();
        walk.place = reader.get_mut().next_piece();
        let event = match reader.read_event_into(&mut buffer) {
            Ok(event) => event,
            Err(error) => return Err(walk.broken(reader.get_ref(), &error)),
        };
        if matches!(event, Event::Eof) {
            return walk.finish();
        }
        walk.take(&event, taker)?;
    }
}

/// Text from outside, short enough for a message.
pub(super) fn shown(text: &str) -> String {
    text.chars().take(60).collect()
}

struct Walk<'a> {
    file: &'a str,
    place: Place,
    depth: usize,
    has_root: bool,
}

impl<'a> Walk<'a> {
    fn new(file: &'a str) -> Self {
        Self {
            file,
            place: Place { line: 1, column: 1 },
            depth: 0,
            has_root: false,
        }
    }

    fn take(&mut self, event: &Event<'_>, taker: &mut impl Take) -> Result<(), MapError> {
        match event {
            Event::Start(start) => self.start(start, taker),
            Event::End(_) => {
                self.depth = self.depth.saturating_sub(1);
                taker.end(self.depth);
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
            Event::Text(text) => {
                taker.text(text);
                Ok(())
            }
            Event::CData(text) => {
                taker.text(text);
                Ok(())
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

    fn start(&mut self, start: &BytesStart<'_>, taker: &mut impl Take) -> Result<(), MapError> {
        if self.depth >= MAX_MAP_DEPTH {
            return Err(self.limit("the depth of XML", MAX_MAP_DEPTH, "MAX_MAP_DEPTH"));
        }
        let attributes = self.attributes(start)?;
        if self.depth == 0 && self.has_root {
            return Err(self.damaged("a second root element follows the first".to_owned()));
        }
        self.has_root = true;
        let name = start.name();
        taker
            .start(self.depth, name.as_ref(), attributes, self.place)
            .map_err(|looks_like| MapError::Format {
                file: self.file.to_owned(),
                looks_like,
            })?;
        self.depth += 1;
        Ok(())
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

    fn finish(self) -> Result<(), MapError> {
        if !self.has_root {
            return Err(self.damaged("it ends before its root element".to_owned()));
        }
        if self.depth > 0 {
            return Err(self.damaged("it ends in the middle: elements are still open".to_owned()));
        }
        Ok(())
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
        MapError::Damaged {
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

fn is_utf8(encoding: &str) -> bool {
    ["utf-8", "utf8", "us-ascii", "ascii"].contains(&encoding.to_ascii_lowercase().as_str())
}
