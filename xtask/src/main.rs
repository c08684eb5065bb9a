//! The front desk of the repository: `cargo xtask WORD` does what the README and CI name.
//!
//! No dependency and no shell: it compiles in a second, so that whatever is missing is said before
//! anything long begins. Each word is a file of its own; this one only chooses.

mod book;
mod cluster;
mod command;
mod demo;
mod histories;
mod lints;
mod map_library;
mod page_test;
mod python;
mod readers;
mod s3;
mod setup;
mod test;

use std::env;
use std::process::ExitCode;

use command::{Failure, workspace_root};

const HELP: &str = "\
cargo xtask WORD [ARGUMENT...]

  setup           fetches ONNX Runtime into .ort/, and MapLibre GL JS for the review page into
                  .maplibre/ (`demo` and `test` do so themselves)
  demo [ARG...]   builds `tilefold` for release and runs `tilefold demo ARG...`
  test [ARG...]   runs every test of the workspace, then the examples in its documentation;
                  ARG... goes to the test runner (a name to filter by, for instance)
  histories [N]   N random histories of small stores (5,000 if not given) against one plain job each
  s3-test         stores in buckets, against moto's S3 server (from PyPI); `test` runs it too
  cluster-test [ARG...]
                  the wheel and its runners: Ray on three nodes of which some die, Spark (from PyPI);
                  ARG... goes to pytest
  page-test       the review page in headless Chromium (Playwright from PyPI); `test` runs it too
  readers-test    stores and exports as DuckDB, GeoPandas, GDAL, libosmium and others (from PyPI) read
                  them; `test` runs it too
  ci-lints        format, clippy, documentation and the book, with every warning an error
  docs            builds the book (docs/book) and the API documentation (target/doc)
";

fn main() -> ExitCode {
    let mut words = env::args().skip(1);
    let word = words.next().unwrap_or_default();
    let arguments: Vec<String> = words.collect();
    match dispatch(&word, &arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("xtask: {failure}");
            ExitCode::from(failure.exit_code())
        }
    }
}

fn dispatch(word: &str, arguments: &[String]) -> Result<(), Failure> {
    if matches!(word, "" | "help" | "-h" | "--help") {
        print!("{HELP}");
        return Ok(());
    }
    let root = workspace_root()?;
    match word {
        "setup" => without_arguments(word, arguments).and_then(|()| setup::run(&root)),
        "demo" => demo::run(&root, arguments),
        "test" => test::run(&root, arguments),
        "histories" => histories::run(&root, arguments),
        "s3-test" => without_arguments(word, arguments).and_then(|()| s3::run(&root)),
        "cluster-test" => cluster::run(&root, arguments),
        "page-test" => page_test::run(&root, arguments),
        "readers-test" => without_arguments(word, arguments).and_then(|()| readers::run(&root)),
        "ci-lints" => without_arguments(word, arguments).and_then(|()| lints::run(&root)),
        "docs" => without_arguments(word, arguments).and_then(|()| book::run(&root)),
        _ => Err(Failure::usage(format!(
            "there is no word {word:?}; `cargo xtask help` lists them"
        ))),
    }
}

fn without_arguments(word: &str, arguments: &[String]) -> Result<(), Failure> {
    match arguments.first() {
        None => Ok(()),
        Some(first) => Err(Failure::usage(format!(
            "`cargo xtask {word}` takes no arguments, but was given {first:?}"
        ))),
    }
}
