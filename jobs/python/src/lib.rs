//! The wheel `tilefold`: what the command line does, from Python.
//!
//! This crate translates and decides nothing: arguments go to the engine, tables come back as Arrow
//! C streams, reports as JSON, and an error as the exception `TilefoldError` with its whole sentence.
//! The typed face is in `python/tilefold`, beside the runners for Ray and Spark.

mod cluster;
mod codes;
mod failure;
mod job;
mod store;
mod stream;

use pyo3::prelude::*;

/// What `python/tilefold` stands on.
#[pymodule]
fn _tilefold(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("TilefoldError", py.get_type::<failure::TilefoldError>())?;
    module.add("ConflictError", py.get_type::<failure::ConflictError>())?;
    module.add_class::<store::Store>()?;
    module.add_class::<store::Snapshot>()?;
    module.add_class::<stream::Rows>()?;
    module.add_class::<cluster::Driver>()?;
    module.add_class::<cluster::Worker>()?;
    module.add_function(wrap_pyfunction!(codes::codes, module)?)?;
    module.add_function(wrap_pyfunction!(job::init, module)?)?;
    module.add_function(wrap_pyfunction!(job::run, module)?)?;
    module.add_function(wrap_pyfunction!(job::plan, module)?)?;
    module.add_function(wrap_pyfunction!(job::inspect, module)?)?;
    module.add_function(wrap_pyfunction!(job::detect, module)?)?;
    Ok(())
}
