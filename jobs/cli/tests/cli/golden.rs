//! Golden stores: small stores as they were written when their format was new (`tests/golden`). What
//! is read here must stay readable; where that ends on purpose, the format's number goes up.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::{on, tilefold};

/// Digests of the layers of versions 1, 2 and 3, as they were when the store of format 2 was made.
const DIGESTS_2: [&str; 3] = [
    "09f09b095e685e376ef03aa1a9f8762228642fe4858e1389a89cffd3cb7d088d",
    "1fb648221aa1d661e9884075b33e2b20acae509b0ffbda515649f3c122516531",
    "8a935fda7de670605e7a820ea7113c4ec28ea9dba2191e0fdd850fce22208803",
];
/// The same of format 3; its evidence is of a later method.
const DIGESTS_3: [&str; 3] = [
    "09f09b095e685e376ef03aa1a9f8762228642fe4858e1389a89cffd3cb7d088d",
    "0e4af3cfd05b4a2c79b9fcb740c91c1436f357be5f15db4a343f07401c4d0c37",
    "5dba66985dfdcec520415da2948b7147a1518289a47be53a455617ddf5e2843a",
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
fn a_store_of_format_2_is_read() {
    is_read(2, DIGESTS_2);
}

#[test]
fn a_store_of_format_3_is_read() {
    is_read(3, DIGESTS_3);
}

#[test]
fn a_store_of_format_2_is_only_read() {
    let (_folder, store) = golden(2);
    on("retract", &store, &["--log", "drive_00000.mcap"])
        .with_code(1)
        .names(&["format 2"]);
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
    let (_folder, store) = golden(3);
    let file = store.join("tilefold.json");
    let text = fs::read_to_string(&file).unwrap();
    let next = text.replace("\"format_version\": 3", "\"format_version\": 4");
    assert_ne!(next, text);
    fs::write(&file, next).unwrap();
    for command in ["log", "show", "verify", "inspect"] {
        let said = on(command, &store, &[]).with_code(1);
        said.names(&[
            "has the store format 4",
            "knows formats up to 3",
            "newer Tilefold",
        ]);
    }
    tilefold(["run".as_ref(), store.as_os_str(), "no.mcap".as_ref()])
        .with_code(1)
        .names(&["has the store format 4"]);
}
