//! `demo`: a small city made in code, through the same path as real logs.

use std::error::Error;
use std::path::Path;

use tilefold_city::{CitySpec, LogProfile, Site};
use tilefold_engine::evaluate::Options;
use tilefold_engine::frames::{self, Outputs, Sources};
use tilefold_engine::{
    FusionModel, InitOptions, Perception, RunOptions, explain, init, run_seeing,
};
use tilefold_review::ReviewError;
use tilefold_schemas::{ChangeRecord, Verdict};
use tilefold_store::{Snapshot, Store, TileFilter};

use crate::args::{Args, Format};
use crate::command::{Asked, scored, words_of_init};
use crate::report::{Outcome, print_set_aside, to_stdout};
use crate::{evaluation, progress, review, table};

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
    tell!("making a city (seed {seed}) in {}", out.display());
    if perception.is_some() {
        tell!(
            "rendering what {} cameras see: this takes minutes",
            spec.vehicles
        );
    }
    let city = tilefold_city::write(&spec, out)?;
    let options = InitOptions {
        tile_level: 15,
        salt: None,
    };
    let made = init(&store, &[city.before_map], &options)?;
    say(args, words_of_init(&made))?;
    let progress = progress::listener(args.progress);
    let options = RunOptions::default();
    let ran = run_seeing(&store, &city.logs, options, perception, progress.as_ref())?;
    say(args, table::run(&ran))?;
    print_set_aside(&ran.set_aside);
    let report = out.join("report");
    let asked = Asked {
        store: &store,
        truth: Some(&city.truth),
        version: None,
        model: FusionModel::Calibrated,
        matching: None,
        plots: Some(&report),
    };
    let evaluation = scored(args, &asked, &Options::default())?;
    say(args, evaluation::words(&evaluation))?;
    if perception.is_some() {
        show_surest(
            &Store::open(store.clone())?.snapshot(None)?,
            perception,
            &report,
        )?;
    }
    tell!(
        "the map with the changes on it is {}; the store is {}: try `tilefold show` and `tilefold export --format geojson` on it",
        report.join("overview.svg").display(),
        store.display()
    );
    point_to_page(&store, &out.join("review"))?;
    if args.format == Format::Json {
        let all = serde_json::json!({ "init": made, "run": ran, "evaluate": evaluation });
        to_stdout(&format!("{all:#}\n"))?;
    }
    Ok(Outcome::with(&ran.set_aside))
}

/// What a step has to say, at once; as JSON, all steps are said together at the end.
fn say(args: &Args, words: String) -> Result<(), Box<dyn Error>> {
    match args.format {
        Format::Json => Ok(()),
        _ => to_stdout(&format!("{}\n", words.trim_end())),
    }
}

/// Writes the review page beside the store and says how to open it. Without its map library the demo
/// is whole all the same.
fn point_to_page(store: &Path, folder: &Path) -> Result<(), Box<dyn Error>> {
    if folder.exists() {
        std::fs::remove_dir_all(folder)?;
    }
    match review::write_page_of(store, folder)? {
        Some(report) => tell!(
            "the review page is {}: open it in a browser; or, to keep what you decide with the store, run `tilefold serve {}`",
            report.page.display(),
            store.display()
        ),
        None => tell!("{}", ReviewError::NoMapLibrary),
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
    let outputs = Outputs {
        folder: Some(report),
        ..Outputs::default()
    };
    let pictures = frames::write(snapshot, &frames, sources, outputs)?;
    if let Some(picture) = pictures.written.first() {
        tell!(
            "a frame that speaks for the surest change ({:016x}), with detections, map and verdicts, is {}",
            surest.change,
            picture.display()
        );
    }
    Ok(())
}
