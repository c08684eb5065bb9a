//! How long it takes: `cargo test --release -p tilefold-store -- --ignored --nocapture figures`.

use std::time::Instant;

use tilefold_schemas::{EvidenceRow, LayerHeader};

use super::rows::{parameters, rows, store, tile, tiles};
use crate::{Store, TileFilter};

fn timed<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let done = work();
    println!("{what}: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    done
}

#[test]
#[ignore = "measures"]
fn figures() {
    let (_folder, store) = timed("create", store);
    let mut all: Vec<EvidenceRow> = Vec::new();
    let mut headers: Vec<LayerHeader> = Vec::new();
    for number in 0..10_000 {
        all.extend(rows(number as u64, tile(number), 30));
        headers.extend(rows(number as u64, tile(number), 1));
    }
    println!("{} evidence rows in 10,000 tiles", all.len());
    let mut tx = store.begin().unwrap();
    timed("write evidence", || tx.append(all).unwrap());
    timed("write layers", || tx.append(headers).unwrap());
    timed("commit", || tx.commit("run", parameters()).unwrap());

    let ten = tiles(4000..4010);
    for round in 1..=3 {
        let store = timed("open store", || Store::open(store.location()).unwrap());
        let snapshot = timed("open snapshot", || store.snapshot(None).unwrap());
        timed("open table", || {
            snapshot.row_count::<EvidenceRow>().unwrap()
        });
        timed("read one tile", || {
            snapshot
                .read::<EvidenceRow>(TileFilter::Tiles(&tiles([4000])))
                .unwrap()
        });
        let mut tx = store.begin().unwrap();
        timed("replace 10 tiles", || {
            let fresh = rows(round * 7919, tile(4001), 100);
            tx.replace_tiles::<EvidenceRow>(&ten, fresh).unwrap();
            tx.replace_tiles::<LayerHeader>(&ten, rows(round, tile(4001), 1))
                .unwrap();
        });
        timed("commit evidence and layers", || {
            tx.commit("run", parameters()).unwrap()
        });
    }
    let snapshot = store.snapshot(None).unwrap();
    timed("digest evidence", || {
        snapshot.digest::<EvidenceRow>().unwrap()
    });
    timed("read evidence", || {
        snapshot.read::<EvidenceRow>(TileFilter::All).unwrap().len()
    });
}
