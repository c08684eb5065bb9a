//! Promise P6: what is damaged is set aside by name, and what is sound counts as if the damage had
//! never been given.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::fs;
use std::path::PathBuf;

use mcap::WriteOptions;
use tempfile::TempDir;
use tilefold_city::CityFiles;
use tilefold_engine::RunReport;
use tilefold_schemas::{SetAside, SetAsideKind};
use tilefold_tests::logs::{chunk_places, only_chunks, rewrite, small_chunks};
use tilefold_tests::trial::{Content, Trial, content_of, small_city};

/// The drive that is damaged, and those that are not. The first of them is of the same vehicle.
const VICTIM: usize = 1;
const OTHERS: [usize; 3] = [6, 0, 2];
/// Name of the damaged file.
const DAMAGED: &str = "damaged.mcap";

/// A city, and one of its drives in small chunks that a test may damage.
struct Case {
    folder: TempDir,
    city: CityFiles,
    victim: Vec<u8>,
    others: Vec<PathBuf>,
}

impl Case {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let city = small_city(folder.path());
        let others = OTHERS.map(|index| city.logs[index].clone()).to_vec();
        let log = fs::read(&city.logs[VICTIM]).unwrap();
        let victim = rewrite(&log, small_chunks(), |_| true);
        assert!(chunk_places(&victim).len() > 10);
        Self {
            folder,
            city,
            victim,
            others,
        }
    }

    /// The sound logs and one of these bytes.
    fn with(&self, name: &str, bytes: &[u8]) -> Vec<PathBuf> {
        let path = self.folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let mut logs = self.others.clone();
        logs.push(path);
        logs
    }

    /// What the sound logs and one of these bytes say; nothing of them may be set aside.
    fn sound_with(&self, bytes: &[u8]) -> Content {
        let trial = Trial::new(&self.city.before_map);
        let report = trial.run(&self.with("sound.mcap", bytes));
        assert_eq!(report.set_aside, []);
        trial.content()
    }

    /// What the sound logs say alone.
    fn sound(&self) -> Content {
        content_of(&self.city.before_map, &self.others)
    }

    /// What is said with the damaged bytes, and what of them was set aside.
    fn damaged(&self, bytes: &[u8]) -> (Content, RunReport) {
        let trial = Trial::new(&self.city.before_map);
        let report = trial.run(&self.with(DAMAGED, bytes));
        assert!(!report.set_aside.is_empty());
        for loss in &report.set_aside {
            assert!(loss.file.ends_with(DAMAGED), "{loss}");
            assert!(!loss.reason.is_empty() && loss.count > 0, "{loss}");
        }
        (trial.content(), report)
    }
}

fn losses(report: &RunReport, kind: SetAsideKind) -> Vec<&SetAside> {
    let losses = report.set_aside.iter();
    losses.filter(|loss| loss.kind == kind).collect()
}

#[test]
fn files_that_are_no_logs() {
    let case = Case::new();
    let name = |name: &str| case.folder.path().join(name);
    let bad = [
        ("words.mcap", &b"lanes, signs and crosswalks\n"[..]),
        ("empty.mcap", b""),
        ("half_magic.mcap", b"\x89MCAP"),
        ("zeros.mcap", &[0; 4096]),
    ];
    let mut logs = case.others.clone();
    for (file, bytes) in bad {
        fs::write(name(file), bytes).unwrap();
        logs.push(name(file));
    }
    fs::create_dir(name("empty_folder")).unwrap();
    logs.extend([name("gone.mcap"), name("empty_folder")]);

    let trial = Trial::new(&case.city.before_map);
    let report = trial.run(&logs);
    assert_eq!(trial.content(), case.sound());
    let files = losses(&report, SetAsideKind::File);
    assert_eq!(files.len(), report.set_aside.len());
    let reason = |file: &str| {
        let path = name(file).display().to_string();
        let loss = files.iter().find(|loss| loss.file == path);
        loss.map_or("", |loss| loss.reason.as_str())
    };
    for (file, _) in bad {
        assert!(reason(file).contains("no MCAP file"), "{file}: {files:?}");
    }
    assert!(reason("gone.mcap").contains("exists"), "{files:?}");
    assert!(
        reason("empty_folder").contains("without .mcap"),
        "{files:?}"
    );
    assert_eq!(files.len(), 6);
}

#[test]
fn a_log_without_what_the_map_stage_needs() {
    let case = Case::new();
    let sound = case.sound();
    for (lacking, why, count) in [
        ("/perception/lanes", "detections", false),
        ("/gnss/fix", "GNSS", true),
    ] {
        let mut lanes = 0;
        let bytes = rewrite(&case.victim, WriteOptions::new(), |message| {
            lanes += u64::from(message.channel.topic == "/perception/lanes");
            message.channel.topic != lacking
        });
        let (content, report) = case.damaged(&bytes);
        assert_eq!(content, sound, "without {lacking}");
        let drives = losses(&report, SetAsideKind::Drive);
        assert_eq!(drives.len(), report.set_aside.len(), "{drives:?}");
        for drive in &drives {
            assert!(drive.reason.contains(why), "{drive}");
        }
        if count {
            // Every frame is counted.
            assert_eq!(drives.iter().map(|loss| loss.count).sum::<u64>(), lanes);
        }
    }
}

#[test]
fn a_cut_log_counts_up_to_its_cut() {
    let case = Case::new();
    let chunks = chunk_places(&case.victim);
    for share in [0.35, 0.8] {
        let cut = (case.victim.len() as f64 * share) as usize;
        let before = only_chunks(&case.victim, |number| chunks[number].end <= cut);
        let (content, report) = case.damaged(&case.victim[..cut]);
        let sections = losses(&report, SetAsideKind::LogSection);
        assert!(
            sections
                .iter()
                .any(|loss| loss.offset.is_some_and(|at| at <= cut as u64)),
            "{sections:?}"
        );
        assert_eq!(content, part(&case, &before), "cut at {cut}");
    }
}

/// As [`Case::sound_with`], for a part of a drive: frames at its ends may lack a pose.
fn part(case: &Case, bytes: &[u8]) -> Content {
    let trial = Trial::new(&case.city.before_map);
    let report = trial.run(&case.with("part.mcap", bytes));
    for loss in &report.set_aside {
        assert_eq!(loss.kind, SetAsideKind::Uncovered, "{loss}");
    }
    trial.content()
}

#[test]
fn a_flipped_byte_costs_its_chunk() {
    let case = Case::new();
    let chunks = chunk_places(&case.victim);
    for lost in [0, chunks.len() / 2, chunks.len() - 1] {
        let at = (chunks[lost].start + chunks[lost].end) / 2;
        let mut bytes = case.victim.clone();
        bytes[at] ^= 0x10;
        let (content, report) = case.damaged(&bytes);
        let sections = losses(&report, SetAsideKind::LogSection);
        assert!(!sections.is_empty());
        for section in sections {
            assert_eq!(section.offset, Some(chunks[lost].start as u64), "{section}");
        }
        let rest = only_chunks(&case.victim, |number| number != lost);
        assert_eq!(
            content,
            part(&case, &rest),
            "chunk {lost} of {}",
            chunks.len()
        );
    }
}

#[test]
fn a_damaged_copy_beside_a_sound_one_changes_nothing() {
    let case = Case::new();
    let whole = case.sound_with(&case.victim);
    assert_ne!(whole, case.sound());
    let chunks = chunk_places(&case.victim);
    let mut flipped = case.victim.clone();
    flipped[chunks[3].start + 200] ^= 1;
    let cut = &case.victim[..case.victim.len() / 2];
    for bytes in [&flipped[..], cut] {
        let together = case.folder.path().join("copy.mcap");
        fs::write(&together, bytes).unwrap();
        let mut logs = case.with("sound.mcap", &case.victim);
        logs.push(together.clone());
        let trial = Trial::new(&case.city.before_map);
        assert!(!trial.run(&logs).set_aside.is_empty());
        assert_eq!(trial.content(), whole);

        // One after the other, in either order.
        let sound = case.with("sound.mcap", &case.victim);
        for [first, second] in [
            [vec![together.clone()], sound.clone()],
            [sound, vec![together]],
        ] {
            let trial = Trial::new(&case.city.before_map);
            trial.run(&first);
            trial.run(&second);
            assert_eq!(trial.content(), whole);
        }
    }
}
