//! Programs that come from PyPI by name, version and hash, into the target folder and nowhere else.

use std::env;
use std::path::{Path, PathBuf};

use crate::command::{Failure, Step};

/// Installs what `requirements` (a file with hashes) names into `into`.
pub(crate) fn install(
    root: &Path,
    requirements: &str,
    into: &Path,
    by_hand: &str,
) -> Result<(), Failure> {
    Step::new("python3", root)
        .args(
            "-m pip install --quiet --disable-pip-version-check --root-user-action=ignore"
                .split(' '),
        )
        .args("--no-deps --only-binary :all: --require-hashes --upgrade".split(' '))
        .args(["-r", requirements, "--target"])
        .args([into])
        .run(by_hand)
}

/// Where tools lie: `target/tools/NAME`.
pub(crate) fn tool_folder(root: &Path, name: &str) -> PathBuf {
    let target = env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| root.join("target"), |target| root.join(target));
    target.join("tools").join(name)
}
