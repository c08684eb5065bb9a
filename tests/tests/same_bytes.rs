//! Promises P1, P2 and P4: whatever the threads, the order, the portions and the containers of the
//! same drives, the store holds the same.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mcap::{Compression, WriteOptions};
use tempfile::tempdir;
use tilefold_engine::{FusionModel, Limit, RunReport, Silent, run};
use tilefold_tests::logs::{copies, rewrite};
use tilefold_tests::trial::{Content, Trial, content_of, real_data, small_city};

/// Every so many real drives are tried. Odd, so that both dialects are among them.
const REAL_STEP: usize = 37;

/// Made once for all tests.
static CASES: LazyLock<Vec<Case>> =
    LazyLock::new(|| std::iter::once(Case::city()).chain(Case::real()).collect());

/// A map, its drives, and what a store holds after one plain job over them.
struct Case {
    name: &'static str,
    map: PathBuf,
    logs: Vec<PathBuf>,
    expected: Content,
}

impl Case {
    fn new(name: &'static str, map: PathBuf, logs: Vec<PathBuf>) -> Self {
        let expected = content_of(&map, &logs);
        assert!(expected.says_something(), "{name}: {expected:#?}");
        Self {
            name,
            map,
            logs,
            expected,
        }
    }

    fn city() -> Self {
        // Test runners may give each test a process: each makes a city of its own.
        let folder = format!("same_bytes-{}", std::process::id());
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
        let city = small_city(&folder);
        Self::new("city", city.before_map, city.logs)
    }

    fn real() -> Option<Self> {
        let folder = real_data()?.join("deecamp");
        let mut logs: Vec<PathBuf> = fs::read_dir(folder.join("logs"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        logs.sort();
        let mut logs: Vec<PathBuf> = logs.into_iter().step_by(REAL_STEP).collect();
        // One with detections in pixels.
        logs.push(folder.join("trip_image_plane.mcap"));
        Some(Self::new("real drives", folder.join("before.osm"), logs))
    }

    /// Copies under other names, byte for byte; they sort the other way than the originals.
    fn renamed(&self, into: &Path) -> Vec<PathBuf> {
        let name = |index| format!("renamed_{:03}.mcap", 999 - index);
        copies(&self.logs, into, name, |log| log)
    }

    #[track_caller]
    fn check(&self, what: &str, trial: &Trial) {
        assert_eq!(trial.content(), self.expected, "{}: {what}", self.name);
    }

    /// Runs these portions one after the other, each bringing something new.
    #[track_caller]
    fn check_runs(&self, what: &str, portions: &[&[PathBuf]]) {
        let trial = Trial::new(&self.map);
        for logs in portions {
            let report = trial.run(logs);
            assert!(report.is_new_version, "{}: {what}", self.name);
        }
        self.check(what, &trial);
    }
}

fn file_name(index: usize) -> String {
    format!("{index:03}.mcap")
}

fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap()
        .install(work)
}

#[test]
fn any_number_of_threads() {
    for case in &*CASES {
        for threads in [1, 2] {
            let content = with_threads(threads, || content_of(&case.map, &case.logs));
            assert_eq!(content, case.expected, "{} on {threads} threads", case.name);
        }
    }
}

#[test]
fn any_limit_of_memory() {
    for case in &*CASES {
        for bytes in [1, 100_000, 1 << 40] {
            let limit = limit(bytes);
            let trial = Trial::new(&case.map);
            let report = trial.run_within(&case.logs, FusionModel::default(), &limit);
            case.check(&format!("within {bytes} bytes"), &trial);
            assert_eq!(report.spilled_bytes > 0, bytes < 1 << 40, "{}", case.name);
            let other = Trial::new(&case.map).run(&case.logs);
            let said = |report: &RunReport| {
                let counts = (report.chunks_mapped, report.tiles_reduced);
                (counts, report.set_aside.clone(), report.mountings.clone())
            };
            assert_eq!(said(&report), said(&other), "{}", case.name);
        }
        let (first, second) = case.logs.split_at(case.logs.len() / 2);
        let trial = Trial::new(&case.map);
        trial.run(first);
        trial.run_within(second, FusionModel::default(), &limit(1));
        case.check("the second half within a limit", &trial);
    }
}

#[test]
fn all_tiles_folded_anew_within_a_limit_of_memory() {
    for case in &*CASES {
        let [plain, limited] = [(); 2].map(|()| Trial::new(&case.map));
        plain.run(&case.logs);
        run(plain.store(), &[], FusionModel::Paper, &Silent).unwrap();
        limited.run(&case.logs);
        let report = limited.run_within(&[], FusionModel::Paper, &limit(1));
        assert!(report.is_new_version && report.tiles_reduced > 0);
        assert_eq!(limited.content(), plain.content(), "{}", case.name);
        assert_ne!(limited.content(), case.expected, "{}", case.name);
    }
}

fn limit(bytes: u64) -> Limit {
    Limit {
        bytes,
        folder: std::env::temp_dir(),
    }
}

#[test]
fn any_order() {
    for case in &*CASES {
        let reversed: Vec<PathBuf> = case.logs.iter().rev().cloned().collect();
        case.check_runs("given in reverse", &[&reversed]);
        let folder = tempdir().unwrap();
        case.check_runs("names in reverse", &[&case.renamed(folder.path())]);
    }
}

#[test]
fn any_portions() {
    for case in &*CASES {
        let (first, second) = case.logs.split_at(case.logs.len() / 2);
        case.check_runs("in two halves", &[first, second]);
        case.check_runs("second half first", &[second, first]);
        let one_by_one: Vec<&[PathBuf]> = case.logs.chunks(1).collect();
        case.check_runs("a drive at a time", &one_by_one);
    }
}

#[test]
fn the_same_again_adds_nothing() {
    for case in &*CASES {
        let folder = tempdir().unwrap();
        let trial = Trial::new(&case.map);
        let first = trial.run(&case.logs);
        assert!(first.is_new_version && first.chunks_mapped > 0);
        for logs in [&case.logs, &case.renamed(folder.path())] {
            let again = trial.run(logs);
            assert_eq!(
                (again.version, again.is_new_version, again.chunks_mapped),
                (first.version, false, 0),
                "{}",
                case.name
            );
            assert_eq!(again.chunks_known as usize, first.chunks_mapped);
        }
        case.check("again", &trial);
    }
}

#[test]
fn every_drive_twice_under_another_name() {
    for case in &*CASES {
        let folder = tempdir().unwrap();
        let twice = [case.logs.clone(), case.renamed(folder.path())].concat();
        let trial = Trial::new(&case.map);
        assert!(trial.run(&twice).duplicate_messages > 0);
        case.check("twice", &trial);
    }
}

#[test]
fn any_container() {
    let clothes = [
        (
            "small chunks, lz4",
            WriteOptions::new()
                .chunk_size(Some(3_000))
                .compression(Some(Compression::Lz4)),
        ),
        (
            "one chunk, zstd",
            WriteOptions::new()
                .chunk_size(None)
                .compression(Some(Compression::Zstd)),
        ),
        (
            "stored chunks, no summary",
            WriteOptions::new()
                .compression(None)
                .emit_statistics(false)
                .emit_summary_records(false),
        ),
        ("no chunks", WriteOptions::new().use_chunks(false)),
    ];
    for case in &*CASES {
        let known = Trial::new(&case.map);
        let version = known.run(&case.logs).version;
        for (what, options) in &clothes {
            let folder = tempdir().unwrap();
            let logs = copies(&case.logs, folder.path(), file_name, |log| {
                rewrite(&log, options.clone(), |_| true)
            });
            case.check_runs(what, &[&logs]);
            // To a store that has the drives already, they are nothing new.
            assert_eq!(known.run(&logs).version, version, "{what}");
        }
        case.check("known", &known);
    }
}

/// The drives' messages in a stretch of their time, as a share of it.
fn parts(case: &Case, into: &Path, share: &std::ops::Range<f64>) -> Vec<PathBuf> {
    copies(&case.logs, into, file_name, |log| {
        let mut times = Vec::new();
        let _ = rewrite(&log, WriteOptions::new(), |message| {
            times.push(message.log_time);
            false
        });
        let (from, to) = (*times.iter().min().unwrap(), *times.iter().max().unwrap());
        rewrite(&log, WriteOptions::new(), |message| {
            share.contains(&((message.log_time - from) as f64 / (to - from + 1) as f64))
        })
    })
}

#[test]
fn a_drive_in_parts() {
    for case in &*CASES {
        let folder = tempdir().unwrap();
        let head = parts(case, &folder.path().join("head"), &(0.0..0.6));
        let tail = parts(case, &folder.path().join("tail"), &(0.4..1.0));
        let both = [head.clone(), tail].concat();
        case.check_runs("in overlapping parts", &[&both]);
        // What a part said is replaced by what the whole says.
        case.check_runs("a part first", &[&head, &case.logs]);
    }
}

#[test]
fn fewer_drives_are_told_apart() {
    for case in &*CASES {
        assert_ne!(content_of(&case.map, &case.logs[1..]), case.expected);
    }
}
