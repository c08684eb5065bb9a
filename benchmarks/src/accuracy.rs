//! One suite: each seed is simulated, its store made and run; then all seeds are scored together,
//! so that intervals are over the places of all cities.

use std::error::Error;
use std::fs;
use std::path::Path;

use serde::Serialize;
use tilefold_engine::evaluate::{Evaluation, Options, Refold, Subject, plots};
use tilefold_engine::{FusionModel, InitOptions, Silent, evaluate, init, run as run_logs};
use tilefold_formats::geojson::{TruthChange, read_changes_file};
use tilefold_schemas::evidence::METHOD_VERSION;
use tilefold_store::Store;

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
}

/// A city after its run.
struct City {
    refold: Refold,
    truth: Vec<TruthChange>,
}

/// Runs a suite; writes `SUITE.json` and its pictures into `out`.
pub(crate) fn run(suite: &Suite, seeds: Seeds, out: &Path) -> Result<(), Box<dyn Error>> {
    let mut cities = Vec::new();
    for &seed in seeds.all() {
        eprintln!("{}: seed {seed}", suite.name);
        cities.push(drive_through(suite, seed)?);
    }
    let subjects: Vec<Subject<'_>> = cities
        .iter()
        .map(|city| Subject {
            refold: &city.refold,
            truth: &city.truth,
        })
        .collect();
    let options = Options {
        single_vehicles: SINGLE_VEHICLES,
        ..Options::default()
    };
    let evaluation = evaluate(&subjects, FusionModel::Calibrated, &options)?;
    let result = RawResult {
        suite,
        seed_set: seeds,
        seeds: seeds.all(),
        method: METHOD_VERSION,
        evaluation: &evaluation,
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
    let store = Store::open(location)?;
    Ok(City {
        refold: Refold::read(&store.snapshot(None)?)?,
        truth: read_changes_file(&files.truth)?,
    })
}
