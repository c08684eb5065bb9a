//! Regions to GeoJSON: polygons that say what changed in them.

use std::io::Write;

use serde_json::{Value, json};
use tilefold_schemas::Region;

use super::GeoJsonError;
use super::write::{closed_ring, push_positions, utc};

/// Writes `regions` in their order as a `FeatureCollection` of polygons whose `kind` is `region`.
///
/// # Errors
/// `out` does not take the bytes.
pub fn write_regions(regions: &[Region], out: &mut impl Write) -> Result<(), GeoJsonError> {
    out.write_all(b"{\"type\":\"FeatureCollection\",\"features\":[")?;
    for (index, region) in regions.iter().enumerate() {
        let separator = if index == 0 { "\n" } else { ",\n" };
        out.write_all(separator.as_bytes())?;
        out.write_all(feature(region).as_bytes())?;
    }
    out.write_all(b"\n]}\n")?;
    Ok(())
}

fn feature(region: &Region) -> String {
    let corner = |&[lon, lat]: &[f64; 2]| [lon, lat, 0.0];
    let mut ring = String::new();
    push_positions(
        &mut ring,
        &closed_ring(region.outline.iter().map(corner).collect()),
    );
    let changes: Vec<String> = region
        .changes
        .iter()
        .map(|id| format!("{id:016x}"))
        .collect();
    let properties: Value = json!({
        "kind": "region",
        "summary": region.summary(),
        "since": region.since_ns.map(utc),
        "tile": region.tile,
        "changes": changes,
    });
    format!(
        "{{\"type\":\"Feature\",\"id\":\"{:016x}\",\"properties\":{properties},\"geometry\":{{\"type\":\"Polygon\",\"coordinates\":[{ring}]}}}}",
        region.id
    )
}
