//! The files of the page, in the program: our own, and MapLibre GL JS where it was set up when the
//! program was built (see `build.rs`).

use crate::error::ReviewError;

/// A file of the page.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Asset {
    /// Its path below the page.
    pub(crate) path: &'static str,
    /// Its content.
    pub(crate) bytes: &'static [u8],
}

impl Asset {
    pub(crate) fn media_type(self) -> &'static str {
        media_type(self.path)
    }
}

/// By the end of a file's name.
pub(crate) fn media_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map(|(_, end)| end) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("json") => "application/json",
        _ => "text/plain; charset=utf-8",
    }
}

macro_rules! ours {
    ($($path:literal),+ $(,)?) => {
        &[$(Asset { path: $path, bytes: include_bytes!(concat!("../page/", $path)) }),+]
    };
}

/// Our own files, but for the page itself, which is filled in: [`page`].
pub(crate) const OURS: &[Asset] = ours![
    "style.css",
    "mark.svg",
    "data.js",
    "words.js",
    "state.js",
    "map.js",
    "list.js",
    "detail.js",
    "decide.js",
    "controls.js",
    "app.js",
];

/// The worker of the map library.
pub(crate) const WORKER: &str = "maplibre/worker.js";

#[cfg(has_map_library)]
const LIBRARY: &[Asset] = {
    macro_rules! theirs {
        ($file:literal) => {
            include_bytes!(concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/../../.maplibre/",
                $file
            ))
        };
    }
    &[
        Asset {
            path: "maplibre/maplibre-gl.js",
            bytes: theirs!("maplibre-gl-csp.js"),
        },
        Asset {
            path: WORKER,
            bytes: theirs!("maplibre-gl-csp-worker.js"),
        },
        Asset {
            path: "maplibre/maplibre-gl.css",
            bytes: theirs!("maplibre-gl.css"),
        },
        Asset {
            path: "maplibre/LICENSE.txt",
            bytes: theirs!("LICENSE.txt"),
        },
    ]
};
#[cfg(not(has_map_library))]
const LIBRARY: &[Asset] = &[];

/// The map library's files.
///
/// # Errors
/// The program was built without it.
pub(crate) fn library() -> Result<&'static [Asset], ReviewError> {
    match LIBRARY.is_empty() {
        true => Err(ReviewError::NoMapLibrary),
        false => Ok(LIBRARY),
    }
}

/// How the page gets its data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mode {
    /// From a server.
    Served,
    /// From files beside it.
    Folder,
}

/// The page itself.
pub(crate) fn page(mode: Mode) -> String {
    let (name, meta, worker) = match mode {
        Mode::Served => ("served", String::new(), ""),
        Mode::Folder => (
            "folder",
            format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{FOLDER_POLICY}\">\n"),
            "<script defer src=\"maplibre/worker-text.js\"></script>\n",
        ),
    };
    include_str!("../page/index.html")
        .replace("<!-- policy -->\n", &meta)
        .replace("<!-- worker -->\n", worker)
        .replace("{mode}", name)
}

/// What a served page may load: what this server gives, and nothing else. A policy in the page could
/// not forbid frames, so this one is a header.
pub(crate) const SERVED_POLICY: &str = "default-src 'none'; script-src 'self'; worker-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What a page in a folder may load: the files beside it. A browser lets no page that was opened from
/// a file start a worker from one: that of the map library comes from memory.
const FOLDER_POLICY: &str = "default-src 'none'; script-src 'self' file:; worker-src blob:; style-src 'self' file:; img-src 'self' file: data: blob:; base-uri 'none'; form-action 'none'";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_runs_nothing_inline_and_loads_nothing_from_elsewhere() {
        for mode in [Mode::Served, Mode::Folder] {
            let page = page(mode);
            assert!(!page.contains("<!-- policy -->") && !page.contains("{mode}"));
            assert_eq!(page.contains("http-equiv"), mode == Mode::Folder);
            assert!(
                !page.contains("://") && !page.contains("style=\""),
                "{page}"
            );
            for script in page.split("<script").skip(1) {
                assert!(
                    script.contains("src=\"") && script.contains("></script>"),
                    "{script}"
                );
            }
        }
        for policy in [SERVED_POLICY, FOLDER_POLICY] {
            assert!(
                !policy.contains("unsafe") && !policy.contains('*'),
                "{policy}"
            );
        }
    }

    #[test]
    fn our_scripts_never_read_data_as_markup() {
        for asset in OURS.iter().filter(|asset| asset.path.ends_with(".js")) {
            let text = std::str::from_utf8(asset.bytes).unwrap();
            for forbidden in [
                "innerHTML",
                "outerHTML",
                "insertAdjacentHTML",
                "document.write",
                "eval(",
                "new Function",
                "setHTML",
            ] {
                assert!(!text.contains(forbidden), "{} has {forbidden}", asset.path);
            }
        }
    }
}
