//! PMTiles 3 with vector tiles: changes over the map, for a browser that has nothing but a file
//! server behind it.

use std::collections::BTreeMap;
use std::io::{Cursor, Write};

use pmtiles::{PmTilesWriter, PmtError, TileCoord, TileId, TileType};
use serde_json::json;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::wkb::Geometry;
use tilefold_schemas::{ChangeRecord, Color, ElementKind, Marking, SignClass, wkb};

use super::attributes::{ATTRIBUTES, Type, Value, values};
use super::change::Change;
use super::cut::{Address, Shape, cut};
use super::error::ExportError;
use super::vector_tile::{Layer, Property, encode};
use crate::geojson::utc;

const FORMAT: &str = "PMTiles";
/// The first zoom with changes.
pub const MIN_ZOOM: u8 = 10;
/// The first zoom with the map's elements: further out they would only make tiles heavy.
pub const MIN_MAP_ZOOM: u8 = 14;
/// The last zoom: a unit of a tile is 15 cm at the equator. Viewers draw it larger.
pub const MAX_ZOOM: u8 = 16;

/// Writes the layers `map` (`elements`) and `changes` (`records`) as tiles of the zooms
/// [`MIN_ZOOM`] to [`MAX_ZOOM`]. What has no geometry is left out.
///
/// # Errors
/// If a record has an unknown code, a geometry is none, or `out` does not take the bytes.
pub fn write_pmtiles(
    records: &[ChangeRecord],
    elements: &[ElementRow],
    out: &mut impl Write,
) -> Result<(), ExportError> {
    let mut tiles = Tiles::default();
    for row in elements {
        let geometry = wkb::read(&row.geometry).map_err(|source| ExportError::Element {
            element: row.element,
            source,
        })?;
        tiles.add(&geometry, MIN_MAP_ZOOM, &of_element(row), |tile| {
            &mut tile.map
        });
    }
    for record in records {
        let change = Change::of(record)?;
        if let Some(geometry) = &change.geometry {
            tiles.add(geometry, MIN_ZOOM, &of_change(&change), |tile| {
                &mut tile.changes
            });
        }
    }
    // The archive's directory stands before its tiles: it is written last, into memory.
    let mut archive = Cursor::new(Vec::new());
    tiles
        .write(&mut archive)
        .map_err(|error| ExportError::encode(FORMAT)(&error))?;
    out.write_all(archive.get_ref())?;
    Ok(())
}

#[derive(Default)]
struct Tile {
    map: Layer,
    changes: Layer,
}

#[derive(Default)]
struct Tiles {
    tiles: BTreeMap<Address, Tile>,
    /// West, south, east, north, degrees.
    bounds: Option<[f64; 4]>,
}

impl Tiles {
    fn add(
        &mut self,
        geometry: &Geometry,
        first_zoom: u8,
        properties: &[(&str, Property)],
        layer: impl Fn(&mut Tile) -> &mut Layer,
    ) {
        for &[longitude_deg, latitude_deg, _] in &geometry.points {
            self.reach(longitude_deg, latitude_deg);
        }
        let shape = Shape::of(geometry);
        let zooms = (first_zoom, MAX_ZOOM);
        cut(&shape, zooms, &mut |address, piece| {
            let tile = self.tiles.entry(address).or_default();
            layer(tile).add(piece.is_area, &piece.in_tile(address), properties);
        });
    }

    fn reach(&mut self, x: f64, y: f64) {
        let [west, south, east, north] = self.bounds.unwrap_or([x, y, x, y]);
        self.bounds = Some([west.min(x), south.min(y), east.max(x), north.max(y)]);
    }

    fn write(self, archive: &mut Cursor<Vec<u8>>) -> Result<(), PmtError> {
        let mut writer = PmTilesWriter::new(TileType::Mvt)
            .min_zoom(MIN_ZOOM)
            .max_zoom(MAX_ZOOM)
            .metadata(metadata());
        if let Some([west, south, east, north]) = self.bounds {
            writer = writer
                .bounds(west, south, east, north)
                .center(west.midpoint(east), south.midpoint(north))
                .center_zoom(MIN_MAP_ZOOM);
        }
        let mut writer = writer.create(archive)?;
        // An archive is read from front to back where its tiles stand in the order of their ids.
        let mut ordered = BTreeMap::new();
        for ((zoom, column, row), tile) in self.tiles {
            let coord = TileCoord::new(zoom, column, row)?;
            ordered.insert(TileId::from(coord), (coord, tile));
        }
        for (coord, tile) in ordered.into_values() {
            if let Some(bytes) = encode([("map", tile.map), ("changes", tile.changes)]) {
                writer.add_tile(coord, &bytes)?;
            }
        }
        writer.finalize()
    }
}

fn of_change(change: &Change<'_>) -> Vec<(&'static str, Property)> {
    let cells = ATTRIBUTES.iter().zip(values(change));
    cells
        .filter_map(|((name, _), value)| {
            let property = match value {
                Value::None => return None,
                Value::Text(text) => Property::Text(text.into_owned()),
                Value::Integer(number) => Property::Integer(number),
                Value::Real(number) => Property::Real(number),
                Value::Time(stamp_ns) => Property::Text(utc(stamp_ns)),
            };
            Some((*name, property))
        })
        .collect()
}

pub(super) fn of_element(row: &ElementRow) -> Vec<(&'static str, Property)> {
    let text = |name: Option<&str>| Property::Text(name.unwrap_or("unknown").to_owned());
    vec![
        ("element_id", Property::Integer(row.element)),
        (
            "kind",
            text(ElementKind::from_code(row.kind).map(ElementKind::name)),
        ),
        (
            "marking",
            text(Marking::from_code(row.marking).map(Marking::name)),
        ),
        ("color", text(Color::from_code(row.color).map(Color::name))),
        (
            "sign",
            text(SignClass::from_code(row.sign).map(SignClass::name)),
        ),
    ]
}

/// The layers and their fields, as TileJSON 3.0 names them.
fn metadata() -> String {
    let kind = |kind| match kind {
        Type::Integer | Type::Real => "Number",
        Type::Text | Type::Time => "String",
    };
    let said: serde_json::Map<String, serde_json::Value> = ATTRIBUTES
        .iter()
        .map(|(name, of)| ((*name).to_owned(), kind(*of).into()))
        .collect();
    let map = json!({
        "element_id": "Number", "kind": "String", "marking": "String", "color": "String",
        "sign": "String",
    });
    json!({
        "name": "Changes of a map",
        "generator": "tilefold",
        "vector_layers": [
            {"id": "map", "minzoom": MIN_MAP_ZOOM, "maxzoom": MAX_ZOOM, "fields": map},
            {"id": "changes", "minzoom": MIN_ZOOM, "maxzoom": MAX_ZOOM, "fields": said},
        ],
    })
    .to_string()
}
