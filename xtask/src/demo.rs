//! `cargo xtask demo`: sets up what is missing, builds the program, runs its demo.
//!
//! The demo looks at pictures with our own network, and ends with the review page. Where ONNX Runtime
//! cannot be had, it says so and shows a city of detections instead; where the page's map library
//! cannot, it goes without the page.

use std::path::Path;

use crate::command::{Failure, Step};
use crate::map_library;
use crate::setup;

/// The card of our own network.
const CARD: &str = "workers/onnx/cards/tilefold_lines.toml";

/// Builds and runs the demo; what it prints is passed through, and so is its exit code.
pub(crate) fn run(root: &Path, arguments: &[String]) -> Result<(), Failure> {
    if let Err(failure) = map_library::run(root) {
        eprintln!("xtask: {failure}\nxtask: the demo goes on without the review page");
    }
    let detector = match setup::onnxruntime(root) {
        Ok(()) => vec!["--detector".to_owned(), CARD.to_owned()],
        Err(failure) => {
            eprintln!("xtask: {failure}\nxtask: the demo goes on without pictures");
            Vec::new()
        }
    };
    Step::cargo(root, "build --release --package tilefold")
        .run("Mend what the compiler says; `rustup toolchain install` if the toolchain is older than rust-version in Cargo.toml")?;
    Step::cargo(
        root,
        "run --release --quiet --package tilefold --bin tilefold -- demo",
    )
    .args(detector)
    .args(arguments)
    .run("Its own message above says why; the same command may be run again")
}
