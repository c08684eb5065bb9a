//! What is refused: each message says what, where, why and how to mend it.

use std::fs;

use crate::support::{Said, Town, on, run, tilefold};

#[test]
fn usage_is_exit_code_two() {
    let town = Town::new();
    let map = town.city.before_map.to_str().unwrap();
    let store = town.path("store");
    let store = store.to_str().unwrap();
    let refused = |arguments: &[&str]| tilefold(arguments).with_code(2);
    refused(&[]).names(&["Usage"]);
    refused(&["frobnicate"]).names(&["frobnicate"]);
    refused(&["init", store]).names(&["--map"]);
    refused(&["run", store]).names(&["LOGS"]);
    refused(&["show", store, "--format", "xml"]).names(&["xml", "text, json, geojson"]);
    refused(&["show", store, "--format", "geojson"]).names(&["geojson", "export", "json"]);
    refused(&["run", store, "x.mcap", "--model", "best"]).names(&["best", "paper, calibrated"]);
    refused(&["init", store, "--map", map, "--tile-level", "16"]).names(&["16", "0..=15"]);
    assert!(!town.path("store").exists());
}

#[test]
fn a_salt_is_64_hexadecimal_digits() {
    let town = Town::new();
    let map = town.city.before_map.to_str().unwrap();
    let store = town.path("store");
    let init = |salt: &str| {
        let store = store.to_str().unwrap();
        tilefold(["init", store, "--map", map, "--vehicle-salt", salt])
    };
    for (salt, count) in [
        ("abc", "3 of its 3"),
        (&"g".repeat(64), "0 of its 64"),
        (&"ä".repeat(32), "0 of its 32"),
        (&"0".repeat(65), "65 of its 65"),
    ] {
        init(salt).with_code(2).names(&[
            "--vehicle-salt",
            count,
            "64 of them",
            "openssl rand -hex 32",
        ]);
        assert!(!store.exists());
    }
    init(&"0f".repeat(32)).with_code(0);
}

#[test]
fn where_no_store_is() {
    let town = Town::new();
    let store = town.path("nowhere");
    let logs = &town.city.logs;
    let name = store.display().to_string();
    let said: Vec<Said> = vec![
        run(&store, logs, &[]),
        run(&store, logs, &["--plan"]),
        on("log", &store, &[]),
        on("show", &store, &[]),
        on("verify", &store, &[]),
        on("export", &store, &[]),
        on("evaluate", &store, &[]),
    ];
    for said in said {
        let said = said.with_code(1);
        said.names(&["error: ", &name, "is not a Tilefold store", "tilefold init"]);
        assert_eq!(said.out, "");
    }
    assert!(!store.exists());
    let json = on("show", &store, &["--format", "json"])
        .with_code(1)
        .json();
    assert!(json["error"].as_str().unwrap().contains(&name));
}

#[test]
fn where_a_store_is_already() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs);
    let before = on("verify", &store, &["--format", "json"]).json();
    let map = town.city.after_map.to_str().unwrap();
    on("init", &store, &["--map", map]).with_code(1).names(&[
        "error: ",
        &store.display().to_string(),
        "already",
        "choose another folder",
    ]);
    assert_eq!(on("verify", &store, &["--format", "json"]).json(), before);
}

#[test]
fn a_version_that_is_not_there() {
    let town = Town::new();
    let store = town.init("store");
    for command in ["show", "verify", "export", "evaluate"] {
        on(command, &store, &["--version", "7"])
            .with_code(1)
            .names(&["no version 7", "0 to 1"]);
    }
}

#[test]
fn maps_that_are_none() {
    let town = Town::new();
    let refused = |name: &str, content: &str, said: &[&str]| {
        let map = town.path(name);
        fs::write(&map, content).unwrap();
        let store = town.path("store");
        let answer = on("init", &store, &["--map", map.to_str().unwrap()]).with_code(1);
        answer.names(&["error: ", name]);
        answer.names(said);
        assert!(!store.exists());
    };
    let bare = r#"<osm version="0.6"><node id="1" lat="50" lon="10"/><node id="2" lat="50.001" lon="10"/>
        <way id="3"><nd ref="1"/><nd ref="2"/><tag k="type" v="fence"/></way></osm>"#;
    refused(
        "bare.osm",
        bare,
        &["paint", "line_thin", "give a map with markings"],
    );
    refused("words.osm", "a map of the town", &["not a map", "Lanelet2"]);
    refused(
        "cut.osm",
        &bare[..100],
        &["damaged at line 2", "mend or re-export"],
    );
    let gone = town.path("gone.osm");
    on(
        "init",
        &town.path("store"),
        &["--map", gone.to_str().unwrap()],
    )
    .with_code(1)
    .names(&["gone.osm", "check the path"]);
}

#[test]
fn truth_that_is_none() {
    let town = Town::new();
    let store = town.init("store");
    let truth = town.path("truth.geojson");
    fs::write(
        &truth,
        "{\"type\": \"FeatureCollection\", \"features\": [{}]}",
    )
    .unwrap();
    let said = on("evaluate", &store, &["--truth", truth.to_str().unwrap()]).with_code(1);
    said.names(&["error: ", "truth.geojson"]);
    let refused = ["--place-m", "0"];
    on("evaluate", &store, &refused)
        .with_code(2)
        .names(&["--place-m", "1 to 1000000 metres"]);
}
