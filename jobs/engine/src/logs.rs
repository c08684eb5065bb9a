//! From log files to units of work: which vehicle, which times, which topics.
//!
//! Logs are containers. They are grouped by vehicle, and a vehicle's time is cut into blocks of
//! absolute windows; a unit is one block of one vehicle, read from whichever logs cover it and its
//! context. Blocks bound the memory of a unit, whatever the length of a drive.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use tilefold_formats::log::{LogIndex, LogReader, Topic, TopicKind};
use tilefold_schemas::log::{DetectionSpace, LogMessage, Payload};
use tilefold_schemas::observation::ObservationFrame;
use tilefold_schemas::{SetAside, SetAsideKind};
use tilefold_tiler::chunk::{self, CONTEXT_NS, window_bounds_ns, window_of};
use tilefold_tiler::recording::{Recording, Stamped};

use crate::meter::{Meter, Stage};
use crate::progress::Progress;

/// Windows in a block.
const BLOCK_WINDOWS: i64 = 2;
/// A header stamp farther than this from the log time belongs to another clock.
pub(crate) const MAX_CLOCK_GAP_NS: i64 = 5_000_000_000;

/// Indexed logs, and what could not be.
#[derive(Debug, Default)]
pub struct Catalogue {
    /// Readable logs, by path.
    pub logs: Vec<LogIndex>,
    /// Files and stretches that were set aside.
    pub set_aside: Vec<SetAside>,
    /// Digest of the model that looks at pictures; none: only detections made on the vehicle count.
    pub model: Option<i64>,
}

impl Catalogue {
    /// Indexes files in parallel. A folder stands for the `.mcap` files in it.
    #[must_use]
    pub fn open(files: &[PathBuf], meter: &Meter, progress: &dyn Progress) -> Self {
        Self::open_seeing(files, None, meter, progress)
    }

    /// As [`Catalogue::open`], with the pictures of logs without detections, which the model of
    /// this digest will look at.
    #[must_use]
    pub fn open_seeing(
        files: &[PathBuf],
        model: Option<i64>,
        meter: &Meter,
        progress: &dyn Progress,
    ) -> Self {
        let (files, empty) = expand(files);
        progress.begin(Stage::Index, files.len() as u64);
        let opened: Vec<_> = files
            .par_iter()
            .map(|file| {
                let result = meter.time(Stage::Index, || LogIndex::open(file));
                let bytes = result.as_ref().map_or(0, |index| index.bytes_read);
                meter.count(Stage::Index, 1, bytes);
                progress.advance(Stage::Index, 1, u64::from(result.is_err()));
                (file, result)
            })
            .collect();
        progress.end(Stage::Index);
        let mut catalogue = Self {
            set_aside: empty,
            model,
            ..Self::default()
        };
        for (file, result) in opened {
            match result {
                Ok(index) => catalogue.add(index),
                Err(error) => catalogue.set_aside.push(SetAside::new(
                    SetAsideKind::File,
                    file.display().to_string(),
                    error.to_string(),
                )),
            }
        }
        catalogue
    }

    fn add(&mut self, index: LogIndex) {
        self.set_aside.extend(index.set_aside.iter().cloned());
        match why_not(&index, self.model) {
            None => self.logs.push(index),
            Some(reason) => self.set_aside.push(SetAside::new(
                SetAsideKind::Drive,
                index.path.display().to_string(),
                reason,
            )),
        }
    }

    /// Digest of what the model of this catalogue sees in the picture of a digest.
    pub(crate) fn seen_digest(&self, picture: i64) -> i64 {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&picture.to_le_bytes());
        hasher.update(&self.model.unwrap_or_default().to_le_bytes());
        tilefold_schemas::id::first_i64(&hasher.finalize())
    }

    /// The units of work, by vehicle and time.
    #[must_use]
    pub fn units(&self) -> Vec<Unit> {
        let mut vehicles: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (index, log) in self.logs.iter().enumerate() {
            vehicles.entry(vehicle_of(log)).or_default().push(index);
        }
        let mut units = Vec::new();
        for (vehicle, logs) in vehicles {
            let blocks: BTreeSet<i64> = logs
                .iter()
                .flat_map(|&log| {
                    let block = |stamp_ns| window_of(stamp_ns).div_euclid(BLOCK_WINDOWS);
                    let log = &self.logs[log];
                    block(log.start_ns)..=block(log.end_ns)
                })
                .collect();
            for block in blocks {
                let unit = Unit::new(&vehicle, block, &logs, &self.logs);
                units.push(unit);
            }
        }
        units
    }
}

/// Why a log cannot be used; none if it can.
fn why_not(index: &LogIndex, model: Option<i64>) -> Option<&'static str> {
    if has_detections(index) {
        return None;
    }
    let has = |kind| index.topics_of(kind).any(|(_, topic)| topic.messages > 0);
    if !has(TopicKind::Image) {
        return Some(
            "it has neither detections (foxglove.SceneUpdate or foxglove.ImageAnnotations) nor pictures",
        );
    }
    if model.is_none() {
        return Some(
            "it has pictures, but no detections; name a network that looks at them with `--detector CARD`",
        );
    }
    let uncalibrated =
        "its pictures have no calibration; record CameraInfo or foxglove.CameraCalibration";
    (!has(TopicKind::Calibration)).then_some(uncalibrated)
}

fn has_detections(index: &LogIndex) -> bool {
    let is_one =
        |topic: &Topic| matches!(topic.kind, TopicKind::Detections(_)) && topic.messages > 0;
    index.topics.iter().any(is_one)
}

/// The log files that are meant, each once, and folders that hold none.
fn expand(files: &[PathBuf]) -> (Vec<PathBuf>, Vec<SetAside>) {
    let mut expanded = BTreeSet::new();
    let mut empty = Vec::new();
    for file in files {
        if !file.is_dir() {
            expanded.insert(file.clone());
            continue;
        }
        let set_aside =
            |reason: String| SetAside::new(SetAsideKind::File, file.display().to_string(), reason);
        match logs_in(file) {
            Ok(logs) if logs.is_empty() => empty.push(set_aside(
                "a folder without .mcap files; name the files, or the folder they are in"
                    .to_owned(),
            )),
            Ok(logs) => expanded.extend(logs),
            Err(error) => empty.push(set_aside(format!(
                "cannot list the folder: {error}; check its rights"
            ))),
        }
    }
    (expanded.into_iter().collect(), empty)
}

fn logs_in(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let is_log = |path: &PathBuf| {
        path.extension()
            .is_some_and(|extension| extension == "mcap")
    };
    let entries: Vec<PathBuf> = std::fs::read_dir(folder)?
        .map(|entry| Ok(entry?.path()))
        .collect::<std::io::Result<_>>()?;
    Ok(entries.into_iter().filter(is_log).collect())
}

/// The vehicle that a log names. One that names none is a vehicle of its own, known by the time
/// of its first message: a renamed copy is the same vehicle.
pub(crate) fn vehicle_of(log: &LogIndex) -> String {
    log.vehicle
        .clone()
        .unwrap_or_else(|| format!("unnamed:{}", log.start_ns))
}

/// One block of one vehicle's time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unit {
    /// Vehicle, as the logs name it.
    pub vehicle: String,
    /// First window and the one after the last.
    pub windows: (i64, i64),
    /// Logs that cover the block or its context: indices into the catalogue.
    pub logs: Vec<usize>,
}

/// What a unit's logs hold of it.
#[derive(Debug, Default)]
pub struct UnitRecording {
    /// Per detection topic: everything that is needed to map it.
    pub channels: BTreeMap<String, Recording>,
    /// What each of the unit's logs gave to it: indices into the catalogue.
    pub given_by: BTreeMap<usize, Given>,
    /// What was lost.
    pub set_aside: Vec<SetAside>,
}

/// What one log gave to a unit.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Given {
    /// Windows in which it has messages.
    pub windows: BTreeSet<i64>,
    /// Whether it has latched messages, which hold for all windows.
    pub is_latched: bool,
}

impl UnitRecording {
    /// The logs that the chunk of a window is made from, context included.
    pub fn logs_of(&self, window: i64) -> impl Iterator<Item = usize> + '_ {
        let context = chunk::around(window);
        let gave = move |given: &Given| {
            given.is_latched || given.windows.range(context.clone()).next().is_some()
        };
        let logs = self.given_by.iter().filter(move |(_, given)| gave(given));
        logs.map(|(&log, _)| log)
    }
}

impl Unit {
    fn new(vehicle: &str, block: i64, logs: &[usize], all: &[LogIndex]) -> Self {
        let windows = (block * BLOCK_WINDOWS, (block + 1) * BLOCK_WINDOWS);
        let mut unit = Self {
            vehicle: vehicle.to_owned(),
            windows,
            logs: Vec::new(),
        };
        let (from_ns, to_ns) = unit.read_range_ns();
        unit.logs = logs
            .iter()
            .copied()
            .filter(|&log| all[log].start_ns < to_ns && all[log].end_ns >= from_ns)
            .collect();
        unit
    }

    /// About how many messages it is made from, its context left out: its logs' messages, as if they
    /// were spread evenly over each log. For the order of work only.
    pub(crate) fn size(&self, catalogue: &Catalogue) -> u64 {
        let (from_ns, to_ns) = self.windows;
        let (from_ns, to_ns) = (window_bounds_ns(from_ns).0, window_bounds_ns(to_ns).0);
        let of_log = |&log: &usize| {
            let log = &catalogue.logs[log];
            let shared_ns = to_ns.min(log.end_ns) as f64 - from_ns.max(log.start_ns) as f64;
            let whole_ns = (log.end_ns as f64 - log.start_ns as f64).max(1.0);
            let share = (shared_ns / whole_ns).clamp(0.0, 1.0);
            (share * log.message_count() as f64) as u64
        };
        self.logs.iter().map(of_log).sum()
    }

    /// Log times to read: the block, its context, and the slack between clocks.
    fn read_range_ns(&self) -> (i64, i64) {
        let slack_ns = CONTEXT_NS + MAX_CLOCK_GAP_NS;
        (
            window_bounds_ns(self.windows.0).0.saturating_sub(slack_ns),
            window_bounds_ns(self.windows.1).0.saturating_add(slack_ns),
        )
    }

    /// Reads the unit, one recording per detection topic, each settled.
    #[must_use]
    pub fn read(&self, catalogue: &Catalogue, meter: &Meter) -> UnitRecording {
        let mut unit = UnitRecording::default();
        let mut shared: Vec<LogMessage> = Vec::new();
        for &log in &self.logs {
            let given = self.read_log(catalogue, log, &mut unit, &mut shared, meter);
            unit.given_by.insert(log, given);
        }
        for recording in unit.channels.values_mut() {
            shared
                .iter()
                .for_each(|message| recording.push(message.clone()));
            recording.settle();
        }
        unit
    }

    fn read_log(
        &self,
        catalogue: &Catalogue,
        log: usize,
        unit: &mut UnitRecording,
        shared: &mut Vec<LogMessage>,
        meter: &Meter,
    ) -> Given {
        let log = &catalogue.logs[log];
        let mut given = Given::default();
        let wanted = wanted_topics(log, catalogue.model);
        let (from_ns, to_ns) = self.read_range_ns();
        let mut other_clock = (0_u64, None);
        let mut sink = |message: LogMessage| {
            let gap_ns = message.stamp_ns.saturating_sub(message.log_time_ns);
            if gap_ns.unsigned_abs() > MAX_CLOCK_GAP_NS.unsigned_abs() {
                let window = window_of(message.log_time_ns);
                if (self.windows.0..self.windows.1).contains(&window) {
                    other_clock.0 += 1;
                    other_clock.1.get_or_insert(message.stamp_ns);
                }
                return;
            }
            let topic = &log.topics[message.topic];
            if is_latched(topic) {
                given.is_latched = true;
            } else {
                given.windows.insert(window_of(message.stamp_ns));
            }
            // Vehicles hide lines from every channel.
            if matches!(message.payload, Payload::Detections(_)) {
                unit.channels
                    .entry(topic.name.clone())
                    .or_default()
                    .push(message);
            } else if matches!(message.payload, Payload::Image(_)) {
                // Only which picture it is: it is looked at later, and once.
                let recording = unit.channels.entry(topic.name.clone()).or_default();
                recording.model = catalogue.model.unwrap_or_default();
                recording.observations.push(Stamped {
                    stamp_ns: message.stamp_ns,
                    frame_id: message.frame_id,
                    digest: catalogue.seen_digest(message.digest),
                    value: ObservationFrame::default(),
                });
            } else {
                shared.push(message);
            }
        };
        let result = meter.time(Stage::Read, || {
            let mut reader = LogReader::new();
            // What was latched before the block still holds in it.
            let latched =
                |index: usize, topic: &Topic| wanted.contains(&index) && is_latched(topic);
            let before = reader.read(log, latched, i64::MIN..from_ns, &mut sink)?;
            let is_wanted = |index: usize, _: &Topic| wanted.contains(&index);
            let mut report = reader.read(log, is_wanted, from_ns..to_ns, &mut sink)?;
            report.bytes_read += before.bytes_read;
            report.messages += before.messages;
            report.set_aside.extend(before.set_aside);
            Ok::<_, tilefold_formats::log::LogError>(report)
        });
        let path = log.path.display().to_string();
        match result {
            Ok(report) => {
                meter.count(Stage::Read, report.messages, report.bytes_read);
                unit.set_aside.extend(report.set_aside);
            }
            Err(error) => unit.set_aside.push(SetAside::new(
                SetAsideKind::File,
                path.clone(),
                error.to_string(),
            )),
        }
        if let (count, Some(stamp_ns)) = other_clock {
            let reason = format!(
                "header stamp and log time are more than {} s apart: two clocks",
                MAX_CLOCK_GAP_NS / 1_000_000_000
            );
            unit.set_aside.push(
                SetAside::new(SetAsideKind::Message, path, reason)
                    .when(stamp_ns)
                    .times(count),
            );
        }
        given
    }
}

/// Whether a topic's messages hold until the next one.
fn is_latched(topic: &Topic) -> bool {
    topic.kind == TopicKind::Calibration || topic.name.ends_with("tf_static")
}

/// Of every kind that is needed, the topic with the most messages; of detections, all. Pictures are
/// for a model, where there are no detections.
fn wanted_topics(log: &LogIndex, model: Option<i64>) -> BTreeSet<usize> {
    let most = |kind: TopicKind| {
        log.topics_of(kind)
            .filter(|(_, topic)| topic.messages > 0)
            .max_by_key(|(index, topic)| (topic.messages, std::cmp::Reverse(*index)))
            .map(|(index, _)| index)
    };
    let orientation = most(TopicKind::Imu).or_else(|| most(TopicKind::Pose));
    let single = [
        most(TopicKind::Gnss),
        orientation,
        most(TopicKind::Odometry),
        model
            .filter(|_| !has_detections(log))
            .and_then(|_| most(TopicKind::Image)),
    ];
    let every = [
        TopicKind::Calibration,
        TopicKind::Transforms,
        TopicKind::Detections(DetectionSpace::Metres),
        TopicKind::Detections(DetectionSpace::Pixels),
    ];
    let all = every
        .into_iter()
        .flat_map(|kind| log.topics_of(kind).map(|(index, _)| index));
    single.into_iter().flatten().chain(all).collect()
}
