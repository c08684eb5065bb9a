//! Sums of evidence by section of an element, over a Parquet file of ledger rows: what
//! `benchmarks/peers/fold.py` asks of DuckDB and Polars too.
//!
//! `fold FILE THREADS` prints seconds, rows, groups and a checksum of all sums as one JSON object.
//! The map's elements are known beforehand, as they are in a job: their index is made from the
//! file first, and timed apart.

use std::fs::File;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::{Int32Type, Int64Type};
use clap::Parser;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder,
};
use tilefold_reducers::sections::SectionIndex;

type Failure = Box<dyn std::error::Error + Send + Sync>;

const KEYS: [&str; 2] = ["element", "section"];
const SUMS: [&str; 5] = [
    "exposed",
    "hit",
    "sum_v_q8",
    "residual_eta_q8",
    "residual_lambda_q8",
];
const BATCH_ROWS: usize = 8192;

/// Sums of one section.
type Sums = [i64; SUMS.len()];

#[derive(Parser)]
struct Asked {
    /// Parquet file of ledger rows.
    file: PathBuf,
    /// Threads.
    #[arg(default_value_t = 2)]
    threads: usize,
}

fn main() -> Result<(), Failure> {
    let asked = Asked::parse();
    let begun = Instant::now();
    let elements = elements(&asked)?;
    let index = SectionIndex::new(elements.iter().copied());
    let index_s = begun.elapsed().as_secs_f64();
    let (begun, begun_cpu_s) = (Instant::now(), processor_s());
    let (sums, rows) = fold(&asked, &index)?;
    let seconds = begun.elapsed().as_secs_f64();
    let processor_seconds = processor_s() - begun_cpu_s;
    let groups = sums.iter().filter(|sums| sums[0] != 0).count();
    let checksum = checksum(&elements, &index, &sums);
    let figures = serde_json::json!({
        "seconds": seconds,
        "processor_seconds": processor_seconds,
        "index_seconds": index_s,
        "rows": rows,
        "groups": groups,
        "checksum": checksum.to_string(),
    });
    println!("{figures}");
    Ok(())
}

/// Processor time of all threads of this process, to a hundredth of a second; 0 where there is no
/// `/proc`.
fn processor_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let behind_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks = behind_name.split_whitespace().skip(11).take(2);
    ticks
        .filter_map(|ticks| ticks.parse::<f64>().ok())
        .sum::<f64>()
        / 100.0
}

/// Elements of the file with their numbers of sections, by id.
fn elements(asked: &Asked) -> Result<Vec<(i64, u32)>, Failure> {
    let parts = each_row_group(
        asked,
        &KEYS,
        Vec::new,
        |batch, found: &mut Vec<(i64, u32)>| {
            let elements = batch.column(0).as_primitive::<Int64Type>().values();
            let sections = batch.column(1).as_primitive::<Int32Type>().values();
            for (&element, &section) in elements.iter().zip(sections) {
                let sections = section.cast_unsigned() + 1;
                match found.last_mut() {
                    Some((last, most)) if *last == element => *most = (*most).max(sections),
                    _ => found.push((element, sections)),
                }
            }
        },
    )?;
    let mut all: Vec<(i64, u32)> = parts.into_iter().flatten().collect();
    all.sort_unstable();
    all.dedup_by(|next, last| {
        let is_same = next.0 == last.0;
        if is_same {
            last.1 = last.1.max(next.1);
        }
        is_same
    });
    Ok(all)
}

/// All sums by place, and the number of rows.
fn fold(asked: &Asked, index: &SectionIndex) -> Result<(Vec<Sums>, usize), Failure> {
    let columns: Vec<&str> = KEYS.iter().chain(&SUMS).copied().collect();
    struct Part {
        sums: Vec<Sums>,
        places: Vec<u32>,
        rows: usize,
    }
    let empty = || Part {
        sums: vec![Sums::default(); index.len()],
        places: Vec::new(),
        rows: 0,
    };
    let parts = each_row_group(asked, &columns, empty, |batch, part| {
        let elements = batch.column(0).as_primitive::<Int64Type>().values();
        let sections = batch.column(1).as_primitive::<Int32Type>().values();
        let narrow = |column: usize| batch.column(column).as_primitive::<Int32Type>().values();
        let wide = |column: usize| batch.column(column).as_primitive::<Int64Type>().values();
        let (exposed, hit) = (narrow(2), narrow(3));
        let (v, eta, lambda) = (wide(4), wide(5), wide(6));
        index.places(elements, sections, &mut part.places);
        for (row, &place) in part.places.iter().enumerate() {
            let sums = &mut part.sums[place as usize];
            sums[0] += i64::from(exposed[row]);
            sums[1] += i64::from(hit[row]);
            sums[2] += v[row];
            sums[3] += eta[row];
            sums[4] += lambda[row];
        }
        part.rows += batch.num_rows();
    })?;
    let mut parts = parts.into_iter();
    let Some(mut whole) = parts.next() else {
        return Ok((Vec::new(), 0));
    };
    for part in parts {
        whole.rows += part.rows;
        for (sums, more) in whole.sums.iter_mut().zip(part.sums) {
            for (sum, value) in sums.iter_mut().zip(more) {
                *sum += value;
            }
        }
    }
    Ok((whole.sums, whole.rows))
}

/// Threads take row groups as they come; integers add up to the same in any order.
fn each_row_group<T: Send>(
    asked: &Asked,
    columns: &[&str],
    empty: impl Fn() -> T + Sync,
    add: impl Fn(&RecordBatch, &mut T) + Sync,
) -> Result<Vec<T>, Failure> {
    let file = File::open(&asked.file)?;
    let metadata = ArrowReaderMetadata::load(&file, Default::default())?;
    let next = AtomicUsize::new(0);
    let work = || -> Result<T, Failure> {
        let mut part = empty();
        loop {
            let group = next.fetch_add(1, Ordering::Relaxed);
            if group >= metadata.metadata().num_row_groups() {
                return Ok(part);
            }
            for batch in reader(asked, &metadata, columns, group)? {
                add(&batch?, &mut part);
            }
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..asked.threads).map(|_| scope.spawn(work)).collect();
        let joined = threads.into_iter().map(|thread| match thread.join() {
            Ok(part) => part,
            Err(_) => Err("a thread failed".into()),
        });
        joined.collect()
    })
}

/// A reader of its own file: threads must not share a position in one.
fn reader(
    asked: &Asked,
    metadata: &ArrowReaderMetadata,
    columns: &[&str],
    group: usize,
) -> Result<ParquetRecordBatchReader, Failure> {
    let file = File::open(&asked.file)?;
    let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(file, metadata.clone());
    let mask = ProjectionMask::columns(builder.parquet_schema(), columns.iter().copied());
    let builder = builder.with_projection(mask).with_row_groups(vec![group]);
    Ok(builder.with_batch_size(BATCH_ROWS).build()?)
}

/// Every sum times what its element leaves over of 1009 and its column's number: as the peers'.
fn checksum(elements: &[(i64, u32)], index: &SectionIndex, sums: &[Sums]) -> i128 {
    let mut total = 0_i128;
    for &(element, sections) in elements {
        let first = index.first(element).unwrap_or(0);
        for place in first..first + sections {
            for (column, sum) in sums[place as usize].iter().enumerate() {
                total += i128::from(*sum) * i128::from(element % 1009) * (column as i128 + 1);
            }
        }
    }
    total
}
