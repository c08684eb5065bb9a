//! `demo`: a small city made in code, through the same path as real logs.

use std::error::Error;
use std::path::Path;

use tilefold_city::{CitySpec, LogProfile, Site};
use tilefold_engine::evaluate::Options;
use tilefold_engine::frames::{self, Sources};
use tilefold_engine::{FusionModel, InitOptions, Perception, RunOptions, explain};
use tilefold_review::ReviewError;
use tilefold_schemas::{ChangeRecord, Verdict};
use tilefold_store::{Snapshot, Store, TileFilter};

use crate::args::Args;
use crate::command::{Asked, init_store, run_logs, score};
use crate::report::Outcome;
use crate::review;

/// Makes the city, runs the job on it and scores both folds. With `perception`, the vehicles have
/// cameras, and the surest change is shown in the frames that say most about it.
///
/// # Errors
/// The folder cannot be written, or a step failed.
pub(crate) fn demo(
    args: &Args,
    out: &Path,
    seed: u64,
    perception: Option<&Perception>,
) -> Result<Outcome, Box<dyn Error>> {
    let store = out.join("store");
    if store.exists() {
        std::fs::remove_dir_all(&store)?;
    }
    let spec = city(seed, perception.is_some());
    eprintln!("making a city (seed {seed}) in {}", out.display());
    if perception.is_some() {
        eprintln!(
            "rendering what {} cameras see: this takes minutes",
            spec.vehicles
        );
    }
    let city = tilefold_city::write(&spec, out)?;
    let options = InitOptions {
        tile_level: 15,
        salt: None,
    };
    init_store(args, &store, &[city.before_map], &options)?;
    let outcome = run_logs(args, &store, &city.logs, RunOptions::default(), perception)?;
    let report = out.join("report");
    let asked = Asked {
        store: &store,
        truth: Some(&city.truth),
        version: None,
        model: FusionModel::Calibrated,
        matching: None,
        plots: Some(&report),
    };
    score(args, &asked, &Options::default())?;
    if perception.is_some() {
        show_surest(
            &Store::open(store.clone())?.snapshot(None)?,
            perception,
            &report,
        )?;
    }
    eprintln!(
        "the map with the changes on it is {}; the store is {}: try `tilefold show` and `tilefold export --format geojson` on it",
        report.join("overview.svg").display(),
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
    match review::write_page_of(store, folder)? {
        Some(report) => eprintln!(
            "the review page is {}: open it in a browser; or, to keep what you decide with the store, run `tilefold serve {}`",
            report.page.display(),
            store.display()
        ),
        None => eprintln!("{}", ReviewError::NoMapLibrary),
    }
    Ok(())
}

fn city(seed: u64, has_cameras: bool) -> CitySpec {
    if !has_cameras {
        return CitySpec {
            seed,
            ..CitySpec::default()
        };
    }
    CitySpec {
        seed,
        site: Site::Drawn { km: 1.0 },
        change_share: 0.1,
        vehicles: 16,
        drives: 16,
        drive_km: 0.8,
        profile: LogProfile::Camera,
        noise: "cameras".to_owned(),
        ..CitySpec::default()
    }
}

/// Writes the frames that say most about the surest change.
fn show_surest(
    snapshot: &Snapshot,
    perception: Option<&Perception>,
    report: &Path,
) -> Result<(), Box<dyn Error>> {
    let records: Vec<ChangeRecord> = snapshot.read(TileFilter::All)?;
    let is_change = |record: &&ChangeRecord| {
        let verdict = Verdict::from_code(record.verdict);
        matches!(
            verdict,
            Some(Verdict::Removed | Verdict::Modified | Verdict::Added)
        )
    };
    let surest =
        (records.iter().filter(is_change)).max_by(|a, b| a.log_odds.total_cmp(&b.log_odds));
    let Some(surest) = surest else {
        return Ok(());
    };
    let told = explain(snapshot, &format!("{:016x}", surest.change))?;
    let frames: Vec<_> = told.into_iter().flat_map(|told| told.frames).collect();
    let sources = Sources {
        logs: &[],
        perception,
    };
    let pictures = frames::write(snapshot, &frames, sources, report)?;
    if let Some(picture) = pictures.written.first() {
        eprintln!(
            "a frame that speaks for the surest change ({:016x}), with detections, map and verdicts, is {}",
            surest.change,
            picture.display()
        );
    }
    Ok(())
}
