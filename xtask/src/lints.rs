//! `cargo xtask ci-lints`: what CI asks of a change besides its tests.

use std::path::Path;

use crate::book;
use crate::command::{Failure, Step};

/// Format, clippy, API documentation and the book; every warning is an error.
pub(crate) fn run(root: &Path) -> Result<(), Failure> {
    Step::cargo(root, "fmt --all -- --check").run("`cargo fmt --all` mends it")?;
    Step::cargo(root, "clippy --workspace --all-targets -- -D warnings")
        .run("Each finding above names its file and its mending")?;
    book::run(root)
}
