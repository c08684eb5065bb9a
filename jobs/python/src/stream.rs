//! Rows of a table on their way out: an Arrow C stream, which pyarrow, pandas, Polars and DuckDB take
//! without a copy.

use std::collections::HashMap;
use std::ffi::CStr;
use std::sync::{Arc, Mutex, PoisonError};

use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{RecordBatch, RecordBatchIterator};
use arrow_schema::{ArrowError, Field, Schema, SchemaRef};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use tilefold_store::{Batches, StoredTable};

/// Name that the Arrow PyCapsule interface gives to streams.
const STREAM: &CStr = c"arrow_array_stream";
/// Field metadata that makes a WKB column a geometry of longitude and latitude.
const EXTENSION: [(&str, &str); 2] = [
    ("ARROW:extension:name", "geoarrow.wkb"),
    (
        "ARROW:extension:metadata",
        r#"{"crs":"OGC:CRS84","crs_type":"authority_code"}"#,
    ),
];

/// Rows that can be read once, a data file at a time.
#[pyclass(module = "tilefold._tilefold")]
pub(crate) struct Rows {
    schema: SchemaRef,
    batches: Mutex<Option<Batches>>,
}

impl Rows {
    pub(crate) fn of<R: StoredTable>(batches: Batches) -> Self {
        Self {
            schema: described(&R::schema(), R::GEOMETRY),
            batches: Mutex::new(Some(batches)),
        }
    }
}

#[pymethods]
impl Rows {
    /// The stream; the schema that a consumer may ask for is left to it.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        drop(requested_schema);
        let taken = self
            .batches
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        let batches = taken.ok_or_else(|| {
            PyValueError::new_err("these rows were read already; ask the snapshot for them again")
        })?;
        let schema = self.schema.clone();
        let read = batches.map(move |batch| {
            let batch = batch.map_err(|error| ArrowError::ExternalError(Box::new(error)))?;
            RecordBatch::try_new(schema.clone(), batch.columns().to_vec())
        });
        let reader = RecordBatchIterator::new(read, self.schema.clone());
        let stream = FFI_ArrowArrayStream::new(Box::new(reader));
        PyCapsule::new_with_value(py, stream, STREAM)
    }
}

/// The schema, with geometry columns that say that they are.
fn described(schema: &Schema, geometry: &[&str]) -> SchemaRef {
    let field = |field: &Arc<Field>| {
        if !geometry.contains(&field.name().as_str()) {
            return field.clone();
        }
        let metadata = EXTENSION.map(|(key, value)| (key.to_owned(), value.to_owned()));
        Arc::new(
            field
                .as_ref()
                .clone()
                .with_metadata(HashMap::from(metadata)),
        )
    };
    let fields: Vec<Arc<Field>> = schema.fields().iter().map(field).collect();
    Arc::new(Schema::new(fields))
}
