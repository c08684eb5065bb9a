//! What is written is read: every table, by tile, by batch, in one order.

use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{ChangeRecord, ChunkRow, EvidenceRow, Footprint, LayerHeader, Sighting};

use super::rows::{parameters, properties, rows, store, tile, tiles};
use crate::{Store, StoreError, StoredTable, TileFilter};

fn round_trip<R: StoredTable + PartialEq + std::fmt::Debug>() {
    let (_folder, store) = store();
    let mut written: Vec<R> = rows(1, tile(1), 50);
    let here = if R::tiled() { 50 } else { 53 };
    written.extend(rows(2, tile(300), 3));
    let mut tx = store.begin().unwrap();
    tx.append::<R>(rows(2, tile(300), 3)).unwrap();
    tx.append::<R>(rows(1, tile(1), 50)).unwrap();
    assert_eq!(tx.commit("run", parameters()).unwrap(), 1);

    let snapshot = Store::open(store.location())
        .unwrap()
        .snapshot(None)
        .unwrap();
    let read: Vec<R> = snapshot.read(TileFilter::All).unwrap();
    assert_eq!(read.len(), 53);
    assert_eq!(snapshot.row_count::<R>().unwrap(), 53);
    assert!(
        written.iter().all(|row| read.contains(row)),
        "a row of `{}` is not as written",
        R::NAME
    );
    let batches = snapshot.batches::<R>(TileFilter::All).unwrap();
    assert_eq!(
        batches
            .map(|batch| batch.unwrap().num_rows())
            .sum::<usize>(),
        53
    );
    match snapshot.read::<R>(TileFilter::Tiles(&tiles([1]))) {
        Ok(read) => assert_eq!(read.len(), here),
        Err(StoreError::NotTiled { .. }) => assert!(!R::tiled()),
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn every_table_reads_back_what_was_written() {
    round_trip::<ElementRow>();
    round_trip::<EvidenceRow>();
    round_trip::<Sighting>();
    round_trip::<Footprint>();
    round_trip::<ChunkRow>();
    round_trip::<ChangeRecord>();
    round_trip::<LayerHeader>();
}

#[test]
fn a_new_store_has_no_rows_and_keeps_its_properties() {
    let (_folder, store) = store();
    let again = Store::open(store.location()).unwrap();
    assert_eq!(again.properties(), &properties());
    let snapshot = again.snapshot(None).unwrap();
    assert_eq!(snapshot.version(), 0);
    assert!(
        snapshot
            .read::<ElementRow>(TileFilter::All)
            .unwrap()
            .is_empty()
    );
    assert!(matches!(
        Store::create(store.location(), properties()),
        Err(StoreError::Exists { .. })
    ));
}

#[test]
fn a_row_of_another_tile_is_refused() {
    let (_folder, store) = store();
    let mut tx = store.begin().unwrap();
    let refused = tx.replace_tiles::<EvidenceRow>(&tiles([1]), rows(1, tile(2), 1));
    assert!(matches!(
        refused,
        Err(StoreError::StrayRow { tiles: 1, .. })
    ));
    assert_eq!(tx.commit("run", parameters()).unwrap(), 0);
}

#[test]
fn async_callers_are_told() {
    let (_folder, store) = store();
    let runtime = tokio::runtime::Builder::new_multi_thread().build().unwrap();
    let refused = runtime.block_on(async { store.latest_version() });
    assert!(matches!(refused, Err(StoreError::Runtime { .. })));
}
