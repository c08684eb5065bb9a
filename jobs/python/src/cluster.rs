//! The two sides of a job on a cluster. Whatever travels is text (JSON) and bytes (Arrow IPC), so that
//! any runner can carry it.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;
use serde::de::DeserializeOwned;
use tilefold_engine::cluster::{Manifest, Part, Reduced};
use tilefold_engine::{EngineError, Silent, cluster};

use crate::failure::failed;
use crate::job::{options, perception};

/// A manifest in transit: its text, and rows of the table `chunks`.
type ManifestParts = (String, Vec<u8>);
/// A part in transit: rows of evidence, sightings, footprints.
type PartBytes = (Vec<u8>, Vec<u8>, Vec<u8>);
/// A part on its way to Python.
type PyPart<'py> = (
    Bound<'py, PyBytes>,
    Bound<'py, PyBytes>,
    Bound<'py, PyBytes>,
);
/// What a map task made, on its way to Python.
type PyMapped<'py> = ((String, Bound<'py, PyBytes>), Vec<PyPart<'py>>);
/// What a reduce task made, in transit: its text; records, sightings, footprints.
type ReducedParts = (String, PartBytes);

fn text<T: Serialize>(value: &T) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| failed(&error))
}

fn parsed<T: DeserializeOwned>(text: &str) -> PyResult<T> {
    serde_json::from_str(text).map_err(|error| failed(&error))
}

/// The driver's side.
#[pyclass(module = "tilefold._tilefold", frozen)]
pub(crate) struct Driver(Mutex<cluster::Driver>);

impl Driver {
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut cluster::Driver) -> Result<T, EngineError> + Send,
    ) -> PyResult<T> {
        let done = py.detach(|| work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner)));
        done.map_err(|error| failed(&error))
    }
}

#[pymethods]
impl Driver {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "Python gives them names")]
    fn new(
        py: Python<'_>,
        store: PathBuf,
        logs: Vec<PathBuf>,
        model: &str,
        registration: bool,
        as_of_ns: Option<i64>,
        detector: Option<PathBuf>,
        onnxruntime: Option<PathBuf>,
        tasks: usize,
        groups: u32,
    ) -> PyResult<Self> {
        let options = options(model, registration, as_of_ns)?;
        let perception = perception(detector.as_deref(), onnxruntime.as_deref(), None)?;
        let seen_by = perception.map(|perception| perception.model().digest);
        let split = (tasks, groups);
        let planned =
            py.detach(|| cluster::Driver::plan(&store, &logs, options, seen_by, split, &Silent));
        let planned = planned.map_err(|error| failed(&error))?;
        Ok(Self(Mutex::new(planned)))
    }

    #[classattr]
    const ATTEMPTS: usize = cluster::Driver::ATTEMPTS;

    fn job(&self, py: Python<'_>) -> PyResult<String> {
        let job = self.with(py, |driver| Ok(driver.job().clone()))?;
        text(&job)
    }

    fn tasks(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let tasks = self.with(py, |driver| Ok(driver.tasks().to_vec()))?;
        tasks.iter().map(text).collect()
    }

    fn mapped(&self, py: Python<'_>, manifests: Vec<ManifestParts>) -> PyResult<()> {
        let read = |(words, chunks): ManifestParts| {
            let mut manifest: Manifest = parsed(&words)?;
            manifest.chunks = chunks;
            Ok(manifest)
        };
        let manifests: PyResult<Vec<Manifest>> = manifests.into_iter().map(read).collect();
        let manifests = manifests?;
        self.with(py, |driver| driver.mapped(manifests))
    }

    fn reductions(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let asked = self.with(py, |driver| Ok(driver.reductions()?.to_vec()))?;
        asked.iter().map(text).collect()
    }

    fn catch_up(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, cluster::Driver::catch_up)
    }

    fn commit(&self, py: Python<'_>, reduced: Vec<ReducedParts>) -> PyResult<String> {
        let read = |(words, (records, sightings, footprints)): ReducedParts| {
            let mut reduced: Reduced = parsed(&words)?;
            reduced.records = records;
            reduced.sightings = sightings;
            reduced.footprints = footprints;
            Ok(reduced)
        };
        let reduced: PyResult<Vec<Reduced>> = reduced.into_iter().map(read).collect();
        let reduced = reduced?;
        let report = self.with(py, |driver| driver.commit(&reduced, &Silent))?;
        text(&report)
    }
}

/// A machine's side: one for all tasks of a job that a process runs.
#[pyclass(module = "tilefold._tilefold", frozen)]
pub(crate) struct Worker {
    worker: cluster::Worker,
    threads: ThreadPool,
}

impl Worker {
    fn work<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&cluster::Worker) -> Result<T, EngineError> + Send,
    ) -> PyResult<T> {
        let done = py.detach(|| self.threads.install(|| work(&self.worker)));
        done.map_err(|error| failed(&error))
    }
}

#[pymethods]
impl Worker {
    #[new]
    fn new(
        py: Python<'_>,
        job: &str,
        detector: Option<PathBuf>,
        onnxruntime: Option<PathBuf>,
        cuda: Option<i32>,
        threads: usize,
    ) -> PyResult<Self> {
        let job: cluster::Job = parsed(job)?;
        let perception = perception(detector.as_deref(), onnxruntime.as_deref(), cuda)?;
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        let threads = pool.map_err(|error| failed(&error))?;
        let opened = py.detach(|| threads.install(|| cluster::Worker::open(job, perception)));
        let worker = opened.map_err(|error| failed(&error))?;
        Ok(Self { worker, threads })
    }

    fn map<'py>(&self, py: Python<'py>, task: &str) -> PyResult<PyMapped<'py>> {
        let task: cluster::Task = parsed(task)?;
        let partial = self.work(py, |worker| worker.map(&task))?;
        let manifest = &partial.manifest;
        let manifest = (text(manifest)?, PyBytes::new(py, &manifest.chunks));
        let part = |part: &Part| {
            (
                PyBytes::new(py, &part.evidence),
                PyBytes::new(py, &part.sightings),
                PyBytes::new(py, &part.footprints),
            )
        };
        Ok((manifest, partial.parts.iter().map(part).collect()))
    }

    fn reduce<'py>(
        &self,
        py: Python<'py>,
        reduction: &str,
        parts: Vec<(usize, PartBytes)>,
    ) -> PyResult<(String, PyPart<'py>)> {
        let reduction: cluster::Reduction = parsed(reduction)?;
        let part = |(task, (evidence, sightings, footprints))| {
            let part = Part {
                evidence,
                sightings,
                footprints,
            };
            (task, part)
        };
        let parts: Vec<(usize, Part)> = parts.into_iter().map(part).collect();
        let reduced = self.work(py, |worker| worker.reduce(&reduction, &parts))?;
        let bytes = (
            PyBytes::new(py, &reduced.records),
            PyBytes::new(py, &reduced.sightings),
            PyBytes::new(py, &reduced.footprints),
        );
        Ok((text(&reduced)?, bytes))
    }
}
