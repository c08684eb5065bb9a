//! How fast a whole job is, stage by stage, and how that changes with threads, with the size of the
//! input, and from one program to another.
//!
//! Every job runs in a process of its own (`job`), so that its memory and processor time are its
//! own; allocations and the legs of the map stage are counted within this program (`counted`).
//! Settings take turns, and a figure is the median of its turns. Raw figures are JSON, `tables`
//! are for people, `benchmarks/plots/throughput.py` draws them.

mod counted;
mod job;
mod tables;

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Serialize;

use counted::Costs;
pub(crate) use counted::costs;
use job::{Input, Job, Setting, measure};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// What is to be measured.
#[derive(Debug, clap::Args)]
pub(crate) struct Wanted {
    /// Map files.
    #[arg(long, required = true, num_args = 1..)]
    map: Vec<PathBuf>,
    /// MCAP files, or folders of them.
    #[arg(long, required = true, num_args = 1..)]
    logs: Vec<PathBuf>,
    /// Length of all drives together, kilometres: for the ledger's bytes per kilometre and pass.
    #[arg(long)]
    km: Option<f64>,
    /// The program `tilefold` of this branch; beside this one if not given.
    #[arg(long)]
    program: Option<PathBuf>,
    /// The program `tilefold` of another commit, to compare with on the first number of threads.
    #[arg(long)]
    base: Option<PathBuf>,
    /// Numbers of threads.
    #[arg(long, value_delimiter = ',', default_value = "1,2")]
    threads: Vec<usize>,
    /// Numbers of logs, for growth over the size of the input, on the first number of threads.
    #[arg(long, value_delimiter = ',')]
    growth: Vec<usize>,
    /// Limit of memory for a second growth run, as `tilefold run --memory` takes it.
    #[arg(long, value_name = "SIZE")]
    memory: Option<String>,
    /// Turns.
    #[arg(long, default_value_t = 3)]
    turns: usize,
    /// Folder of the results: `throughput.json` and `throughput.md`.
    #[arg(long)]
    out: PathBuf,
}

/// Everything that was measured.
#[derive(Debug, Serialize)]
struct Measured {
    machine: Machine,
    /// Length of all drives together, kilometres.
    km: Option<f64>,
    /// By number of threads, every turn.
    scaling: Vec<Vec<Job>>,
    /// By number of logs, every turn.
    growth: Vec<Vec<Job>>,
    /// The same within a limit of memory.
    growth_limited: Vec<Vec<Job>>,
    /// Turns of the other program and of this one.
    against: Option<[Vec<Job>; 2]>,
    costs: Costs,
}

/// Where it was measured.
#[derive(Debug, Serialize)]
struct Machine {
    cores: usize,
    processor: String,
    /// Load over the last minute, before and after.
    load: [f64; 2],
}

/// Measures, and writes the results.
pub(crate) fn throughput(wanted: &Wanted) -> Result<()> {
    fs::create_dir_all(&wanted.out)?;
    let folder = tempfile::tempdir_in(&wanted.out)?;
    let input = Input {
        map: wanted.map.clone(),
        logs: logs(&wanted.logs)?,
    };
    let program = match &wanted.program {
        Some(program) => program.clone(),
        None => std::env::current_exe()?.with_file_name("tilefold"),
    };
    let load_before = load();
    let with = |program: &Path, threads: usize| Setting {
        program: program.to_owned(),
        threads,
        arguments: Vec::new(),
    };
    let first = wanted.threads.first().copied().unwrap_or(1);
    let in_turns = |jobs: &[(Input, Setting)]| in_turns(jobs, wanted.turns, folder.path());

    let scaling: Vec<_> = (wanted.threads.iter())
        .map(|&threads| (input.clone(), with(&program, threads)))
        .collect();
    let sizes = |arguments: &[String]| -> Vec<(Input, Setting)> {
        let size = |&count: &usize| {
            let mut setting = with(&program, first);
            setting.arguments = arguments.to_vec();
            (input.first(count), setting)
        };
        wanted.growth.iter().map(size).collect()
    };
    let limited = match &wanted.memory {
        Some(limit) => sizes(&["--memory".to_owned(), limit.clone()]),
        None => Vec::new(),
    };
    let against = match &wanted.base {
        Some(base) => {
            let both = [base, &program].map(|program| (input.clone(), with(program, first)));
            in_turns(&both)?.try_into().ok()
        }
        None => None,
    };
    let result = Measured {
        km: wanted.km,
        scaling: in_turns(&scaling)?,
        growth: in_turns(&sizes(&[]))?,
        growth_limited: in_turns(&limited)?,
        against,
        costs: counted_apart(&program, &input, folder.path())?,
        machine: Machine {
            cores: std::thread::available_parallelism()?.get(),
            processor: processor(),
            load: [load_before, load()],
        },
    };
    let json = serde_json::to_string_pretty(&result)?;
    fs::write(wanted.out.join("throughput.json"), json + "\n")?;
    let page = tables::page(&result);
    print!("{page}");
    fs::write(wanted.out.join("throughput.md"), page)?;
    Ok(())
}

/// Measures every setting once, and again, as often as there are turns; every second turn backwards,
/// so that none always follows another.
fn in_turns(jobs: &[(Input, Setting)], turns: usize, folder: &Path) -> Result<Vec<Vec<Job>>> {
    let mut measured: Vec<Vec<Job>> = jobs.iter().map(|_| Vec::new()).collect();
    for turn in 0..turns {
        let mut order: Vec<usize> = (0..jobs.len()).collect();
        if turn % 2 == 1 {
            order.reverse();
        }
        for index in order {
            let (input, setting) = &jobs[index];
            let job = measure(input, setting, folder)?;
            eprintln!(
                "turn {turn}: {} logs, {} threads, {:?}: {:.2} s, {:.2} s of processor, {:.0} MB",
                job.logs,
                job.threads,
                job.arguments,
                job.wall_s,
                job.processor_s(),
                job.peak_bytes as f64 * 1e-6
            );
            measured[index].push(job);
        }
    }
    Ok(measured)
}

/// [`costs`] in a process of its own: what it holds in memory would be told of its children.
fn counted_apart(program: &Path, input: &Input, folder: &Path) -> Result<Costs> {
    let store = folder.join("counted");
    let mut init = Command::new(program);
    init.arg("init").arg(&store).arg("--map").args(&input.map);
    init.stdout(Stdio::null()).status()?;
    let mut command = Command::new(std::env::current_exe()?);
    command.arg("counted").arg(&store).args(&input.logs);
    let output = command.stderr(Stdio::inherit()).output()?;
    Ok(serde_json::from_slice(&output.stdout)?)
}

impl Input {
    /// The same with this many logs at most.
    fn first(&self, count: usize) -> Self {
        let logs = self.logs.iter().take(count).cloned().collect();
        Self {
            map: self.map.clone(),
            logs,
        }
    }
}

/// The log files that are meant, in order.
fn logs(named: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut logs = Vec::new();
    for path in named {
        if !path.is_dir() {
            logs.push(path.clone());
            continue;
        }
        let mut inside: Vec<PathBuf> = fs::read_dir(path)?
            .map(|entry| Ok(entry?.path()))
            .collect::<std::io::Result<_>>()?;
        inside.retain(|path| path.extension().is_some_and(|name| name == "mcap"));
        inside.sort();
        logs.extend(inside);
    }
    Ok(logs)
}

/// Load over the last minute; 0 where the system does not say.
fn load() -> f64 {
    let text = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let first = text.split_whitespace().next();
    first.and_then(|word| word.parse().ok()).unwrap_or(0.0)
}

fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split(':').nth(1));
    name.unwrap_or("unknown").trim().to_owned()
}
