//! The whole job on a city: what it finds of the changes.

use std::error::Error;
use std::path::Path;

use serde::Serialize;
use tilefold_city::CityFiles;
use tilefold_engine::evaluate::{Findings, Options, Refold, Subject};
use tilefold_engine::run::run_seeing;
use tilefold_engine::{FusionModel, InitOptions, Perception, Silent, calibrate, evaluate, init};
use tilefold_formats::geojson::read_changes_file;
use tilefold_store::Store;

/// The changes of one city, found from pixels and from detections.
#[derive(Debug, Serialize)]
pub(super) struct Changes {
    pub(super) seed: u64,
    pub(super) from_pixels: Findings,
    /// What the simulator's own detector saw, on drives of the same seed.
    pub(super) from_detections: Findings,
}

/// Runs the job, fits the sensor model, and scores the result.
pub(super) fn found(
    city: &CityFiles,
    perception: Option<&Perception>,
    store: &Path,
) -> Result<Findings, Box<dyn Error>> {
    let options = InitOptions {
        tile_level: 15,
        salt: None,
    };
    init(store, std::slice::from_ref(&city.before_map), &options)?;
    run_seeing(
        store,
        &city.logs,
        FusionModel::Calibrated,
        perception,
        &Silent,
    )?;
    calibrate(store, &Silent)?;
    let refold = Refold::read(&Store::open(store.to_path_buf())?.snapshot(None)?)?;
    let truth = read_changes_file(&city.truth)?;
    let subject = Subject {
        refold: &refold,
        truth: &truth,
    };
    let options = Options {
        single_vehicles: 0,
        ..Options::default()
    };
    Ok(evaluate(&[subject], FusionModel::Calibrated, &options)?.findings)
}
