//! Benchmarks: `cargo run --release -p tilefold-benchmarks -- accuracy`.
//!
//! `suite` says which cities are driven through, `accuracy` runs them and keeps raw results,
//! `perception` drives a camera through cities and scores what a network sees,
//! `placed` writes where every frame was placed on the map,
//! `throughput` measures whole jobs, `reading` the reading of logs beside its limits,
//! `many_rows` makes a large store to be folded within a limit of memory,
//! `report` makes the page of the book from raw results and says whether it is up to date.

mod accuracy;
mod many_rows;
mod perception;
mod placed;
mod processor;
mod reading;
mod report;
mod suite;
mod throughput;

use std::alloc::System;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

use suite::Seeds;

/// Counts what is allocated, for `throughput`.
#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Measures Tilefold.
#[derive(Debug, Parser)]
#[command(max_term_width = 100)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Simulates the cities of each suite, runs the job on them, and scores both fusion models.
    Accuracy {
        /// Suite; all that can be simulated if not given.
        #[arg(long)]
        suite: Vec<String>,
        /// Which seeds: parameters are chosen on `tuning` and figures published from `reporting`.
        #[arg(long, value_enum, default_value_t)]
        seeds: Seeds,
        /// Folder of the raw results.
        #[arg(long, default_value = "benchmarks/runs/accuracy")]
        out: PathBuf,
        /// Makes docs/results/accuracy.md and its pictures from the raw results instead.
        #[arg(long)]
        report: bool,
        /// Only says whether the page and the raw results are up to date; exit code 1 if not.
        #[arg(long, requires = "report")]
        check: bool,
    },
    /// Takes pictures of drives through cities, and scores what a network sees in them: classes by
    /// condition, tracks, and the changes that the whole job finds from pixels.
    Perception {
        /// The network's card.
        #[arg(long)]
        card: PathBuf,
        /// Seeds of the cities; 3000 to 3999 are for training.
        #[arg(long, default_values_t = [401, 402])]
        seed: Vec<u64>,
        /// Drives through each city, each by a vehicle of its own.
        #[arg(long, default_value_t = 14)]
        drives: u32,
        /// Length of a drive in kilometres.
        #[arg(long, default_value_t = 1.2)]
        drive_km: f64,
        /// How sensors err: a preset of the simulator, or a file.
        #[arg(long, default_value = "cameras")]
        noise: String,
        /// Folder of the raw results.
        #[arg(long, default_value_os_t = perception::default_out())]
        out: PathBuf,
    },
    /// Writes where each frame was placed on the map of a store, and how each line that it saw lies
    /// beside the map: `frames.csv` and `lines.csv`.
    Placed {
        /// The store.
        store: PathBuf,
        /// MCAP files, or folders of them.
        #[arg(required = true)]
        logs: Vec<PathBuf>,
        /// Folder of the two files.
        #[arg(long)]
        out: PathBuf,
    },
    /// Runs whole jobs, each in a process of its own: stages, threads, growth over the input, another
    /// commit's program beside this one's, allocations.
    Throughput(throughput::Wanted),
    /// What reading logs costs beside the bare mcap crate, the file and memory; JSON.
    Reading {
        /// MCAP files.
        #[arg(required = true)]
        logs: Vec<PathBuf>,
        /// The best of so many turns.
        #[arg(long, default_value_t = 5)]
        turns: u32,
    },
    /// A store with many ledger rows, to fold it within `tilefold run --memory`.
    ManyRows {
        /// Folder of the new store.
        folder: PathBuf,
        /// Ledger rows, about.
        rows: usize,
    },
    /// What a job and the legs of its map stage cost, counted within this process.
    #[command(hide = true)]
    Counted {
        /// A store without evidence.
        store: PathBuf,
        /// MCAP files.
        #[arg(required = true)]
        logs: Vec<PathBuf>,
    },
}

fn main() -> ExitCode {
    match run(&Args::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: &Command) -> Result<(), Box<dyn Error>> {
    match command {
        Command::Accuracy {
            out,
            report: true,
            check,
            ..
        } => report::make(out, Path::new("docs/results"), *check),
        Command::Accuracy {
            suite, seeds, out, ..
        } => {
            let wanted = suite::named(suite)?;
            for suite in wanted {
                match suite.obstacle() {
                    Some(why) => eprintln!("{}: left out, {why}", suite.name),
                    None => accuracy::run(suite, *seeds, out)?,
                }
            }
            Ok(())
        }
        Command::Perception {
            card,
            seed,
            drives,
            drive_km,
            noise,
            out,
        } => perception::run(&perception::Wanted {
            card,
            seeds: seed,
            drives: *drives,
            drive_km: *drive_km,
            noise,
            out,
        }),
        Command::Placed { store, logs, out } => placed::write(store, logs, out),
        Command::Reading { logs, turns } => reading::reading(logs, *turns),
        Command::ManyRows { folder, rows } => many_rows::make(folder, *rows),
        Command::Throughput(wanted) => throughput::throughput(wanted),
        Command::Counted { store, logs } => {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
            let costs =
                pool.install(|| throughput::costs(store, logs).map_err(|error| error.to_string()))?;
            println!("{}", serde_json::to_string(&costs)?);
            Ok(())
        }
    }
}
