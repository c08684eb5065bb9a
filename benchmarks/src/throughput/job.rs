//! One job of one program, in a process of its own: how long it took, what it used, what it left.

use std::error::Error;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use serde::Serialize;
use serde_json::Value;
use wait4::Wait4;

/// What a job is made from.
#[derive(Debug, Clone)]
pub(crate) struct Input {
    /// Map files.
    pub(crate) map: Vec<PathBuf>,
    /// Log files, in order.
    pub(crate) logs: Vec<PathBuf>,
}

/// How a job is made.
#[derive(Debug, Clone)]
pub(crate) struct Setting {
    /// The program `tilefold`.
    pub(crate) program: PathBuf,
    /// Threads.
    pub(crate) threads: usize,
    /// Further arguments of `run`.
    pub(crate) arguments: Vec<String>,
}

/// What was measured of a job.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Job {
    /// Threads that it was given.
    pub(crate) threads: usize,
    /// Further arguments.
    pub(crate) arguments: Vec<String>,
    /// How many logs it was given.
    pub(crate) logs: usize,
    /// Their bytes.
    pub(crate) log_bytes: u64,
    /// Seconds from the start of the process to its end.
    pub(crate) wall_s: f64,
    /// Seconds of processor time in the program.
    pub(crate) user_s: f64,
    /// Seconds of processor time in the kernel.
    pub(crate) system_s: f64,
    /// Most memory that the process held at once, bytes.
    pub(crate) peak_bytes: u64,
    /// Bytes of the data files of each table that it left.
    pub(crate) table_bytes: Vec<(String, u64)>,
    /// What the program says of itself, but for what it says of single files.
    pub(crate) report: Value,
}

impl Job {
    /// Processor time, seconds.
    pub(crate) fn processor_s(&self) -> f64 {
        self.user_s + self.system_s
    }

    /// Seconds that threads were busy in a stage.
    pub(crate) fn busy_s(&self, stage: &str) -> f64 {
        self.figure(stage, "busy_s")
    }

    /// A figure of a stage as the program reports it; 0 where it does not.
    pub(crate) fn figure(&self, stage: &str, name: &str) -> f64 {
        let stages = self.report["stages"].as_array();
        let found = stages
            .into_iter()
            .flatten()
            .find(|one| one["stage"] == stage);
        found.and_then(|one| one[name].as_f64()).unwrap_or(0.0)
    }

    /// Names of the stages, in the order of the data.
    pub(crate) fn stages(&self) -> Vec<String> {
        let stages = self.report["stages"].as_array().into_iter().flatten();
        let names = stages.filter_map(|one| one["stage"].as_str());
        names.map(str::to_owned).collect()
    }

    /// Share of the threads' time, from start to end, in which they were in a stage.
    pub(crate) fn busy_share(&self) -> f64 {
        let busy_s: f64 = self.stages().iter().map(|stage| self.busy_s(stage)).sum();
        busy_s / (self.threads as f64 * self.wall_s)
    }
}

/// Makes a new store in `folder`, runs the job on it and measures the run.
pub(crate) fn measure(
    input: &Input,
    setting: &Setting,
    folder: &Path,
) -> Result<Job, Box<dyn Error>> {
    let store = folder.join("store");
    if store.exists() {
        fs::remove_dir_all(&store)?;
    }
    let mut init = Command::new(&setting.program);
    init.arg("init").arg(&store).arg("--map").args(&input.map);
    succeed(init.stdout(Stdio::null()).status()?.code(), "init")?;

    let said = folder.join("report.json");
    let mut command = Command::new(&setting.program);
    command
        .args(["--format", "json", "--progress", "off", "--threads"])
        .arg(setting.threads.to_string())
        .arg("run")
        .args(&setting.arguments)
        .arg(&store)
        .args(&input.logs)
        .stdout(File::create(&said)?)
        .stderr(Stdio::null());
    let started = Instant::now();
    let used = command.spawn()?.wait4()?;
    let wall_s = started.elapsed().as_secs_f64();
    succeed(used.status.code(), "run")?;
    let sizes = input.logs.iter().map(|log| Ok(fs::metadata(log)?.len()));
    Ok(Job {
        threads: setting.threads,
        arguments: setting.arguments.clone(),
        logs: input.logs.len(),
        log_bytes: sizes.sum::<std::io::Result<u64>>()?,
        wall_s,
        user_s: used.rusage.utime.as_secs_f64(),
        system_s: used.rusage.stime.as_secs_f64(),
        peak_bytes: used.rusage.maxrss,
        table_bytes: table_bytes(&store)?,
        report: figures(serde_json::from_slice(&fs::read(said)?)?),
    })
}

/// A report without its lists of files.
fn figures(mut report: Value) -> Value {
    if let Some(fields) = report.as_object_mut() {
        fields.retain(|name, value| name == "stages" || !value.is_array());
    }
    report
}

/// What was set aside is no failure here.
fn succeed(code: Option<i32>, what: &str) -> Result<(), Box<dyn Error>> {
    match code {
        Some(0 | 3) => Ok(()),
        Some(code) => Err(format!("`tilefold {what}` ended with exit code {code}").into()),
        None => Err(format!("`tilefold {what}` was killed").into()),
    }
}

/// Bytes of the data files of each table of a new store: all of them belong to its one version.
fn table_bytes(store: &Path) -> std::io::Result<Vec<(String, u64)>> {
    let mut tables = Vec::new();
    for entry in fs::read_dir(store)? {
        let path = entry?.path();
        if path.is_dir() {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            tables.push((name.into_owned(), parquet_bytes(&path)?));
        }
    }
    tables.sort();
    Ok(tables)
}

fn parquet_bytes(folder: &Path) -> std::io::Result<u64> {
    let mut bytes = 0;
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry
            .path()
            .extension()
            .is_some_and(|name| name == "parquet")
        {
            bytes += entry.metadata()?.len();
        }
    }
    Ok(bytes)
}
