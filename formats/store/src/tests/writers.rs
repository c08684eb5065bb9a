//! Several writers, and writers that were killed between two tables.

use tilefold_schemas::{EvidenceRow, LayerHeader, Sighting};

use super::rows::{parameters, properties, rows, store, tile, tiles};
use crate::{Parameters, Store, StoreError, TileFilter, Transaction};

fn staged(store: &Store, number: i32) -> Transaction {
    let mut tx = store.begin().unwrap();
    let seed = number as u64;
    tx.append::<EvidenceRow>(rows(seed, tile(number), 5))
        .unwrap();
    tx.append::<Sighting>(rows(seed, tile(number), 2)).unwrap();
    tx.replace_tiles::<LayerHeader>(&tiles([number]), rows(seed, tile(number), 1))
        .unwrap();
    tx
}

fn digests(store: &Store) -> [String; 3] {
    let snapshot = store.snapshot(None).unwrap();
    [
        snapshot.digest::<EvidenceRow>().unwrap(),
        snapshot.digest::<Sighting>().unwrap(),
        snapshot.digest::<LayerHeader>().unwrap(),
    ]
}

#[test]
fn what_was_committed_before_a_kill_is_not_seen_and_not_kept() {
    let (_a, clean) = store();
    staged(&clean, 1).commit("run", parameters()).unwrap();
    staged(&clean, 2).commit("run", parameters()).unwrap();

    let (_b, torn) = store();
    staged(&torn, 1).commit("run", parameters()).unwrap();
    let before = digests(&torn);
    staged(&torn, 800).commit_tables().unwrap(); // killed before `layers`
    assert_eq!(digests(&torn), before);
    assert_eq!(torn.latest_version().unwrap(), 1);
    let seen = torn.snapshot(None).unwrap();
    assert_eq!(seen.read::<EvidenceRow>(TileFilter::All).unwrap().len(), 5);

    assert_eq!(staged(&torn, 2).commit("run", parameters()).unwrap(), 2);
    assert_eq!(digests(&torn), digests(&clean));
}

#[test]
fn the_same_job_after_a_kill_adopts_what_is_there() {
    let (_folder, store) = store();
    staged(&store, 1).commit_tables().unwrap();
    staged(&store, 1).commit("run", parameters()).unwrap();
    let info = store.snapshot(None).unwrap().info().clone();
    assert_eq!(
        info.pins["evidence"].version, 1,
        "no second commit was needed"
    );
}

#[test]
fn of_two_writers_one_is_told() {
    let (_folder, store) = store();
    let first = staged(&store, 1);
    let second = staged(&store, 2);
    assert_eq!(first.commit("run", parameters()).unwrap(), 1);
    let refused = second.commit("run", parameters());
    let Err(
        error @ StoreError::Conflict {
            base: 0, latest: 1, ..
        },
    ) = refused
    else {
        panic!("expected a conflict");
    };
    assert!(error.to_string().contains("run the same command again"));
    assert_eq!(staged(&store, 2).commit("run", parameters()).unwrap(), 2);
}

#[test]
fn writers_that_interleave_by_table_do_not_mix() {
    let (_folder, store) = store();
    let first = staged(&store, 1);
    let second = staged(&store, 2);
    let pins = first.commit_tables().unwrap();
    let other_pins = second.commit_tables().unwrap();
    assert_eq!(
        first.commit_layers(pins, "run", Parameters::new()).unwrap(),
        1
    );
    let late = second.commit_layers(other_pins, "run", Parameters::new());
    assert!(matches!(
        late,
        Err(StoreError::Conflict {
            base: 0,
            latest: 1,
            ..
        })
    ));

    let (_other, alone) = super::rows::store();
    staged(&alone, 1).commit("run", parameters()).unwrap();
    assert_eq!(digests(&store), digests(&alone));
}

#[test]
fn eight_writers_make_one_linear_history_and_none_is_lost() {
    let (_folder, store) = store();
    let conflicts: usize = std::thread::scope(|scope| {
        let writers: Vec<_> = (0..8)
            .map(|writer| {
                scope.spawn({
                    let store = Store::open(store.location()).unwrap();
                    move || {
                        let mut conflicts = 0;
                        loop {
                            match staged(&store, writer * 400).commit("run", parameters()) {
                                Ok(_) => return conflicts,
                                Err(StoreError::Conflict { .. } | StoreError::Busy { .. }) => {
                                    conflicts += 1
                                }
                                Err(error) => panic!("{error}"),
                            }
                        }
                    }
                })
            })
            .collect();
        writers
            .into_iter()
            .map(|writer| writer.join().unwrap())
            .sum()
    });
    assert!(conflicts > 0, "the writers never met");
    assert_eq!(store.latest_version().unwrap(), 8);
    let snapshot = store.snapshot(None).unwrap();
    assert_eq!(snapshot.row_count::<EvidenceRow>().unwrap(), 40);
    assert_eq!(snapshot.row_count::<LayerHeader>().unwrap(), 8);
}

#[test]
fn of_many_creators_one_makes_the_store() {
    let folder = tempfile::TempDir::new().unwrap();
    let made: Vec<_> = std::thread::scope(|scope| {
        let creators: Vec<_> = (0..6)
            .map(|_| scope.spawn(|| Store::create(folder.path(), properties()).map(|_| ())))
            .collect();
        creators
            .into_iter()
            .map(|creator| creator.join().unwrap())
            .collect()
    });
    assert_eq!(
        made.iter().filter(|made| made.is_ok()).count(),
        1,
        "{made:?}"
    );
    let exists = |made: &&Result<(), _>| matches!(made, Err(StoreError::Exists { .. }));
    assert_eq!(made.iter().filter(exists).count(), 5, "{made:?}");
    let store = Store::open(folder.path()).unwrap();
    assert_eq!(staged(&store, 1).commit("run", parameters()).unwrap(), 1);
    assert_eq!(store.versions().unwrap().len(), 2);
}
