//! `cargo xtask page-test`: the review page in a real browser without a window: load, filter, click,
//! decide, export; served, and opened from a file.
//!
//! The browser is Chromium as the machine has it, or as Debian packages it; the driver is Playwright,
//! from PyPI by version and hash.

use std::env;
use std::path::{Path, PathBuf};

use crate::command::{Failure, Step};
use crate::map_library;
use crate::python;
use crate::test;

/// The version of Playwright; the same as in `xtask/playwright.txt`.
const PLAYWRIGHT: &str = "1.65.2";
/// What Chromium is called.
const CHROMIUMS: [&str; 4] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
];

const BY_HAND: &str = "Python 3.10 or later with pip and PyPI in reach are needed; nothing else of Tilefold's tests needs them";
const NO_BROWSER: &str =
    "Install Chromium (Debian: `apt-get install chromium`), or name one in TILEFOLD_CHROMIUM";

/// Builds the program with the page in it, and runs `tests/page/page_test.py`.
pub(crate) fn run(root: &Path, arguments: &[String]) -> Result<(), Failure> {
    map_library::run(root)?;
    test::build(root)?;
    let driver = python::tool_folder(root, &format!("playwright-{PLAYWRIGHT}"));
    if !driver
        .join(format!("playwright-{PLAYWRIGHT}.dist-info"))
        .is_dir()
    {
        python::install(root, "xtask/playwright.txt", &driver, BY_HAND)?;
    }
    Step::new("python3", root)
        .args(["tests/page/page_test.py", "--chromium"])
        .args([chromium(root)?])
        .args(["--tilefold".as_ref(), program(root).as_os_str()])
        .args(arguments)
        .env("PYTHONPATH", driver)
        .run("What failed is named above; `cargo xtask page-test --keep FOLDER` keeps the stores and pictures")
}

fn program(root: &Path) -> PathBuf {
    let target = env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| root.join("target"), |target| root.join(target));
    target
        .join("debug")
        .join(format!("tilefold{}", env::consts::EXE_SUFFIX))
}

/// The browser, installed by apt where that is how it comes.
fn chromium(root: &Path) -> Result<PathBuf, Failure> {
    if let Some(named) = env::var_os("TILEFOLD_CHROMIUM") {
        return Ok(named.into());
    }
    if let Some(found) = installed() {
        return Ok(found);
    }
    if Step::new("apt-get", root)
        .args(["--version"])
        .output()
        .is_none()
    {
        return Err(Failure::new(format!("there is no Chromium. {NO_BROWSER}")));
    }
    Step::new("apt-get", root)
        .args(["update", "-q"])
        .run(NO_BROWSER)?;
    Step::new("apt-get", root)
        .args("install -q -y --no-install-recommends chromium".split(' '))
        .env("DEBIAN_FRONTEND", "noninteractive")
        .run(NO_BROWSER)?;
    installed().ok_or_else(|| Failure::new(format!("there is no Chromium. {NO_BROWSER}")))
}

fn installed() -> Option<PathBuf> {
    let path = env::var_os("PATH")?;
    let folders: Vec<PathBuf> = env::split_paths(&path).collect();
    let places = CHROMIUMS
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    places.into_iter().find(|place| place.is_file())
}
