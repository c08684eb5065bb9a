//! `cargo xtask readers-test`: stores as Python's `deltalake`, DuckDB with its spatial extension and
//! GeoPandas read them.

use std::fs;
use std::path::{Path, PathBuf};

use crate::command::{Failure, Step};
use crate::python;
use crate::test;

/// What is installed, with versions and hashes.
const REQUIREMENTS: &str = "xtask/readers.txt";

const BY_HAND: &str = "Python 3.11 or later with pip and PyPI in reach are needed; nothing else of Tilefold's tests needs them";

/// Installs the readers and runs the tests that need them.
pub(crate) fn run(root: &Path) -> Result<(), Failure> {
    let readers = readers(root)?;
    let failing = "The failing test is named above";
    for words in [
        "--test cli -- --ignored readers::",
        "--lib -- --ignored other_readers",
    ] {
        Step::cargo(root, "test")
            .args(test::ALL)
            .args(words.split(' '))
            .env("PYTHONPATH", &readers)
            .run(failing)?;
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
