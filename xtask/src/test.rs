//! `cargo xtask test`: every test of the workspace, and every example in its documentation; without
//! arguments also those that need an S3 server, a browser, or readers of stores that are not ours.
//! Those of the wheel and its clusters have a word of their own (`cluster-test`): they compile the
//! workspace once more.
//!
//! ONNX Runtime is set up first: its tests fail where it is not. Tests on real data look for it themselves and say so where they are skipped.

use std::path::Path;

use crate::command::{Failure, Step};
use crate::page_test;
use crate::readers;
use crate::s3;
use crate::setup;

/// What is tested: also what the default build leaves out. Who tests a part names the same, so that
/// nothing is compiled anew.
const ALL: [&str; 3] = ["--workspace", "--features", "tilefold-tests/h264"];

/// The program as the tests have it, so that nothing is built twice for those that run it.
pub(crate) fn build(root: &Path) -> Result<(), Failure> {
    Step::cargo(root, "build --tests")
        .args(ALL)
        .run("Mend what the compiler says")
}

/// Some of the tests, built as all of them are, by cargo's own words.
pub(crate) fn some(root: &Path, words: &str) -> Step {
    Step::cargo(root, "test").args(ALL).args(words.split(' '))
}

/// Runs the tests with cargo-nextest where it is installed, and else with `cargo test`.
pub(crate) fn run(root: &Path, arguments: &[String]) -> Result<(), Failure> {
    setup::run(root)?;
    let all = ALL.into_iter().filter(|_| !names_package(arguments));
    let test = |words| Step::cargo(root, words).args(all.clone()).args(arguments);
    let tests = match Step::cargo(root, "nextest --version").output() {
        Some(_) => test("nextest run"),
        None => test("test --lib --bins --tests"),
    };
    tests.run("The failing test is named above; run it alone with `cargo xtask test NAME`")?;
    test("test --doc").run("The failing example is named above")?;
    if arguments.is_empty() {
        s3::run(root)?;
        page_test::run(root, &[])?;
        readers::run(root)?;
    }
    Ok(())
}

/// `--workspace` would overrule a package that is asked for.
fn names_package(arguments: &[String]) -> bool {
    arguments
        .iter()
        .any(|argument| argument.starts_with("-p") || argument.starts_with("--package"))
}
