//! The truth in the GeoJSON form that truth and change files share: features with `element_id`,
//! `change_type`, `kind`, `from_m` and `to_m` of a stretch, and what else is known of the event.
//! What was added or modified is drawn where it is on the road, what was removed where it was in
//! the map.

use chrono::{DateTime, SecondsFormat, Utc};
use serde_json::{Map, Value, json};
use tilefold_schemas::element::ElementKind;

use crate::edit::{Change, ChangeType};
use crate::world::World;

/// The changes as a file, in the order given.
pub(crate) fn geojson<'a>(world: &World, changes: impl Iterator<Item = &'a Change>) -> String {
    let features: Vec<Value> = changes.map(|change| feature(world, change)).collect();
    let collection = json!({"type": "FeatureCollection", "features": features});
    format!("{collection:#}\n")
}

/// Whether the road differs from the map because of this, at a time.
pub(crate) fn is_so(change: &Change, time_ns: i64) -> bool {
    change.change_type != ChangeType::NoChange
        && (change.since_ns..change.until_ns).contains(&time_ns)
}

fn feature(world: &World, change: &Change) -> Value {
    let mut properties = Map::new();
    let mut say = |key: &str, value: Value| properties.insert(key.to_owned(), value);
    say("element_id", json!(change.paint.id));
    say("change_type", json!(change.change_type.name()));
    say("kind", json!(change.paint.kind.name()));
    say("detail", json!(change.happening.name()));
    if let Some([from_m, to_m]) = change.stretch_m {
        say("from_m", json!(millimetres(from_m)));
        say("to_m", json!(millimetres(to_m)));
    }
    if let Some(shift_m) = change.shift_m {
        say("shift_m", json!(millimetres(shift_m)));
    }
    say("since", json!(date(change.since_ns)));
    if change.until_ns < i64::MAX {
        say("until", json!(date(change.until_ns)));
    }
    json!({
        "type": "Feature",
        "properties": properties,
        "geometry": geometry(world, change),
    })
}

fn geometry(world: &World, change: &Change) -> Value {
    let points = change.paint.points.iter();
    let mut coordinates: Vec<Value> = points
        .map(|&point| {
            let [longitude_deg, latitude_deg, _] = world.on_earth(point);
            json!([rounded(longitude_deg), rounded(latitude_deg)])
        })
        .collect();
    if matches!(
        change.paint.kind,
        ElementKind::LaneMarking | ElementKind::StopLine
    ) {
        return json!({"type": "LineString", "coordinates": coordinates});
    }
    coordinates.extend(coordinates.first().cloned());
    json!({"type": "Polygon", "coordinates": [coordinates]})
}

fn date(time_ns: i64) -> String {
    let seconds = time_ns.div_euclid(1_000_000_000);
    let date: Option<DateTime<Utc>> = DateTime::from_timestamp(seconds, 0);
    date.map_or_else(String::new, |date| {
        date.to_rfc3339_opts(SecondsFormat::Secs, true)
    })
}

fn millimetres(metres: f64) -> f64 {
    (metres * 1e3).round() / 1e3
}

/// Ten digits: 0.01 mm.
fn rounded(degrees: f64) -> f64 {
    (degrees * 1e10).round() / 1e10
}
