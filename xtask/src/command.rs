//! One child process: named on stderr before it starts, and named again, with the fix, if it fails.

use std::env;
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Exit code for a word or argument that does not exist.
const USAGE: u8 = 2;

/// Why a word failed: what happened and what mends it.
#[derive(Debug)]
pub(crate) struct Failure {
    what: String,
    exit_code: u8,
}

impl Failure {
    /// A failure of the work itself.
    pub(crate) fn new(what: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            exit_code: 1,
        }
    }

    /// A word or argument that does not exist.
    pub(crate) fn usage(what: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            exit_code: USAGE,
        }
    }

    /// What the process ends with.
    pub(crate) fn exit_code(&self) -> u8 {
        self.exit_code
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

/// A child process in the making: a program, its arguments and its environment, never a line of shell.
pub(crate) struct Step {
    program: OsString,
    arguments: Vec<OsString>,
    environment: Vec<(&'static str, OsString)>,
    directory: PathBuf,
}

impl Step {
    /// `program`, to be run in `directory`.
    pub(crate) fn new(program: impl AsRef<OsStr>, directory: &Path) -> Self {
        Self {
            program: program.as_ref().to_owned(),
            arguments: Vec::new(),
            environment: Vec::new(),
            directory: directory.to_owned(),
        }
    }

    /// The cargo that runs us, with the words of `words` as its arguments.
    pub(crate) fn cargo(root: &Path, words: &str) -> Self {
        let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        Self::new(cargo, root).args(words.split_whitespace())
    }

    /// Adds arguments.
    pub(crate) fn args<A: AsRef<OsStr>>(mut self, arguments: impl IntoIterator<Item = A>) -> Self {
        self.arguments
            .extend(arguments.into_iter().map(|a| a.as_ref().to_owned()));
        self
    }

    /// Sets an environment variable.
    pub(crate) fn env(mut self, key: &'static str, value: impl Into<OsString>) -> Self {
        self.environment.push((key, value.into()));
        self
    }

    /// Runs it with our own stdout and stderr; an exit code other than 0 is a failure with that code.
    pub(crate) fn run(self, fix: &str) -> Result<(), Failure> {
        eprintln!("xtask: {self}");
        let status = self
            .command()
            .status()
            .map_err(|error| Failure::new(format!("cannot start `{self}`: {error}. {fix}")))?;
        if status.success() {
            return Ok(());
        }
        let code = status.code().and_then(|code| u8::try_from(code).ok());
        Err(Failure {
            what: format!("`{self}` ended with {status}. {fix}"),
            exit_code: code.unwrap_or(1),
        })
    }

    /// What it prints, if it starts and succeeds; used to look for tools.
    pub(crate) fn output(&self) -> Option<String> {
        let output = self
            .command()
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .output()
            .ok()?;
        output
            .status
            .success()
            .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
    }

    fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        for key in said_of_us() {
            command.env_remove(key);
        }
        command
            .args(&self.arguments)
            .envs(self.environment.iter().map(|(key, value)| (key, value)))
            .current_dir(&self.directory);
        command
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (key, value) in &self.environment {
            write!(f, "{key}={} ", value.to_string_lossy())?;
        }
        let name = Path::new(&self.program).file_name();
        f.write_str(&name.unwrap_or(&self.program).to_string_lossy())?;
        for argument in &self.arguments {
            write!(f, " {}", argument.to_string_lossy())?;
        }
        Ok(())
    }
}

/// What cargo said of this package when it started us. Build scripts of dependencies heed these (that
/// of `ring` does): passed on, they would have everything built anew that was built without us.
fn said_of_us() -> impl Iterator<Item = OsString> {
    let is_ours = |key: &OsString| {
        let key = key.to_string_lossy();
        key.starts_with("CARGO_PKG_") || key.starts_with("CARGO_MANIFEST_")
    };
    env::vars_os().map(|(key, _)| key).filter(is_ours)
}

/// The folder of the workspace: the parent of this crate's own.
pub(crate) fn workspace_root() -> Result<PathBuf, Failure> {
    let here = env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    here.as_deref()
        .and_then(Path::parent)
        .map(Path::to_owned)
        .ok_or_else(|| Failure::usage("start me as `cargo xtask WORD`, inside of the repository"))
}
