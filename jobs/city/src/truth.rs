//! The truth in the GeoJSON form that truth and change files share: features with `element_id`,
//! `change_type` and `kind`. What was added or modified is drawn where it is on the road, what was
//! removed where it was in the map.

use serde_json::{Value, json};

use crate::edit::Change;

/// The truth file of a city.
pub(crate) fn geojson(changes: &[Change]) -> String {
    let features: Vec<Value> = changes.iter().map(feature).collect();
    let collection = json!({"type": "FeatureCollection", "features": features});
    format!("{collection:#}\n")
}

fn feature(change: &Change) -> Value {
    let points = change.element.points.iter();
    let coordinates: Vec<Value> = points
        .map(|&[longitude_deg, latitude_deg, _]| {
            json!([rounded(longitude_deg), rounded(latitude_deg)])
        })
        .collect();
    json!({
        "type": "Feature",
        "properties": {
            "element_id": change.element.id.0,
            "change_type": change.change_type.name(),
            "kind": change.element.kind.name(),
            "shift_m": change.shift_m.map(|shift_m| (shift_m * 1e3).round() / 1e3),
        },
        "geometry": {"type": "LineString", "coordinates": coordinates},
    })
}

/// Ten digits: 0.01 mm.
fn rounded(degrees: f64) -> f64 {
    (degrees * 1e10).round() / 1e10
}
