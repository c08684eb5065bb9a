//! The storage fails, tears or stops at every operation of a small job: readers see the old version
//! or the new one, and the same command, given again, ends in the same bytes.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use tilefold_city::CityFiles;
use tilefold_engine::{
    EngineError, Forget, FusionModel, InitOptions, Silent, init, rebase, retract, run,
};
use tilefold_store::StoreError;
use tilefold_tests::faulty::{Fault, arm, through_fuse};
use tilefold_tests::trial::{Trial, tiny_city};

static CITY: LazyLock<CityFiles> = LazyLock::new(|| {
    let folder = format!("kills-{}", std::process::id());
    tiny_city(&Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder))
});

/// A job on the store at a place.
type Job<'a> = &'a dyn Fn(&Path) -> Result<(), EngineError>;

/// Lets these faults happen at every operation of `job` on copies of `old`.
fn kill_everywhere(old: &Trial, faults: &[Fault], job: Job<'_>) {
    let before = old.content();
    let whole = Trial::copy_of(old);
    let counting = arm(whole.store(), Fault::Fail, usize::MAX);
    job(&through_fuse(whole.store())).unwrap();
    let (after, operations) = (whole.content(), counting.operations());
    assert_ne!(before, after);
    assert!(operations > 40, "the job took {operations} operations only");
    let (mut failed, mut survived) = (0, 0);
    for &fault in faults {
        for at in 0..operations {
            let trial = Trial::copy_of(old);
            let fuse = arm(trial.store(), fault, at);
            let done = job(&through_fuse(trial.store()));
            let what = format!("{fault:?} at operation {at} of {operations}");
            // Operations of several threads come in any order, and a few more or less of them.
            assert!(done.is_ok() || fuse.has_fired(), "{what}: {done:?}");
            let found = trial.content();
            assert!(
                found == before || found == after,
                "{what}: neither old nor new"
            );
            match done {
                Ok(()) => survived += 1,
                Err(_) => failed += 1,
            }
            assert!(
                done.is_err() || found == after,
                "{what}: done, but not there"
            );
            if found == before {
                job(trial.store()).unwrap();
            }
            assert_eq!(trial.content(), after, "{what}: again");
        }
    }
    println!("{operations} operations: {failed} jobs failed, {survived} survived");
    assert!(failed > survived);
}

#[test]
fn a_run() {
    let old = Trial::new(&CITY.before_map);
    old.run(&CITY.logs[..1]);
    let logs: Vec<PathBuf> = CITY.logs[1..2].to_vec();
    kill_everywhere(&old, &Fault::ALL, &|store| {
        run(store, &logs, FusionModel::default(), &Silent).map(drop)
    });
}

#[test]
fn a_retraction() {
    let old = Trial::new(&CITY.before_map);
    old.run(&CITY.logs[..2]);
    let log = Forget::Log(CITY.logs[0].display().to_string());
    kill_everywhere(&old, &[Fault::Stop], &|store| {
        retract(store, &log, &Silent).map(drop)
    });
}

#[test]
fn a_new_map() {
    let old = Trial::new(&CITY.before_map);
    old.run(&CITY.logs[..2]);
    let map = [CITY.after_map.clone()];
    kill_everywhere(&old, &[Fault::Stop], &|store| {
        rebase(store, &map, &Silent).map(drop)
    });
}

#[test]
fn a_creation() {
    let map = [CITY.before_map.clone()];
    let options = InitOptions {
        tile_level: 15,
        salt: None,
    };
    let expected = Trial::new(&CITY.before_map).content();
    for fault in Fault::ALL {
        for at in 0.. {
            let folder = tempfile::tempdir().unwrap();
            let store = folder.path().join("store");
            std::fs::create_dir(&store).unwrap();
            let fuse = arm(&store, fault, at);
            let done = init(&through_fuse(&store), &map, &options);
            if done.is_err() {
                assert!(fuse.has_fired());
                // Only the reply was lost where there is a store already.
                let again = init(&store, &map, &options);
                let is_there = |error: &EngineError| {
                    matches!(error, EngineError::Store(StoreError::Exists { .. }))
                };
                assert!(again.as_ref().err().is_none_or(is_there), "{again:?}");
            }
            let trial = Trial::of(folder, store);
            assert_eq!(trial.content(), expected, "{fault:?} at operation {at}");
            if !fuse.has_fired() {
                break;
            }
        }
    }
}
