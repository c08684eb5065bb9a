//! The digest of a table's rows: independent of files, batches, histories and library versions.
//!
//! The columns (name and type) are hashed first, then the rows in the table's order, each as the
//! sequence of its values: a byte that says whether there is one, then integers in little-endian
//! order, the bit patterns of floats, and texts and bytes behind their 64-bit lengths.

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int16Type, Int32Type, Int64Type};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field};

use crate::error::StoreError;
use crate::layout::{Layout, StoredTable};
use crate::order;

/// Rows that are turned into bytes at once.
const BLOCK_ROWS: usize = 1024;

/// Digest of rows in any order, as [`Snapshot::digest`](crate::Snapshot::digest) gives it for a
/// table that holds just these.
///
/// # Errors
/// The rows cannot be sorted or encoded, which is a defect.
pub fn digest_rows<R: StoredTable>(rows: Vec<R>) -> Result<String, StoreError> {
    let layout = Layout::of::<R>();
    let mut digest = TableDigest::new(&layout);
    digest.update(&order::sorted(&layout, &[R::to_batch(rows)])?)?;
    Ok(digest.finish())
}

/// Collects the rows of one table.
pub(crate) struct TableDigest {
    hasher: blake3::Hasher,
    table: &'static str,
    columns: Vec<usize>,
}

impl TableDigest {
    pub(crate) fn new(layout: &Layout) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"tilefold table 1\n");
        let mut columns = Vec::new();
        for (index, field) in layout.schema.fields().iter().enumerate() {
            if !layout.not_digested.contains(&field.name().as_str()) {
                hasher.update(describe(field).as_bytes());
                columns.push(index);
            }
        }
        Self {
            hasher,
            table: layout.name,
            columns,
        }
    }

    /// Adds rows; batches must come in the table's order and in the layout's normal form.
    pub(crate) fn update(&mut self, rows: &RecordBatch) -> Result<(), StoreError> {
        let columns: Vec<&ArrayRef> = self.columns.iter().map(|&i| rows.column(i)).collect();
        let mut block = Vec::new();
        for row in 0..rows.num_rows() {
            for column in &columns {
                push(&mut block, column, row)
                    .map_err(|reason| StoreError::encode("digest", self.table, reason))?;
            }
            if (row + 1) % BLOCK_ROWS == 0 {
                self.hasher.update(&block);
                block.clear();
            }
        }
        self.hasher.update(&block);
        Ok(())
    }

    /// The digest in hexadecimal.
    pub(crate) fn finish(self) -> String {
        self.hasher.finalize().to_hex().to_string()
    }
}

fn describe(field: &Field) -> String {
    format!("{}:{}\n", field.name(), field.data_type())
}

fn push(out: &mut Vec<u8>, column: &ArrayRef, row: usize) -> Result<(), String> {
    if column.is_null(row) {
        out.push(0);
        return Ok(());
    }
    out.push(1);
    match column.data_type() {
        DataType::Int16 => out.extend(column.as_primitive::<Int16Type>().value(row).to_le_bytes()),
        DataType::Int32 => out.extend(column.as_primitive::<Int32Type>().value(row).to_le_bytes()),
        DataType::Int64 => out.extend(column.as_primitive::<Int64Type>().value(row).to_le_bytes()),
        DataType::Float64 => {
            let value = column.as_primitive::<Float64Type>().value(row);
            out.extend(value.to_bits().to_le_bytes());
        }
        DataType::Boolean => out.push(u8::from(column.as_boolean().value(row))),
        DataType::Utf8 => push_bytes(out, column.as_string::<i32>().value(row).as_bytes()),
        DataType::Binary => push_bytes(out, column.as_binary::<i32>().value(row)),
        other => return Err(format!("a column of type {other} has no canonical form")),
    }
    Ok(())
}

fn push_bytes(out: &mut Vec<u8>, bytes: &[u8]) {
    out.extend((bytes.len() as u64).to_le_bytes());
    out.extend(bytes);
}
