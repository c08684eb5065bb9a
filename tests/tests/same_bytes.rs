//! Promises P1, P2 and P4: whatever the threads, the order, the portions and the containers of the
//! same drives, the store holds the same.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::path::{Path, PathBuf};

use mcap::{Compression, WriteOptions};
use tempfile::TempDir;
use tilefold_tests::logs::{copies, rewrite};
use tilefold_tests::trial::{Content, Trial, content_of, real_data, small_city};

/// Every so many real drives are tried. Odd, so that both dialects are among them.
const REAL_STEP: usize = 37;

/// A map, its drives, and what a store holds after one plain job over them.
struct Case {
    folder: TempDir,
    map: PathBuf,
    logs: Vec<PathBuf>,
    expected: Content,
}

impl Case {
    fn new(folder: TempDir, map: PathBuf, logs: Vec<PathBuf>) -> Self {
        let expected = content_of(&map, &logs);
        assert!(expected.says_something(), "{expected:#?}");
        Self {
            folder,
            map,
            logs,
            expected,
        }
    }

    fn city() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let city = small_city(folder.path());
        Self::new(folder, city.before_map, city.logs)
    }

    fn real() -> Option<Self> {
        let folder = real_data()?.join("deecamp");
        let mut logs: Vec<PathBuf> = std::fs::read_dir(folder.join("logs"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        logs.sort();
        let mut logs: Vec<PathBuf> = logs.into_iter().step_by(REAL_STEP).collect();
        // One with detections in pixels.
        logs.push(folder.join("trip_image_plane.mcap"));
        let map = folder.join("before.osm");
        Some(Self::new(tempfile::tempdir().unwrap(), map, logs))
    }

    fn all() -> Vec<(&'static str, Self)> {
        let real = Self::real().map(|case| ("real drives", case));
        std::iter::once(("city", Self::city()))
            .chain(real)
            .collect()
    }

    fn folder(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Copies under other names, byte for byte; they sort the other way than the originals.
    fn renamed(&self) -> Vec<PathBuf> {
        let name = |index| format!("renamed_{:03}.mcap", 999 - index);
        copies(&self.logs, &self.folder("renamed"), name, |log| log)
    }

    /// The same messages in another container.
    fn rewritten(&self, name: &str, options: &WriteOptions) -> Vec<PathBuf> {
        let change = |log: Vec<u8>| rewrite(&log, options.clone(), |_| true);
        copies(&self.logs, &self.folder(name), file_name, change)
    }

    #[track_caller]
    fn check(&self, what: &str, trial: &Trial) {
        assert_eq!(trial.content(), self.expected, "{what}");
    }

    #[track_caller]
    fn check_runs(&self, what: &str, runs: &[&[PathBuf]]) {
        let trial = Trial::new(&self.map);
        for logs in runs {
            let report = trial.run(logs);
            assert!(report.is_new_version, "{what}");
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
    for (name, case) in Case::all() {
        for threads in [1, 2, 5] {
            let content = with_threads(threads, || content_of(&case.map, &case.logs));
            assert_eq!(content, case.expected, "{name} on {threads} threads");
        }
    }
}

#[test]
fn any_order() {
    for (name, case) in Case::all() {
        let reversed: Vec<PathBuf> = case.logs.iter().rev().cloned().collect();
        case.check_runs(&format!("{name}, given in reverse"), &[&reversed]);
        // Their names, too, are in reverse.
        case.check_runs(&format!("{name}, renamed"), &[&case.renamed()]);
    }
}

#[test]
fn any_portions() {
    for (name, case) in Case::all() {
        let (first, second) = case.logs.split_at(case.logs.len() / 2);
        case.check_runs(&format!("{name} in two halves"), &[first, second]);
        case.check_runs(&format!("{name}, second half first"), &[second, first]);
        let overlapping = &case.logs[case.logs.len() / 3..];
        case.check_runs(&format!("{name}, overlapping"), &[first, overlapping]);
        let one_by_one: Vec<&[PathBuf]> = case.logs.chunks(1).collect();
        case.check_runs(&format!("{name}, a drive at a time"), &one_by_one);
    }
}

#[test]
fn the_same_again_adds_nothing() {
    for (name, case) in Case::all() {
        let trial = Trial::new(&case.map);
        let first = trial.run(&case.logs);
        assert!(first.is_new_version && first.chunks_mapped > 0, "{name}");
        for logs in [&case.logs, &case.renamed()] {
            let again = trial.run(logs);
            assert_eq!(
                (again.version, again.is_new_version, again.chunks_mapped),
                (first.version, false, 0),
                "{name}"
            );
            assert_eq!(again.chunks_known as usize, first.chunks_mapped, "{name}");
        }
        case.check(name, &trial);
    }
}

#[test]
fn every_drive_twice_under_another_name() {
    for (name, case) in Case::all() {
        let twice = [case.logs.clone(), case.renamed()].concat();
        let trial = Trial::new(&case.map);
        let report = trial.run(&twice);
        assert!(report.duplicate_messages > 0, "{name}");
        case.check(name, &trial);
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
            "one large chunk, zstd",
            WriteOptions::new()
                .chunk_size(None)
                .compression(Some(Compression::Zstd)),
        ),
        (
            "chunks as they are, stored",
            WriteOptions::new()
                .chunk_size(Some(100_000))
                .compression(None),
        ),
        ("no chunks", WriteOptions::new().use_chunks(false)),
        (
            "no summary",
            WriteOptions::new()
                .emit_statistics(false)
                .emit_summary_records(false),
        ),
    ];
    for (name, case) in Case::all() {
        let known = Trial::new(&case.map);
        let version = known.run(&case.logs).version;
        for (clothing, options) in &clothes {
            let what = format!("{name}: {clothing}");
            let logs = case.rewritten(clothing, options);
            let trial = Trial::new(&case.map);
            let report = trial.run(&logs);
            assert_eq!(report.logs, logs.len(), "{what}");
            case.check(&what, &trial);
            // To a store that has the drives already, they are nothing new.
            assert_eq!(known.run(&logs).version, version, "{what}");
        }
        case.check(name, &known);
    }
}

/// The messages of a log in a stretch of its time, as a share of it.
fn stretch(log: &[u8], share: std::ops::Range<f64>) -> Vec<u8> {
    let mut times = Vec::new();
    let _ = rewrite(log, WriteOptions::new(), |message| {
        times.push(message.log_time);
        true
    });
    let (from, to) = (*times.iter().min().unwrap(), *times.iter().max().unwrap());
    rewrite(log, WriteOptions::new(), |message| {
        share.contains(&((message.log_time - from) as f64 / (to - from + 1) as f64))
    })
}

fn parts(case: &Case, name: &str, share: &std::ops::Range<f64>) -> Vec<PathBuf> {
    copies(&case.logs, &case.folder(name), file_name, |log| {
        stretch(&log, share.clone())
    })
}

#[test]
fn a_drive_in_parts() {
    for (name, case) in Case::all() {
        let head = parts(&case, "head", &(0.0..0.6));
        let tail = parts(&case, "tail", &(0.4..1.0));
        let both = [head.clone(), tail].concat();
        case.check_runs(&format!("{name} in overlapping parts"), &[&both]);
        // What a part said is replaced by what the whole says.
        case.check_runs(&format!("{name}, parts first"), &[&head, &case.logs]);
    }
}

#[test]
fn another_map_or_fewer_drives_is_told_apart() {
    let case = Case::city();
    let after: &Path = &case.folder("after.osm");
    assert_ne!(content_of(after, &case.logs), case.expected);
    assert_ne!(content_of(&case.map, &case.logs[1..]), case.expected);
}
