//! Every form of `export`, `compare`, and what other programs read in the exports.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::support::{Said, Town, on, tilefold};

fn export(store: &Path, form: &str, options: &[&str]) -> Said {
    on("export", store, &[&["--format", form], options].concat())
}

fn exported(town: &Town, store: &Path, form: &str, options: &[&str]) -> Vec<u8> {
    let file = town.path(&format!("export.{form}"));
    let out = ["--out", file.to_str().unwrap()];
    export(store, form, &[options, &out].concat()).with_code(0);
    fs::read(file).unwrap()
}

#[test]
fn every_form_is_what_it_says_and_the_same_again() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs);
    for (form, begins) in [
        ("geojson", &b"{\"type\":\"FeatureCollection\""[..]),
        ("geoparquet", b"PAR1"),
        ("flatgeobuf", b"fgb\x03fgb"),
        ("pmtiles", b"PMTiles\x03"),
        ("mcap", b"\x89MCAP0\r\n"),
    ] {
        let bytes = exported(&town, &store, form, &["--all"]);
        assert!(bytes.starts_with(begins), "{form}");
        assert!(bytes == exported(&town, &store, form, &["--all"]), "{form}");
        // Nothing has changed yet: that is an export too.
        exported(&town, &store, form, &["--version", "1"]);
    }
}

#[test]
fn maps_come_out_as_they_went_in_or_with_the_changes() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs);
    let map = town.city.before_map.to_str().unwrap();
    let before = fs::read(map).unwrap();
    let none = exported(&town, &store, "lanelet2", &["--map", map, "--version", "1"]);
    assert!(none == before);
    let claims = ["--map", map, "--threshold", "0.5", "--min-vehicles", "1"];
    let patched = exported(&town, &store, "lanelet2", &claims);
    assert!(patched != before);
    let file = town.path("export.lanelet2");
    let osc = exported(&town, &store, "osc", &claims);
    assert!(String::from_utf8(osc).unwrap().contains("<osmChange"));

    // The patched map differs from the map by what was claimed, and from itself by nothing.
    let compare = |b: &Path| tilefold(["compare", map, b.to_str().unwrap(), "--format", "json"]);
    let differences = compare(&file).with_code(4).json();
    assert!(!differences["differences"].as_array().unwrap().is_empty());
    let same = compare(Path::new(map)).with_code(0).json();
    assert_eq!(same["differences"], Value::Array(Vec::new()));

    let after = town.city.after_map.to_str().unwrap();
    export(&store, "lanelet2", &["--map", after])
        .with_code(1)
        .names(&["is not the map of version 2", "tilefold init --map"]);
}

#[test]
fn options_that_do_not_go_together_are_usage_errors() {
    let town = Town::new();
    let store = town.init("store");
    let map = town.city.before_map.to_str().unwrap();
    export(&store, "osc", &[])
        .with_code(2)
        .names(&["--map FILE"]);
    export(&store, "osc", &["--map", map, "--all"])
        .with_code(2)
        .names(&["--all"]);
    export(&store, "geojson", &["--map", map])
        .with_code(2)
        .names(&["--map"]);
    on("show", &store, &["--format", "pmtiles"])
        .with_code(2)
        .names(&["pmtiles", "export"]);
}

#[test]
fn versions_are_compared_by_what_they_say() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs);
    let words = on("compare", &store, &["--from", "1", "--to", "2"])
        .with_code(4)
        .out;
    assert!(words.contains("version 1 to version 2"), "{words}");
    let json = on("compare", &store, &["--format", "json"])
        .with_code(4)
        .json();
    let tile = &json["tiles"][0];
    assert_ne!(tile["from_digest"], tile["to_digest"]);
    assert_eq!(json["from"], 1);
    let same = on("compare", &store, &["--from", "2", "--to", "2"]).with_code(0);
    assert!(same.out.contains("0 tiles differ"));
}

#[test]
#[ignore = "needs the readers that tests/oracles/read_exports.py names: cargo xtask readers-test"]
fn other_programs_find_in_every_form_what_is_in_it() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs);
    let folder = town.path("exports");
    fs::create_dir(&folder).unwrap();
    for form in ["geojson", "geoparquet", "flatgeobuf", "pmtiles", "mcap"] {
        let bytes = exported(&town, &store, form, &["--all"]);
        fs::write(folder.join(format!("changes.{form}")), bytes).unwrap();
    }
    let map = town.city.before_map.to_str().unwrap();
    fs::copy(map, folder.join("before.osm")).unwrap();
    let claims = ["--map", map, "--threshold", "0.5", "--min-vehicles", "1"];
    for (form, name) in [("lanelet2", "patched.osm"), ("osc", "change.osc")] {
        fs::write(folder.join(name), exported(&town, &store, form, &claims)).unwrap();
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/oracles/read_exports.py");
    let said = Command::new("python3")
        .arg(script)
        .arg(&folder)
        .output()
        .unwrap();
    println!("{}", String::from_utf8_lossy(&said.stdout));
    assert!(
        said.status.success(),
        "{}",
        String::from_utf8_lossy(&said.stderr)
    );
}
