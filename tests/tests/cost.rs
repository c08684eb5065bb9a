//! What one more drive costs, counted in files: a job reads and writes what lies where its logs are,
//! however much else the store holds.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::collections::BTreeSet;

use tilefold_engine::{FusionModel, Silent, run};
use tilefold_schemas::{EvidenceRow, LayerHeader, TileId};
use tilefold_store::{Store, TileFilter, coarse};
use tilefold_tests::faulty::{Access, Fault, arm, through_fuse};
use tilefold_tests::towns::Towns;

/// The coarse tile and the table that a data file is of; none of other files.
fn data_file(path: &str) -> Option<(String, String)> {
    let mut parts = path.rsplit('/');
    let tile = parts.next()?.strip_prefix("tile-")?.split('-').next()?;
    Some((tile.to_owned(), parts.next()?.to_owned()))
}

#[test]
fn a_drive_in_one_town_touches_no_file_of_the_other() {
    let towns = Towns::new();
    let trial = towns.store();
    let (before, last) = towns.days();
    trial.run(&before);
    let snapshot = Store::open(trial.store().to_path_buf()).unwrap();
    let snapshot = snapshot.snapshot(None).unwrap();
    let in_both = snapshot.files::<EvidenceRow>(TileFilter::All).unwrap();
    assert!(in_both.len() > 1, "both towns have evidence");
    let headers: Vec<LayerHeader> = snapshot.read(TileFilter::All).unwrap();

    let fuse = arm(trial.store(), Fault::Fail, usize::MAX);
    let done = run(
        &through_fuse(trial.store()),
        &last,
        FusionModel::default(),
        &Silent,
    )
    .unwrap();
    assert!(done.is_new_version && done.tiles_reduced > 0);
    let accesses = fuse.accesses();

    let changed = |header: &&LayerHeader| !headers.contains(header);
    let now: Vec<LayerHeader> = trial.rows();
    let near: BTreeSet<String> = now
        .iter()
        .filter(changed)
        .map(|header| coarse(TileId(header.tile)).to_string())
        .collect();
    let touched = |wanted: &dyn Fn(&Access) -> bool, tables: &[&str]| -> BTreeSet<String> {
        let files = accesses.iter().filter(|access| wanted(access));
        let files = files.filter_map(|access| data_file(&access.path));
        let of_tables = files.filter(|(_, table)| tables.contains(&table.as_str()));
        of_tables.map(|(tile, _)| tile).collect()
    };
    let is_read = |access: &Access| !access.is_write;
    let ledger = ["evidence", "sightings", "footprints", "changes"];
    assert_eq!(touched(&is_read, &ledger), near);
    let written = ["evidence", "sightings", "footprints", "changes", "layers"];
    assert_eq!(touched(&|access| access.is_write, &written), near);
    // The base map and the headers are read as a whole: the canary of what is counted here.
    assert!(touched(&is_read, &["elements", "layers"]).len() > near.len());

    let whole = towns.store();
    whole.run(&[before, last].concat());
    assert_eq!(trial.content(), whole.content());
}
