//! The program, a small city, and a store of it.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;
use tilefold_city::{CityFiles, CitySpec, Site};

/// What the program said, and how it ended.
#[derive(Debug)]
pub(crate) struct Said {
    pub(crate) code: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Said {
    /// Its standard output, which must be one JSON value.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {self:#?}"))
    }

    /// Itself, if it ended with `code`.
    #[track_caller]
    pub(crate) fn with_code(self, code: i32) -> Self {
        assert_eq!(self.code, code, "{self:#?}");
        self
    }

    /// Whether standard error has all of these.
    #[track_caller]
    pub(crate) fn names(&self, parts: &[&str]) {
        for part in parts {
            assert!(self.err.contains(part), "{part:?} is not in {self:#?}");
        }
    }
}

/// Runs the program; no terminal, no settings from outside.
pub(crate) fn tilefold<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Said {
    tilefold_in([], arguments)
}

/// Runs the program with these variables in its environment.
pub(crate) fn tilefold_in<'a, A: AsRef<OsStr>>(
    variables: impl IntoIterator<Item = (&'a str, &'a str)>,
    arguments: impl IntoIterator<Item = A>,
) -> Said {
    let output = Command::new(env!("CARGO_BIN_EXE_tilefold"))
        .args(arguments)
        .envs(variables)
        .env_remove("TILEFOLD_THREADS")
        .env_remove("TILEFOLD_VEHICLE_SALT")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    Said {
        code: output.status.code().unwrap(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

/// A city and a folder for stores.
pub(crate) struct Town {
    pub(crate) folder: TempDir,
    pub(crate) city: CityFiles,
}

impl Town {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let spec = CitySpec {
            seed: 9,
            site: Site::Drawn { km: 1.0 },
            vehicles: 6,
            drives: 6,
            drive_km: 0.5,
            days: 3,
            ..CitySpec::default()
        };
        let city = tilefold_city::write(&spec, folder.path()).unwrap();
        Self { folder, city }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A new store of the map with errors.
    pub(crate) fn init(&self, name: &str) -> PathBuf {
        let store = self.path(name);
        let map = &self.city.before_map;
        tilefold([
            "init".as_ref(),
            store.as_os_str(),
            "--map".as_ref(),
            map.as_ref(),
        ])
        .with_code(0);
        store
    }

    /// A new store in which all `logs` were run without loss.
    pub(crate) fn store(&self, name: &str, logs: &[PathBuf]) -> PathBuf {
        let store = self.init(name);
        run(&store, logs, &[]).with_code(0);
        store
    }
}

/// `tilefold run STORE LOG... OPTION...`
pub(crate) fn run(store: &Path, logs: &[PathBuf], options: &[&str]) -> Said {
    let fixed = ["run".as_ref(), store.as_os_str()].into_iter();
    let logs = logs.iter().map(|log| log.as_os_str());
    tilefold(fixed.chain(logs).chain(options.iter().map(OsStr::new)))
}

/// `tilefold COMMAND STORE OPTION...`
pub(crate) fn on(command: &str, store: &Path, options: &[&str]) -> Said {
    let fixed = [OsStr::new(command), store.as_os_str()].into_iter();
    tilefold(fixed.chain(options.iter().map(OsStr::new)))
}

/// The names of an object, in order.
#[track_caller]
pub(crate) fn keys(value: &Value) -> Vec<&str> {
    let object = value.as_object().unwrap_or_else(|| panic!("{value}"));
    object.keys().map(String::as_str).collect()
}
