//! `run --metrics FILE`: what a run does and did, in the text form of Prometheus, for the textfile
//! collector of node_exporter.
//!
//! The file is written beside itself and renamed, so that a collector never reads half of one; every
//! ten seconds while the run goes on, and once more at its end, whichever that is.

use std::fmt::{Display, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tilefold_engine::{Meter, Progress, RunReport, Stage, StageReport};
use tilefold_schemas::SetAside;

/// How often the file is written while a run goes on.
const INTERVAL: Duration = Duration::from_secs(10);

/// Writes the file, and hands progress on to who listens besides.
pub(crate) struct Metrics {
    path: PathBuf,
    listener: Box<dyn Progress>,
    state: Mutex<State>,
}

struct State {
    written: Instant,
    /// Steps done and steps in all, in the order of [`Stage::ALL`].
    steps: [(u64, u64); Stage::ALL.len()],
    set_aside: u64,
}

impl Metrics {
    /// Writes the first state; from then on the file is there.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn begin(path: &Path, listener: Box<dyn Progress>) -> Result<Self, String> {
        let metrics = Self {
            path: path.to_owned(),
            listener,
            state: Mutex::new(State {
                written: Instant::now(),
                steps: Default::default(),
                set_aside: 0,
            }),
        };
        metrics.write(&metrics.running(&[]))?;
        Ok(metrics)
    }

    /// Writes how the run ended; `None` where it failed.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn end(&self, report: Option<&RunReport>) -> Result<(), String> {
        let mut page = Page::default();
        page.gauge("running", "1 while the run goes on.", [("", 0)]);
        let ok = u8::from(report.is_some());
        page.gauge(
            "ok",
            "1 where the run ended well, 0 where it failed.",
            [("", ok)],
        );
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let now_s = now.map_or(0.0, |since| since.as_secs_f64());
        page.gauge("end_timestamp_seconds", "When it ended.", [("", now_s)]);
        if let Some(report) = report {
            page.report(report);
        }
        self.write(&page.0)
    }

    /// What is known while the run goes on.
    fn running(&self, stages: &[StageReport]) -> String {
        let state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        let mut page = Page::default();
        page.gauge("running", "1 while the run goes on.", [("", 1)]);
        let of = |pick: fn(&(u64, u64)) -> u64| {
            let steps = Stage::ALL.iter().zip(&state.steps);
            steps.map(move |(stage, count)| (label_of(*stage), pick(count)))
        };
        page.gauge(
            "steps_done",
            "Steps of a stage that are done.",
            of(|count| count.0),
        );
        page.gauge(
            "steps",
            "Steps of a stage that are known of.",
            of(|count| count.1),
        );
        let so_far = "Things set aside so far.";
        page.gauge("set_aside_so_far", so_far, [("", state.set_aside)]);
        page.stages(stages);
        page.0
    }

    fn write(&self, text: &str) -> Result<(), String> {
        let mut beside = self.path.clone().into_os_string();
        beside.push(".tmp");
        std::fs::write(&beside, text)
            .and_then(|()| std::fs::rename(&beside, &self.path))
            .map_err(|error| {
                let path = self.path.display();
                format!("cannot write the metrics to {path}: {error}; check the folder of --metrics and its rights")
            })
    }

    /// Changes the state; whether the file is due.
    fn note(&self, change: impl FnOnce(&mut State)) -> bool {
        let mut state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        change(&mut state);
        let is_due = state.written.elapsed() >= INTERVAL;
        if is_due {
            state.written = Instant::now();
        }
        is_due
    }
}

fn label_of(stage: Stage) -> String {
    format!("stage=\"{}\",unit=\"{}\"", stage.name(), stage.step())
}

impl Progress for Metrics {
    fn begin(&self, stage: Stage, total: u64) {
        self.note(|state| state.steps[stage as usize] = (0, total));
        self.listener.begin(stage, total);
    }

    fn advance(&self, stage: Stage, done: u64, set_aside: u64) {
        self.note(|state| {
            state.steps[stage as usize].0 += done;
            state.set_aside += set_aside;
        });
        self.listener.advance(stage, done, set_aside);
    }

    fn end(&self, stage: Stage) {
        self.listener.end(stage);
    }

    fn measured(&self, meter: &Meter) {
        if self.note(|_| {}) {
            // A collector that misses one of many states misses nothing; the last one is not let go.
            if let Err(reason) = self.write(&self.running(&meter.report())) {
                tracing::warn!(reason, "no metrics were written");
            }
        }
        self.listener.measured(meter);
    }
}

/// A page of metrics, all of them `tilefold_run_NAME`.
#[derive(Default)]
struct Page(String);

impl Page {
    /// A gauge, its help and its samples: labels (without braces) and a value.
    fn gauge<L: AsRef<str>, V: Display>(
        &mut self,
        name: &str,
        help: &str,
        samples: impl IntoIterator<Item = (L, V)>,
    ) {
        let name = format!("tilefold_run_{name}");
        // Writing to a string does not fail.
        let _ = writeln!(self.0, "# HELP {name} {help}\n# TYPE {name} gauge");
        for (labels, value) in samples {
            let _ = match labels.as_ref() {
                "" => writeln!(self.0, "{name} {value}"),
                labels => writeln!(self.0, "{name}{{{labels}}} {value}"),
            };
        }
    }

    fn stages(&mut self, stages: &[StageReport]) {
        let label =
            |stage: &StageReport| format!("stage=\"{}\",unit=\"{}\"", stage.stage, stage.unit);
        let items = stages.iter().map(|stage| (label(stage), stage.items));
        self.gauge("stage_items", "What a stage has done.", items);
        let bytes = stages.iter().map(|stage| (label(stage), stage.bytes));
        self.gauge("stage_bytes", "Bytes that a stage has read.", bytes);
        let busy = stages.iter().map(|stage| (label(stage), stage.busy_s));
        let help = "Seconds of work of a stage, summed over threads.";
        self.gauge("stage_busy_seconds", help, busy);
    }

    fn report(&mut self, report: &RunReport) {
        self.stages(&report.stages);
        self.gauge(
            "duration_seconds",
            "From start to commit.",
            [("", report.wall_s)],
        );
        self.gauge(
            "store_version",
            "Version that readers see.",
            [("", report.version)],
        );
        let is_new = u8::from(report.is_new_version);
        self.gauge(
            "is_new_version",
            "1 where the run made that version.",
            [("", is_new)],
        );
        self.gauge("logs", "Logs that could be read.", [("", report.logs)]);
        self.gauge("vehicles", "Vehicles in them.", [("", report.vehicles)]);
        self.gauge(
            "chunks_mapped",
            "Chunks mapped now.",
            [("", report.chunks_mapped)],
        );
        self.gauge(
            "chunks_known",
            "Chunks that the store knew.",
            [("", report.chunks_known)],
        );
        self.gauge(
            "tiles_reduced",
            "Tiles that were judged anew.",
            [("", report.tiles_reduced)],
        );
        let losses = by_kind(&report.set_aside);
        let samples = losses.map(|(kind, count)| (format!("kind=\"{kind}\""), count));
        self.gauge("set_aside", "What was set aside, by kind.", samples);
    }
}

/// What was set aside of each kind there is, in the order of their names.
fn by_kind(losses: &[SetAside]) -> impl Iterator<Item = (&'static str, u64)> {
    let mut counts = std::collections::BTreeMap::new();
    for loss in losses {
        *counts.entry(loss.kind.name()).or_insert(0) += loss.count;
    }
    counts.into_iter()
}
