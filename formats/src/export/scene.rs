//! MCAP: changes and the map as a scene for Foxglove and whatever else reads its messages.
//!
//! | topic | schema | |
//! | --- | --- | --- |
//! | `/map` | `foxglove.SceneUpdate` | the map's elements, one message a tile |
//! | `/changes` | `foxglove.SceneUpdate` | the changes, one message a tile |
//! | `/changes/geojson` | `foxglove.GeoJSON` | the changes once more, for map panels |

use std::collections::BTreeMap;
use std::io::Write;

use foxglove::messages as fox;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::wkb::Geometry;
use tilefold_schemas::{ChangeRecord, ElementKind, Verdict, wkb};

use super::attributes::{ATTRIBUTES, Value, values};
use super::change::Change;
use super::error::ExportError;
use super::memory_log::MemoryLog;
use crate::geojson::{utc, write_changes};
use crate::heights::Heights;
use crate::log_write::{message, timestamp};

/// The frame of the scene: metres east, north and up of its origin.
const FRAME: &str = "map";
const MAP_WIDTH_M: f64 = 0.1;
const CHANGE_WIDTH_M: f64 = 0.25;
/// Changes lie this much above the paint that they are about.
const LIFT_M: f64 = 0.05;

/// What a scene is made of.
pub struct Scene<'a> {
    /// The changes.
    pub records: &'a [ChangeRecord],
    /// The map.
    pub elements: &'a [ElementRow],
    /// Where the frame `map` stands: `[longitude_deg, latitude_deg, elevation_m]`.
    pub origin: [f64; 3],
    /// Metres east, north and up of the origin, of a position on WGS 84.
    pub to_map_m: &'a dyn Fn([f64; 3]) -> [f64; 3],
}

/// Writes a scene; its time is that of the last look at a change.
///
/// # Errors
/// If a record has an unknown code, a geometry is none, or `out` does not take the bytes.
pub fn write_scene(scene: &Scene<'_>, out: &mut impl Write) -> Result<(), ExportError> {
    let stamp_ns = scene.records.iter().map(|record| record.last_ns).max();
    let stamp_ns = stamp_ns.unwrap_or(0).max(0);
    let stamp = timestamp(stamp_ns)?;
    let mut log = MemoryLog::create()?;
    let names = ["longitude_deg", "latitude_deg", "elevation_m"];
    let of_origin = names
        .into_iter()
        .zip(scene.origin.map(|value| value.to_string()));
    log.describe("map_origin", of_origin)?;
    for entities in map_entities(scene, stamp)?.into_values() {
        log.write(
            "/map",
            stamp_ns,
            &message("foxglove.SceneUpdate", &update(entities))?,
        )?;
    }
    for entities in change_entities(scene, stamp)?.into_values() {
        log.write(
            "/changes",
            stamp_ns,
            &message("foxglove.SceneUpdate", &update(entities))?,
        )?;
    }
    let mut geojson = Vec::new();
    write_changes(scene.records, &mut geojson)?;
    let geojson = fox::GeoJson {
        geojson: String::from_utf8_lossy(&geojson).into_owned(),
    };
    log.write(
        "/changes/geojson",
        stamp_ns,
        &message("foxglove.GeoJSON", &geojson)?,
    )?;
    out.write_all(&log.finish()?)?;
    Ok(())
}

type ByTile = BTreeMap<i32, Vec<fox::SceneEntity>>;

fn map_entities(scene: &Scene<'_>, stamp: fox::Timestamp) -> Result<ByTile, ExportError> {
    let mut by_tile = ByTile::new();
    for row in scene.elements {
        let geometry = wkb::read(&row.geometry).map_err(|source| ExportError::Element {
            element: row.element,
            source,
        })?;
        let kind = ElementKind::from_code(row.kind).map_or("unknown", ElementKind::name);
        let drawn = line(scene, &geometry, 0.0, MAP_WIDTH_M, [0.75, 0.75, 0.75, 0.6]);
        let entity = fox::SceneEntity {
            id: row.element.to_string(),
            metadata: vec![pair("class", kind.to_owned())],
            ..entity(stamp, drawn)
        };
        by_tile.entry(row.tile).or_default().push(entity);
    }
    Ok(by_tile)
}

fn change_entities(scene: &Scene<'_>, stamp: fox::Timestamp) -> Result<ByTile, ExportError> {
    let mut by_tile = ByTile::new();
    let shapes = scene
        .elements
        .iter()
        .filter_map(|row| wkb::read(&row.geometry).ok());
    let heights = Heights::new(shapes.flat_map(|shape| shape.points));
    for record in scene.records {
        let change = Change::of(record)?;
        let Some(geometry) = &change.geometry else {
            continue;
        };
        let [r, g, b] = color(change.verdict);
        let opacity = change.posterior().clamp(0.0, 1.0);
        let geometry = Geometry {
            points: heights.complete(&geometry.points),
            ..*geometry
        };
        let drawn = line(scene, &geometry, LIFT_M, CHANGE_WIDTH_M, [r, g, b, opacity]);
        let entity = fox::SceneEntity {
            id: format!("{:016x}", record.change),
            metadata: metadata(&change),
            ..entity(stamp, drawn)
        };
        by_tile.entry(record.tile).or_default().push(entity);
    }
    Ok(by_tile)
}

/// Green is new, red is gone, orange is elsewhere or otherwise.
fn color(verdict: Verdict) -> [f64; 3] {
    match verdict {
        Verdict::Added => [0.1, 0.75, 0.2],
        Verdict::Removed => [0.9, 0.1, 0.1],
        Verdict::Modified => [1.0, 0.6, 0.0],
        Verdict::NoChange => [0.3, 0.5, 0.9],
        Verdict::Unknown | Verdict::Stale => [0.5, 0.5, 0.5],
    }
}

fn metadata(change: &Change<'_>) -> Vec<fox::KeyValuePair> {
    let cells = ATTRIBUTES.iter().zip(values(change));
    cells
        .filter_map(|((name, _), value)| {
            let text = match value {
                Value::None => return None,
                Value::Text(text) => text.into_owned(),
                Value::Integer(number) => number.to_string(),
                Value::Real(number) => number.to_string(),
                Value::Time(stamp_ns) => utc(stamp_ns),
            };
            Some(pair(name, text))
        })
        .collect()
}

fn pair(key: &str, value: String) -> fox::KeyValuePair {
    fox::KeyValuePair {
        key: key.to_owned(),
        value,
    }
}

fn entity(stamp: fox::Timestamp, line: fox::LinePrimitive) -> fox::SceneEntity {
    fox::SceneEntity {
        timestamp: Some(stamp),
        frame_id: FRAME.to_owned(),
        lines: vec![line],
        ..fox::SceneEntity::default()
    }
}

fn line(
    scene: &Scene<'_>,
    geometry: &Geometry,
    lift_m: f64,
    width_m: f64,
    [r, g, b, a]: [f64; 4],
) -> fox::LinePrimitive {
    use fox::line_primitive::Type;
    let points = geometry.points.iter().map(|&point| {
        let [x, y, z] = (scene.to_map_m)(point);
        fox::Point3 {
            x,
            y,
            z: z + lift_m,
        }
    });
    fox::LinePrimitive {
        r#type: match geometry.is_area {
            true => Type::LineLoop.into(),
            false => Type::LineStrip.into(),
        },
        pose: Some(fox::Pose {
            position: Some(fox::Vector3 {
                x: 0.0,
                y: 0.0,
                z: 0.0,
            }),
            orientation: Some(fox::Quaternion {
                x: 0.0,
                y: 0.0,
                z: 0.0,
                w: 1.0,
            }),
        }),
        thickness: width_m,
        points: points.collect(),
        color: Some(fox::Color { r, g, b, a }),
        ..fox::LinePrimitive::default()
    }
}

fn update(entities: Vec<fox::SceneEntity>) -> fox::SceneUpdate {
    fox::SceneUpdate {
        deletions: Vec::new(),
        entities,
    }
}
