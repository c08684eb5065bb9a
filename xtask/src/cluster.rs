//! `cargo xtask cluster-test`: the wheel, built and installed as a user has it, then its tests: those of
//! reading and of jobs, three nodes of Ray on this machine of which some die, and two executors of Spark.
//!
//! Everything of Python lies in an environment of its own under the target folder. Without Java the
//! tests on Spark are skipped, and say so.

use std::fs;
use std::path::{Path, PathBuf};

use crate::command::{Failure, Step};
use crate::python;
use crate::test;

/// What is installed beside the wheel.
const REQUIREMENTS: &str = "xtask/cluster.txt";
const BY_HAND: &str = "Python 3.11 or later with venv and PyPI in reach are needed; nothing else of Tilefold's tests needs them";

/// Builds the wheel and runs its tests; `arguments` go to pytest.
pub(crate) fn run(root: &Path, arguments: &[String]) -> Result<(), Failure> {
    let folder = python::tool_folder(root, "cluster");
    let bin = environment(root, &folder)?;
    test::build(root)?;
    install(root, &folder, &bin)?;
    let tests = root.join("jobs/python");
    Step::new(bin.join("mypy"), &tests)
        .args("--config-file pyproject.toml".split(' '))
        .args(["--cache-dir".as_ref(), folder.join("mypy").as_os_str()])
        .args(["python/tilefold"])
        .run("The types of the wheel are wrong where it says")?;
    let target = folder.ancestors().nth(2).unwrap_or(root);
    Step::new(bin.join("python"), &tests)
        .args("-m pytest -q -rs -p no:cacheprovider".split(' '))
        .args(arguments)
        .env("TILEFOLD_BIN", target.join("debug/tilefold"))
        .env("RAY_USAGE_STATS_ENABLED", "0")
        .run(
            "The failing test is named above; run it alone with `cargo xtask cluster-test -k NAME`",
        )
}

/// The folder of programs of an environment with what `REQUIREMENTS` names, made if need be.
fn environment(root: &Path, folder: &Path) -> Result<PathBuf, Failure> {
    let cannot = |error: std::io::Error| {
        Failure::new(format!(
            "{REQUIREMENTS}: {error}. Check the disk and its rights"
        ))
    };
    let wanted = fs::read(root.join(REQUIREMENTS)).map_err(cannot)?;
    let installed = folder.join("installed.txt");
    let bin = folder.join("bin");
    if fs::read(&installed).is_ok_and(|found| found == wanted) {
        return Ok(bin);
    }
    Step::new("python3", root)
        .args(["-m", "venv", "--clear"])
        .args([folder])
        .run(BY_HAND)?;
    Step::new(bin.join("python"), root)
        .args("-m pip install --quiet --disable-pip-version-check".split(' '))
        .args(["--no-deps", "--require-hashes", "-r", REQUIREMENTS])
        .run(BY_HAND)?;
    // Written last: what it names is there as a whole.
    fs::write(&installed, wanted).map_err(cannot)?;
    Ok(bin)
}

/// Builds the wheel and puts it into the environment.
fn install(root: &Path, folder: &Path, bin: &Path) -> Result<(), Failure> {
    let wheels = folder.join("wheels");
    let _ = fs::remove_dir_all(&wheels);
    Step::new(bin.join("maturin"), root)
        .args("build --quiet --profile dev --auditwheel skip --compatibility linux".split(' '))
        .args(["--manifest-path", "jobs/python/Cargo.toml"])
        .args(["--interpreter".as_ref(), bin.join("python").as_os_str()])
        .args(["--out".as_ref(), wheels.as_os_str()])
        .run("The compiler's own words are above")?;
    Step::new(bin.join("python"), root)
        .args("-m pip install --quiet --disable-pip-version-check".split(' '))
        .args(["--no-deps", "--no-index", "--force-reinstall", "tilefold"])
        .args(["--find-links".as_ref(), wheels.as_os_str()])
        .run(BY_HAND)
}
