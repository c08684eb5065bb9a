//! One function a command: it calls the engine and prints what came of it.

use std::error::Error;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tilefold_engine::evaluate::{Drives, Options, Refold, Subject, matching, overview, plots};
use tilefold_engine::{
    Criteria, Evaluation, FusionModel, InitOptions, InitReport, Limit, Meter, Perception, Progress,
    RunOptions, RunReport, evaluate, init, plan, run_seeing, run_within,
};
use tilefold_formats::geojson::read_changes_file;
use tilefold_formats::matching_truth::MatchingTruth;
use tilefold_schemas::LayerHeader;
use tilefold_store::{Store, TileFilter};

use crate::args::{Args, Command, Runtime};
use crate::at::{At, open};
use crate::metrics::Metrics;
use crate::report::{Outcome, print, print_set_aside, to_stdout};
use crate::{
    bench, calibration, compare, demo, detect, evaluation, explanation, export, inspect, manual,
    progress, rebase, reference, regions, retract, review, simulate, table, vacuum,
};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Does what the arguments say.
///
/// # Errors
/// It failed; nothing has changed.
pub(crate) fn dispatch(args: &Args) -> Result<Outcome> {
    match &args.command {
        Command::Demo {
            out,
            seed,
            detector,
            runtime,
        } => {
            let perception = perception(detector.as_deref(), runtime)?;
            demo::demo(args, out, *seed, perception.as_ref())
        }
        Command::Simulate(simulation) => simulate::simulate(args, simulation),
        Command::Init {
            store,
            map,
            tile_level,
            vehicle_salt,
        } => {
            let options = InitOptions {
                tile_level: *tile_level,
                salt: vehicle_salt.map(|salt| salt.0),
            };
            init_store(args, store, map, &options)
        }
        Command::Run {
            store,
            logs,
            detector,
            runtime,
            plan: true,
            ..
        } => {
            let perception = perception(detector.as_deref(), runtime)?;
            plan_logs(args, store, logs, perception.as_ref())
        }
        Command::Run {
            store,
            logs,
            model,
            as_of,
            registration,
            detector,
            runtime,
            metrics,
            memory,
            ..
        } => {
            let perception = perception(detector.as_deref(), runtime)?;
            let options = RunOptions {
                model: (*model).into(),
                registering: (*registration).into(),
                as_of_ns: *as_of,
            };
            let job = Job {
                store,
                logs,
                options,
                perception: perception.as_ref(),
                memory: *memory,
            };
            run_logs(args, &job, metrics.as_deref())
        }
        Command::Bench(wanted) => bench::bench(args, wanted),
        Command::Detect(asked) => detect::detect_in(args, asked),
        Command::Doctor { cards, runtime } => detect::doctor(args, runtime, cards),
        Command::Calibrate { store } => calibration::calibrate_store(args, store),
        Command::Retract { store, what } => retract::retract_from(args, store, what),
        Command::Rebase { store, map } => rebase::rebase_store(args, store, map),
        Command::Vacuum {
            store,
            retain_days,
            grace_hours,
            dry_run,
        } => vacuum::vacuum_store(args, store, (*retain_days, *grace_hours), *dry_run),
        Command::Inspect { file } => inspect::look_into(args, file),
        Command::Log { store } => log(args, store),
        Command::Show { store, version } => show(args, store, *version),
        Command::Regions {
            store,
            version,
            threshold,
        } => regions::list(args, store, *version, *threshold),
        Command::Explain {
            store,
            id,
            version,
            frames,
        } => explanation::explain_verdict(args, (store, id, *version), frames),
        Command::Verify { store, version } => verify(args, store, *version),
        Command::Compare(asked) => compare::compare(args, asked),
        Command::Export(asked) => export::export(args, asked),
        Command::Serve(asked) => review::serve_page(args, asked),
        Command::Decide(asked) => review::decide(args, asked),
        Command::Evaluate {
            store,
            truth,
            version,
            model,
            threshold,
            min_vehicles,
            single_vehicles,
            place_m,
            seed,
            matching,
            logs,
            plots,
        } => {
            let options = Options {
                criteria: Criteria {
                    threshold: *threshold,
                    min_vehicles: *min_vehicles,
                },
                place_m: *place_m,
                single_vehicles: *single_vehicles,
                seed: *seed,
            };
            let asked = Asked {
                store,
                truth: truth.as_deref(),
                version: *version,
                model: (*model).into(),
                matching: matching.as_deref().map(|truth| (truth, logs.as_slice())),
                plots: plots.as_deref(),
            };
            score(args, &asked, &options)
        }
        Command::Reference => {
            to_stdout(&reference::page())?;
            Ok(Outcome::Done)
        }
        Command::Completions { shell } => {
            manual::completions(*shell)?;
            Ok(Outcome::Done)
        }
        Command::Man { out } => {
            let count = manual::man_pages(out)?;
            print(args, &serde_json::json!({ "pages": count }), |_| {
                let folder = out.display();
                format!("wrote {count} man pages to {folder}: `man -l {folder}/tilefold.1`")
            })?;
            Ok(Outcome::Done)
        }
    }
}

/// What came of `init`, for people.
pub(crate) fn words_of_init(report: &InitReport) -> String {
    format!(
        "created {} at version {}: {} elements in {} tiles",
        report.store, report.version, report.elements, report.tiles
    )
}

fn init_store(
    args: &Args,
    store: &Path,
    maps: &[PathBuf],
    options: &InitOptions,
) -> Result<Outcome> {
    let report = init(store, maps, options)?;
    print(args, &report, words_of_init)?;
    print_set_aside(&report.set_aside);
    Ok(Outcome::with(&report.set_aside))
}

pub(crate) fn perception(card: Option<&Path>, runtime: &Runtime) -> Result<Option<Perception>> {
    card.map(|card| detect::perception(card, runtime))
        .transpose()
}

fn plan_logs(
    args: &Args,
    store: &Path,
    logs: &[PathBuf],
    perception: Option<&Perception>,
) -> Result<Outcome> {
    Store::open(store.to_path_buf())?;
    let progress = progress::listener(args.progress);
    let plan = plan(logs, perception, &Meter::default(), progress.as_ref());
    print(args, &plan, |plan| {
        format!(
            "would read {} logs of {} vehicles: {} messages, {:.1} MB, in {} units of work",
            plan.logs,
            plan.vehicles,
            plan.messages,
            plan.bytes as f64 * 1e-6,
            plan.units
        )
    })?;
    print_set_aside(&plan.set_aside);
    Ok(Outcome::with(&plan.set_aside))
}

/// What `run` is asked for.
struct Job<'a> {
    store: &'a Path,
    logs: &'a [PathBuf],
    options: RunOptions,
    perception: Option<&'a Perception>,
    /// Bytes of memory that it may take.
    memory: Option<u64>,
}

impl Job<'_> {
    fn run(&self, progress: &dyn Progress) -> Result<RunReport> {
        let (store, logs, options, perception) =
            (self.store, self.logs, self.options, self.perception);
        Ok(match self.memory {
            None => run_seeing(store, logs, options, perception, progress)?,
            Some(bytes) => {
                let folder = std::env::temp_dir();
                let limit = Limit { bytes, folder };
                run_within(store, logs, options, perception, &limit, progress)?
            }
        })
    }
}

fn run_logs(args: &Args, job: &Job<'_>, metrics: Option<&Path>) -> Result<Outcome> {
    let progress = progress::listener(args.progress);
    let report = match metrics {
        None => job.run(progress.as_ref())?,
        Some(file) => {
            let metrics = Metrics::begin(file, progress)?;
            let report = job.run(&metrics);
            metrics.end(report.as_ref().ok())?;
            report?
        }
    };
    print(args, &report, table::run)?;
    print_set_aside(&report.set_aside);
    if report.logs == 0 && !job.logs.is_empty() {
        tell!(
            "no log could be read: give MCAP files, or folders that they lie in; nothing was done"
        );
    }
    Ok(Outcome::with(&report.set_aside))
}

#[derive(Serialize)]
struct LogLine {
    version: i64,
    timestamp_ms: i64,
    operation: String,
    parameters: tilefold_store::Parameters,
}

fn log(args: &Args, store: &Path) -> Result<Outcome> {
    let versions = Store::open(store.to_path_buf())?.versions()?;
    let lines: Vec<LogLine> = versions
        .into_iter()
        .map(|info| LogLine {
            version: info.version,
            timestamp_ms: info.timestamp_ms,
            operation: info.operation,
            parameters: info.parameters,
        })
        .collect();
    print(args, &lines, |lines| {
        table::rows(
            &["version", "written (UTC)", "operation", "parameters"],
            lines.iter().map(|line| {
                vec![
                    line.version.to_string(),
                    utc(line.timestamp_ms),
                    line.operation.clone(),
                    serde_json::to_string(&line.parameters).unwrap_or_default(),
                ]
            }),
        )
    })?;
    Ok(Outcome::Done)
}

/// A time as a person reads it.
pub(crate) fn utc(timestamp_ms: i64) -> String {
    chrono::DateTime::from_timestamp_millis(timestamp_ms).map_or_else(String::new, |time| {
        time.format("%Y-%m-%d %H:%M:%S").to_string()
    })
}

#[derive(Serialize)]
struct TileLine {
    tile: i32,
    no_change: i32,
    added: i32,
    removed: i32,
    modified: i32,
    unknown: i32,
    stale: i32,
    digest: String,
}

#[derive(Serialize)]
struct Summary {
    version: i64,
    operation: String,
    fusion_model: Option<String>,
    tiles: Vec<TileLine>,
}

fn show(args: &Args, store: &Path, version: Option<At>) -> Result<Outcome> {
    let snapshot = open(store, version)?;
    let headers: Vec<LayerHeader> = snapshot.read(TileFilter::All)?;
    let summary = Summary {
        version: snapshot.version(),
        operation: snapshot.info().operation.clone(),
        fusion_model: headers.first().map(|header| header.fusion_model.clone()),
        tiles: headers
            .into_iter()
            .map(|header| TileLine {
                tile: header.tile,
                no_change: header.no_change,
                added: header.added,
                removed: header.removed,
                modified: header.modified,
                unknown: header.unknown,
                stale: header.stale,
                digest: header.digest,
            })
            .collect(),
    };
    print(args, &summary, |summary| {
        let tiles = table::rows(
            &[
                "tile",
                "no change",
                "added",
                "removed",
                "modified",
                "unknown",
                "stale",
                "digest",
            ],
            summary.tiles.iter().map(|tile| {
                let counts = [
                    tile.tile,
                    tile.no_change,
                    tile.added,
                    tile.removed,
                    tile.modified,
                    tile.unknown,
                    tile.stale,
                ];
                let mut row: Vec<String> = counts.iter().map(i32::to_string).collect();
                row.push(tile.digest.chars().take(12).collect());
                row
            }),
        );
        format!(
            "version {} ({})\n\n{tiles}",
            summary.version, summary.operation
        )
    })?;
    Ok(Outcome::Done)
}

fn verify(args: &Args, store: &Path, version: Option<At>) -> Result<Outcome> {
    let verification = tilefold_engine::verify(&open(store, version)?)?;
    for finding in &verification.findings {
        tell!("{finding}");
    }
    print(args, &verification, |v| {
        format!(
            "version {}: {} {}",
            v.version,
            if v.ok { "ok" } else { "DIFFERS" },
            v.digest.as_deref().unwrap_or("-")
        )
    })?;
    Ok(if verification.ok {
        Outcome::Done
    } else {
        Outcome::Differs
    })
}

/// What `evaluate` is asked to score.
pub(crate) struct Asked<'a> {
    /// The store.
    pub(crate) store: &'a Path,
    /// Its true changes; none: nothing has changed.
    pub(crate) truth: Option<&'a Path>,
    /// Version; the latest if not given.
    pub(crate) version: Option<At>,
    /// Fusion model.
    pub(crate) model: FusionModel,
    /// Which element each detection is of, and the logs with the detections.
    pub(crate) matching: Option<(&'a Path, &'a [PathBuf])>,
    /// Folder for pictures.
    pub(crate) plots: Option<&'a Path>,
}

fn score(args: &Args, asked: &Asked<'_>, options: &Options) -> Result<Outcome> {
    let evaluation = scored(args, asked, options)?;
    print(args, &evaluation, evaluation::words)?;
    Ok(Outcome::Done)
}

/// Scores a version, and writes the pictures of it that are asked for.
///
/// # Errors
/// The store or the truth cannot be read, or the pictures not be written.
pub(crate) fn scored(args: &Args, asked: &Asked<'_>, options: &Options) -> Result<Evaluation> {
    let snapshot = open(asked.store, asked.version)?;
    let truth = asked.truth.map(read_changes_file).transpose()?;
    let subject = Subject {
        refold: &Refold::read(&snapshot)?,
        truth: &truth.unwrap_or_default(),
    };
    let mut evaluation = evaluate(std::slice::from_ref(&subject), asked.model, options)?;
    if let Some((truth, logs)) = asked.matching {
        let drives = Drives {
            snapshot: &snapshot,
            logs,
            truth: &MatchingTruth::read_file(truth)?,
        };
        let progress = progress::listener(args.progress);
        evaluation.matching = Some(matching(&[drives], progress.as_ref())?);
    }
    if let Some(folder) = asked.plots {
        let mut written = overview::write(folder, &subject, asked.model, options.criteria)?;
        written.extend(plots::write(folder, &evaluation)?);
        for file in written {
            tell!("wrote {}", file.display());
        }
    }
    Ok(evaluation)
}
