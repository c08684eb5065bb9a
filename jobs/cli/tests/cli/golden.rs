//! Golden stores: small stores as they were written when their format was new (`tests/golden`). What
//! is read here must stay readable; where that ends on purpose, the format's number goes up.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::{on, tilefold};

/// Digests of the layers of versions 1, 2 and 3, as they were when the store was made.
const DIGESTS_4: [&str; 3] = [
    "a58c3100e5d18b0ee6b7ad82190c74cedb4dda2a3f632164971e3886f57516d4",
    "097822762c0dc1fab5e4d32017ca7f1fd7e214fa68880ff9d63d603fe220c73f",
    "4108e3579d7bb7c642f33f26fe7a61a46231cb6e51867dd896943b99817f2869",
];

/// The store of a format, in a folder of its own: reading must not write beside the original.
pub(crate) fn golden(format: u32) -> (tempfile::TempDir, PathBuf) {
    let kept = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/golden")
        .join(format!("format-{format}"));
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("store");
    copy(&kept, &store);
    (folder, store)
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        match entry.file_type().unwrap().is_dir() {
            true => copy(&entry.path(), &target),
            false => drop(fs::copy(entry.path(), target).unwrap()),
        }
    }
}

fn json(command: &str, store: &Path, options: &[&str]) -> Value {
    let options = [options, &["--format", "json"]].concat();
    on(command, store, &options).with_code(0).json()
}

#[test]
fn a_store_of_format_4_is_read() {
    is_read(4, DIGESTS_4);
}

#[test]
fn a_store_from_before_the_first_release_is_refused_with_a_sentence() {
    let (_folder, store) = golden(2);
    for command in ["log", "show", "verify", "inspect"] {
        let said = on(command, &store, &[]).with_code(1);
        said.names(&["has the store format 2", "reads formats from 4"]);
    }
}

fn is_read(format: u32, digests: [&str; 3]) {
    let (_folder, store) = golden(format);
    let log = json("log", &store, &[]);
    let operations: Vec<&str> = log
        .as_array()
        .unwrap()
        .iter()
        .map(|line| line["operation"].as_str().unwrap())
        .collect();
    assert_eq!(operations, ["create", "init", "run", "run"]);
    for (version, digest) in ["1", "2", "3"].into_iter().zip(digests) {
        let verified = json("verify", &store, &["--version", version]);
        assert_eq!(verified["ok"], true, "{version}");
        assert_eq!(verified["digest"], digest, "{version}");
    }
    let content = json("inspect", &store, &[]);
    for table in [
        "elements",
        "evidence",
        "footprints",
        "chunks",
        "changes",
        "layers",
    ] {
        assert!(content["tables"][table].as_i64().unwrap() > 0, "{table}");
    }
    let changes = on("export", &store, &["--all"]).with_code(0).json();
    assert!(!changes["features"].as_array().unwrap().is_empty());
}

#[test]
fn a_store_of_a_format_to_come_is_refused_with_a_sentence() {
    let (_folder, store) = golden(4);
    let file = store.join("tilefold.json");
    let text = fs::read_to_string(&file).unwrap();
    let next = text.replace("\"format_version\": 4", "\"format_version\": 5");
    assert_ne!(next, text);
    fs::write(&file, next).unwrap();
    for command in ["log", "show", "verify", "inspect"] {
        let said = on(command, &store, &[]).with_code(1);
        said.names(&[
            "has the store format 5",
            "knows formats up to 4",
            "newer Tilefold",
        ]);
    }
    tilefold(["run".as_ref(), store.as_os_str(), "no.mcap".as_ref()])
        .with_code(1)
        .names(&["has the store format 5"]);
}
