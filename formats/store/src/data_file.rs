//! A data file: sorted rows as Parquet, named by the hash of its bytes.
//!
//! The same rows give the same bytes and so the same name. Whoever reads the file compares size
//! and hash first: a file that was torn or flipped is an error and never a wrong row.

use std::sync::Arc;

use arrow_array::{Array, Int32Array, RecordBatch, cast::AsArray, types::Float64Type};
use arrow_select::concat::concat_batches;
use bytes::Bytes;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::schema::types::ColumnPath;
use serde_json::{Map, Value, json};
use tilefold_schemas::TileId;

use crate::bbox::{self, BBOX};
use crate::error::StoreError;
use crate::geo;
use crate::layout::{Layout, TILE};

/// Rows in one row group: small enough to skip within a file, large enough for the dictionaries.
const ROW_GROUP_ROWS: usize = 128 * 1024;

/// Levels between a tile and the coarse tile whose rows share a file (16 by 16 tiles).
const COARSE_LEVELS: u32 = 4;

/// Written into each file in place of the library's version, which must not change the bytes.
const CREATED_BY: &str = "tilefold";

/// Units of columns in which hardly a value comes twice: sums, times, places, angles. They are packed
/// into as many bits as their differences need; a dictionary makes the file larger (decision 0036).
const VARIED: [&str; 6] = ["_q8", "_fx", "_ms", "_ns", "_e6", "_mrad"];

/// Columns of numbers whose smallest and largest values other readers may skip by; `bbox` is another.
pub(crate) const STATISTICS: &[&str] = &[TILE, "xmin", "ymin", "xmax", "ymax"];

/// A data file as the table's log knows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DataFile {
    /// Name within the table's folder.
    pub name: String,
    /// Size in bytes.
    pub size: i64,
    /// Number of rows.
    pub rows: i64,
    /// Smallest and largest tile, where the table is tiled.
    pub tiles: Option<(TileId, TileId)>,
    /// Statistics as Delta Lake writes them.
    pub(crate) statistics: String,
}

impl DataFile {
    /// A file as it stands in a log; nothing where the statistics are not ours.
    pub(crate) fn from_log(name: String, size: i64, statistics: String) -> Option<Self> {
        let parsed: Value = serde_json::from_str(&statistics).ok()?;
        let bound = |which: &str| -> Option<TileId> {
            let value = parsed.get(which)?.get(TILE)?.as_i64()?;
            i32::try_from(value).ok().map(TileId)
        };
        Some(Self {
            name,
            size,
            rows: parsed.get("numRecords")?.as_i64()?,
            tiles: bound("minValues").zip(bound("maxValues")),
            statistics,
        })
    }

    /// The coarse tile that the file holds.
    pub(crate) fn coarse(&self) -> Option<TileId> {
        self.tiles.map(|(first, _)| coarse(first))
    }

    /// West, south, east and north of what its rows draw, in degrees, where the log says it.
    #[must_use]
    pub fn bounds_deg(&self) -> Option<[f64; 4]> {
        let parsed: Value = serde_json::from_str(&self.statistics).ok()?;
        bbox::bounds(&parsed)
    }

    /// The hash that the name promises.
    fn promised_hash(&self) -> Option<&str> {
        let stem = self.name.strip_suffix(".parquet")?;
        stem.rsplit('-').next()
    }
}

/// The coarse tile whose file holds the rows of `tile`.
#[must_use]
pub fn coarse(tile: TileId) -> TileId {
    tile.ancestor(tile.level().saturating_sub(COARSE_LEVELS))
}

/// Encodes sorted rows; the file's name follows from its bytes.
pub(crate) fn encode(layout: &Layout, rows: &RecordBatch) -> Result<(DataFile, Bytes), StoreError> {
    let refuse = |error| StoreError::encode("encode", layout.name, error);
    let rows = &with_boxes(layout, rows)?;
    let bytes = to_parquet(layout, rows).map_err(refuse)?;
    let tiles = tile_range(layout, rows);
    let prefix = match tiles {
        Some((first, _)) => format!("tile-{}", coarse(first)),
        None => "part".to_owned(),
    };
    let file = DataFile {
        name: format!("{prefix}-{}.parquet", blake3::hash(&bytes).to_hex()),
        size: i64::try_from(bytes.len())
            .map_err(|error| StoreError::encode("encode", layout.name, error))?,
        rows: count(rows.num_rows()),
        tiles,
        statistics: statistics(rows).to_string(),
    };
    Ok((file, bytes))
}

fn with_boxes(layout: &Layout, rows: &RecordBatch) -> Result<RecordBatch, StoreError> {
    match layout.geometry {
        [] => Ok(rows.clone()),
        columns => bbox::with_column(rows, columns)
            .map_err(|error| StoreError::encode("draw boxes around", layout.name, error)),
    }
}

fn to_parquet(layout: &Layout, rows: &RecordBatch) -> Result<Bytes, ParquetError> {
    let options = ArrowWriterOptions::new()
        .with_properties(properties(layout)?)
        .with_skip_arrow_metadata(true);
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new_with_options(&mut bytes, rows.schema(), options)?;
    writer.write(rows)?;
    writer.close()?;
    Ok(bytes.into())
}

fn properties(layout: &Layout) -> Result<WriterProperties, ParquetError> {
    let geo = geo::metadata(layout.geometry).map(|entry| vec![entry]);
    let fields = layout.schema.fields().iter();
    let varied = fields.filter(|field| VARIED.iter().any(|unit| field.name().ends_with(unit)));
    let builder = varied.fold(WriterProperties::builder(), |builder, field| {
        let column = ColumnPath::from(field.name().as_str());
        builder
            .set_column_dictionary_enabled(column.clone(), false)
            .set_column_encoding(column, Encoding::DELTA_BINARY_PACKED)
    });
    Ok(builder
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(3)?))
        .set_dictionary_enabled(true)
        .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_created_by(CREATED_BY.to_owned())
        .set_key_value_metadata(geo)
        .build())
}

/// Checks bytes against what the log says of the file, then decodes them into one batch.
///
/// `place` names the file in errors.
pub(crate) fn decode(
    layout: &Layout,
    file: &DataFile,
    place: &str,
    bytes: Bytes,
) -> Result<RecordBatch, StoreError> {
    check(file, place, &bytes)?;
    let rows = from_parquet(layout, bytes).map_err(|error| StoreError::damaged(place, error))?;
    if count(rows.num_rows()) != file.rows || tile_range(layout, &rows) != file.tiles {
        return Err(StoreError::damaged(
            place,
            "its rows or tiles are not those that the table's log names",
        ));
    }
    Ok(rows)
}

/// As [`decode`], a row group at a time.
pub(crate) fn decode_in_parts(
    layout: &Layout,
    file: &DataFile,
    place: &str,
    bytes: Bytes,
    mut take: impl FnMut(RecordBatch) -> Result<(), StoreError>,
) -> Result<(), StoreError> {
    check(file, place, &bytes)?;
    let damaged = |error: String| StoreError::damaged(place, error);
    let reader = ParquetRecordBatchReaderBuilder::try_new(bytes)
        .and_then(|builder| builder.with_batch_size(ROW_GROUP_ROWS).build())
        .map_err(|error| damaged(error.to_string()))?;
    let mut rows = 0;
    for batch in reader {
        let batch = batch.map_err(|error| damaged(error.to_string()))?;
        let outside = tile_range(layout, &batch).filter(|&(first, last)| {
            file.tiles
                .is_none_or(|(low, high)| first < low || last > high)
        });
        if outside.is_some() {
            return Err(damaged(
                "its tiles are not those that the table's log names".to_owned(),
            ));
        }
        rows += count(batch.num_rows());
        take(batch)?;
    }
    match rows == file.rows {
        true => Ok(()),
        false => Err(damaged(
            "its rows are not those that the table's log names".to_owned(),
        )),
    }
}

fn check(file: &DataFile, place: &str, bytes: &Bytes) -> Result<(), StoreError> {
    if count(bytes.len()) != file.size {
        let reason = format!("it has {} bytes instead of {}", bytes.len(), file.size);
        return Err(StoreError::damaged(place, reason));
    }
    let hash = blake3::hash(bytes).to_hex();
    if file.promised_hash() != Some(hash.as_str()) {
        let reason = "the hash of its content is not the one in its name";
        return Err(StoreError::damaged(place, reason));
    }
    Ok(())
}

fn from_parquet(layout: &Layout, bytes: Bytes) -> Result<RecordBatch, ParquetError> {
    let builder = ParquetRecordBatchReaderBuilder::try_new(bytes)?;
    let schema = builder.schema().clone();
    let batches = builder
        .with_batch_size(ROW_GROUP_ROWS)
        .build()?
        .collect::<Result<Vec<_>, _>>()?;
    match batches.len() {
        0 => Ok(RecordBatch::new_empty(layout.schema.clone())),
        _ => Ok(concat_batches(&schema, &batches)?),
    }
}

/// The tile column of a tiled table.
pub(crate) fn tiles(rows: &RecordBatch) -> Option<&Int32Array> {
    rows.column_by_name(TILE)?.as_any().downcast_ref()
}

fn tile_range(layout: &Layout, rows: &RecordBatch) -> Option<(TileId, TileId)> {
    if !layout.tiled {
        return None;
    }
    let column = tiles(rows)?.values();
    Some((TileId(*column.iter().min()?), TileId(*column.iter().max()?)))
}

fn statistics(rows: &RecordBatch) -> Value {
    let (mut least, mut most, mut nulls) = (Map::new(), Map::new(), Map::new());
    for &name in STATISTICS {
        let Some(column) = rows.column_by_name(name) else {
            continue;
        };
        nulls.insert(name.to_owned(), json!(column.null_count()));
        if let Some((low, high)) = bounds(column) {
            least.insert(name.to_owned(), low);
            most.insert(name.to_owned(), high);
        }
    }
    nulls.extend(bbox::nulls(rows).map(|count| (BBOX.to_owned(), count)));
    if let Some((low, high)) = bbox::extremes(rows) {
        least.insert(BBOX.to_owned(), low);
        most.insert(BBOX.to_owned(), high);
    }
    json!({
        "numRecords": rows.num_rows(),
        "minValues": least,
        "maxValues": most,
        "nullCount": nulls,
    })
}

fn bounds(column: &Arc<dyn Array>) -> Option<(Value, Value)> {
    if let Some(tiles) = column.as_any().downcast_ref::<Int32Array>() {
        let values = tiles.values();
        return Some((json!(values.iter().min()?), json!(values.iter().max()?)));
    }
    let values = column.as_primitive_opt::<Float64Type>()?.values();
    // A value that is no number has no place in an order: then nobody may skip by this column.
    let finite = values.iter().all(|value| value.is_finite());
    let low = values.iter().copied().reduce(f64::min).filter(|_| finite)?;
    let high = values.iter().copied().reduce(f64::max)?;
    Some((json!(low), json!(high)))
}

fn count(length: usize) -> i64 {
    i64::try_from(length).unwrap_or(i64::MAX)
}
