//! `cargo xtask demo`: sets up what is missing, builds the program, runs its demo.
//!
//! Nothing is to be set up yet: the demo makes its own city, and needs the checkout alone.

use std::path::Path;

use crate::command::{Failure, Step};

/// Builds and runs the demo; what it prints is passed through, and so is its exit code.
pub(crate) fn run(root: &Path, arguments: &[String]) -> Result<(), Failure> {
    Step::cargo(root, "build --release --package tilefold")
        .run("Mend what the compiler says; `rustup toolchain install` if the toolchain is older than rust-version in Cargo.toml")?;
    Step::cargo(
        root,
        "run --release --quiet --package tilefold --bin tilefold -- demo",
    )
    .args(arguments)
    .run("Its own message above says why; the same command may be run again")
}
