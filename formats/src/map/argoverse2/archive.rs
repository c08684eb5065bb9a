//! The JSON of an Argoverse 2 map: each lane segment and crossing by itself, so that a bad one is set
//! aside with its line and column and the rest is read.

use std::collections::BTreeMap;
use std::fmt;
use std::io::Read;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::{DeserializeOwned, Deserializer, MapAccess, Visitor};
use serde_json::error::Category;
use serde_json::value::RawValue;
use tilefold_schemas::limits::MAX_MAP_BYTES;
use tilefold_schemas::{SetAside, SetAsideKind};

use crate::map::error::MapError;

#[derive(Debug, Deserialize)]
pub(super) struct Segment {
    pub(super) id: i64,
    pub(super) left_lane_boundary: Vec<Point>,
    pub(super) right_lane_boundary: Vec<Point>,
    pub(super) left_lane_mark_type: String,
    pub(super) right_lane_mark_type: String,
}

#[derive(Debug, Deserialize)]
pub(super) struct Crossing {
    pub(super) id: i64,
    pub(super) edge1: Vec<Point>,
    pub(super) edge2: Vec<Point>,
}

/// In metres from the city's origin.
#[derive(Debug, Clone, Copy, Deserialize)]
pub(super) struct Point {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) z: f64,
}

/// A place in the file, counted from 1. These files often are one line: columns are bytes, which can
/// be told without counting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) line: u64,
    column: u64,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// Something of the file and where it begins.
pub(super) struct Item<T> {
    pub(super) place: Place,
    pub(super) value: T,
}

/// A map's content by id.
pub(super) struct Archive {
    pub(super) segments: BTreeMap<i64, Item<Segment>>,
    pub(super) crossings: BTreeMap<i64, Item<Crossing>>,
    pub(super) lost: Vec<SetAside>,
}

/// The whole of `source` as text.
pub(super) fn text(source: impl Read, file: &str) -> Result<String, MapError> {
    let mut bytes = Vec::new();
    let read = source.take(MAX_MAP_BYTES + 1).read_to_end(&mut bytes);
    read.map_err(|source| MapError::Io {
        file: file.to_owned(),
        source,
    })?;
    if bytes.len() as u64 > MAX_MAP_BYTES {
        return Err(MapError::TooLarge {
            file: file.to_owned(),
            bytes: bytes.len() as u64,
            limit: MAX_MAP_BYTES,
        });
    }
    if bytes.starts_with(b"\xef\xbb\xbf") {
        // JSON has no byte order mark, but editors write one. Three spaces keep the columns.
        bytes[..3].fill(b' ');
    }
    String::from_utf8(bytes).map_err(|error| {
        let good = error.utf8_error().valid_up_to();
        let place = Lines::of(error.as_bytes()).place(good);
        damaged(file, place, "it is not UTF-8".to_owned())
    })
}

impl Archive {
    /// The content of `text`.
    pub(super) fn read(text: &str, file: &str) -> Result<Self, MapError> {
        let raw: Raw<'_> = serde_json::from_str(text).map_err(|error| refused(file, &error))?;
        let mut sorting = Sorting {
            file,
            text,
            lines: Lines::of(text.as_bytes()),
            lost: Vec::new(),
        };
        Ok(Self {
            segments: sorting.by_id("lane segment", raw.lane_segments, |segment: &Segment| {
                segment.id
            }),
            crossings: sorting.by_id(
                "crossing",
                raw.pedestrian_crossings,
                |crossing: &Crossing| crossing.id,
            ),
            lost: sorting.lost,
        })
    }
}

fn refused(file: &str, error: &serde_json::Error) -> MapError {
    let place = Place {
        line: error.line() as u64,
        column: error.column() as u64,
    };
    match error.classify() {
        Category::Data => MapError::Format {
            file: file.to_owned(),
            looks_like: format!("JSON, but not of an Argoverse 2 map: {error}"),
        },
        _ => damaged(file, place, error.to_string()),
    }
}

fn damaged(file: &str, place: Place, what: String) -> MapError {
    MapError::Damaged {
        file: file.to_owned(),
        line: place.line,
        column: place.column,
        what,
    }
}

/// The parts of the file that are read, each of them still as text.
#[derive(Deserialize)]
struct Raw<'a> {
    #[serde(borrow)]
    lane_segments: Entries<'a>,
    #[serde(borrow)]
    pedestrian_crossings: Entries<'a>,
}

/// The values of a JSON object in the order of the file, those under the same name too.
struct Entries<'a>(Vec<&'a RawValue>);

impl<'de: 'a, 'a> Deserialize<'de> for Entries<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct All<'a>(PhantomData<&'a ()>);
        impl<'de: 'a, 'a> Visitor<'de> for All<'a> {
            type Value = Entries<'a>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object of things by their ids")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entries<'a>, A::Error> {
                let mut values = Vec::new();
                while let Some((_, value)) = map.next_entry::<String, &'a RawValue>()? {
                    values.push(value);
                }
                Ok(Entries(values))
            }
        }
        deserializer.deserialize_map(All(PhantomData))
    }
}

struct Sorting<'a> {
    file: &'a str,
    text: &'a str,
    lines: Lines,
    lost: Vec<SetAside>,
}

impl Sorting<'_> {
    /// Of one id, the one that comes first in the file stays.
    fn by_id<T: DeserializeOwned>(
        &mut self,
        what: &str,
        entries: Entries<'_>,
        id_of: impl Fn(&T) -> i64,
    ) -> BTreeMap<i64, Item<T>> {
        let mut found = BTreeMap::new();
        for entry in entries.0 {
            let place = self.place(entry);
            match serde_json::from_str::<T>(entry.get()) {
                Err(error) => self.lose(what, within(place, &error), &reason(&error)),
                Ok(value) if found.contains_key(&id_of(&value)) => {
                    let why = format!("another one has the same id, {}", id_of(&value));
                    self.lose(what, place, &why);
                }
                Ok(value) => drop(found.insert(id_of(&value), Item { place, value })),
            }
        }
        found
    }

    /// Where a part of the text begins.
    fn place(&self, part: &RawValue) -> Place {
        let offset = (part.get().as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize);
        self.lines.place(offset)
    }

    fn lose(&mut self, what: &str, place: Place, why: &str) {
        let reason = format!("{what} ({place}): {why}");
        let lost = SetAside::new(SetAsideKind::Element, self.file, reason).at(place.line);
        self.lost.push(lost);
    }
}

/// The place of an error in a part of the text that begins at `start`.
fn within(start: Place, error: &serde_json::Error) -> Place {
    let [line, column] = [error.line() as u64, error.column() as u64];
    match line {
        0 | 1 => Place {
            line: start.line,
            column: (start.column + column).saturating_sub(1),
        },
        _ => Place {
            line: start.line + line - 1,
            column,
        },
    }
}

/// What an error says, without its own line and column: they count from the part's beginning.
fn reason(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let end = text.rfind(" at line ").unwrap_or(text.len());
    text[..end].chars().take(200).collect()
}

/// Where lines begin, in bytes.
struct Lines(Vec<usize>);

impl Lines {
    fn of(text: &[u8]) -> Self {
        let breaks = text.iter().enumerate().filter(|(_, byte)| **byte == b'\n');
        Self(
            std::iter::once(0)
                .chain(breaks.map(|(at, _)| at + 1))
                .collect(),
        )
    }

    fn place(&self, offset: usize) -> Place {
        let line = self.0.partition_point(|start| *start <= offset).max(1);
        let column = offset.saturating_sub(self.0[line - 1]) + 1;
        Place {
            line: line as u64,
            column: column as u64,
        }
    }
}
