//! Data files are a function of the rows: names, digests, GeoParquet metadata, tiles.

use std::collections::BTreeSet;
use std::path::Path;

use parquet::file::reader::{FileReader, SerializedFileReader};
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{
    ChangeRecord, ChunkRow, EvidenceRow, Footprint, Ledger, Sighting, Testified, TileId,
};

use super::rows::{parameters, rows, store, tile, tiles};
use crate::layout::Layout;
use crate::{Snapshot, StoredTable, TileFilter, digest_rows};

fn names<R: StoredTable>(snapshot: &Snapshot) -> BTreeSet<String> {
    let files = snapshot.files::<R>(TileFilter::All).unwrap();
    files.into_iter().map(|file| file.name).collect()
}

#[test]
fn sort_keys_and_geometries_are_columns() {
    for layout in Layout::known() {
        for name in layout
            .sort_key
            .iter()
            .chain(layout.geometry)
            .chain(layout.not_digested)
        {
            assert!(
                layout.schema.index_of(name).is_ok(),
                "{} has no {name}",
                layout.name
            );
        }
    }
}

#[test]
fn same_rows_in_another_order_and_history_give_the_same_files() {
    let mut all: Vec<EvidenceRow> = Vec::new();
    for number in [1, 2, 255, 256, 1000] {
        all.extend(rows(number as u64, tile(number), 40));
    }
    let (_a, at_once) = store();
    let mut tx = at_once.begin().unwrap();
    tx.overwrite(all.clone()).unwrap();
    tx.commit("run", parameters()).unwrap();

    let (_b, bit_by_bit) = store();
    all.reverse();
    for part in all.chunks(33) {
        let mut tx = bit_by_bit.begin().unwrap();
        tx.append(part.to_vec()).unwrap();
        tx.commit("run", parameters()).unwrap();
    }
    let a = at_once.snapshot(None).unwrap();
    let b = bit_by_bit.snapshot(None).unwrap();
    assert_eq!(names::<EvidenceRow>(&a), names::<EvidenceRow>(&b));
    assert_eq!(
        names::<EvidenceRow>(&a).len(),
        3,
        "tiles 1, 2 and 255 share a file"
    );
    assert_eq!(
        a.digest::<EvidenceRow>().unwrap(),
        b.digest::<EvidenceRow>().unwrap()
    );
    assert_eq!(
        a.read::<EvidenceRow>(TileFilter::All).unwrap(),
        b.read::<EvidenceRow>(TileFilter::All).unwrap()
    );
}

#[test]
fn replacing_a_tile_leaves_the_others() {
    let (_folder, store) = store();
    let mut tx = store.begin().unwrap();
    for number in [1, 2, 3, 700] {
        tx.append::<EvidenceRow>(rows(number as u64, tile(number), 10))
            .unwrap();
    }
    tx.commit("run", parameters()).unwrap();
    let before = store.snapshot(None).unwrap();
    let mut tx = store.begin().unwrap();
    tx.replace_tiles::<EvidenceRow>(&tiles([2, 3]), rows(99, tile(2), 4))
        .unwrap();
    tx.commit("run", parameters()).unwrap();
    let after = store.snapshot(None).unwrap();
    let count = |number| {
        let wanted = tiles([number]);
        after
            .read::<EvidenceRow>(TileFilter::Tiles(&wanted))
            .unwrap()
            .len()
    };
    assert_eq!([count(1), count(2), count(3), count(700)], [10, 4, 0, 10]);
    let kept = |snapshot: &Snapshot| {
        snapshot
            .read::<EvidenceRow>(TileFilter::Tiles(&tiles([1, 700])))
            .unwrap()
    };
    assert_eq!(kept(&before), kept(&after));
    assert_eq!(
        names::<EvidenceRow>(&before)
            .intersection(&names::<EvidenceRow>(&after))
            .count(),
        1
    );
}

#[test]
fn the_file_goes_with_its_last_row() {
    let (_folder, store) = store();
    let mut tx = store.begin().unwrap();
    tx.append::<EvidenceRow>(rows(1, tile(1), 10)).unwrap();
    tx.replace_tiles::<EvidenceRow>(&tiles([1]), Vec::new())
        .unwrap();
    assert_eq!(
        tx.commit("run", parameters()).unwrap(),
        0,
        "nothing changed"
    );
}

#[test]
fn only_files_of_the_wanted_tiles_are_read() {
    let (folder, store) = store();
    let mut tx = store.begin().unwrap();
    tx.append::<EvidenceRow>(rows(1, tile(1), 10)).unwrap();
    tx.append::<EvidenceRow>(rows(2, tile(900), 10)).unwrap();
    tx.commit("run", parameters()).unwrap();
    let snapshot = store.snapshot(None).unwrap();
    let other = &snapshot
        .files::<EvidenceRow>(TileFilter::Tiles(&tiles([900])))
        .unwrap()[0];
    std::fs::remove_file(
        Path::new(&store.location())
            .join("evidence")
            .join(&other.name),
    )
    .unwrap();
    let read = snapshot
        .read::<EvidenceRow>(TileFilter::Tiles(&tiles([1, 2])))
        .unwrap();
    assert_eq!(read.len(), 10);
    drop(folder);
}

#[test]
fn tiles_at_the_deepest_level_are_negative_and_work() {
    let (_folder, store) = store();
    let deepest = TileId(i32::MIN + 12345);
    assert_eq!(deepest.level(), 15);
    assert_eq!(deepest.ancestor(11).level(), 11);
    let mut tx = store.begin().unwrap();
    tx.append::<EvidenceRow>(rows(1, deepest, 5)).unwrap();
    tx.append::<EvidenceRow>(rows(1, TileId(-1), 5)).unwrap();
    tx.commit("run", parameters()).unwrap();
    let snapshot = store.snapshot(None).unwrap();
    let wanted = BTreeSet::from([deepest]);
    assert_eq!(
        snapshot
            .read::<EvidenceRow>(TileFilter::Tiles(&wanted))
            .unwrap()
            .len(),
        5
    );
}

#[test]
fn the_same_chunk_twice_is_there_twice() {
    let (_folder, store) = store();
    let mut tx = store.begin().unwrap();
    for _ in 0..3 {
        tx.append::<ChunkRow>(rows(1, tile(0), 2)).unwrap();
    }
    tx.commit("run", parameters()).unwrap();
    assert_eq!(
        store
            .snapshot(None)
            .unwrap()
            .row_count::<ChunkRow>()
            .unwrap(),
        6
    );
}

#[test]
fn the_log_that_a_chunk_came_from_is_not_digested() {
    let digest = |log: &str| {
        let (_folder, store) = store();
        let mut chunks: Vec<ChunkRow> = rows(1, tile(0), 5);
        chunks
            .iter_mut()
            .for_each(|chunk| chunk.log = log.to_owned());
        let mut tx = store.begin().unwrap();
        tx.append(chunks).unwrap();
        tx.commit("run", parameters()).unwrap();
        store.snapshot(None).unwrap().digest::<ChunkRow>().unwrap()
    };
    assert_eq!(digest("a.mcap"), digest("renamed.mcap"));
}

#[test]
fn geometry_columns_are_named_in_geoparquet_metadata() {
    fn geo<R: StoredTable>() -> serde_json::Value {
        let (_folder, store) = store();
        let mut tx = store.begin().unwrap();
        tx.append::<R>(rows(1, tile(1), 5)).unwrap();
        tx.commit("run", parameters()).unwrap();
        let file = &store
            .snapshot(None)
            .unwrap()
            .files::<R>(TileFilter::All)
            .unwrap()[0];
        let path = Path::new(&store.location()).join(R::NAME).join(&file.name);
        let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
        let metadata = reader.metadata().file_metadata().clone();
        assert_eq!(metadata.created_by(), Some("tilefold"));
        let entries = metadata.key_value_metadata().unwrap();
        let geo = entries.iter().find(|entry| entry.key == "geo").unwrap();
        serde_json::from_str(geo.value.as_ref().unwrap()).unwrap()
    }
    assert_eq!(geo::<ElementRow>()["primary_column"], "geometry");
    let changes = geo::<ChangeRecord>();
    assert_eq!(changes["primary_column"], "geometry_new");
    assert_eq!(changes["columns"]["geometry_old"]["encoding"], "WKB");
}

/// The store's digest and the ledger's are one, whatever order the rows come in.
#[test]
fn a_ledger_has_the_digest_of_its_table() {
    fn check<R: StoredTable + Testified>(seed: u64) {
        let mut all: Vec<R> = [300, 2, 5000]
            .into_iter()
            .flat_map(|number| rows(seed, tile(number), 40))
            .collect();
        let digest = Ledger::of(all.clone()).digest();
        assert_eq!(digest, digest_rows(all.clone()).unwrap());
        all.reverse();
        assert_eq!(digest, Ledger::of(all).digest());
    }
    check::<EvidenceRow>(1);
    check::<Sighting>(2);
    check::<Footprint>(3);
}
