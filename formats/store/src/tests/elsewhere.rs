//! Data files written by other transactions: the same store as by one, or a refusal.

use tilefold_schemas::EvidenceRow;

use super::rows::{parameters, rows, store, tile, tiles};
use crate::{Rewritten, Snapshot, Store, StoreError};

/// What a worker does: replaces the rows of two tiles, which lie in one coarse tile.
fn worker(base: &Snapshot, first: i32, seed: u64) -> Rewritten {
    let mut tx = base.store().begin_from(base.clone()).unwrap();
    let two = tiles([first, first + 1]);
    tx.replace_tiles::<EvidenceRow>(&two, rows(seed, tile(first), 9))
        .unwrap();
    tx.rewritten::<EvidenceRow>().unwrap()
}

fn filled() -> (tempfile::TempDir, Store) {
    let (folder, store) = store();
    let mut tx = store.begin().unwrap();
    tx.append::<EvidenceRow>(rows(1, tile(1), 20)).unwrap();
    tx.append::<EvidenceRow>(rows(2, tile(600), 20)).unwrap();
    tx.commit("run", parameters()).unwrap();
    (folder, store)
}

#[test]
fn files_of_two_workers_are_the_files_of_one_transaction() {
    let ((_a, shared), (_b, single)) = (filled(), filled());
    let base = shared.snapshot(None).unwrap();
    let mut tx = shared.begin_from(base.clone()).unwrap();
    for (first, seed) in [(1, 5), (600, 6)] {
        // As a runner carries it, and twice over: a worker that runs again changes nothing.
        worker(&base, first, seed);
        let text = serde_json::to_string(&worker(&base, first, seed)).unwrap();
        tx.take_over::<EvidenceRow>(&serde_json::from_str(&text).unwrap())
            .unwrap();
    }
    tx.commit("run", parameters()).unwrap();
    let mut tx = single.begin().unwrap();
    for (first, seed) in [(1, 5), (600, 6)] {
        let two = tiles([first, first + 1]);
        tx.replace_tiles::<EvidenceRow>(&two, rows(seed, tile(first), 9))
            .unwrap();
    }
    tx.commit("run", parameters()).unwrap();
    let [shared, single] = [shared, single].map(|store| store.snapshot(None).unwrap());
    assert_eq!(shared.info().pins, single.info().pins);
    assert_eq!(
        shared.digest::<EvidenceRow>().unwrap(),
        single.digest::<EvidenceRow>().unwrap()
    );
}

#[test]
fn what_is_taken_over_twice_is_refused() {
    let (_folder, store) = filled();
    let base = store.snapshot(None).unwrap();
    let one = worker(&base, 1, 5);
    let mut tx = store.begin_from(base.clone()).unwrap();
    tx.take_over::<EvidenceRow>(&one).unwrap();
    let again = tx.take_over::<EvidenceRow>(&one);
    assert!(matches!(again, Err(StoreError::Elsewhere { .. })));
}

#[test]
fn files_for_another_version_are_refused() {
    let (_folder, store) = filled();
    let old = worker(&store.snapshot(None).unwrap(), 1, 5);
    let mut tx = store.begin().unwrap();
    tx.append::<EvidenceRow>(rows(3, tile(601), 2)).unwrap();
    tx.commit("run", parameters()).unwrap();
    let late = store.begin().unwrap().take_over::<EvidenceRow>(&old);
    let said = late.unwrap_err().to_string();
    assert!(
        said.contains("at version 1, and wanted are those of version 2"),
        "{said}"
    );
}
