//! What reading a log costs beside what it must cost at least, each the best of some turns on one
//! thread: `cargo run --release -p tilefold-benchmarks --example limits -- LOG...`, one JSON object.
//!
//! `memory` copies 256 MiB within memory, `file` reads the files' bytes, `mcap` walks over all
//! messages with the bare crate (chunks are decompressed, nothing is decoded), `tilefold` indexes the
//! logs and reads all messages that a job may want, decoded and checked. `--turns N` says how often.

use std::fs;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use serde_json::json;
use tilefold_formats::log::{LogIndex, LogReader};

fn main() {
    let mut turns = 5;
    let mut logs: Vec<PathBuf> = Vec::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--turns" => {
                turns = arguments
                    .next()
                    .expect("a number")
                    .parse()
                    .expect("a number")
            }
            log => logs.push(log.into()),
        }
    }
    let files = || -> u64 {
        let sizes = logs
            .iter()
            .map(|log| black_box(fs::read(log).expect("a file")).len());
        sizes.sum::<usize>() as u64
    };
    let bytes = files();
    let source = vec![1_u8; 256 << 20];
    let mut target = vec![0_u8; source.len()];
    let mut best = [f64::INFINITY; 4];
    let (mut walked, mut decoded) = (0, 0);
    for _ in 0..turns {
        let seconds = [
            time(|| black_box(&mut target).copy_from_slice(black_box(&source))),
            time(|| files()),
            time(|| walked = logs.iter().map(walk).sum()),
            time(|| decoded = logs.iter().map(read).sum()),
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
}

fn time<T>(work: impl FnOnce() -> T) -> f64 {
    let started = Instant::now();
    black_box(work());
    started.elapsed().as_secs_f64()
}

/// All messages with the bare crate; what they hold is not looked at.
fn walk(log: &PathBuf) -> u64 {
    let bytes = fs::read(log).expect("a file");
    let messages = mcap::MessageStream::new(&bytes).expect("a log");
    messages
        .map(|message| {
            black_box(message.expect("a message").data.len());
        })
        .count() as u64
}

fn read(log: &PathBuf) -> u64 {
    let index = LogIndex::open(log).expect("a log");
    let mut count = 0;
    LogReader::new()
        .read(&index, |_, _| true, i64::MIN..i64::MAX, &mut |message| {
            black_box(&message);
            count += 1;
        })
        .expect("a readable log");
    count
}
