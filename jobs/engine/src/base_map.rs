//! The base map on its way into the store and out of it.

use std::collections::BTreeMap;
use std::path::PathBuf;

use tilefold_formats::map;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{Color, Element, ElementId, ElementKind, Marking, SetAside, SignClass, wkb};
use tilefold_tiler::map_index::{MappedElement, bounds};

use crate::error::EngineError;

/// Reads map files into rows; what could not be read comes beside them.
///
/// # Errors
/// A file is no map, or two files disagree on an element.
pub(crate) fn read(
    files: &[PathBuf],
    tile_level: u32,
) -> Result<(Vec<ElementRow>, Vec<SetAside>), EngineError> {
    let mut rows: BTreeMap<i64, ElementRow> = BTreeMap::new();
    let mut set_aside = Vec::new();
    for file in files {
        let source = file_name(file);
        let read = map::read(file)?;
        set_aside.extend(read.set_aside);
        for element in read.elements {
            let row = to_row(element, tile_level, &source)?;
            match rows.get(&row.element) {
                // Maps that overlap share elements; the first file is named as the source.
                Some(known) if known.content == row.content => {}
                Some(known) => {
                    return Err(EngineError::Clash {
                        element: row.element,
                        first: known.source.clone(),
                        second: source,
                    });
                }
                None => {
                    rows.insert(row.element, row);
                }
            }
        }
    }
    Ok((rows.into_values().collect(), set_aside))
}

/// As [`read`], but a map must have paint.
///
/// # Errors
/// As [`read`], or there is no paint at all.
pub(crate) fn read_painted(
    maps: &[PathBuf],
    tile_level: u32,
) -> Result<(Vec<ElementRow>, Vec<SetAside>), EngineError> {
    let (rows, set_aside) = read(maps, tile_level)?;
    if rows.is_empty() {
        let names: Vec<String> = maps.iter().map(|map| map.display().to_string()).collect();
        return Err(EngineError::Nothing(format!(
            "no paint in {} (line_thin, line_thick, stop_line, zebra_marking, arrow, ...): there is nothing to find changes of; give a map with markings",
            names.join(", ")
        )));
    }
    Ok((rows, set_aside))
}

fn file_name(file: &std::path::Path) -> String {
    file.file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

fn to_row(element: Element, tile_level: u32, source: &str) -> Result<ElementRow, EngineError> {
    let id = element.id.0;
    let mapped = MappedElement::new(element, tile_level).map_err(|source| EngineError::Tile {
        element: id,
        source,
    })?;
    let element = mapped.element;
    let (low, high) = bounds(&element.points);
    let geometry = match element.kind {
        ElementKind::LaneMarking | ElementKind::StopLine => wkb::line(&element.points),
        ElementKind::Crosswalk | ElementKind::GroundSign => wkb::polygon(&element.points),
    };
    Ok(ElementRow {
        tile: mapped.tile.0,
        element: id,
        content: mapped.content.0,
        kind: element.kind.code(),
        marking: element.marking.code(),
        color: element.color.code(),
        sign: element.sign.code(),
        geometry,
        xmin: low[0],
        ymin: low[1],
        xmax: high[0],
        ymax: high[1],
        // A map of texts always is a JSON object.
        tags: serde_json::to_string(&element.tags).unwrap_or_default(),
        source: source.to_owned(),
    })
}

/// An element as it was stored, with its tile and content hash recomputed and compared.
///
/// # Errors
/// The row is damaged.
pub(crate) fn from_row(row: ElementRow, tile_level: u32) -> Result<MappedElement, EngineError> {
    let damaged = |reason: String| EngineError::Damaged {
        what: "map element",
        reason: format!("element {}: {reason}", row.element),
    };
    let geometry = wkb::read(&row.geometry).map_err(|error| damaged(error.to_string()))?;
    let known = |name: &str, code: i16| damaged(format!("unknown {name} code {code}"));
    let element = Element {
        id: ElementId(row.element),
        kind: ElementKind::from_code(row.kind).ok_or_else(|| known("kind", row.kind))?,
        marking: Marking::from_code(row.marking).ok_or_else(|| known("marking", row.marking))?,
        color: Color::from_code(row.color).ok_or_else(|| known("colour", row.color))?,
        sign: SignClass::from_code(row.sign).ok_or_else(|| known("sign", row.sign))?,
        points: geometry.points,
        tags: serde_json::from_str(&row.tags).map_err(|error| damaged(error.to_string()))?,
    };
    let mapped =
        MappedElement::new(element, tile_level).map_err(|error| damaged(error.to_string()))?;
    if mapped.content.0 != row.content || mapped.tile.0 != row.tile {
        return Err(damaged(
            "its content hash or tile does not fit it".to_owned(),
        ));
    }
    Ok(mapped)
}
