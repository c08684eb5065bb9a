//! `cargo xtask demo`: sets up what is missing, builds the program, runs its demo.
//!
//! The demo makes its own city, and needs the checkout alone; only the review page at its end wants
//! the map library, without which everything else still runs.

use std::path::Path;

use crate::command::{Failure, Step};
use crate::map_library;

/// Builds and runs the demo; what it prints is passed through, and so is its exit code.
pub(crate) fn run(root: &Path, arguments: &[String]) -> Result<(), Failure> {
    if let Err(failure) = map_library::run(root) {
        eprintln!("xtask: the demo will have no review page: {failure}");
    }
    Step::cargo(root, "build --release --package tilefold")
        .run("Mend what the compiler says; `rustup toolchain install` if the toolchain is older than rust-version in Cargo.toml")?;
    Step::cargo(
        root,
        "run --release --quiet --package tilefold --bin tilefold -- demo",
    )
    .args(arguments)
    .run("Its own message above says why; the same command may be run again")
}
