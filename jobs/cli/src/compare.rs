//! `compare`: two maps, or two versions of a store.

use std::error::Error;
use std::path::Path;

use tilefold_engine::compare::{
    MapComparison, MapDifference, VersionComparison, compare_maps, compare_versions,
};

use crate::args::{Args, Compare};
use crate::at::{At, open};
use crate::report::{Outcome, print, print_set_aside};
use crate::table;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Lines of words; JSON has them all.
const LINES: usize = 200;

/// Compares what is asked for.
///
/// # Errors
/// A map or the store cannot be read.
pub(crate) fn compare(args: &Args, asked: &Compare) -> Result<Outcome> {
    match &asked.b {
        Some(b) => maps(args, &asked.a, b, asked.tolerance_m),
        None if asked.a.is_file() => Err(format!(
            "{} is a file: name the map to compare it with as well, or a store alone",
            asked.a.display()
        )
        .into()),
        None => versions(args, &asked.a, asked.from, asked.to),
    }
}

fn maps(args: &Args, a: &Path, b: &Path, tolerance_m: f64) -> Result<Outcome> {
    let comparison = compare_maps(a, b, tolerance_m)?;
    print(args, &comparison, map_words)?;
    print_set_aside(&comparison.set_aside);
    Ok(match comparison.differences.is_empty() {
        true => Outcome::Done,
        false => Outcome::Differs,
    })
}

fn map_words(comparison: &MapComparison) -> String {
    if comparison.differences.is_empty() {
        return "the maps are the same".to_owned();
    }
    let shown = comparison.differences.iter().take(LINES).map(|difference| {
        vec![
            difference.class.to_owned(),
            difference.id.to_string(),
            clean(&difference.kind),
            difference.how.to_owned(),
            clean(&detail(difference)),
        ]
    });
    let list = table::rows(&["", "id", "type", "differs", ""], shown);
    let counts = comparison.counts.iter();
    let counts: Vec<String> = counts
        .map(|(name, count)| format!("{count} {name}"))
        .collect();
    let farthest = comparison.farthest_m;
    let farthest = farthest.map_or(String::new(), |m| format!("; the farthest moved {m:.3} m"));
    let more = comparison.differences.len().saturating_sub(LINES);
    let more = match more {
        0 => String::new(),
        _ => format!("\nand {more} more: --format json lists all"),
    };
    format!("{list}{more}\n\n{}{farthest}", counts.join(", "))
}

fn detail(difference: &MapDifference) -> String {
    let moved = difference.moved_m.map(|metres| format!("{metres:.3} m"));
    let new_id = difference.new_id.map(|id| format!("now {id}"));
    let detail = difference.detail.clone();
    moved.or(new_id).or(detail).unwrap_or_default()
}

/// Text from a map, without what would steer a terminal.
fn clean(text: &str) -> String {
    let shown = text.chars().take(100);
    let shown = shown.map(|c| if c.is_control() { '\u{fffd}' } else { c });
    shown.collect()
}

fn versions(args: &Args, store: &Path, from: Option<At>, to: Option<At>) -> Result<Outcome> {
    let to = open(store, to)?;
    let from = open(store, Some(from.unwrap_or(At::Version(to.version() - 1))))?;
    let comparison = compare_versions(&from, &to)?;
    print(args, &comparison, version_words)?;
    Ok(match comparison.tiles.is_empty() {
        true => Outcome::Done,
        false => Outcome::Differs,
    })
}

fn version_words(comparison: &VersionComparison) -> String {
    let VersionComparison { from, to, .. } = comparison;
    let head = format!(
        "version {from} to version {to}: {} tiles differ, {} are the same",
        comparison.tiles.len(),
        comparison.same_tiles
    );
    let records = comparison.tiles.iter().flat_map(|tile| {
        tile.records.iter().map(move |record| {
            vec![
                tile.tile.to_string(),
                record.change.clone(),
                record
                    .element_id
                    .map_or("-".to_owned(), |id| id.to_string()),
                record.from.unwrap_or("-").to_owned(),
                record.to.unwrap_or("-").to_owned(),
                format!("{:.3}", record.p_change),
            ]
        })
    });
    let records: Vec<Vec<String>> = records.take(LINES).collect();
    let same: usize = comparison.tiles.iter().map(|tile| tile.renumbered).sum();
    let names = ["tile", "change", "element", "was", "is", "p(change)"];
    let list = table::rows(&names, records);
    format!("{head}\n\n{list}\n\n{same} records keep their verdict and have other figures")
}
