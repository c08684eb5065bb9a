//! GeoParquet 1.1: changes as a table with WKB geometry and a bounding box per row, by which
//! readers skip row groups.

use std::io::Write;
use std::sync::Arc;

use arrow_array::{
    ArrayRef, BinaryArray, Float64Array, Int64Array, RecordBatch, StringArray, StructArray,
    TimestampMillisecondArray,
};
use arrow_schema::{ArrowError, DataType, Field, Fields, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::json;
use tilefold_schemas::{ChangeRecord, wkb};

use super::attributes::{ATTRIBUTES, Type, Value, values};
use super::change::Change;
use super::error::ExportError;
use crate::geojson::{GeoJsonError, closed_ring};

const FORMAT: &str = "GeoParquet";
/// Rows in one row group.
const ROW_GROUP_ROWS: usize = 16 * 1024;
const CORNERS: [&str; 4] = ["xmin", "ymin", "xmax", "ymax"];

/// Writes `records` in their order: the columns of the GeoJSON export, `geometry` and `bbox`, both
/// null where a record has no geometry.
///
/// # Errors
/// If a record has an unknown code or a geometry that is none, or `out` does not take the bytes.
pub fn write_geoparquet(
    records: &[ChangeRecord],
    out: &mut (impl Write + Send),
) -> Result<(), ExportError> {
    let changes = records
        .iter()
        .map(Change::of)
        .collect::<Result<Vec<_>, GeoJsonError>>()?;
    let rows = batch(&changes).map_err(|error| ExportError::encode(FORMAT)(&error))?;
    write(&rows, out).map_err(|error| ExportError::encode(FORMAT)(&error))
}

fn write(rows: &RecordBatch, out: &mut (impl Write + Send)) -> Result<(), ParquetError> {
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(3)?))
        .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
        .set_created_by("tilefold".to_owned())
        .set_key_value_metadata(Some(vec![KeyValue::new("geo".to_owned(), metadata())]))
        .build();
    let mut writer = ArrowWriter::try_new(out, rows.schema(), Some(properties))?;
    writer.write(rows)?;
    writer.close()?;
    Ok(())
}

/// Without a CRS, which by the specification means OGC:CRS84, longitude first.
fn metadata() -> String {
    let corner = |name: &str| json!(["bbox", name]);
    let [xmin, ymin, xmax, ymax] = CORNERS.map(corner);
    let geometry = json!({
        "encoding": "WKB",
        "geometry_types": ["LineString Z", "Polygon Z"],
        "orientation": "counterclockwise",
        "covering": {"bbox": {"xmin": xmin, "ymin": ymin, "xmax": xmax, "ymax": ymax}},
    });
    json!({
        "version": "1.1.0",
        "primary_column": "geometry",
        "columns": {"geometry": geometry},
    })
    .to_string()
}

fn batch(changes: &[Change<'_>]) -> Result<RecordBatch, ArrowError> {
    let rows: Vec<_> = changes.iter().map(values).collect();
    let mut fields = Vec::new();
    let mut columns: Vec<ArrayRef> = Vec::new();
    for (index, (name, kind)) in ATTRIBUTES.iter().enumerate() {
        let column = column(*kind, rows.iter().map(|row| &row[index]));
        fields.push(Field::new(*name, column.data_type().clone(), true));
        columns.push(column);
    }
    let boxes = boxes(changes);
    fields.push(Field::new("bbox", DataType::Struct(corners()), true));
    columns.push(Arc::new(boxes?));
    fields.push(Field::new("geometry", DataType::Binary, true));
    let shapes: BinaryArray = changes.iter().map(shape).collect();
    columns.push(Arc::new(shapes));
    RecordBatch::try_new(Arc::new(Schema::new(fields)), columns)
}

fn column<'a>(kind: Type, cells: impl Iterator<Item = &'a Value<'a>>) -> ArrayRef {
    match kind {
        Type::Text => Arc::new(cells.map(text).collect::<StringArray>()),
        Type::Integer => Arc::new(cells.map(integer).collect::<Int64Array>()),
        Type::Real => Arc::new(cells.map(real).collect::<Float64Array>()),
        Type::Time => {
            let times: TimestampMillisecondArray = cells.map(milliseconds).collect();
            Arc::new(times.with_timezone("UTC"))
        }
    }
}

fn text<'a>(cell: &'a Value<'a>) -> Option<&'a str> {
    match cell {
        Value::Text(text) => Some(text),
        _ => None,
    }
}

fn integer(cell: &Value<'_>) -> Option<i64> {
    match cell {
        Value::Integer(number) => Some(*number),
        _ => None,
    }
}

fn real(cell: &Value<'_>) -> Option<f64> {
    match cell {
        Value::Real(number) => Some(*number),
        _ => None,
    }
}

fn milliseconds(cell: &Value<'_>) -> Option<i64> {
    match cell {
        Value::Time(stamp_ns) => Some(stamp_ns.div_euclid(1_000_000)),
        _ => None,
    }
}

/// WKB with z; rings counter-clockwise, as the metadata promise.
fn shape(change: &Change<'_>) -> Option<Vec<u8>> {
    let geometry = change.geometry.as_ref()?;
    if !geometry.is_area {
        return Some(wkb::line(&geometry.points));
    }
    let mut ring = closed_ring(geometry.points.clone());
    ring.pop();
    Some(wkb::polygon(&ring))
}

fn corners() -> Fields {
    let corner = |name: &str| Field::new(name, DataType::Float64, false);
    CORNERS.map(corner).into_iter().collect()
}

fn boxes(changes: &[Change<'_>]) -> Result<StructArray, ArrowError> {
    let boxes: Vec<Option<[f64; 4]>> = changes.iter().map(bounds).collect();
    let column = |corner: usize| -> ArrayRef {
        let values = boxes
            .iter()
            .map(|cell| cell.map_or(0.0, |cell| cell[corner]));
        Arc::new(Float64Array::from_iter_values(values))
    };
    let nulls = boxes.iter().map(Option::is_some).collect::<Vec<bool>>();
    StructArray::try_new(
        corners(),
        (0..CORNERS.len()).map(column).collect(),
        Some(nulls.into()),
    )
}

fn bounds(change: &Change<'_>) -> Option<[f64; 4]> {
    let points = &change.geometry.as_ref()?.points;
    let axis = |index: usize| points.iter().map(move |point| point[index]);
    let low = |index| axis(index).reduce(f64::min);
    let high = |index| axis(index).reduce(f64::max);
    Some([low(0)?, low(1)?, high(0)?, high(1)?])
}
