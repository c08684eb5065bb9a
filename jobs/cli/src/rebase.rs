//! `rebase`: a new base map, what of the old one goes on, and which claims it confirms.

use std::error::Error;
use std::path::{Path, PathBuf};

use tilefold_engine::{RebaseReport, rebase};

use crate::args::Args;
use crate::report::{Outcome, print, print_set_aside};
use crate::{progress, table};

/// At most this many logs are listed; JSON has them all.
const LISTED: usize = 20;

/// Lays a new base map under a store.
///
/// # Errors
/// As [`tilefold_engine::rebase()`].
pub(crate) fn rebase_store(
    args: &Args,
    store: &Path,
    maps: &[PathBuf],
) -> Result<Outcome, Box<dyn Error>> {
    let progress = progress::listener(args.progress);
    let report = rebase(store, maps, progress.as_ref())?;
    print(args, &report, words)?;
    print_set_aside(&report.set_aside);
    Ok(Outcome::with(&report.set_aside))
}

fn words(report: &RebaseReport) -> String {
    let mut text = format!(
        "version {}: {} elements: {} unchanged, {} at the same place, {} new or edited; {} gone\n\
         {} ledger rows left with them; {} tiles reduced",
        report.version,
        report.elements,
        report.unchanged,
        report.same_place,
        report.new,
        report.gone,
        report.rows_dropped,
        report.tiles_reduced
    );
    if !report.accepted.is_empty() {
        let id = |id: Option<i64>| id.map_or_else(String::new, |id| id.to_string());
        let rows = report.accepted.iter().map(|claim| {
            let verdict = claim.verdict.to_owned();
            vec![
                verdict,
                format!("{:016x}", claim.change),
                id(claim.element),
                id(claim.now),
            ]
        });
        let header = ["accepted", "change", "element", "now"];
        text.push_str("\n\n");
        text.push_str(&table::rows(&header, rows));
    }
    if !report.run_again.is_empty() {
        let (some, rest) = report
            .run_again
            .split_at(report.run_again.len().min(LISTED));
        text.push_str(&format!(
            "\n\n{} chunks were mapped where the map has changed; `tilefold run` with their logs maps them anew:\n  {}",
            report.outdated,
            some.join("\n  ")
        ));
        if !rest.is_empty() {
            text.push_str(&format!("\n  and {} more", rest.len()));
        }
    }
    text
}
