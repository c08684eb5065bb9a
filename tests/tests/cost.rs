//! What one more drive costs, counted in files: a job reads and writes what lies where its logs are,
//! however much else the store holds.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::collections::BTreeSet;
use std::path::PathBuf;

use tilefold_city::{CitySpec, Site};
use tilefold_engine::{FusionModel, RunOptions, Silent, run};
use tilefold_schemas::{ChunkRow, EvidenceRow, LayerHeader, Sighting, TileId};
use tilefold_store::{Store, TileFilter, coarse};
use tilefold_tests::faulty::{Access, Fault, arm, through_fuse};
use tilefold_tests::towns::Towns;
use tilefold_tests::trial::{Trial, content_of, tiny_city_in_two_files};

/// The coarse tile and the table that a data file is of; none of other files.
fn data_file(path: &str) -> Option<(String, String)> {
    let mut parts = path.rsplit('/');
    let tile = parts.next()?.strip_prefix("tile-")?.split('-').next()?;
    Some((tile.to_owned(), parts.next()?.to_owned()))
}

#[test]
fn a_drive_in_one_town_touches_no_file_of_the_other() {
    let towns = Towns::new();
    let trial = towns.store();
    let (before, last) = towns.days();
    trial.run(&before);
    let snapshot = Store::open(trial.store().to_path_buf()).unwrap();
    let snapshot = snapshot.snapshot(None).unwrap();
    let files = snapshot.files::<EvidenceRow>(TileFilter::All).unwrap();
    assert_eq!(files.len(), 2, "a file for each town");
    let headers: Vec<LayerHeader> = snapshot.read(TileFilter::All).unwrap();

    let fuse = arm(trial.store(), Fault::Fail, usize::MAX);
    let done = run(
        &through_fuse(trial.store()),
        &last,
        FusionModel::default(),
        &Silent,
    )
    .unwrap();
    assert!(done.is_new_version && done.tiles_reduced > 0);
    let accesses = fuse.accesses();

    let changed = |header: &&LayerHeader| !headers.contains(header);
    let now: Vec<LayerHeader> = trial.rows();
    let near: BTreeSet<String> = now
        .iter()
        .filter(changed)
        .map(|header| coarse(TileId(header.tile)).to_string())
        .collect();
    let touched = |wanted: &dyn Fn(&Access) -> bool, tables: &[&str]| -> BTreeSet<String> {
        let files = accesses.iter().filter(|access| wanted(access));
        let files = files.filter_map(|access| data_file(&access.path));
        let of_tables = files.filter(|(_, table)| tables.contains(&table.as_str()));
        of_tables.map(|(tile, _)| tile).collect()
    };
    let is_read = |access: &Access| !access.is_write;
    let ledger = ["evidence", "sightings", "footprints", "changes"];
    assert_eq!(touched(&is_read, &ledger), near);
    let written = ["evidence", "sightings", "footprints", "changes", "layers"];
    assert_eq!(touched(&|access| access.is_write, &written), near);
    assert_eq!(near.len(), 1);
    // The base map and the headers are read as a whole: the canary of what is counted here.
    assert_eq!(touched(&is_read, &["elements", "layers"]).len(), 2);

    let whole = towns.store();
    whole.run(&[before, last].concat());
    assert_eq!(trial.content(), whole.content());
}

#[test]
fn what_lies_across_two_files_is_read_from_both() {
    let folder = tempfile::tempdir().unwrap();
    let city = tiny_city_in_two_files(folder.path());
    let trial = Trial::new(&city.before_map);
    for log in &city.logs {
        trial.run(std::slice::from_ref(log));
    }
    let snapshot = Store::open(trial.store().to_path_buf()).unwrap();
    let snapshot = snapshot.snapshot(None).unwrap();
    let files = snapshot.files::<Sighting>(TileFilter::All).unwrap();
    assert_eq!(files.len(), 2);
    assert_eq!(trial.content(), content_of(&city.before_map, &city.logs));
}

/// The table of docs/results/incremental.md: `cargo test --workspace --features tilefold-tests/h264
/// --test cost -- --ignored --nocapture`.
#[test]
#[ignore = "measures, for a quarter of an hour"]
fn what_a_day_costs_by_the_share_of_tiles_that_it_touches() {
    let folder = tempfile::tempdir().unwrap();
    let city = |name: &str, drives: u32, drive_km: f64| {
        let spec = CitySpec {
            seed: 5,
            site: Site::Drawn { km: 60.0 },
            vehicles: 60,
            drives,
            drive_km,
            ..CitySpec::default()
        };
        tilefold_city::write(&spec, &folder.path().join(name)).unwrap()
    };
    let (long, short) = (city("long", 48, 5.0), city("short", 60, 0.3));
    let (first, other_half) = long.logs.split_at(24);
    let old = Trial::new(&long.before_map);
    let first_day = day(&old, first, FusionModel::default());
    let rows: Vec<EvidenceRow> = old.rows();
    let tiles: BTreeSet<i32> = rows.iter().map(|row| row.tile).collect();
    println!(
        "{} tiles with evidence; into an empty store: {first_day:?}",
        tiles.len()
    );
    let days = [1, 3, 8, 20].map(|drives| &short.logs[30..30 + drives]);
    for logs in days.into_iter().chain([other_half]) {
        let trial = Trial::copy_of(&old);
        let day = day(&trial, logs, FusionModel::default());
        let all = all_anew(&trial);
        let share = |part: f64, whole: f64| 100.0 * part / whole;
        println!(
            "{} logs: {:.1} % of the tiles judged, {:.1} % of the reduce stage, {day:?}; all anew: {all:?}",
            logs.len(),
            share(day.judged_tiles as f64, all.judged_tiles as f64),
            share(day.reduce_s, all.reduce_s),
        );
    }
}

/// All of the store folded anew, as of a time when all of it has been seen.
fn all_anew(trial: &Trial) -> Day {
    let chunks: Vec<ChunkRow> = trial.rows();
    let last_ns = chunks.iter().map(|chunk| chunk.last_ns).max();
    let options = RunOptions {
        as_of_ns: last_ns,
        ..RunOptions::default()
    };
    day(trial, &[], options)
}

/// What a job did.
#[derive(Debug)]
#[expect(dead_code, reason = "printed")]
struct Day {
    layers: usize,
    judged_tiles: u64,
    reduce_s: f64,
    files_read: usize,
    read_mb: f64,
    files_written: usize,
    written_mb: f64,
}

fn day(trial: &Trial, logs: &[PathBuf], options: impl Into<RunOptions>) -> Day {
    let fuse = arm(trial.store(), Fault::Fail, usize::MAX);
    let place = through_fuse(trial.store());
    let report = run(&place, logs, options, &Silent).unwrap();
    let reduce = report.stages.iter().find(|stage| stage.stage == "reduce");
    let reduce = reduce.unwrap();
    let accesses = fuse.accesses();
    let of = |is_write: bool| {
        let all = accesses.iter();
        let data = all.filter(|one| one.is_write == is_write && one.path.ends_with(".parquet"));
        let data = data.filter(|one| !one.path.contains("_delta_log"));
        data.fold((0, 0.0), |(files, mb), one| {
            (files + 1, mb + one.bytes as f64 * 1e-6)
        })
    };
    let ((files_read, read_mb), (files_written, written_mb)) = (of(false), of(true));
    Day {
        layers: report.tiles_reduced,
        judged_tiles: reduce.items,
        reduce_s: reduce.busy_s,
        files_read,
        read_mb,
        files_written,
        written_mb,
    }
}
