//! `cargo xtask setup`: fetches ONNX Runtime into `.ort/`, where the program and its tests look, and
//! the map library of the review page into `.maplibre/`.
//!
//! The library is taken out of the wheel on PyPI, whose hash is pinned; nothing of Python is
//! installed. A library that is there already is left alone.

use std::fs;
use std::path::Path;

use crate::command::{Failure, Step};
use crate::map_library;

/// Version of ONNX Runtime.
const VERSION: &str = "1.31.1";
/// The wheel for x86-64 Linux. Its ABI tag does not matter: only the library is taken.
const SHA256: &str = "5752bd508126ae7c49894d3b9d2e83f0c3d487319246d04c444b393308d7ad7f";
const WHEEL: [&str; 4] = ["manylinux_2_28_x86_64", "3.11", "cp", "cp311"];
const NO_PIP: &str =
    "Install Python with pip, or put libonnxruntime.so of ONNX Runtime 1.31 into .ort/ by hand";

/// Fetches what is lacking.
pub(crate) fn run(root: &Path) -> Result<(), Failure> {
    onnxruntime(root)?;
    map_library::run(root)
}

/// Fetches ONNX Runtime, if it is not there.
///
/// # Errors
/// There is none for this machine, or PyPI is out of reach.
pub(crate) fn onnxruntime(root: &Path) -> Result<(), Failure> {
    let folder = root.join(".ort");
    let library = folder.join(format!("libonnxruntime.so.{VERSION}"));
    if library.is_file() {
        return Ok(());
    }
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return if is_filled(&folder) {
            Ok(())
        } else {
            Err(by_hand())
        };
    }
    let unpacked = folder.join("unpacked");
    let cannot = |error: std::io::Error| {
        Failure::new(format!(
            "cannot write {}: {error}. Check the disk and its rights",
            folder.display()
        ))
    };
    fs::create_dir_all(&unpacked).map_err(cannot)?;
    let requirement = folder.join("requirements.txt");
    fs::write(
        &requirement,
        format!("onnxruntime=={VERSION} --hash=sha256:{SHA256}\n"),
    )
    .map_err(cannot)?;
    fetch(root, &requirement, &folder)?;
    let wheel = wheel_in(&folder).map_err(cannot)?;
    Step::new("python3", root)
        .args(["-m", "zipfile", "-e"])
        .args([&wheel, &unpacked])
        .run(NO_PIP)?;
    let inside = unpacked
        .join("onnxruntime/capi")
        .join(format!("libonnxruntime.so.{VERSION}"));
    // Renamed last: a library that is there is whole.
    fs::rename(&inside, &library).map_err(cannot)?;
    fs::remove_dir_all(&unpacked).map_err(cannot)?;
    fs::remove_file(&wheel).map_err(cannot)?;
    fs::remove_file(&requirement).map_err(cannot)
}

fn fetch(root: &Path, requirement: &Path, folder: &Path) -> Result<(), Failure> {
    let [platform, python, implementation, abi] = WHEEL;
    Step::new("python3", root)
        .args([
            "-m",
            "pip",
            "download",
            "--quiet",
            "--disable-pip-version-check",
        ])
        .args(["--no-deps", "--require-hashes", "--only-binary=:all:"])
        .args(["--platform", platform, "--python-version", python])
        .args(["--implementation", implementation, "--abi", abi])
        .args(["--requirement".as_ref(), requirement.as_os_str()])
        .args(["--dest".as_ref(), folder.as_os_str()])
        .run(NO_PIP)
}

fn wheel_in(folder: &Path) -> std::io::Result<std::path::PathBuf> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "whl") {
            return Ok(path);
        }
    }
    Err(std::io::Error::other("pip left no wheel in it"))
}

/// Whether somebody put a library there by hand.
fn is_filled(folder: &Path) -> bool {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name()).any(|name| {
        let name = name.to_string_lossy();
        name.contains("onnxruntime")
            && [".so", ".dylib", ".dll"]
                .iter()
                .any(|end| name.contains(end))
    })
}

fn by_hand() -> Failure {
    Failure::new(format!(
        "ONNX Runtime is fetched for x86-64 Linux only. Put the library of the wheel `onnxruntime=={VERSION}` for this machine (onnxruntime/capi/) into .ort/"
    ))
}
