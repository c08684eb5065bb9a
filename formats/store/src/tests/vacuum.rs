//! What `vacuum` removes, and what it must not.

use tilefold_schemas::{EvidenceRow, LayerHeader};

use super::rows::{parameters, rows, store, tile, tiles};
use crate::{Retention, Store, StoreError, TileFilter};

fn job(store: &Store, seed: u64) -> i64 {
    let mut tx = store.begin().unwrap();
    tx.replace_tiles::<EvidenceRow>(&tiles([1]), rows(seed, tile(1), 5))
        .unwrap();
    tx.replace_tiles::<LayerHeader>(&tiles([1]), rows(seed, tile(1), 1))
        .unwrap();
    tx.commit("run", parameters()).unwrap()
}

fn three_jobs(store: &Store) {
    for seed in 1..=3 {
        job(store, seed);
    }
}

/// Everything that is not needed for versions since then, however young.
fn since(since_ms: i64) -> Retention {
    Retention {
        since_ms,
        written_since_ms: i64::MAX,
        is_dry: false,
    }
}

fn read(store: &Store, version: i64) -> Result<Vec<EvidenceRow>, StoreError> {
    store.snapshot(Some(version))?.read(TileFilter::All)
}

#[test]
fn the_latest_version_stays_and_older_ones_are_refused_by_name() {
    let (_folder, store) = store();
    three_jobs(&store);
    let latest = read(&store, 3).unwrap();
    let done = store.vacuum(&since(i64::MAX)).unwrap();
    assert_eq!((done.oldest_version, done.files), (3, 4));
    assert_eq!(read(&store, 3).unwrap(), latest);
    let refused = read(&store, 2).unwrap_err();
    assert!(matches!(
        refused,
        StoreError::Vacuumed {
            version: 2,
            oldest: 3,
            ..
        }
    ));
    assert_eq!(store.versions().unwrap().len(), 4);
    assert_eq!(store.vacuum(&since(i64::MAX)).unwrap().files, 0);
    assert_eq!(job(&store, 9), 4);
    assert_eq!(read(&store, 3).unwrap(), latest);
}

#[test]
fn versions_that_were_current_since_then_stay() {
    let (_folder, store) = store();
    three_jobs(&store);
    let versions = store.versions().unwrap();
    let done = store.vacuum(&since(versions[2].timestamp_ms)).unwrap();
    // Version 1 was replaced at that very instant: it was current until then.
    assert!(done.oldest_version <= 1);
    assert!((1..=3).all(|version| read(&store, version).is_ok()));
}

#[test]
fn a_dry_one_and_a_careful_one_remove_nothing() {
    let (_folder, store) = store();
    three_jobs(&store);
    let dry = Retention {
        is_dry: true,
        ..since(i64::MAX)
    };
    assert_eq!(store.vacuum(&dry).unwrap().files, 4);
    assert!(read(&store, 1).is_ok());
    let careful = Retention {
        written_since_ms: 0,
        ..since(0)
    };
    assert_eq!(store.vacuum(&careful).unwrap().files, 0);
    assert!(read(&store, 1).is_ok());
}

#[test]
fn what_a_killed_job_left_goes() {
    let (_folder, store) = store();
    job(&store, 1);
    let mut tx = store.begin().unwrap();
    tx.append::<EvidenceRow>(rows(7, tile(2), 5)).unwrap();
    drop(tx);
    assert_eq!(store.vacuum(&since(0)).unwrap().files, 1);
    assert!(read(&store, 1).is_ok());
}
