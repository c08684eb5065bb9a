//! `explain`: the passes of every verdict add up to what the layer holds.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::support::{Town, on};

#[test]
fn every_verdict_is_the_sum_of_its_passes() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs);
    let exported = on("export", &store, &["--all", "--format", "geojson"]).with_code(0);
    let mut verdicts = BTreeSet::new();
    for feature in exported.json()["features"].as_array().unwrap() {
        let change = feature["properties"]["change"].as_str().unwrap();
        let told = on("explain", &store, &[change, "--format", "json"]).with_code(0);
        let told = &told.json()[0];
        let passes = told["passes"].as_array().unwrap();
        let of = |pass: &Value| pass["for_change_fx"].as_i64().unwrap();
        let sum: i64 = passes.iter().map(of).sum();
        assert_eq!(sum, told["evidence_fx"].as_i64().unwrap(), "{told:#}");
        assert_eq!(told["agrees"], true, "{told:#}");
        for frame in told["frames"].as_array().unwrap() {
            assert!(frame["log"].as_str().unwrap().ends_with(".mcap"), "{frame}");
        }
        verdicts.insert(told["verdict"].as_str().unwrap().to_owned());
    }
    assert!(verdicts.len() > 1, "{verdicts:?}");
}

#[test]
fn who_asks_for_what_is_not_there_is_told_what_is() {
    let town = Town::new();
    let store = town.init("store");
    let exported = on("export", &store, &["--all", "--format", "geojson"]).json();
    let known = exported["features"][0]["properties"]["element_id"].to_string();
    let asked = format!("{known}x");
    on("explain", &store, &[&asked])
        .with_code(1)
        .names(&[&asked, &known, "export STORE --all"]);
    // Before any drive, all that can be said is that nobody looked.
    let said = on("explain", &store, &[&known]).with_code(0);
    assert!(said.out.contains("unknown"), "{said:#?}");
}
