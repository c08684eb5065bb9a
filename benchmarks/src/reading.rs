//! What reading a log costs beside what it must cost at least, each the best of some turns on one
//! thread, in processor time: `tilefold-benchmarks reading LOG...`, one JSON object.
//!
//! `memory` copies 256 MiB within memory, `file` reads the files' bytes, `mcap` walks over all
//! messages with the bare crate (chunks are decompressed, nothing is decoded), `tilefold` indexes the
//! logs and reads all messages that a job may want, decoded and checked.

use std::error::Error;
use std::fs;
use std::hint::black_box;
use std::path::PathBuf;

use serde_json::json;
use tilefold_formats::log::{LogIndex, LogReader};

use crate::processor::Moment;

/// Measures, and prints.
pub(crate) fn reading(logs: &[PathBuf], turns: u32) -> Result<(), Box<dyn Error>> {
    let bytes = files(logs)?;
    let source = vec![1_u8; 256 << 20];
    let mut target = vec![0_u8; source.len()];
    let mut best = [f64::INFINITY; 4];
    let (mut walked, mut decoded) = (0, 0);
    for _ in 0..turns {
        let seconds = [
            time(|| {
                black_box(&mut target).copy_from_slice(black_box(&source));
                Ok(())
            })?,
            time(|| files(logs).map(|_| ()))?,
            time(|| sum(logs, walk).map(|count| walked = count))?,
            time(|| sum(logs, read).map(|count| decoded = count))?,
        ];
        best = std::array::from_fn(|which| best[which].min(seconds[which]));
    }
    let megabytes = bytes as f64 * 1e-6;
    let figures = json!({
        "logs": logs.len(),
        "bytes": bytes,
        "memory_copied_mb_s": source.len() as f64 * 1e-6 / best[0],
        "file_mb_s": megabytes / best[1],
        "mcap": { "messages": walked, "mb_s": megabytes / best[2], "messages_s": walked as f64 / best[2] },
        "tilefold": { "messages": decoded, "mb_s": megabytes / best[3], "messages_s": decoded as f64 / best[3] },
        "tilefold_of_mcap": best[2] / best[3],
    });
    println!("{figures:#}");
    Ok(())
}

fn files(logs: &[PathBuf]) -> Result<u64, Box<dyn Error>> {
    sum(logs, |log| Ok(black_box(fs::read(log)?).len() as u64))
}

fn sum(
    logs: &[PathBuf],
    of: impl Fn(&PathBuf) -> Result<u64, Box<dyn Error>>,
) -> Result<u64, Box<dyn Error>> {
    logs.iter().map(of).sum()
}

fn time(work: impl FnOnce() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let started = Moment::now();
    work()?;
    Ok(started.elapsed_s())
}

/// All messages with the bare crate; what they hold is not looked at.
fn walk(log: &PathBuf) -> Result<u64, Box<dyn Error>> {
    let bytes = fs::read(log)?;
    let mut count = 0;
    for message in mcap::MessageStream::new(&bytes)? {
        black_box(message?.data.len());
        count += 1;
    }
    Ok(count)
}

fn read(log: &PathBuf) -> Result<u64, Box<dyn Error>> {
    let index = LogIndex::open(log)?;
    let mut count = 0;
    let mut sink = |message| {
        black_box(&message);
        count += 1;
    };
    LogReader::new().read(&index, |_, _| true, i64::MIN..i64::MAX, &mut sink)?;
    Ok(count)
}
