//! One suite: each seed is simulated, its store made and run; then all seeds are scored together,
//! so that intervals are over the places of all cities.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tempfile::TempDir;
use tilefold_engine::evaluate::{
    ChangeScores, Drives, Evaluation, Findings, Matching, Options, Refold, Subject, matching, plots,
};
use tilefold_engine::{
    Criteria, FusionModel, InitOptions, Silent, calibrate, evaluate, init, run as run_logs,
};
use tilefold_formats::geojson::{TruthChange, read_changes_file};
use tilefold_formats::matching_truth::MatchingTruth;
use tilefold_schemas::evidence::METHOD_VERSION;
use tilefold_store::{Snapshot, Store};

use crate::suite::{Seeds, Suite};

/// Vehicles that are judged alone, of each city.
const SINGLE_VEHICLES: usize = 8;

/// A raw result.
#[derive(Debug, Serialize)]
struct RawResult<'a> {
    suite: &'a Suite,
    seed_set: Seeds,
    seeds: &'a [u64],
    /// Version of the map stage's method.
    method: i32,
    evaluation: &'a Evaluation,
    /// With the built-in sensor model, before any was fitted.
    before_calibration: &'a Findings,
    /// Of a small fleet: what is found where fewer vehicles are enough for a claim.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    few_vehicles: Vec<OfFew>,
}

/// What is found where this many vehicles are enough for a claim.
#[derive(Debug, Serialize)]
struct OfFew {
    min_vehicles: i32,
    change: ChangeScores,
    looked_at: ChangeScores,
}

/// A city after its run.
struct City {
    snapshot: Snapshot,
    refold: Refold,
    /// The same before the sensor model was fitted.
    before: Refold,
    truth: Vec<TruthChange>,
    logs: Vec<PathBuf>,
    /// Which element each detection is of, where the simulator says so.
    matching_truth: Option<MatchingTruth>,
    /// Holds the store and the logs, and is deleted with the city.
    _folder: TempDir,
}

/// Runs a suite; writes `SUITE.json` and its pictures into `out`.
pub(crate) fn run(suite: &Suite, seeds: Seeds, out: &Path) -> Result<(), Box<dyn Error>> {
    let mut cities = Vec::new();
    for &seed in seeds.all() {
        eprintln!("{}: seed {seed}", suite.name);
        cities.push(drive_through(suite, seed)?);
    }
    let subjects = |of: fn(&City) -> &Refold| -> Vec<Subject<'_>> {
        let subject = |city| Subject {
            refold: of(city),
            truth: &city.truth,
        };
        cities.iter().map(subject).collect()
    };
    let options = Options {
        single_vehicles: SINGLE_VEHICLES,
        ..Options::default()
    };
    let fitted = subjects(|city| &city.refold);
    let mut evaluation = evaluate(&fitted, FusionModel::Calibrated, &options)?;
    let built_in = subjects(|city| &city.before);
    let before = evaluate(&built_in, FusionModel::Calibrated, &Options::default())?;
    evaluation.matching = match_all(&cities)?;
    let result = RawResult {
        suite,
        seed_set: seeds,
        seeds: seeds.all(),
        method: METHOD_VERSION,
        evaluation: &evaluation,
        before_calibration: &before.findings,
        few_vehicles: few_vehicles(suite, &fitted)?,
    };
    let pictures = plots::write(&out.join(suite.name), &evaluation)?;
    let file = out.join(format!("{}.json", suite.name));
    fs::write(&file, serde_json::to_string_pretty(&result)? + "\n")?;
    eprintln!(
        "{}: wrote {} and {} pictures",
        suite.name,
        file.display(),
        pictures.len()
    );
    Ok(())
}

/// A fleet that has as many vehicles as a claim takes by default, or fewer, is also scored with fewer.
fn few_vehicles(suite: &Suite, cities: &[Subject<'_>]) -> Result<Vec<OfFew>, Box<dyn Error>> {
    let usual = Criteria::default();
    if i64::from(suite.vehicles) > i64::from(usual.min_vehicles) {
        return Ok(Vec::new());
    }
    let of_few = |min_vehicles| {
        let options = Options {
            criteria: Criteria {
                min_vehicles,
                ..usual
            },
            single_vehicles: 0,
            ..Options::default()
        };
        let found = evaluate(cities, FusionModel::Calibrated, &options)?.findings;
        Ok(OfFew {
            min_vehicles,
            change: found.change,
            looked_at: found.looked_at,
        })
    };
    (2..=usual.min_vehicles).map(of_few).collect()
}

/// How well detections of all cities are matched; none where one of them does not know.
fn match_all(cities: &[City]) -> Result<Option<Matching>, Box<dyn Error>> {
    let drives = cities.iter().map(|city| {
        Some(Drives {
            snapshot: &city.snapshot,
            logs: &city.logs,
            truth: city.matching_truth.as_ref()?,
        })
    });
    let drives: Option<Vec<Drives<'_>>> = drives.collect();
    Ok(drives
        .map(|drives| matching(&drives, &Silent))
        .transpose()?)
}

fn drive_through(suite: &Suite, seed: u64) -> Result<City, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let files = suite.simulate(seed, folder.path())?;
    let location = folder.path().join("store");
    let options = InitOptions {
        tile_level: 15,
        salt: None,
    };
    init(&location, &[files.before_map], &options)?;
    run_logs(&location, &files.logs, FusionModel::Calibrated, &Silent)?;
    let store = Store::open(location.clone())?;
    let before = Refold::read(&store.snapshot(None)?)?;
    calibrate(&location, &Silent)?;
    let snapshot = store.snapshot(None)?;
    let matching_truth = folder.path().join("matching.csv");
    Ok(City {
        refold: Refold::read(&snapshot)?,
        before,
        snapshot,
        truth: read_changes_file(&files.truth)?,
        logs: files.logs,
        matching_truth: matching_truth
            .exists()
            .then(|| MatchingTruth::read_file(&matching_truth))
            .transpose()?,
        _folder: folder,
    })
}
