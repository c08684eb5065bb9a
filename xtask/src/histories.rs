//! `cargo xtask histories`: many more random histories of stores than a test run has time for.

use std::path::Path;

use crate::command::Failure;
use crate::test;

/// How many, if nobody says.
const HISTORIES: &str = "5000";

/// Lives the histories of `tests/tests/histories.rs`.
pub(crate) fn run(root: &Path, arguments: &[String]) -> Result<(), Failure> {
    let count = match arguments {
        [] => HISTORIES,
        [count] if count.parse::<u32>().is_ok() => count.as_str(),
        _ => {
            return Err(Failure::usage(format!(
                "`cargo xtask histories` takes one number, but was given {arguments:?}"
            )));
        }
    };
    test::some(root, "--test histories -- --nocapture")
        .env("TILEFOLD_HISTORIES", count)
        .run("The history that failed is printed above, as short as it could be made")
}
