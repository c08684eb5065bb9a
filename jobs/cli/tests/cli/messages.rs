//! What people read after common mistakes: each message as it stands in `messages.txt`, so that a
//! change of one is looked at. `TILEFOLD_WRITE_MESSAGES=1` writes the file anew.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::support::Town;

/// A mistake, and the words that make it; paths are relative to the town.
const MISTAKES: &[(&str, &str)] = &[
    ("a slip of the finger", "rnu store logs"),
    ("an option of another command", "show store --out x.json"),
    ("logs forgotten", "run store"),
    ("the map forgotten", "init new"),
    ("a version that is no number", "show store --version latest"),
    ("a time that is none", "run store logs --as-of yesterday"),
    ("a form that is for export", "show store --format geojson"),
    (
        "a patched map without the map",
        "export store --format lanelet2",
    ),
    ("a page without a folder", "export store --format html"),
    (
        "a short secret",
        "init new --map before.osm --vehicle-salt abc",
    ),
    ("nothing to take out", "retract store"),
    ("a decision without a change", "decide store"),
    ("an address that is none", "serve store --bind 300.1.1.1"),
    ("no store there", "show nowhere"),
    ("a folder that is no store", "run logs logs"),
    ("a map where a store is asked for", "show before.osm"),
    (
        "a store where one is already",
        "init store --map before.osm",
    ),
    ("a version that never was", "show store --version 7"),
    (
        "a time before the store",
        "show store --as-of 1999-01-01T00:00:00Z",
    ),
    ("a change that never was", "explain store 0123456789abcdef"),
    (
        "a decision on a change that never was",
        "decide store 0123456789abcdef accept",
    ),
    (
        "a log that never came in",
        "retract store --log drive_99.mcap",
    ),
    (
        "a vehicle that never came",
        "retract store --vehicle nobody",
    ),
    ("a map that is not there", "init new --map gone.osm"),
    ("a text that is no map", "init new --map words.osm"),
    ("half a map", "init new --map cut.osm"),
    ("a log as a map", "init new --map logs/drive_00000.mcap"),
    ("a map without paint", "init new --map bare.osm"),
    ("logs that are not there", "run store gone.mcap"),
    ("a folder without logs", "run store empty"),
    ("a map as a log", "run store before.osm"),
    ("half a log", "run store cut.mcap"),
    (
        "evidence of two methods",
        "run store logs --registration off",
    ),
    (
        "a card that is not there",
        "run store logs --detector gone.toml",
    ),
    (
        "a card with a key of no card",
        "run store logs --detector odd.toml",
    ),
    (
        "metrics into no folder",
        "run store logs --metrics nowhere/tilefold.prom",
    ),
    (
        "another map than the store's",
        "export store --format osc --map after.osm",
    ),
    (
        "a truth that is not there",
        "evaluate store --truth gone.geojson",
    ),
    (
        "a truth that is no GeoJSON",
        "evaluate store --truth words.osm",
    ),
    ("one map to compare", "compare before.osm"),
    ("nothing to look into", "inspect gone"),
    ("a text to look into", "inspect words.osm"),
];

#[test]
fn messages_are_as_they_were_looked_at() {
    let town = Town::new();
    prepare(&town);
    let mut page = String::new();
    for (mistake, words) in MISTAKES {
        let (code, said) = made(town.folder.path(), words);
        assert!(matches!(code, 1..=3), "{words}: {code} {said}");
        write!(page, "{mistake}\n$ tilefold {words}\n{said}[{code}]\n\n").unwrap();
    }
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/messages.txt");
    if std::env::var_os("TILEFOLD_WRITE_MESSAGES").is_some() {
        fs::write(&kept, &page).unwrap();
    }
    let kept = fs::read_to_string(&kept).unwrap();
    for (now, then) in page.split("\n\n").zip(kept.split("\n\n")) {
        assert_eq!(now, then);
    }
    assert_eq!(page, kept);
}

fn prepare(town: &Town) {
    let bare = r#"<osm version="0.6"><node id="1" lat="50" lon="10"/><node id="2" lat="50.001" lon="10"/>
        <way id="3"><nd ref="1"/><nd ref="2"/><tag k="type" v="fence"/></way></osm>"#;
    town.store("store", &town.city.logs);
    fs::write(town.path("bare.osm"), bare).unwrap();
    fs::write(town.path("cut.osm"), &bare[..100]).unwrap();
    fs::write(town.path("words.osm"), "a map of the town").unwrap();
    fs::write(town.path("odd.toml"), "nmae = \"a network\"\n").unwrap();
    fs::create_dir(town.path("empty")).unwrap();
    let log = fs::read(&town.city.logs[0]).unwrap();
    fs::write(town.path("cut.mcap"), &log[..log.len() / 2]).unwrap();
}

/// The exit code, and standard error with what differs between machines taken out.
fn made(folder: &Path, words: &str) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tilefold"))
        .args(words.split(' '))
        .current_dir(folder)
        .env_remove("TILEFOLD_THREADS")
        .env_remove("TILEFOLD_VEHICLE_SALT")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    let said = said.replace(&folder.display().to_string(), "TOWN");
    let said = without_numbers(&without_now(&said));
    (output.status.code().unwrap(), said)
}

/// A store says when it was written: now.
fn without_now(text: &str) -> String {
    const WHEN: &str = "was written at ";
    match text.split_once(WHEN) {
        Some((before, after)) => {
            let end = after.find(';').unwrap_or(after.len());
            format!("{before}{WHEN}NOW{}", &after[end..])
        }
        None => text.to_owned(),
    }
}

/// Long numbers are those of this city: offsets, ids, times in nanoseconds.
fn without_numbers(text: &str) -> String {
    let mut plain = String::new();
    let mut digits = String::new();
    for c in text.chars().chain(['\n']) {
        if c.is_ascii_digit() {
            digits.push(c);
            continue;
        }
        match digits.len() {
            0..=4 => plain.push_str(&digits),
            _ => plain.push('#'),
        }
        digits.clear();
        plain.push(c);
    }
    plain.pop();
    plain
}
