//! `cargo xtask test`: every test of the workspace, and every example in its documentation.
//!
//! Tests on real data look for it themselves and say so where they are skipped.

use std::path::Path;

use crate::command::{Failure, Step};

/// Runs the tests with cargo-nextest where it is installed, and else with `cargo test`.
pub(crate) fn run(root: &Path, arguments: &[String]) -> Result<(), Failure> {
    let fix = "The failing test is named above; run it alone with `cargo xtask test NAME`";
    if Step::cargo(root, "nextest --version").output().is_some() {
        Step::cargo(root, "nextest run --workspace")
            .args(arguments)
            .run(fix)?;
    } else {
        Step::cargo(root, "test --workspace --lib --bins --tests")
            .args(arguments)
            .run(fix)?;
    }
    Step::cargo(root, "test --workspace --doc")
        .args(arguments)
        .run("The failing example is named above")
}
