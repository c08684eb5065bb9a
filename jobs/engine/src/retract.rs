//! `retract`: evidence out, as if it had never come in.
//!
//! A chunk leaves if anything it was made from is to be forgotten, context included: what stays in
//! the store knows nothing of it. Where that takes more than was asked for, the report names the
//! logs that bring the rest back.

use std::collections::BTreeSet;
use std::path::Path;

use serde::Serialize;
use tilefold_reducers::{Fold, SensorModel};
use tilefold_schemas::{ChunkId, ChunkRow, EvidenceRow, Ledger, VehicleKey};
use tilefold_store::{Parameters, Snapshot, Store, TileFilter, Transaction};
use tilefold_tiler::map_index::MapIndex;

use crate::calibrate;
use crate::drives::drives;
use crate::error::EngineError;
use crate::meter::Meter;
use crate::progress::Progress;
use crate::update::{Revision, Update, fold_of, read_elements};

/// At most this many names are listed in an error.
const LISTED: usize = 20;

/// What is to be forgotten.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Forget {
    /// A drive by its id; see [`crate::drives`].
    Drive(String),
    /// A vehicle, by the name in its logs or by its key in the store (16 hexadecimal digits).
    Vehicle(String),
    /// What came from a log: its file name, or its path as it was given to `run`.
    Log(String),
    /// What was captured in `[from_ns, to_ns)`, nanoseconds since the Unix epoch.
    Time {
        /// From when on.
        from_ns: i64,
        /// Until when.
        to_ns: i64,
    },
}

/// What a retraction did.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RetractReport {
    /// Version that readers see now.
    pub version: i64,
    /// Chunks that were removed.
    pub chunks: usize,
    /// Their frames.
    pub frames: i64,
    /// Their drives.
    pub drives: Vec<String>,
    /// Tiles that were reduced.
    pub tiles_reduced: usize,
    /// Logs from which some of the chunks also were made: `run` brings back what is theirs alone.
    pub run_again: Vec<String>,
}

/// Removes what is to be forgotten, folds what it touched, and commits a version.
///
/// A fitted sensor model is fitted anew to what remains.
///
/// # Errors
/// There is nothing of the kind, the store cannot be read or written, or another writer was faster.
/// Nothing has changed then.
pub fn retract(
    location: &Path,
    forget: &Forget,
    progress: &dyn Progress,
) -> Result<RetractReport, EngineError> {
    let store = Store::open(location.to_path_buf())?;
    let snapshot = store.snapshot(None)?;
    let tile_level = u32::from(store.properties().tile_level);
    let known: Vec<ChunkRow> = snapshot.read(TileFilter::All)?;
    let gone = select(&known, forget, &store.properties().salt);
    if gone.is_empty() {
        return Err(nothing_like(forget, &known));
    }
    let mut report = describe(&known, &gone, forget);
    let map = MapIndex::new(read_elements(&snapshot, tile_level)?);
    let mut transaction = store.begin_from(snapshot.clone())?;
    let fold = fold_without(&snapshot, &map, &gone, &mut transaction)?;
    let update = Update {
        map: &map,
        tile_level,
        fold: &fold,
        meter: &Meter::default(),
        progress,
    };
    let revision = Revision {
        gone,
        parameters: parameters(forget, &store.properties().salt, &report),
        ..Revision::default()
    };
    let (version, tiles_reduced) = update.commit("retract", transaction, known, revision)?;
    report.version = version;
    report.tiles_reduced = tiles_reduced;
    Ok(report)
}

/// The chunks that were made from something that is to be forgotten.
fn select(known: &[ChunkRow], forget: &Forget, salt: &[u8; 32]) -> BTreeSet<ChunkId> {
    let rows = |is_one: &dyn Fn(&&ChunkRow) -> bool| -> BTreeSet<ChunkId> {
        known.iter().filter(is_one).map(ChunkRow::chunk).collect()
    };
    match forget {
        Forget::Drive(id) => {
            let all = drives(known).into_iter();
            all.filter(|drive| &drive.id == id)
                .flat_map(|drive| drive.chunks)
                .collect()
        }
        Forget::Vehicle(name) => {
            let keys = [Some(VehicleKey::new(salt, name)), key(name)];
            rows(&|row| keys.contains(&Some(VehicleKey(row.vehicle))))
        }
        Forget::Log(name) => rows(&|row| row.log.lines().any(|log| is_named(log, name))),
        Forget::Time { from_ns, to_ns } => {
            rows(&|row| row.given_from_ns < *to_ns && *from_ns <= row.given_to_ns)
        }
    }
}

/// A vehicle's key as it is printed.
fn key(text: &str) -> Option<VehicleKey> {
    let bits = u64::from_str_radix(text, 16).ok()?;
    (text.len() == 16).then_some(VehicleKey(bits.cast_signed()))
}

fn is_named(log: &str, name: &str) -> bool {
    log == name || Path::new(log).file_name() == Some(name.as_ref())
}

fn describe(known: &[ChunkRow], gone: &BTreeSet<ChunkId>, forget: &Forget) -> RetractReport {
    let leaves = |row: &&ChunkRow| gone.contains(&row.chunk());
    let leaving = || known.iter().filter(leaves);
    let drives = drives(known).into_iter();
    let touched = drives.filter(|drive| !drive.chunks.is_disjoint(gone));
    let again: BTreeSet<&str> = leaving().flat_map(|row| innocent(row, forget)).collect();
    RetractReport {
        version: 0,
        chunks: gone.len(),
        frames: leaving().map(|row| i64::from(row.frames)).sum(),
        drives: touched.map(|drive| drive.id).collect(),
        tiles_reduced: 0,
        run_again: again.into_iter().map(str::to_owned).collect(),
    }
}

/// Logs of a chunk that hold more than what is to be forgotten.
fn innocent<'a>(row: &'a ChunkRow, forget: &Forget) -> Vec<&'a str> {
    let logs = row.log.lines();
    match forget {
        Forget::Drive(_) | Forget::Vehicle(_) => Vec::new(),
        Forget::Log(name) => logs.filter(|log| !is_named(log, name)).collect(),
        Forget::Time { from_ns, to_ns } => {
            let is_inside = *from_ns <= row.given_from_ns && row.given_to_ns < *to_ns;
            logs.filter(|_| !is_inside).collect()
        }
    }
}

/// How layers are folded without these chunks.
fn fold_without(
    snapshot: &Snapshot,
    map: &MapIndex,
    gone: &BTreeSet<ChunkId>,
    transaction: &mut Transaction,
) -> Result<Fold, EngineError> {
    let fold = fold_of(snapshot)?;
    if fold.sensor == SensorModel::default() {
        return Ok(fold);
    }
    let rows: Vec<EvidenceRow> = snapshot.read(TileFilter::All)?;
    let ledger = Ledger::of(rows).subtract(gone);
    let sensor = calibrate::fit_to(map.elements(), ledger.rows());
    transaction.overwrite(sensor.to_rows())?;
    Ok(Fold { sensor, ..fold })
}

/// What the commit says. The name of a vehicle is as secret as it was before.
fn parameters(forget: &Forget, salt: &[u8; 32], report: &RetractReport) -> Parameters {
    let (what, which) = match forget {
        Forget::Drive(id) => ("drive", id.clone()),
        Forget::Vehicle(name) => {
            let key = key(name).unwrap_or_else(|| VehicleKey::new(salt, name));
            ("vehicle", key.to_string())
        }
        Forget::Log(name) => ("log", name.clone()),
        Forget::Time { from_ns, to_ns } => ("time_ns", format!("{from_ns}..{to_ns}")),
    };
    Parameters::from([
        (what.to_owned(), which.into()),
        ("chunks".to_owned(), report.chunks.into()),
    ])
}

fn nothing_like(forget: &Forget, known: &[ChunkRow]) -> EngineError {
    let (wanted, there): (String, BTreeSet<String>) = match forget {
        Forget::Drive(id) => (
            format!("the drive `{id}`"),
            drives(known).into_iter().map(|drive| drive.id).collect(),
        ),
        Forget::Vehicle(name) => (
            format!("the vehicle `{name}`"),
            known
                .iter()
                .map(|row| VehicleKey(row.vehicle).to_string())
                .collect(),
        ),
        Forget::Log(name) => (
            format!("the log `{name}`"),
            known
                .iter()
                .flat_map(|row| row.log.lines().map(str::to_owned))
                .collect(),
        ),
        Forget::Time { .. } => (
            "that time".to_owned(),
            drives(known).into_iter().map(|drive| drive.id).collect(),
        ),
    };
    let listed: Vec<&str> = there.iter().take(LISTED).map(String::as_str).collect();
    let more = match there.len().saturating_sub(LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    EngineError::Nothing(match listed.is_empty() {
        true => format!("the store has no evidence at all, and so none of {wanted}"),
        false => format!(
            "the store has no evidence of {wanted}; it has some of {}{more}",
            listed.join(", ")
        ),
    })
}
