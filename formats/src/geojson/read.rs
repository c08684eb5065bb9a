//! Truth and change files. They are untrusted: each field is looked at, and an error names the
//! feature and the field. Unknown properties are left alone.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde_json::{Map, Value};
use tilefold_schemas::limits::{MAX_POINTS_PER_ELEMENT, MAX_TAG_BYTES};
use tilefold_schemas::{ElementKind, Verdict};

use super::{GeoJsonError, Shape, TruthChange};

/// Most bytes of a truth or change file. (Nesting is bounded by the JSON reader, to 128 levels.)
pub const MAX_CHANGES_BYTES: u64 = 256 << 20;

/// Reads a truth or change file.
///
/// # Errors
/// As [`read_changes`], and if the file cannot be opened.
pub fn read_changes_file(path: &Path) -> Result<Vec<TruthChange>, GeoJsonError> {
    let name = path.display().to_string();
    let file = File::open(path).map_err(|source| GeoJsonError::Io {
        file: name.clone(),
        source,
    })?;
    read_changes(file, &name)
}

/// Reads changes from `source`; `file` is what errors call it.
///
/// # Errors
/// If it cannot be read, is over [`MAX_CHANGES_BYTES`], is no GeoJSON, or a feature lacks what a
/// change needs.
pub fn read_changes(source: impl Read, file: &str) -> Result<Vec<TruthChange>, GeoJsonError> {
    let mut bytes = Vec::new();
    let taken = source.take(MAX_CHANGES_BYTES + 1).read_to_end(&mut bytes);
    taken.map_err(|source| GeoJsonError::Io {
        file: file.to_owned(),
        source,
    })?;
    if bytes.len() as u64 > MAX_CHANGES_BYTES {
        return Err(GeoJsonError::TooLarge {
            file: file.to_owned(),
            limit: MAX_CHANGES_BYTES,
        });
    }
    let whole = serde_json::from_slice(&bytes).map_err(|source| GeoJsonError::Json {
        file: file.to_owned(),
        source,
    })?;
    let features = features(&whole).map_err(|what| GeoJsonError::Collection {
        file: file.to_owned(),
        what,
    })?;
    let read = |(index, value)| {
        change(value).map_err(|Wrong { field, what }| GeoJsonError::Feature {
            file: file.to_owned(),
            index,
            field,
            what,
        })
    };
    features.iter().enumerate().map(read).collect()
}

fn features(whole: &Value) -> Result<&Vec<Value>, &'static str> {
    if whole["type"] != "FeatureCollection" {
        return Err("its type is not FeatureCollection");
    }
    whole["features"]
        .as_array()
        .ok_or("it has no list of features")
}

/// A field that says something else than it should.
struct Wrong {
    field: &'static str,
    what: String,
}

fn wrong<T>(field: &'static str, what: impl Into<String>) -> Result<T, Wrong> {
    let what = what.into();
    Err(Wrong { field, what })
}

fn change(feature: &Value) -> Result<TruthChange, Wrong> {
    if feature["type"] != "Feature" {
        return wrong(
            "type",
            format!("it is {}, not \"Feature\"", shown(&feature["type"])),
        );
    }
    let Some(properties) = feature["properties"].as_object() else {
        return wrong("properties", "an object is missing");
    };
    let (shape, points) = geometry(&feature["geometry"])?;
    let from_m = station(properties, "from_m")?;
    let to_m = station(properties, "to_m")?;
    if let (Some(from), Some(to)) = (from_m, to_m)
        && from > to
    {
        return wrong(
            "to_m",
            format!("the stretch ends at {to} m, before it begins at {from} m"),
        );
    }
    Ok(TruthChange {
        element_id: element_id(properties)?,
        change_type: named(
            properties,
            "change_type",
            Verdict::from_name,
            "added, removed or modified",
        )?,
        kind: named(
            properties,
            "kind",
            ElementKind::from_name,
            "lane_marking, stop_line, crosswalk or ground_sign",
        )?,
        from_m,
        to_m,
        detail: detail(properties)?,
        since_ns: since_ns(properties)?,
        shape,
        points,
    })
}

/// An integer, also as text (JavaScript has none beyond 2^53), or null.
fn element_id(properties: &Map<String, Value>) -> Result<Option<i64>, Wrong> {
    let read = match properties.get("element_id") {
        None | Some(Value::Null) => return Ok(None),
        Some(Value::String(text)) => text.parse().ok(),
        Some(other) => other.as_i64(),
    };
    match (read, properties.get("element_id")) {
        (None, Some(value)) => wrong(
            "element_id",
            format!("{} is not a 64-bit integer or null", shown(value)),
        ),
        (id, _) => Ok(id),
    }
}

fn named<T>(
    properties: &Map<String, Value>,
    field: &'static str,
    from_name: impl Fn(&str) -> Option<T>,
    names: &str,
) -> Result<T, Wrong> {
    let value = properties.get(field).unwrap_or(&Value::Null);
    match value.as_str().and_then(from_name) {
        Some(read) => Ok(read),
        None => wrong(field, format!("{} is not {names}", shown(value))),
    }
}

fn station(properties: &Map<String, Value>, field: &'static str) -> Result<Option<f64>, Wrong> {
    let value = properties.get(field).unwrap_or(&Value::Null);
    match (value, value.as_f64()) {
        (Value::Null, _) => Ok(None),
        (_, Some(metres)) if metres.is_finite() && metres >= 0.0 => Ok(Some(metres)),
        _ => wrong(
            field,
            format!("{} is not a station in metres, 0 or more", shown(value)),
        ),
    }
}

fn detail(properties: &Map<String, Value>) -> Result<Option<String>, Wrong> {
    match properties.get("detail") {
        None | Some(Value::Null) => Ok(None),
        Some(Value::String(text)) if text.len() <= MAX_TAG_BYTES => Ok(Some(text.clone())),
        Some(other) => wrong(
            "detail",
            format!(
                "{} is not a text of at most {MAX_TAG_BYTES} bytes (MAX_TAG_BYTES)",
                shown(other)
            ),
        ),
    }
}

/// An instant as RFC 3339 text, or as nanoseconds since the Unix epoch.
fn since_ns(properties: &Map<String, Value>) -> Result<Option<i64>, Wrong> {
    let value = properties.get("since").unwrap_or(&Value::Null);
    let read = match value {
        Value::Null => return Ok(None),
        Value::String(text) => rfc3339_ns(text),
        other => other.as_i64(),
    };
    match read {
        Some(since_ns) => Ok(Some(since_ns)),
        None => wrong(
            "since",
            format!(
                "{} is neither an RFC 3339 time (2026-03-02T06:00:00Z) nor nanoseconds since 1970",
                shown(value)
            ),
        ),
    }
}

fn rfc3339_ns(text: &str) -> Option<i64> {
    let time = chrono::DateTime::parse_from_rfc3339(text).ok()?;
    time.timestamp_nanos_opt()
}

fn geometry(value: &Value) -> Result<(Shape, Vec<[f64; 3]>), Wrong> {
    let coordinates = &value["coordinates"];
    match value["type"].as_str() {
        None if value.is_null() => Ok((Shape::None, Vec::new())),
        Some("Point") => Ok((Shape::Point, vec![position(coordinates)?])),
        Some("LineString") => Ok((Shape::Line, positions(coordinates, 2)?)),
        Some("Polygon") => match coordinates.as_array().map(Vec::as_slice) {
            Some([ring]) => Ok((Shape::Area, open_ring(positions(ring, 4)?)?)),
            _ => wrong(
                "geometry.coordinates",
                "a polygon has one ring here, without holes",
            ),
        },
        _ => wrong(
            "geometry.type",
            format!(
                "{} is not Point, LineString or Polygon",
                shown(&value["type"])
            ),
        ),
    }
}

fn open_ring(mut ring: Vec<[f64; 3]>) -> Result<Vec<[f64; 3]>, Wrong> {
    if ring.first() != ring.last() {
        return wrong(
            "geometry.coordinates",
            "the ring does not end where it begins",
        );
    }
    ring.pop();
    Ok(ring)
}

fn positions(value: &Value, at_least: usize) -> Result<Vec<[f64; 3]>, Wrong> {
    const FIELD: &str = "geometry.coordinates";
    match value.as_array() {
        None => wrong(FIELD, "a list of positions is missing"),
        Some(list) if list.len() < at_least => wrong(
            FIELD,
            format!(
                "{} positions are too few, {at_least} are needed",
                list.len()
            ),
        ),
        Some(list) if list.len() > MAX_POINTS_PER_ELEMENT => wrong(
            FIELD,
            format!(
                "{} positions are over the limit of {MAX_POINTS_PER_ELEMENT} (MAX_POINTS_PER_ELEMENT)",
                list.len()
            ),
        ),
        Some(list) => list.iter().map(position).collect(),
    }
}

fn position(value: &Value) -> Result<[f64; 3], Wrong> {
    let number = |index: usize| value[index].as_f64();
    let elevation_m = number(2).unwrap_or(0.0);
    match (number(0), number(1)) {
        (Some(lon), Some(lat))
            if lon.abs() <= 180.0 && lat.abs() <= 90.0 && elevation_m.is_finite() =>
        {
            Ok([lon, lat, elevation_m])
        }
        _ => wrong(
            "geometry.coordinates",
            format!(
                "{} is not a position [longitude, latitude] in degrees",
                shown(value)
            ),
        ),
    }
}

/// A value from outside, short enough for a message.
fn shown(value: &Value) -> String {
    match value {
        Value::Null => "nothing".to_owned(),
        Value::Array(list) if list.len() > 4 => format!("a list of {}", list.len()),
        other => other.to_string().chars().take(60).collect(),
    }
}
