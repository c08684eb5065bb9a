//! `regions`: changes that lie beside each other, as one thing to look at.

use std::error::Error;
use std::path::Path;

use serde::Serialize;
use tilefold_engine::regions;
use tilefold_formats::geojson::write_regions;
use tilefold_schemas::{ChangeRecord, Region};
use tilefold_store::{Snapshot, TileFilter};

use crate::args::{Args, Format};
use crate::at::{At, open};
use crate::report::{Outcome, print};
use crate::table;

/// A region as it is listed.
#[derive(Debug, Serialize)]
pub(crate) struct RegionLine {
    id: String,
    tile: i32,
    summary: String,
    since_ns: Option<i64>,
    changes: Vec<String>,
    outline: Vec<[f64; 2]>,
}

/// Lists the regions of a version: as a table, JSON or GeoJSON polygons.
///
/// # Errors
/// The store is damaged.
pub(crate) fn list(
    args: &Args,
    store: &Path,
    version: Option<At>,
    threshold: f64,
) -> Result<Outcome, Box<dyn Error>> {
    let snapshot = open(store, version)?;
    let found = of_version(&snapshot, threshold)?;
    if args.format == Format::Geojson {
        write_regions(&found, &mut std::io::stdout().lock())?;
        return Ok(Outcome::Done);
    }
    let lines: Vec<RegionLine> = found.iter().map(line).collect();
    print(args, &lines, |lines| text(lines))?;
    Ok(Outcome::Done)
}

/// The regions of a version's changes that are at least this likely.
fn of_version(snapshot: &Snapshot, threshold: f64) -> Result<Vec<Region>, Box<dyn Error>> {
    let mut records: Vec<ChangeRecord> = snapshot.read(TileFilter::All)?;
    records.retain(|record| {
        let p = record.p_added.max(record.p_removed).max(record.p_modified);
        p >= threshold
    });
    Ok(regions(&records))
}

fn line(region: &Region) -> RegionLine {
    RegionLine {
        id: format!("{:016x}", region.id),
        tile: region.tile,
        summary: region.summary(),
        since_ns: region.since_ns,
        changes: region
            .changes
            .iter()
            .map(|id| format!("{id:016x}"))
            .collect(),
        outline: region.outline.clone(),
    }
}

fn text(lines: &[RegionLine]) -> String {
    let row = |line: &RegionLine| {
        vec![
            line.id.clone(),
            line.summary.clone(),
            line.since_ns.map_or_else(|| "-".to_owned(), day),
            line.changes.len().to_string(),
        ]
    };
    let header = ["region", "what", "since", "changes"];
    table::rows(&header, lines.iter().map(row))
}

fn day(stamp_ns: i64) -> String {
    let time = chrono::DateTime::from_timestamp_nanos(stamp_ns);
    time.format("%-d %B %Y").to_string()
}
