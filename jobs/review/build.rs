//! Whether MapLibre GL JS is there to be bundled: `cargo xtask setup` puts it into `.maplibre/`.
//! Nothing is fetched here.

use std::path::Path;

const FILES: [&str; 4] = [
    "maplibre-gl-csp.js",
    "maplibre-gl-csp-worker.js",
    "maplibre-gl.css",
    "LICENSE.txt",
];

fn main() {
    let folder = Path::new("../../.maplibre");
    println!("cargo::rustc-check-cfg=cfg(has_map_library)");
    // The folder is in every checkout: cargo looks into it, and runs this again when files come.
    println!("cargo::rerun-if-changed={}", folder.display());
    if FILES.iter().all(|file| folder.join(file).is_file()) {
        println!("cargo::rustc-cfg=has_map_library");
    }
}
