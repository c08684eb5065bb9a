//! Mapbox Vector Tiles 2.1: one tile's layers, from features in tile units to bytes.

use std::collections::BTreeMap;

use prost::Message;

/// Units of a tile along a side.
pub(super) const EXTENT: i32 = 4096;

const LINE_STRING: i32 = 2;
const POLYGON: i32 = 3;

#[derive(Clone, PartialEq, Message)]
struct TileMessage {
    #[prost(message, repeated, tag = "3")]
    layers: Vec<LayerMessage>,
}

#[derive(Clone, PartialEq, Message)]
struct LayerMessage {
    #[prost(uint32, required, tag = "15")]
    version: u32,
    #[prost(string, required, tag = "1")]
    name: String,
    #[prost(message, repeated, tag = "2")]
    features: Vec<FeatureMessage>,
    #[prost(string, repeated, tag = "3")]
    keys: Vec<String>,
    #[prost(message, repeated, tag = "4")]
    values: Vec<ValueMessage>,
    #[prost(uint32, optional, tag = "5")]
    extent: Option<u32>,
}

#[derive(Clone, PartialEq, Message)]
struct FeatureMessage {
    #[prost(uint32, repeated, packed = "true", tag = "2")]
    tags: Vec<u32>,
    #[prost(int32, optional, tag = "3")]
    kind: Option<i32>,
    #[prost(uint32, repeated, packed = "true", tag = "4")]
    geometry: Vec<u32>,
}

#[derive(Clone, PartialEq, Message)]
struct ValueMessage {
    #[prost(string, optional, tag = "1")]
    text: Option<String>,
    #[prost(double, optional, tag = "3")]
    real: Option<f64>,
    #[prost(sint64, optional, tag = "6")]
    integer: Option<i64>,
}

/// A property of a feature.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Property {
    Text(String),
    Real(f64),
    Integer(i64),
}

/// What lies in a tile of one layer.
#[derive(Debug, Default)]
pub(super) struct Layer {
    keys: Interned,
    values: Vec<ValueMessage>,
    value_ids: BTreeMap<(u8, Vec<u8>), u32>,
    features: Vec<FeatureMessage>,
}

#[derive(Debug, Default)]
struct Interned {
    names: Vec<String>,
    ids: BTreeMap<String, u32>,
}

impl Interned {
    fn id(&mut self, name: &str) -> u32 {
        if let Some(id) = self.ids.get(name) {
            return *id;
        }
        let id = self.names.len() as u32;
        self.names.push(name.to_owned());
        self.ids.insert(name.to_owned(), id);
        id
    }
}

impl Layer {
    /// Adds lines (`is_area` false) or rings, given without their repeated first vertex; y goes
    /// down. Parts that fall into one point are left out, and a feature without parts is none.
    pub(super) fn add(
        &mut self,
        is_area: bool,
        parts: &[Vec<[i32; 2]>],
        properties: &[(&str, Property)],
    ) {
        let geometry = commands(is_area, parts);
        if geometry.is_empty() {
            return;
        }
        let mut tags = Vec::with_capacity(2 * properties.len());
        for (key, value) in properties {
            tags.push(self.keys.id(key));
            tags.push(self.value(value));
        }
        self.features.push(FeatureMessage {
            tags,
            kind: Some(if is_area { POLYGON } else { LINE_STRING }),
            geometry,
        });
    }

    fn value(&mut self, value: &Property) -> u32 {
        let mut message = ValueMessage::default();
        let key = match value {
            Property::Text(text) => {
                message.text = Some(text.clone());
                (0, text.clone().into_bytes())
            }
            Property::Real(number) => {
                message.real = Some(*number);
                (1, number.to_le_bytes().to_vec())
            }
            Property::Integer(number) => {
                message.integer = Some(*number);
                (2, number.to_le_bytes().to_vec())
            }
        };
        let next = self.values.len() as u32;
        let id = *self.value_ids.entry(key).or_insert(next);
        if id == next {
            self.values.push(message);
        }
        id
    }
}

/// A tile of these layers; those without features are left out, and without any there is no tile.
pub(super) fn encode(layers: impl IntoIterator<Item = (&'static str, Layer)>) -> Option<Vec<u8>> {
    let layers: Vec<LayerMessage> = layers
        .into_iter()
        .filter(|(_, layer)| !layer.features.is_empty())
        .map(|(name, layer)| LayerMessage {
            version: 2,
            name: name.to_owned(),
            features: layer.features,
            keys: layer.keys.names,
            values: layer.values,
            extent: Some(EXTENT.unsigned_abs()),
        })
        .collect();
    (!layers.is_empty()).then(|| TileMessage { layers }.encode_to_vec())
}

/// MoveTo, LineTo and ClosePath with deltas (section 4.3 of the specification).
fn commands(is_area: bool, parts: &[Vec<[i32; 2]>]) -> Vec<u32> {
    let mut stream = Vec::new();
    let mut cursor = [0, 0];
    for part in parts {
        let mut part = part.clone();
        part.dedup();
        if is_area {
            outward(&mut part);
        }
        let needed = if is_area { 3 } else { 2 };
        if part.len() < needed {
            continue;
        }
        for (index, &point) in part.iter().enumerate() {
            match index {
                0 => stream.push(1 | 1 << 3),
                1 => stream.push(2 | (part.len() as u32 - 1) << 3),
                _ => {}
            }
            stream.extend([0, 1].map(|axis| zigzag(point[axis] - cursor[axis])));
            cursor = point;
        }
        if is_area {
            stream.push(7 | 1 << 3);
        }
    }
    stream
}

/// An outer ring has a positive area where y goes down; a ring without any is emptied.
fn outward(ring: &mut Vec<[i32; 2]>) {
    let next = ring.iter().cycle().skip(1);
    let cross = |a: &[i32; 2], b: &[i32; 2]| {
        i64::from(a[0]) * i64::from(b[1]) - i64::from(b[0]) * i64::from(a[1])
    };
    let area: i64 = ring.iter().zip(next).map(|(a, b)| cross(a, b)).sum();
    match area {
        0 => ring.clear(),
        1.. => {}
        _ => ring.reverse(),
    }
}

fn zigzag(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)).cast_unsigned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_those_of_the_specification() {
        // Section 4.3.5 of the specification, examples 2 and 5.
        let line = commands(false, &[vec![[2, 2], [2, 10], [10, 10]]]);
        assert_eq!(line, [9, 4, 4, 18, 0, 16, 16, 0]);
        let area = commands(true, &[vec![[3, 6], [8, 12], [20, 34]]]);
        assert_eq!(area, [9, 6, 12, 18, 10, 12, 24, 44, 15]);
        let turned = commands(true, &[vec![[20, 34], [8, 12], [3, 6]]]);
        assert_eq!(turned, area);
    }

    #[test]
    fn what_has_no_extent_is_left_out() {
        assert!(commands(false, &[vec![[5, 5], [5, 5]]]).is_empty());
        assert!(commands(true, &[vec![[5, 5], [6, 6], [7, 7]]]).is_empty());
    }
}
