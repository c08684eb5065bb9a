//! Jobs of the engine: arguments in, a report as JSON out. Python's lock is let go meanwhile.

use std::error::Error;
use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use serde::Serialize;
use tilefold_engine::detect::Outputs;
use tilefold_engine::inspect::inspect as inspect_file;
use tilefold_engine::{
    Device, FusionModel, InitOptions, Meter, Perception, Registering, RunOptions, Silent,
};

use crate::failure::{TilefoldError, failed};

/// Runs `work` without Python's lock, on this many threads (0: all), and gives its report as JSON.
fn report<T: Serialize + Send, E: Error + Send + 'static>(
    py: Python<'_>,
    threads: usize,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<String> {
    let done = py.detach(|| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.map(|pool| pool.install(work))
    });
    let done = done.map_err(|error| failed(&error))?;
    let value = done.map_err(|error| failed(&error))?;
    serde_json::to_string(&value).map_err(|error| failed(&error))
}

/// The options of a run by their names.
///
/// # Errors
/// There is no such fusion model.
pub(crate) fn options(
    model: &str,
    registration: bool,
    as_of_ns: Option<i64>,
) -> PyResult<RunOptions> {
    let named = FusionModel::ALL.into_iter().find(|one| one.name() == model);
    let model = named.ok_or_else(|| {
        let names = FusionModel::ALL.map(FusionModel::name).join(" and ");
        TilefoldError::new_err(format!(
            "there is no fusion model {model:?}; there are {names}"
        ))
    })?;
    Ok(RunOptions {
        model,
        registering: if registration {
            Registering::On
        } else {
            Registering::Off
        },
        as_of_ns,
    })
}

/// The network of a card, if one is named.
///
/// # Errors
/// It cannot be used.
pub(crate) fn perception(
    card: Option<&Path>,
    onnxruntime: Option<&Path>,
    cuda: Option<i32>,
) -> PyResult<Option<Perception>> {
    let device = cuda.map_or(Device::Cpu, Device::Cuda);
    card.map(|card| Perception::open(card, onnxruntime, device).map_err(|error| failed(&error)))
        .transpose()
}

#[pyfunction]
pub(crate) fn init(
    py: Python<'_>,
    store: PathBuf,
    maps: Vec<PathBuf>,
    tile_level: u8,
    salt: Option<[u8; 32]>,
) -> PyResult<String> {
    let options = InitOptions { tile_level, salt };
    report(py, 0, || tilefold_engine::init(&store, &maps, &options))
}

#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "Python gives them names")]
pub(crate) fn run(
    py: Python<'_>,
    store: PathBuf,
    logs: Vec<PathBuf>,
    model: &str,
    registration: bool,
    as_of_ns: Option<i64>,
    detector: Option<PathBuf>,
    onnxruntime: Option<PathBuf>,
    cuda: Option<i32>,
    threads: usize,
) -> PyResult<String> {
    let options = options(model, registration, as_of_ns)?;
    let perception = perception(detector.as_deref(), onnxruntime.as_deref(), cuda)?;
    report(py, threads, || {
        tilefold_engine::run_seeing(&store, &logs, options, perception.as_ref(), &Silent)
    })
}

#[pyfunction]
pub(crate) fn plan(
    py: Python<'_>,
    logs: Vec<PathBuf>,
    detector: Option<PathBuf>,
    onnxruntime: Option<PathBuf>,
) -> PyResult<String> {
    let perception = perception(detector.as_deref(), onnxruntime.as_deref(), None)?;
    report(py, 0, || {
        let meter = Meter::default();
        let plan = tilefold_engine::plan(&logs, perception.as_ref(), &meter, &Silent);
        Ok::<_, tilefold_engine::EngineError>(plan)
    })
}

#[pyfunction]
pub(crate) fn inspect(py: Python<'_>, file: PathBuf) -> PyResult<String> {
    report(py, 0, || inspect_file(&file))
}

#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "Python gives them names")]
pub(crate) fn detect(
    py: Python<'_>,
    input: PathBuf,
    card: PathBuf,
    onnxruntime: Option<PathBuf>,
    cuda: Option<i32>,
    overlay: Option<PathBuf>,
    annotations: Option<PathBuf>,
    threads: usize,
) -> PyResult<String> {
    let device = cuda.map_or(Device::Cpu, Device::Cuda);
    let perception =
        Perception::open(&card, onnxruntime.as_deref(), device).map_err(|error| failed(&error))?;
    report(py, threads, || {
        let outputs = Outputs {
            overlay: overlay.as_deref(),
            annotations: annotations.as_deref(),
        };
        tilefold_engine::detect::detect(&input, &perception, outputs, &Silent)
    })
}
