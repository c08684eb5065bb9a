//! Finds ONNX Runtime's library and loads it, once a process.
//!
//! It is looked for where it is named (a flag, then ORT_DYLIB_PATH), beside the executable, and in
//! the folder `.ort` that `cargo xtask setup` fills, in the working folder or the executable's, or
//! above either. Nothing is ever fetched here.

use std::env;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

use ort::environment::Environment;
use ort::ep::{self, ExecutionProvider};

use crate::error::OnnxError;

/// How the library's file is called; a version may follow.
const NAME: &str = if cfg!(windows) {
    "onnxruntime.dll"
} else if cfg!(target_os = "macos") {
    "libonnxruntime.dylib"
} else {
    "libonnxruntime.so"
};
/// The folder that `cargo xtask setup` fills.
const FOLDER: &str = ".ort";

/// The loaded library; there is one in a process.
static LOADED: OnceLock<Library> = OnceLock::new();
/// One thread loads, others wait.
static LOADING: Mutex<()> = Mutex::new(());

/// ONNX Runtime, loaded.
#[derive(Debug, Clone)]
pub struct Library {
    /// The file.
    pub path: PathBuf,
    pub(crate) environment: Environment,
}

impl Library {
    /// Loads ONNX Runtime: from `named`, or from where it is found.
    ///
    /// # Errors
    /// It is nowhere, it cannot be loaded, or another one is loaded already.
    pub fn load(named: Option<&Path>) -> Result<Self, OnnxError> {
        let path = find(named)?;
        let _guard = LOADING.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(loaded) = LOADED.get() {
            return loaded.same(path);
        }
        let refuse = |reason: String| OnnxError::Library {
            path: path.clone(),
            reason,
        };
        // `init` without a path would panic where there is no library.
        let builder = ort::init_from(&path).map_err(|error| refuse(error.to_string()))?;
        let environment = builder
            .with_telemetry(false)
            .build()
            .map_err(|error| refuse(error.to_string()))?;
        let library = Self { path, environment };
        Ok(LOADED.get_or_init(|| library).clone())
    }

    fn same(&self, wanted: PathBuf) -> Result<Self, OnnxError> {
        if self.path == wanted {
            return Ok(self.clone());
        }
        Err(OnnxError::SecondLibrary {
            wanted,
            loaded: self.path.clone(),
        })
    }

    /// What it can run networks on.
    #[must_use]
    pub fn providers(&self) -> Vec<&'static str> {
        let known = [
            ("CPU", Ok(true)),
            ("CUDA", ep::CUDA::is_available()),
            ("TensorRT", ep::TensorRT::is_available()),
        ];
        let there = known
            .into_iter()
            .filter(|(_, found)| matches!(found, Ok(true)));
        there.map(|(name, _)| name).collect()
    }

    /// Version of the library, from its file's name; as in `libonnxruntime.so.1.31.1`.
    #[must_use]
    pub fn version(&self) -> String {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let version = name
            .strip_prefix(NAME)
            .and_then(|rest| rest.strip_prefix('.'));
        version.map_or_else(|| "of unknown version".to_owned(), str::to_owned)
    }
}

/// Where the library is.
///
/// # Errors
/// Nowhere.
pub fn find(named: Option<&Path>) -> Result<PathBuf, OnnxError> {
    let variable = env::var_os("ORT_DYLIB_PATH").map(PathBuf::from);
    let variable = variable.filter(|path| !path.as_os_str().is_empty());
    if let Some(path) = named.map(Path::to_owned).or(variable) {
        return if path.is_dir() {
            in_folder(&path).ok_or_else(|| nowhere(vec![path]))
        } else {
            Ok(path)
        };
    }
    let places = places();
    let found = places.iter().find_map(|place| in_folder(place));
    found.ok_or_else(|| nowhere(places))
}

fn nowhere(places: Vec<PathBuf>) -> OnnxError {
    OnnxError::NoLibrary { name: NAME, places }
}

fn places() -> Vec<PathBuf> {
    let executable = env::current_exe().ok();
    let beside = executable.as_deref().and_then(Path::parent);
    let working = env::current_dir().ok();
    let above = working.as_deref().into_iter().chain(beside);
    let above = above.flat_map(Path::ancestors);
    let mut places: Vec<PathBuf> = beside.map(Path::to_owned).into_iter().collect();
    for folder in above.map(|folder| folder.join(FOLDER)) {
        if folder.is_dir() && !places.contains(&folder) {
            places.push(folder);
        }
    }
    if places.len() < 2 {
        places.extend(working.map(|working| working.join(FOLDER)));
    }
    places
}

/// The library in a folder: the last by name where there are several.
fn in_folder(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).ok()?;
    let is_it = |path: &PathBuf| {
        path.file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with(NAME))
    };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    paths.filter(is_it).max()
}
