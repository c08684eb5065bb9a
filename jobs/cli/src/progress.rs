//! Progress on standard error: a bar a stage on a terminal, or one JSON object a line.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use tilefold_engine::{Meter, Progress, Silent, Stage};

use crate::args::ProgressForm;

/// The listener that the flags and the terminal ask for.
#[must_use]
pub(crate) fn listener(form: ProgressForm) -> Box<dyn Progress> {
    match form {
        ProgressForm::Json => Box::new(Lines::default()),
        ProgressForm::Auto if std::io::stderr().is_terminal() => Box::new(Bars::default()),
        ProgressForm::Auto | ProgressForm::Off => Box::new(Silent),
    }
}

/// Bars with rate, time to go, bottleneck and losses.
#[derive(Default)]
struct Bars {
    bar: Mutex<Option<ProgressBar>>,
    set_aside: AtomicU64,
    bottleneck: Mutex<String>,
}

impl Bars {
    /// What is said behind a bar: what takes the time, and what was lost.
    fn say(&self) {
        let busiest = self.bottleneck.lock().unwrap_or_else(|e| e.into_inner());
        let lost = self.set_aside.load(Ordering::Relaxed);
        let lost = (lost > 0).then(|| format!("set aside {lost}"));
        let parts: Vec<&str> = [busiest.as_str(), lost.as_deref().unwrap_or_default()]
            .into_iter()
            .filter(|part| !part.is_empty())
            .collect();
        self.with(|bar| bar.set_message(parts.join(", ")));
    }

    fn with(&self, act: impl FnOnce(&ProgressBar)) {
        if let Some(bar) = self.bar.lock().unwrap_or_else(|e| e.into_inner()).as_ref() {
            act(bar);
        }
    }
}

impl Progress for Bars {
    fn begin(&self, stage: Stage, total: u64) {
        let bar = ProgressBar::new(total).with_prefix(stage.name());
        let style = "{prefix:>9} [{bar:30}] {pos}/{len} {per_sec} eta {eta} {msg}";
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        *self.bar.lock().unwrap_or_else(|e| e.into_inner()) = Some(bar);
    }

    fn advance(&self, _: Stage, done: u64, set_aside: u64) {
        self.set_aside.fetch_add(set_aside, Ordering::Relaxed);
        self.with(|bar| bar.inc(done));
        self.say();
    }

    fn end(&self, _: Stage) {
        self.with(ProgressBar::finish);
    }

    fn measured(&self, meter: &Meter) {
        if let Some((stage, share)) = meter.bottleneck() {
            let text = format!("mostly {} ({:.0} %)", stage.name(), share * 100.0);
            *self.bottleneck.lock().unwrap_or_else(|e| e.into_inner()) = text;
        }
        self.say();
    }
}

/// Events as JSON lines.
#[derive(Default)]
struct Lines {
    state: Mutex<(u64, u64, u64)>,
}

impl Lines {
    fn print(event: &str, stage: Stage, (done, total, set_aside): (u64, u64, u64)) {
        let line = serde_json::json!({
            "event": event, "stage": stage.name(), "unit": stage.step(),
            "done": done, "total": total, "set_aside": set_aside,
        });
        tell!("{line}");
    }
}

impl Progress for Lines {
    fn begin(&self, stage: Stage, total: u64) {
        let mut state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        *state = (0, total, state.2);
        Self::print("begin", stage, *state);
    }

    fn advance(&self, stage: Stage, done: u64, set_aside: u64) {
        let mut state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        state.0 += done;
        state.2 += set_aside;
        Self::print("advance", stage, *state);
    }

    fn end(&self, stage: Stage) {
        let state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        Self::print("end", stage, *state);
    }
}
