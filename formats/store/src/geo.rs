//! GeoParquet metadata, so that GeoPandas, DuckDB and QGIS know the geometry columns.

use parquet::file::metadata::KeyValue;
use serde_json::{Map, Value, json};

use crate::bbox;

/// Version of the GeoParquet specification that is followed.
const VERSION: &str = "1.1.0";

/// The `geo` entry for a file with these WKB columns, the primary one first; none without them.
///
/// The CRS is left out, which by the specification means OGC:CRS84, longitude first.
pub(crate) fn metadata(columns: &[&str]) -> Option<KeyValue> {
    let primary = columns.first()?;
    let described: Map<String, Value> = columns
        .iter()
        .map(|&name| {
            let covering = bbox::covering();
            let column = json!({"encoding": "WKB", "geometry_types": [], "covering": covering});
            (name.to_owned(), column)
        })
        .collect();
    let geo = json!({"version": VERSION, "primary_column": primary, "columns": described});
    Some(KeyValue::new("geo".to_owned(), geo.to_string()))
}
