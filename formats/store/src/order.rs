//! The order of rows within a file and within a digest: the table's sort key, then all other
//! columns, so that equal row sets have one order whatever order they came in.

use arrow_array::{RecordBatch, UInt32Array};
use arrow_select::concat::concat_batches;
use arrow_select::take::take_record_batch;
use deltalake::arrow::error::ArrowError;
use deltalake::arrow::row::{RowConverter, Rows, SortField};

use crate::error::StoreError;
use crate::layout::Layout;

/// Puts the rows of all batches into the table's order.
pub(crate) fn sorted(layout: &Layout, batches: &[RecordBatch]) -> Result<RecordBatch, StoreError> {
    let refuse = |error: ArrowError| StoreError::encode("sort", layout.name, error);
    let rows = match batches {
        [one] => one.clone(),
        many => concat_batches(&layout.schema, many).map_err(refuse)?,
    };
    let rows = normal_form(layout, &rows)?;
    refuse_too_many(layout, &rows)?;
    sort(layout, &rows).map_err(refuse)
}

/// Rows are counted in 32 bits here: more of them belong into several calls.
pub(crate) fn refuse_too_many(layout: &Layout, rows: &RecordBatch) -> Result<(), StoreError> {
    if u32::try_from(rows.num_rows()).is_ok() {
        return Ok(());
    }
    let reason = format!("there are {} of them at once", rows.num_rows());
    Err(StoreError::encode("order", layout.name, reason))
}

/// The batch with the columns of the layout, in its order.
pub(crate) fn normal_form(layout: &Layout, rows: &RecordBatch) -> Result<RecordBatch, StoreError> {
    if rows.schema_ref() == &layout.schema {
        return Ok(rows.clone());
    }
    let refuse = |error: ArrowError| StoreError::encode("arrange", layout.name, error);
    let columns = layout
        .schema
        .fields()
        .iter()
        .map(|field| rows.schema_ref().index_of(field.name()))
        .map(|index| index.map(|index| rows.column(index).clone()))
        .collect::<Result<Vec<_>, _>>()
        .map_err(refuse)?;
    RecordBatch::try_new(layout.schema.clone(), columns).map_err(refuse)
}

fn sort(layout: &Layout, rows: &RecordBatch) -> Result<RecordBatch, ArrowError> {
    let key = encoded(rows, &key_columns(layout)?)?;
    if key_decides(&key) {
        return Ok(rows.clone());
    }
    let mut order = order_of(&key);
    if has_ties(&key, &order) {
        order = order_of(&encoded(rows, &all_columns(layout)?)?);
    }
    take_record_batch(rows, &UInt32Array::from(order))
}

/// Whether the rows are in strictly ascending order already.
fn key_decides(key: &Rows) -> bool {
    (1..key.num_rows()).all(|row| key.row(row - 1) < key.row(row))
}

fn has_ties(key: &Rows, order: &[u32]) -> bool {
    order
        .windows(2)
        .any(|pair| key.row(pair[0] as usize) == key.row(pair[1] as usize))
}

fn order_of(key: &Rows) -> Vec<u32> {
    let mut order: Vec<u32> = (0..).take(key.num_rows()).collect();
    order.sort_unstable_by(|&a, &b| key.row(a as usize).cmp(&key.row(b as usize)));
    order
}

fn encoded(rows: &RecordBatch, columns: &[usize]) -> Result<Rows, ArrowError> {
    let columns: Vec<_> = columns
        .iter()
        .map(|&index| rows.column(index).clone())
        .collect();
    let fields = columns
        .iter()
        .map(|column| SortField::new(column.data_type().clone()))
        .collect();
    RowConverter::new(fields)?.convert_columns(&columns)
}

fn key_columns(layout: &Layout) -> Result<Vec<usize>, ArrowError> {
    layout
        .sort_key
        .iter()
        .map(|name| layout.schema.index_of(name))
        .collect()
}

/// The key, then what is digested, then the rest.
fn all_columns(layout: &Layout) -> Result<Vec<usize>, ArrowError> {
    let mut columns = key_columns(layout)?;
    for digested in [true, false] {
        for (index, field) in layout.schema.fields().iter().enumerate() {
            let is_digested = !layout.not_digested.contains(&field.name().as_str());
            if is_digested == digested && !columns.contains(&index) {
                columns.push(index);
            }
        }
    }
    Ok(columns)
}
