//! Rows between machines: Arrow IPC streams in the schemas of the store's tables.

use arrow_ipc::reader::StreamReader;
use arrow_ipc::writer::StreamWriter;
use tilefold_schemas::table::Table;

use crate::error::EngineError;

/// Rows as an Arrow IPC stream.
///
/// # Errors
/// They cannot be encoded, which is a defect.
pub(super) fn bytes<R: Table>(rows: Vec<R>) -> Result<Vec<u8>, EngineError> {
    let write = || {
        let mut bytes = Vec::new();
        let mut writer = StreamWriter::try_new(&mut bytes, R::schema().as_ref())?;
        writer.write(&R::to_batch(rows))?;
        writer.finish()?;
        drop(writer);
        Ok::<_, arrow_schema::ArrowError>(bytes)
    };
    write().map_err(|error| broken::<R>(&error))
}

/// The rows of an Arrow IPC stream.
///
/// # Errors
/// It is cut, or of another table.
pub(super) fn rows<R: Table>(bytes: &[u8]) -> Result<Vec<R>, EngineError> {
    let reader = StreamReader::try_new(bytes, None).map_err(|error| broken::<R>(&error))?;
    let mut all = Vec::new();
    for batch in reader {
        let batch = batch.map_err(|error| broken::<R>(&error))?;
        all.extend(R::from_batch(&batch).map_err(|error| broken::<R>(&error))?);
    }
    Ok(all)
}

fn broken<R: Table>(error: &dyn std::fmt::Display) -> EngineError {
    EngineError::Cluster(format!("rows of `{}` cannot be read: {error}", R::NAME))
}
