//! How the type of one field becomes one or more Arrow columns, and back.
//!
//! Only types that Delta Lake knows are used: there are no unsigned integers and no fixed-size
//! lists in it, so hashes are kept as `i64` bit patterns and histograms as one column a bin.

use std::sync::Arc;

use arrow_array::{
    Array, ArrayRef, BinaryArray, BooleanArray, Float64Array, Int16Array, Int32Array, Int64Array,
    RecordBatch, StringArray,
};
use arrow_schema::{DataType, Field};

/// Why a batch could not be read as rows of a table.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ColumnError {
    /// The batch lacks a column of the table.
    #[error("column `{0}` is missing; the table was written by another version of Tilefold")]
    Missing(String),
    /// The column has another Arrow type than the table says.
    #[error("column `{name}` has the type {found}, expected {expected}")]
    Type {
        /// Column name.
        name: String,
        /// Type found in the batch.
        found: String,
        /// Type the table declares.
        expected: String,
    },
    /// A value that may not be null is null.
    #[error("column `{name}` is null in row {row}, but must have a value")]
    Null {
        /// Column name.
        name: String,
        /// Zero-based row in the batch.
        row: usize,
    },
    /// A value outside what its type allows.
    #[error("column `{name}` has the value {value} in row {row}, which is none of the known ones")]
    Value {
        /// Column name.
        name: String,
        /// Zero-based row in the batch.
        row: usize,
        /// The value found.
        value: String,
    },
}

/// A field type that can be stored as Arrow columns.
pub trait Column: Sized {
    /// The Arrow fields of a column of this type called `name`.
    fn fields(name: &str) -> Vec<Field>;
    /// The arrays for `values`, in the order of [`Column::fields`].
    fn arrays(values: Vec<Self>) -> Vec<ArrayRef>;
    /// All values of the column called `name` in `batch`.
    ///
    /// # Errors
    /// A missing column, another type, or a null where none may be.
    fn values(name: &str, batch: &RecordBatch) -> Result<Vec<Self>, ColumnError>;
}

fn downcast<'a, A: Array + 'static>(
    name: &str,
    expected: &DataType,
    batch: &'a RecordBatch,
) -> Result<&'a A, ColumnError> {
    let array = batch
        .column_by_name(name)
        .ok_or_else(|| ColumnError::Missing(name.to_owned()))?;
    array
        .as_any()
        .downcast_ref::<A>()
        .ok_or_else(|| ColumnError::Type {
            name: name.to_owned(),
            found: array.data_type().to_string(),
            expected: expected.to_string(),
        })
}

fn refuse_nulls(name: &str, array: &dyn Array) -> Result<(), ColumnError> {
    match (0..array.len()).find(|&row| array.is_null(row)) {
        None => Ok(()),
        Some(row) => Err(ColumnError::Null {
            name: name.to_owned(),
            row,
        }),
    }
}

macro_rules! column {
    ($type:ty, $array:ty, $data_type:expr, $to:expr) => {
        impl Column for $type {
            fn fields(name: &str) -> Vec<Field> {
                vec![Field::new(name, $data_type, false)]
            }
            fn arrays(values: Vec<Self>) -> Vec<ArrayRef> {
                vec![Arc::new(<$array>::from_iter_values(values))]
            }
            fn values(name: &str, batch: &RecordBatch) -> Result<Vec<Self>, ColumnError> {
                let array: &$array = downcast(name, &$data_type, batch)?;
                refuse_nulls(name, array)?;
                Ok(array.iter().flatten().map($to).collect())
            }
        }
        impl Column for Option<$type> {
            fn fields(name: &str) -> Vec<Field> {
                vec![Field::new(name, $data_type, true)]
            }
            fn arrays(values: Vec<Self>) -> Vec<ArrayRef> {
                vec![Arc::new(values.into_iter().collect::<$array>())]
            }
            fn values(name: &str, batch: &RecordBatch) -> Result<Vec<Self>, ColumnError> {
                let array: &$array = downcast(name, &$data_type, batch)?;
                Ok(array.iter().map(|value| value.map($to)).collect())
            }
        }
    };
}

column!(i64, Int64Array, DataType::Int64, |value| value);
column!(i32, Int32Array, DataType::Int32, |value| value);
column!(i16, Int16Array, DataType::Int16, |value| value);
column!(f64, Float64Array, DataType::Float64, |value| value);
column!(String, StringArray, DataType::Utf8, |value: &str| value
    .to_owned());
column!(Vec<u8>, BinaryArray, DataType::Binary, |value: &[u8]| value
    .to_owned());

impl Column for bool {
    fn fields(name: &str) -> Vec<Field> {
        vec![Field::new(name, DataType::Boolean, false)]
    }
    fn arrays(values: Vec<Self>) -> Vec<ArrayRef> {
        vec![Arc::new(BooleanArray::from(values))]
    }
    fn values(name: &str, batch: &RecordBatch) -> Result<Vec<Self>, ColumnError> {
        let array: &BooleanArray = downcast(name, &DataType::Boolean, batch)?;
        refuse_nulls(name, array)?;
        Ok(array.iter().flatten().collect())
    }
}

/// A histogram: one column a bin, named `name_00`, `name_01`, ...
impl<const N: usize> Column for [i32; N] {
    fn fields(name: &str) -> Vec<Field> {
        (0..N)
            .map(|bin| Field::new(format!("{name}_{bin:02}"), DataType::Int32, false))
            .collect()
    }
    fn arrays(values: Vec<Self>) -> Vec<ArrayRef> {
        (0..N)
            .map(|bin| {
                let column = values.iter().map(|histogram| histogram[bin]);
                Arc::new(Int32Array::from_iter_values(column)) as ArrayRef
            })
            .collect()
    }
    fn values(name: &str, batch: &RecordBatch) -> Result<Vec<Self>, ColumnError> {
        let mut histograms = vec![[0; N]; batch.num_rows()];
        for bin in 0..N {
            let column = i32::values(&format!("{name}_{bin:02}"), batch)?;
            for (histogram, value) in histograms.iter_mut().zip(column) {
                histogram[bin] = value;
            }
        }
        Ok(histograms)
    }
}
