//! Old versions stay as they were, by number and by time; past checkpoints too.

use tilefold_schemas::{EvidenceRow, LayerHeader};

use super::rows::{parameters, rows, store, tile, tiles};
use crate::{Store, StoreError, TileFilter};

fn commit(store: &Store, number: i32) -> i64 {
    let mut tx = store.begin().unwrap();
    let seed = number as u64;
    tx.append::<EvidenceRow>(rows(seed, tile(number), 3))
        .unwrap();
    tx.replace_tiles::<LayerHeader>(&tiles([number]), rows(seed, tile(number), 1))
        .unwrap();
    tx.commit("run", parameters()).unwrap()
}

#[test]
fn each_version_keeps_its_rows() {
    let (_folder, store) = store();
    for number in 0..4 {
        assert_eq!(commit(&store, number), i64::from(number) + 1);
    }
    for version in 0..=4 {
        let snapshot = store.snapshot(Some(version)).unwrap();
        assert_eq!(snapshot.row_count::<EvidenceRow>().unwrap(), version * 3);
        let headers = snapshot.read::<LayerHeader>(TileFilter::All).unwrap();
        assert_eq!(headers.len() as i64, version);
    }
    for version in [-1, 5] {
        let refused = store.snapshot(Some(version));
        assert!(matches!(
            refused,
            Err(StoreError::NoSuchVersion { latest: 4, .. })
        ));
    }
}

#[test]
fn versions_say_who_did_what_and_find_themselves_by_time() {
    let (_folder, store) = store();
    commit(&store, 1);
    std::thread::sleep(std::time::Duration::from_millis(5));
    commit(&store, 2);
    let versions = store.versions().unwrap();
    let operations: Vec<&str> = versions
        .iter()
        .map(|info| info.operation.as_str())
        .collect();
    assert_eq!(operations, ["create", "run", "run"]);
    assert_eq!(versions[2].parameters, parameters());
    assert_eq!(versions[2].pins["evidence"].version, 2);
    assert_eq!(versions[2].pins["layers"].version, 2);
    assert_eq!(versions[2].pins["elements"].version, 0);
    for info in &versions[1..] {
        assert_eq!(
            store.snapshot_as_of(info.timestamp_ms).unwrap().version(),
            info.version
        );
    }
    assert_eq!(store.snapshot_as_of(i64::MAX).unwrap().version(), 2);
    let refused = store.snapshot_as_of(versions[0].timestamp_ms - 1);
    assert!(matches!(
        refused,
        Err(StoreError::BeforeFirstVersion { .. })
    ));
}

#[test]
fn nothing_to_change_is_no_version() {
    let (_folder, store) = store();
    commit(&store, 1);
    let mut tx = store.begin().unwrap();
    tx.replace_tiles::<EvidenceRow>(&tiles([1]), rows(1, tile(1), 3))
        .unwrap();
    assert_eq!(tx.commit("run", parameters()).unwrap(), 1);
    assert_eq!(store.latest_version().unwrap(), 1);
}

#[test]
fn versions_before_and_after_a_checkpoint_open() {
    let (_folder, store) = store();
    for number in 0..104 {
        commit(&store, number % 7 * 300);
    }
    let checkpoint = std::path::Path::new(&store.location())
        .join("layers/_delta_log/00000000000000000099.checkpoint.parquet");
    assert!(checkpoint.exists());
    for version in [3, 98, 99, 100, 104] {
        let snapshot = store.snapshot(Some(version)).unwrap();
        assert_eq!(snapshot.row_count::<EvidenceRow>().unwrap(), version * 3);
        assert!(!snapshot.digest::<EvidenceRow>().unwrap().is_empty());
        let refound = snapshot.read::<LayerHeader>(TileFilter::All).unwrap();
        assert_eq!(refound.len() as i64, version.min(7));
    }
}
