//! `detect` and `doctor`: perception alone, and what it needs.

use std::error::Error;
use std::path::Path;

use serde::Serialize;
use tilefold_engine::detect::{Detected, Outputs, detect};
use tilefold_engine::{Perception, perceive};

use crate::args::{Args, Detection, Runtime};
use crate::progress;
use crate::report::{Outcome, print, print_set_aside};
use crate::table;

/// Opens the network of a card.
///
/// # Errors
/// It cannot be used.
pub(crate) fn perception(card: &Path, runtime: &Runtime) -> Result<Perception, Box<dyn Error>> {
    Ok(Perception::open(
        card,
        runtime.onnxruntime.as_deref(),
        runtime.device(),
    )?)
}

/// `detect`.
///
/// # Errors
/// The model cannot be used, there are no pictures, or an output cannot be written.
pub(crate) fn detect_in(args: &Args, asked: &Detection) -> Result<Outcome, Box<dyn Error>> {
    let perception = perception(&asked.model, &asked.runtime)?;
    let progress = progress::listener(args.progress);
    let outputs = Outputs {
        overlay: asked.overlay.as_deref(),
        annotations: asked.out.as_deref(),
    };
    let detected = detect(&asked.input, &perception, outputs, progress.as_ref())?;
    print(args, &detected, words)?;
    print_set_aside(&detected.set_aside);
    Ok(Outcome::with(&detected.set_aside))
}

fn words(detected: &Detected) -> String {
    let items = detected
        .pictures
        .iter()
        .flat_map(|picture| &picture.detections);
    let mut counts = std::collections::BTreeMap::new();
    items.for_each(|item| *counts.entry(item.class).or_insert(0_u64) += 1);
    let rows = counts
        .iter()
        .map(|(class, count)| vec![(*class).to_owned(), count.to_string()]);
    format!(
        "{}\n\n{}\n{} pictures in {:.1} s with {}; `--format json` says where everything is",
        table::stages(&detected.stages),
        table::rows(&["class", "seen"], rows),
        detected.pictures.len(),
        detected.wall_s,
        detected.model,
    )
}

#[derive(Serialize)]
struct Finding {
    what: &'static str,
    is_good: bool,
    found: String,
}

/// `doctor`.
///
/// # Errors
/// Standard output is closed.
pub(crate) fn doctor(
    args: &Args,
    runtime: &Runtime,
    cards: &[std::path::PathBuf],
) -> Result<Outcome, Box<dyn Error>> {
    let mut findings = vec![Finding {
        what: "threads",
        is_good: true,
        found: std::thread::available_parallelism()
            .map_or_else(|error| error.to_string(), |n| n.to_string()),
    }];
    match perceive::runtime(runtime.onnxruntime.as_deref()) {
        Ok(found) => {
            let path = found.path.display().to_string();
            findings.push(finding(
                "onnxruntime",
                true,
                format!("{} in {path}", found.version),
            ));
            findings.push(finding("providers", true, found.providers.join(", ")));
        }
        Err(error) => findings.push(finding("onnxruntime", false, error.to_string())),
    }
    for card in cards {
        findings.push(match perception(card, runtime) {
            Ok(perception) => {
                let model = perception.model();
                let found = format!(
                    "{}: {}, SHA-256 {}",
                    model.card.name,
                    model.path.display(),
                    model.card.sha256
                );
                finding("model", true, found)
            }
            Err(error) => finding("model", false, error.to_string()),
        });
    }
    let is_bad = findings.iter().any(|finding| !finding.is_good);
    print(args, &findings, |findings| {
        let mark = |is_good: bool| if is_good { "ok" } else { "WRONG" };
        // Not a table: one long path would make every line as long.
        let line = |f: &Finding| format!("{:<11}  {:<5}  {}\n", f.what, mark(f.is_good), f.found);
        findings.iter().map(line).collect()
    })?;
    Ok(if is_bad {
        Outcome::Wrong
    } else {
        Outcome::Done
    })
}

fn finding(what: &'static str, is_good: bool, found: String) -> Finding {
    Finding {
        what,
        is_good,
        found,
    }
}
