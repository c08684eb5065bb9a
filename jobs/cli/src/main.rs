//! The command line: flags in, reports out. It owns no algorithm.

#[macro_use]
mod report;

mod args;
mod at;
mod bench;
mod calibration;
mod command;
mod compare;
mod demo;
mod detect;
mod evaluation;
mod explanation;
mod export;
mod inspect;
mod logging;
mod manual;
mod metrics;
mod progress;
mod rebase;
mod reference;
mod regions;
mod retract;
mod review;
mod simulate;
mod table;
mod vacuum;

use std::process::ExitCode;

use crate::args::Args;
use crate::report::Outcome;

/// Done, but something was set aside.
const EXIT_SET_ASIDE: u8 = 3;
/// Verify or compare differs.
const EXIT_DIFFERS: u8 = 4;

fn main() -> ExitCode {
    let args = Args::parse_checked();
    logging::start(args.log_level, args.log_form);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads)
        .build_global();
    if let Err(error) = pool {
        tell!("error: cannot start {} threads: {error}", args.threads);
        return ExitCode::FAILURE;
    }
    match command::dispatch(&args) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::SetAside) => ExitCode::from(EXIT_SET_ASIDE),
        Ok(Outcome::Wrong) => ExitCode::FAILURE,
        Ok(Outcome::Differs) => ExitCode::from(EXIT_DIFFERS),
        Err(error) if report::is_reader_gone(error.as_ref()) => ExitCode::SUCCESS,
        Err(error) => {
            report::print_error(&args, error.as_ref());
            ExitCode::FAILURE
        }
    }
}
