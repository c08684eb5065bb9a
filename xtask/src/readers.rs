//! `cargo xtask readers-test`: stores as Python's `deltalake`, DuckDB with its spatial extension and
//! GeoPandas read them, and exports as GDAL, libosmium and the libraries of PMTiles and MCAP do.

use std::fs;
use std::path::{Path, PathBuf};

use crate::command::Failure;
use crate::python;
use crate::test;

/// What is installed, with versions and hashes.
const REQUIREMENTS: &str = "xtask/readers.txt";

const BY_HAND: &str = "Python 3.11 or later with pip and PyPI in reach are needed; nothing else of Tilefold's tests needs them";

/// Installs the readers and runs the tests that need them.
pub(crate) fn run(root: &Path) -> Result<(), Failure> {
    let readers = readers(root)?;
    for words in [
        "--test cli -- --ignored readers:: exports::",
        "--lib -- --ignored other_readers",
    ] {
        test::some(root, words)
            .env("PYTHONPATH", &readers)
            .run("The failing test is named above")?;
    }
    Ok(())
}

/// The folder that the readers are in, installed if other ones are wanted now.
fn readers(root: &Path) -> Result<PathBuf, Failure> {
    let folder = python::tool_folder(root, "readers");
    let installed = folder.join("installed.txt");
    let unread = |error: std::io::Error| Failure::new(format!("{REQUIREMENTS}: {error}"));
    let wanted = fs::read(root.join(REQUIREMENTS)).map_err(unread)?;
    if fs::read(&installed).ok().as_ref() != Some(&wanted) {
        python::install(root, REQUIREMENTS, &folder, BY_HAND)?;
        fs::write(&installed, &wanted).map_err(unread)?;
    }
    Ok(folder)
}
