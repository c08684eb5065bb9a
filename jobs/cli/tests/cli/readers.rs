//! The tables with geometry as other programs open them: `tests/oracles/read_geometry.py`.
//!
//! `cargo xtask readers-test` installs these programs and runs this.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::golden::golden;
use crate::support::{Town, on};

/// A store's changes as one GeoParquet file.
fn export(store: &Path) -> PathBuf {
    let export = store.with_extension("geoparquet");
    let options = ["--all", "--format", "geoparquet", "--out"];
    let options = [&options[..], &[export.to_str().unwrap()]].concat();
    on("export", store, &options).with_code(0);
    export
}

/// What the readers say of a store and of exported changes.
fn ask(store: &Path, export: &Path) -> Output {
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/oracles/read_geometry.py"
    );
    let mut python = Command::new("python3");
    python.arg(script).arg(store).arg(export).output().unwrap()
}

#[track_caller]
fn is_read(store: &Path) {
    let said = ask(store, &export(store));
    assert!(said.status.success(), "{said:#?}");
}

#[test]
#[ignore = "needs Python's deltalake, DuckDB and GeoPandas: cargo xtask readers-test"]
fn other_programs_read_geometry_boxes_and_bounds() {
    let town = Town::new();
    is_read(&town.store("store", &town.city.logs));
    let (_folder, store) = golden(4);
    is_read(&store);
    // The canary: a store without boxes must be noticed.
    let (_older, without) = golden(2);
    let said = ask(&without, &export(&store));
    assert!(!said.status.success(), "{said:#?}");
    assert!(
        String::from_utf8_lossy(&said.stderr).contains("bbox"),
        "{said:#?}"
    );
}
