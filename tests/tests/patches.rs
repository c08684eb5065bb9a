//! The maps of a store of two, with its changes in them: each change in one map, no new thing's id in
//! both, and the same changes as an OsmChange.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use tilefold_engine::export::{Amended, Amendment, Choice, amend, chosen};
use tilefold_engine::{Criteria, InitOptions, init};
use tilefold_formats::map;
use tilefold_formats::map_compare::Comparable;
use tilefold_store::{Snapshot, Store};
use tilefold_tests::towns::Towns;
use tilefold_tests::trial::Trial;

const EVERY_CLAIM: Choice = Choice::Claims(Criteria {
    threshold: 0.5,
    min_vehicles: 1,
});

fn driven(towns: &Towns) -> (Trial, Snapshot) {
    let trial = towns.store();
    let (before, last) = towns.days();
    trial.run(&[before, last].concat());
    let store = Store::open(trial.store().to_path_buf()).unwrap();
    let snapshot = store.snapshot(None).unwrap();
    (trial, snapshot)
}

fn amended(snapshot: &Snapshot, maps: &[PathBuf], form: Amendment) -> Amended {
    let records = chosen(snapshot, EVERY_CLAIM).unwrap();
    amend(snapshot, records, maps, form).unwrap()
}

/// Ids of all nodes, ways and relations.
fn ids(text: &str) -> BTreeSet<&str> {
    let behind = text.split(" id=").skip(1);
    behind
        .map(|rest| rest[1..].split(['"', '\'']).next().unwrap())
        .collect()
}

#[test]
fn two_maps_of_one_store_are_patched_together() {
    let towns = Towns::new();
    let (_trial, snapshot) = driven(&towns);
    let claims = chosen(&snapshot, EVERY_CLAIM).unwrap().len();
    let both = amended(&snapshot, &towns.maps, Amendment::Lanelet2);
    assert_eq!(both.elsewhere, 0);
    assert_eq!(both.applied + both.set_aside.len(), claims);

    let folder = tempfile::tempdir().unwrap();
    let mut new_ids = Vec::new();
    let mut patched = Vec::new();
    for (before, after) in towns.maps.iter().zip(&both.maps) {
        let file = folder.path().join(&after.name);
        fs::write(&file, &after.bytes).unwrap();
        let [old, new] =
            [before, &file].map(|file| Comparable::elements(&map::read(file).unwrap()));
        let differences = old.differences(&new, 0.01);
        assert!(!differences.is_empty(), "{} has changes in it", after.name);
        let [old, new] = [before, &file].map(|file| fs::read_to_string(file).unwrap());
        let old = ids(&old);
        let new = ids(&new).into_iter().filter(|id| !old.contains(id));
        new_ids.push(new.map(str::to_owned).collect::<BTreeSet<String>>());
        patched.push(file);
    }
    assert!(
        new_ids.iter().all(|ids| !ids.is_empty()),
        "both maps have new things"
    );
    assert!(new_ids[0].is_disjoint(&new_ids[1]));
    let options = InitOptions {
        tile_level: 15,
        salt: None,
    };
    init(&folder.path().join("store"), &patched, &options).unwrap();
}

#[test]
fn each_map_by_itself_gets_its_own_changes() {
    let towns = Towns::new();
    let (_trial, snapshot) = driven(&towns);
    let both = amended(&snapshot, &towns.maps, Amendment::Osc);
    let [near, far] = [0, 1].map(|map| amended(&snapshot, &towns.maps[map..=map], Amendment::Osc));
    assert_eq!(near.applied + far.applied, both.applied);
    assert_eq!(near.elsewhere, far.applied + far.set_aside.len());
    assert!(near.applied > 0 && far.applied > 0);
    assert_eq!(
        near.maps[0], both.maps[0],
        "the first one's ids are as if it were alone"
    );
}

#[test]
fn what_two_maps_share_is_set_aside() {
    let towns = Towns::new();
    let (_trial, snapshot) = driven(&towns);
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("copy.osm");
    fs::copy(&towns.maps[0], &copy).unwrap();
    let maps = [towns.maps[0].clone(), copy];
    let shared = amended(&snapshot, &maps, Amendment::Lanelet2);
    assert!(
        shared
            .set_aside
            .iter()
            .any(|lost| lost.reason.contains("is also in"))
    );
    // What is new on the road is in one of them.
    let alone = amended(&snapshot, &maps[..1], Amendment::Lanelet2);
    assert!(shared.applied < alone.applied);
    assert!(shared.maps[1].bytes == fs::read(&maps[1]).unwrap());
}
