//! `demo`: a small city made in code, through the same path as real logs.

use std::error::Error;
use std::path::Path;

use tilefold_city::CitySpec;
use tilefold_engine::evaluate::Options;
use tilefold_engine::{FusionModel, InitOptions, RunOptions};
use tilefold_review::ReviewError;

use crate::args::Args;
use crate::command::{Asked, init_store, run_logs, score};
use crate::report::Outcome;
use crate::review;

/// Makes the city, runs the job on it and scores both folds.
///
/// # Errors
/// The folder cannot be written, or a step failed.
pub(crate) fn demo(args: &Args, out: &Path, seed: u64) -> Result<Outcome, Box<dyn Error>> {
    let spec = CitySpec {
        seed,
        ..CitySpec::default()
    };
    let store = out.join("store");
    if store.exists() {
        std::fs::remove_dir_all(&store)?;
    }
    eprintln!("making a city (seed {seed}) in {}", out.display());
    let city = tilefold_city::write(&spec, out)?;
    let options = InitOptions {
        tile_level: 15,
        salt: None,
    };
    init_store(args, &store, &[city.before_map], &options)?;
    let outcome = run_logs(args, &store, &city.logs, RunOptions::default(), None)?;
    let asked = Asked {
        store: &store,
        truth: Some(&city.truth),
        version: None,
        model: FusionModel::Calibrated,
        matching: None,
        plots: Some(&out.join("report")),
    };
    score(args, &asked, &Options::default())?;
    eprintln!(
        "the map with the changes on it is {}; the store is {}: try `tilefold show` and `tilefold export --format geojson` on it",
        out.join("report/overview.svg").display(),
        store.display()
    );
    point_to_page(&store, &out.join("review"))?;
    Ok(outcome)
}

/// Writes the review page beside the store and says how to open it. Without its map library the demo
/// is whole all the same.
fn point_to_page(store: &Path, folder: &Path) -> Result<(), Box<dyn Error>> {
    if folder.exists() {
        std::fs::remove_dir_all(folder)?;
    }
    match review::write_page_of(store, folder) {
        Ok(report) => eprintln!(
            "the review page is {}: open it in a browser; or, to keep what you decide with the store, run `tilefold serve {}`",
            report.page.display(),
            store.display()
        ),
        Err(ReviewError::NoMapLibrary) => eprintln!("{}", ReviewError::NoMapLibrary),
        Err(error) => return Err(error.into()),
    }
    Ok(())
}
