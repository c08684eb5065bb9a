//! `retract`: evidence out, and which logs bring back what went with it.

use std::error::Error;
use std::path::Path;

use tilefold_engine::{Forget, RetractReport, retract};

use crate::args::{Args, What};
use crate::progress;
use crate::report::{Outcome, print};

impl From<&What> for Forget {
    fn from(what: &What) -> Self {
        match what {
            What {
                drive: Some(id), ..
            } => Self::Drive(id.clone()),
            What {
                vehicle: Some(name),
                ..
            } => Self::Vehicle(name.clone()),
            What {
                log: Some(name), ..
            } => Self::Log(name.clone()),
            // Clap has seen to it that there is one of them.
            What { from, to, .. } => Self::Time {
                from_ns: from.unwrap_or(i64::MIN),
                to_ns: to.unwrap_or(i64::MAX),
            },
        }
    }
}

/// Takes evidence out of a store.
///
/// # Errors
/// As [`tilefold_engine::retract()`].
pub(crate) fn retract_from(
    args: &Args,
    store: &Path,
    what: &What,
) -> Result<Outcome, Box<dyn Error>> {
    let progress = progress::listener(args.progress);
    let report = retract(store, &what.into(), progress.as_ref())?;
    print(args, &report, words)?;
    Ok(Outcome::Done)
}

fn words(report: &RetractReport) -> String {
    let mut text = format!(
        "version {}: {} chunks with {} frames of {} drives are gone; {} tiles reduced\n\
         older versions still hold them, until `tilefold vacuum` removes these",
        report.version,
        report.chunks,
        report.frames,
        report.drives.len(),
        report.tiles_reduced
    );
    if !report.run_again.is_empty() {
        text.push_str("\nsome of the chunks were also made from these logs; `tilefold run` with them brings back what is theirs:");
        for log in &report.run_again {
            text.push_str("\n  ");
            text.push_str(log);
        }
    }
    text
}
