//! The camera suite: what a network sees in rendered drives that it was not trained on, against what
//! is really in the pictures, and what the whole job finds from those pixels.
//!
//! `truth` reads what each picture holds, `lines` and `boxes` compare a picture, `identity` compares
//! tracks, `score` counts. Lines are compared point by point along the rows of the picture, because a
//! network sees through the border of two map elements and may see half of a line.

mod boxes;
mod changes;
mod identity;
mod lines;
mod score;
mod tables;
mod truth;

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;
use tilefold_city::{CityFiles, CitySpec, LogProfile, Site};
use tilefold_engine::{Device, Meter, Perception};
use tilefold_formats::log::{ALL_TIME, LogIndex, LogReader};
use tilefold_schemas::log::{LogMessage, Payload};
use tilefold_schemas::observation::ObservationFrame;
use tilefold_tiler::recording::Stamped;
use tilefold_workers::track::{Tracker, Weights};

use changes::Changes;
use identity::{Identity, Lives};
use score::{ByClass, Scores};
use truth::Picture;

/// What is driven through. Seeds are apart from those of training and of the accuracy suites.
pub(crate) struct Wanted<'a> {
    pub(crate) card: &'a Path,
    pub(crate) seeds: &'a [u64],
    pub(crate) drives: u32,
    pub(crate) drive_km: f64,
    pub(crate) noise: &'a str,
    pub(crate) out: &'a Path,
}

/// A raw result.
#[derive(Debug, Serialize)]
struct RawResult {
    model: String,
    sha256: String,
    seeds: Vec<u64>,
    drives: u32,
    drive_km: f64,
    pictures: usize,
    /// All conditions together.
    all: Scores,
    by_condition: BTreeMap<String, Scores>,
    /// Of the markings of line points that were found: rows are true, columns seen.
    marking_confusion: BTreeMap<String, BTreeMap<String, u64>>,
    /// By what is followed, with and without appearance.
    tracking: BTreeMap<&'static str, BTreeMap<&'static str, Identity>>,
    /// By city: from pixels, and from the simulator's detections.
    changes: Vec<Changes>,
}

/// What was counted in one log.
#[derive(Default)]
struct Counted {
    pictures: usize,
    by_condition: BTreeMap<String, ByClass>,
    confusion: BTreeMap<String, BTreeMap<String, u64>>,
    tracking: BTreeMap<&'static str, Lives>,
}

/// Runs the suite; writes `perception.json` and `perception.md`.
pub(crate) fn run(wanted: &Wanted<'_>) -> Result<(), Box<dyn Error>> {
    let perception = Perception::open(wanted.card, None, Device::Cpu)?;
    let mut counted = Counted::default();
    let mut changes = Vec::new();
    for &seed in wanted.seeds {
        let folder = tempfile::tempdir()?;
        eprintln!("seed {seed}: taking pictures");
        let city = simulate(
            wanted,
            seed,
            LogProfile::Camera,
            &folder.path().join("camera"),
        )?;
        eprintln!("seed {seed}: looking at them");
        let logs: Vec<Counted> = (city.logs.par_iter())
            .map(|log| {
                count(&perception, log).map_err(|error| format!("{}: {error}", log.display()))
            })
            .collect::<Result<_, _>>()?;
        logs.into_iter().for_each(|log| counted.add(log));
        eprintln!("seed {seed}: the whole job");
        let detections = simulate(
            wanted,
            seed,
            LogProfile::Detections,
            &folder.path().join("detections"),
        )?;
        changes.push(Changes {
            seed,
            from_pixels: changes::found(
                &city,
                Some(&perception),
                &folder.path().join("from_pixels"),
            )?,
            from_detections: changes::found(
                &detections,
                None,
                &folder.path().join("from_detections"),
            )?,
        });
    }
    let result = counted.result(wanted, &perception, changes);
    fs::create_dir_all(wanted.out)?;
    fs::write(
        wanted.out.join("perception.json"),
        serde_json::to_string_pretty(&result)? + "\n",
    )?;
    fs::write(wanted.out.join("perception.md"), tables::page(&result))?;
    Ok(())
}

fn simulate(
    wanted: &Wanted<'_>,
    seed: u64,
    profile: LogProfile,
    folder: &Path,
) -> Result<CityFiles, Box<dyn Error>> {
    let spec = CitySpec {
        seed,
        site: Site::Drawn { km: 2.0 },
        vehicles: wanted.drives,
        drives: wanted.drives,
        drive_km: wanted.drive_km,
        noise: wanted.noise.to_owned(),
        profile,
        ..CitySpec::default()
    };
    Ok(tilefold_city::write(&spec, folder)?)
}

/// What a network sees in a log, in the order of time.
fn seen(
    perception: &Perception,
    log: &Path,
) -> Result<Vec<Stamped<ObservationFrame>>, Box<dyn Error>> {
    let index = LogIndex::open(log)?;
    let meter = Meter::default();
    let (mut frames, mut failed) = (Vec::new(), Vec::new());
    LogReader::new().read(
        &index,
        |_, _| true,
        ALL_TIME,
        |message: LogMessage| {
            let Payload::Image(frame) = &message.payload else {
                return;
            };
            match perception.look(frame, &meter) {
                Ok(value) => frames.push(Stamped {
                    stamp_ns: message.stamp_ns,
                    frame_id: message.frame_id.clone(),
                    digest: message.digest,
                    value,
                }),
                Err(reason) => failed.push(reason),
            }
        },
    )?;
    if let Some(reason) = failed.first() {
        return Err(format!("{} pictures could not be looked at: {reason}", failed.len()).into());
    }
    frames.sort_by_key(|frame| frame.stamp_ns);
    Ok(frames)
}

fn count(perception: &Perception, log: &Path) -> Result<Counted, Box<dyn Error>> {
    let truth = truth::read(&log.with_extension("frames.jsonl"))?;
    let frames = seen(perception, log)?;
    let mut counted = Counted {
        pictures: frames.len(),
        ..Counted::default()
    };
    let mut pictures: Vec<&Picture> = Vec::new();
    for frame in &frames {
        let picture = truth
            .get(&frame.stamp_ns)
            .ok_or_else(|| format!("a picture of {} ns is not in its truth", frame.stamp_ns))?;
        let by_class = counted
            .by_condition
            .entry(picture.category.clone())
            .or_default();
        lines::count(picture, &frame.value, by_class, &mut counted.confusion);
        boxes::count(picture, &frame.value, by_class);
        pictures.push(picture);
    }
    let ways = [
        ("with appearance", Weights::default()),
        ("place alone", Weights { place: 1.0 }),
    ];
    for (way, weights) in ways {
        let tracks = Tracker::weighing(weights).follow(&frames);
        counted
            .tracking
            .insert(way, Lives::of(&pictures, &frames, &tracks));
    }
    Ok(counted)
}

impl Counted {
    fn add(&mut self, other: Self) {
        self.pictures += other.pictures;
        for (condition, by_class) in other.by_condition {
            self.by_condition
                .entry(condition)
                .or_default()
                .add(&by_class);
        }
        for (truth, row) in other.confusion {
            let own = self.confusion.entry(truth).or_default();
            row.into_iter()
                .for_each(|(seen, count)| *own.entry(seen).or_default() += count);
        }
        for (way, lives) in other.tracking {
            self.tracking.entry(way).or_default().add(&lives);
        }
    }

    fn result(
        self,
        wanted: &Wanted<'_>,
        perception: &Perception,
        changes: Vec<Changes>,
    ) -> RawResult {
        let mut all = ByClass::default();
        self.by_condition
            .values()
            .for_each(|by_class| all.add(by_class));
        let scored = |(condition, by_class): (String, ByClass)| (condition, by_class.scores());
        RawResult {
            model: perception.model().card.name.clone(),
            sha256: perception.model().card.sha256.clone(),
            seeds: wanted.seeds.to_vec(),
            drives: wanted.drives,
            drive_km: wanted.drive_km,
            pictures: self.pictures,
            all: all.scores(),
            by_condition: self.by_condition.into_iter().map(scored).collect(),
            marking_confusion: self.confusion,
            tracking: (self.tracking.into_iter())
                .map(|(way, lives)| (way, lives.identities()))
                .collect(),
            changes,
        }
    }
}

/// The default place of the raw results.
pub(crate) fn default_out() -> PathBuf {
    PathBuf::from("benchmarks/runs/perception")
}
