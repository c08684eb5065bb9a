//! Eight jobs at once on one store: one history, nothing lost, and the bytes of one job over all.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use tilefold_engine::{FusionModel, Silent, run};
use tilefold_store::Store;
use tilefold_tests::trial::{Trial, content_of, small_city};

#[test]
fn eight_runs_at_once_end_in_the_bytes_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let city = small_city(folder.path());
    let trial = Trial::new(&city.before_map);
    // Seven drives and eight writers: two bring the same one.
    let portions = (0..8).map(|writer| vec![city.logs[writer % city.logs.len()].clone()]);
    let store = trial.store();
    let new: usize = std::thread::scope(|scope| {
        let writers: Vec<_> = portions
            .map(|logs| scope.spawn(move || run(store, &logs, FusionModel::default(), &Silent)))
            .collect();
        let reports = writers
            .into_iter()
            .map(|writer| writer.join().unwrap().unwrap());
        reports.filter(|report| report.is_new_version).count()
    });
    assert_eq!(
        new,
        city.logs.len(),
        "the drive that came twice counts once"
    );
    let versions = Store::open(store.to_path_buf())
        .unwrap()
        .versions()
        .unwrap();
    let runs = versions.iter().filter(|version| version.operation == "run");
    assert_eq!(runs.count(), city.logs.len());
    assert_eq!(trial.content(), content_of(&city.before_map, &city.logs));
}
