//! The column `bbox` of what has geometry: the bounding box of each row, by which readers skip files,
//! row groups and rows (GeoParquet 1.1, "bbox covering").
//!
//! It is made from the geometry when a file is written, and left out when rows are read: no row type
//! has it, and no digest counts it. Stores of format 2 lack it.

use std::sync::Arc;

use arrow_array::builder::{Float64Builder, NullBufferBuilder};
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, RecordBatch, StructArray};
use arrow_schema::{ArrowError, DataType, Field, Fields, Schema, SchemaRef};
use serde_json::{Map, Value, json};
use tilefold_schemas::wkb;

/// Name of the column.
pub(crate) const BBOX: &str = "bbox";

/// Its fields: degrees, longitude and latitude.
pub(crate) const CORNERS: [&str; 4] = ["xmin", "ymin", "xmax", "ymax"];

/// West, south, east and north, in degrees.
type Corners = [f64; 4];

/// What GeoParquet's metadata say of the column.
pub(crate) fn covering() -> Value {
    let [xmin, ymin, xmax, ymax] = CORNERS.map(|name| json!([BBOX, name]));
    json!({"bbox": {"xmin": xmin, "ymin": ymin, "xmax": xmax, "ymax": ymax}})
}

/// A table's columns with the box behind them.
pub(crate) fn with_field(schema: &SchemaRef) -> SchemaRef {
    let fields = schema.fields().iter().cloned();
    let field = Field::new(BBOX, DataType::Struct(corner_fields()), true);
    Arc::new(Schema::new(
        fields.chain([Arc::new(field)]).collect::<Fields>(),
    ))
}

/// The rows with the boxes of these WKB columns: of all of them together, where there are several.
/// Null where a row has no geometry.
pub(crate) fn with_column(
    rows: &RecordBatch,
    geometry: &[&str],
) -> Result<RecordBatch, ArrowError> {
    let boxes = boxes(rows, geometry)?;
    let mut columns = rows.columns().to_vec();
    columns.push(Arc::new(boxes));
    RecordBatch::try_new(with_field(rows.schema_ref()), columns)
}

fn boxes(rows: &RecordBatch, geometry: &[&str]) -> Result<StructArray, ArrowError> {
    let mut values: [Float64Builder; 4] = Default::default();
    let mut present = NullBufferBuilder::new(rows.num_rows());
    for row in 0..rows.num_rows() {
        let found = box_of(rows, geometry, row);
        present.append(found.is_some());
        for (values, value) in values.iter_mut().zip(found.unwrap_or_default()) {
            values.append_value(value);
        }
    }
    let values = values.map(|mut values| Arc::new(values.finish()) as _);
    StructArray::try_new(corner_fields(), values.to_vec(), present.finish())
}

fn box_of(rows: &RecordBatch, geometry: &[&str], row: usize) -> Option<Corners> {
    let columns = geometry.iter().filter_map(|name| rows.column_by_name(name));
    let shapes = columns
        .filter_map(|column| column.as_binary_opt::<i32>())
        .filter(|column| column.is_valid(row))
        .filter_map(|column| wkb::read(column.value(row)).ok());
    shapes
        .flat_map(|shape| shape.points)
        .map(|[x, y, _]| [x, y, x, y])
        .reduce(joined)
}

fn joined(a: Corners, b: Corners) -> Corners {
    [
        a[0].min(b[0]),
        a[1].min(b[1]),
        a[2].max(b[2]),
        a[3].max(b[3]),
    ]
}

/// Smallest and largest values of each corner, as Delta Lake's statistics have them; none where no
/// row has a box.
pub(crate) fn extremes(rows: &RecordBatch) -> Option<(Value, Value)> {
    let boxes = rows.column_by_name(BBOX)?.as_struct_opt()?;
    let (mut least, mut most) = (Map::new(), Map::new());
    for name in CORNERS {
        let corner = boxes
            .column_by_name(name)?
            .as_primitive_opt::<Float64Type>()?;
        let of_rows = || (0..boxes.len()).filter(|&row| boxes.is_valid(row));
        let values = || of_rows().map(|row| corner.value(row));
        least.insert(name.to_owned(), json!(values().reduce(f64::min)?));
        most.insert(name.to_owned(), json!(values().reduce(f64::max)?));
    }
    Some((least.into(), most.into()))
}

/// West, south, east and north of all boxes of a file, from its statistics.
pub(crate) fn bounds(statistics: &Value) -> Option<Corners> {
    let corner = |which: &str, name: &str| statistics.get(which)?.get(BBOX)?.get(name)?.as_f64();
    let [xmin, ymin, xmax, ymax] = CORNERS;
    Some([
        corner("minValues", xmin)?,
        corner("minValues", ymin)?,
        corner("maxValues", xmax)?,
        corner("maxValues", ymax)?,
    ])
}

/// Of each corner, how many rows have none.
pub(crate) fn nulls(rows: &RecordBatch) -> Option<Value> {
    let count = rows.column_by_name(BBOX)?.null_count();
    let corners = CORNERS.map(|name| (name.to_owned(), json!(count)));
    Some(corners.into_iter().collect::<Map<_, _>>().into())
}

fn corner_fields() -> Fields {
    let corner = |name: &str| Field::new(name, DataType::Float64, false);
    CORNERS.map(corner).into_iter().collect()
}
