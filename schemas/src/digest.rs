//! The digest of a table's rows: independent of files, batches, histories and library versions.
//!
//! The columns (name and type) are hashed first, then the rows in the table's order, each as the
//! sequence of its values: a byte that says whether there is one, then integers in little-endian
//! order, the bit patterns of floats, and texts and bytes behind their 64-bit lengths.

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int16Type, Int32Type, Int64Type};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Schema};

/// Rows that are turned into bytes at once.
const BLOCK_ROWS: usize = 1024;

/// A column of this Arrow type has no canonical form.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a column of type {0} has no canonical form")]
pub struct NoCanonicalForm(DataType);

/// Collects the rows of one table.
#[derive(Debug)]
pub struct TableDigest {
    hasher: blake3::Hasher,
    columns: Vec<usize>,
}

impl TableDigest {
    /// Of a table with this schema, but for the columns `not_digested`.
    #[must_use]
    pub fn new(schema: &Schema, not_digested: &[&str]) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"tilefold table 1\n");
        let mut columns = Vec::new();
        for (index, field) in schema.fields().iter().enumerate() {
            if !not_digested.contains(&field.name().as_str()) {
                hasher.update(describe(field).as_bytes());
                columns.push(index);
            }
        }
        Self { hasher, columns }
    }

    /// Adds rows; batches must come in the table's order, with the columns of its schema.
    ///
    /// # Errors
    /// A column is of a type that no table has.
    pub fn update(&mut self, rows: &RecordBatch) -> Result<(), NoCanonicalForm> {
        let columns: Vec<&ArrayRef> = self.columns.iter().map(|&i| rows.column(i)).collect();
        let mut block = Vec::new();
        for row in 0..rows.num_rows() {
            for column in &columns {
                push(&mut block, column, row)?;
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
    #[must_use]
    pub fn finish(self) -> String {
        self.hasher.finalize().to_hex().to_string()
    }
}

fn describe(field: &Field) -> String {
    format!("{}:{}\n", field.name(), field.data_type())
}

fn push(out: &mut Vec<u8>, column: &ArrayRef, row: usize) -> Result<(), NoCanonicalForm> {
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
        other => return Err(NoCanonicalForm(other.clone())),
    }
    Ok(())
}

fn push_bytes(out: &mut Vec<u8>, bytes: &[u8]) {
    out.extend((bytes.len() as u64).to_le_bytes());
    out.extend(bytes);
}
