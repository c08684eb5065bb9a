//! One reduce task: the ledgers of a group of tiles as they will be, written, and folded.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tilefold_reducers::Fold;
use tilefold_schemas::{
    ChangeRecord, ChunkId, EvidenceRow, Footprint, Ledger, Sighting, Testified, TileId, VehicleKey,
};
use tilefold_store::{Rewritten, Snapshot, TileFilter};
use tilefold_tiler::map_index::MappedElement;

use super::map::Part;
use super::wire;
use super::worker::Worker;
use crate::error::EngineError;
use crate::meter::{Count, Meter, Stage};
use crate::progress::Silent;
use crate::reduce_job::Sum;
use crate::split;
use crate::update::{Exchange, Update};

/// Of each tile the digest of its rows, and when the last of them was seen.
type Sums = BTreeMap<i32, (String, Option<i64>)>;

/// Rows of tiles that stay as they are, as many of which are judged at once.
const ROWS_AT_ONCE: usize = 256 * 1024;

/// A chunk: vehicle, channel, window.
pub(super) type Chunk = (i64, i64, i64);

/// What one reduce task is to do.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reduction {
    /// The group.
    pub group: u32,
    /// The version that the commit will be based on.
    pub version: i64,
    /// Map tasks that have a part for it.
    pub tasks: Vec<usize>,
    /// Tiles whose rows change.
    pub touched: BTreeSet<i32>,
    /// Tiles to judge; the touched ones are among them.
    pub judged: BTreeSet<i32>,
    /// Chunks whose rows leave the store.
    pub leaving: BTreeSet<Chunk>,
    /// Chunks that were mapped, but that another writer brought meanwhile.
    pub dropped: BTreeSet<Chunk>,
}

/// What a reduce task made.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Reduced {
    /// What was asked.
    pub reduction: Reduction,
    /// Of each map task, how many rows of evidence, sightings and footprints came.
    pub rows: BTreeMap<usize, [u64; 3]>,
    /// What was done to the data files of evidence, sightings and footprints.
    pub(super) rewritten: [Rewritten; 3],
    /// Of each judged tile, what its header says of its rows: digest and time of the last.
    tiles: Sums,
    /// What was counted of each stage.
    pub counts: Vec<Count>,
    /// What is said of the elements of judged tiles: an Arrow IPC stream of the table `changes`.
    #[serde(skip)]
    pub records: Vec<u8>,
    /// The sightings that came, for what is added: an Arrow IPC stream.
    #[serde(skip)]
    pub sightings: Vec<u8>,
    /// The footprints that came: an Arrow IPC stream.
    #[serde(skip)]
    pub footprints: Vec<u8>,
}

impl Reduced {
    pub(super) fn sums(&self) -> impl Iterator<Item = (TileId, Sum)> + '_ {
        self.tiles.iter().map(|(&tile, (digest, last_ns))| {
            let sum = Sum {
                digest: digest.clone(),
                last_ns: *last_ns,
            };
            (TileId(tile), sum)
        })
    }
}

pub(super) fn chunk(id: &ChunkId) -> Chunk {
    (id.vehicle.0, id.channel, id.window)
}

fn chunk_id(&(vehicle, channel, window): &Chunk) -> ChunkId {
    ChunkId {
        vehicle: VehicleKey(vehicle),
        channel,
        window,
    }
}

fn tiles(tiles: &BTreeSet<i32>) -> BTreeSet<TileId> {
    tiles.iter().copied().map(TileId).collect()
}

impl Worker {
    /// Brings the parts of a group's tiles into the store's data files, and judges the tiles.
    ///
    /// # Errors
    /// The store cannot be read or written, or a part is not what it should be.
    pub fn reduce(
        &self,
        reduction: &Reduction,
        parts: &[(usize, Part)],
    ) -> Result<Reduced, EngineError> {
        let meter = Meter::default();
        let base = self.snapshot.store().snapshot(Some(reduction.version))?;
        let fold = self.fold(&base)?;
        let (touched, judged) = (tiles(&reduction.touched), tiles(&reduction.judged));
        if !self.is_of(reduction.group, &judged) {
            let reason = format!("tiles of another group were given to {}", reduction.group);
            return Err(EngineError::Cluster(reason));
        }
        let came = Came::read(reduction, parts)?;
        let leaving: BTreeSet<ChunkId> = reduction.leaving.iter().map(chunk_id).collect();
        let update = Update {
            map: &self.context.map,
            tile_level: self.context.tile_level,
            fold: &fold,
            meter: &meter,
            progress: &Silent,
        };
        let exchange = Exchange {
            touched: &touched,
            leaving: &leaving,
        };
        let mut transaction = base.store().begin_from(base.clone())?;
        let rows = update.exchange(&mut transaction, &exchange, came.evidence, Some)?;
        update.exchange(&mut transaction, &exchange, came.sightings.clone(), Some)?;
        update.exchange(&mut transaction, &exchange, came.footprints.clone(), Some)?;
        let (mut sums, mut records) = self.judge(by_tile(rows, &fold, &touched), &fold, &meter);
        let others = judged.difference(&touched).copied().collect();
        self.judge_stored(&base, &others, &fold, |tiles| {
            let (more_sums, more_records) = self.judge(tiles, &fold, &meter);
            sums.extend(more_sums);
            records.extend(more_records);
        })?;
        Ok(Reduced {
            reduction: reduction.clone(),
            rows: came.counts,
            rewritten: [
                transaction.rewritten::<EvidenceRow>()?,
                transaction.rewritten::<Sighting>()?,
                transaction.rewritten::<Footprint>()?,
            ],
            tiles: sums,
            counts: meter.counts(),
            records: wire::bytes(records)?,
            sightings: wire::bytes(came.sightings)?,
            footprints: wire::bytes(came.footprints)?,
        })
    }

    /// Hands the rows of tiles that are judged, but stay as they are, to `judge`: some tiles at a time,
    /// so that no more than these are in memory.
    fn judge_stored(
        &self,
        base: &Snapshot,
        tiles: &BTreeSet<TileId>,
        fold: &Fold,
        mut judge: impl FnMut(BTreeMap<TileId, Vec<EvidenceRow>>),
    ) -> Result<(), EngineError> {
        if tiles.is_empty() {
            return Ok(());
        }
        let mut waiting = Waiting::of(tiles);
        base.each(TileFilter::Tiles(tiles), |rows: Vec<EvidenceRow>| {
            let counting = rows.into_iter().filter(|row| fold.counts(row.first_ns()));
            counting.for_each(|row| waiting.add(row));
            if waiting.count > ROWS_AT_ONCE {
                judge(waiting.whole());
            }
        })?;
        judge(waiting.by_tile);
        Ok(())
    }

    fn judge(
        &self,
        by_tile: BTreeMap<TileId, Vec<EvidenceRow>>,
        fold: &Fold,
        meter: &Meter,
    ) -> (Sums, Vec<ChangeRecord>) {
        let mut elements: BTreeMap<TileId, Vec<&MappedElement>> = BTreeMap::new();
        for mapped in self.context.map.elements() {
            if by_tile.contains_key(&mapped.tile) {
                elements.entry(mapped.tile).or_default().push(mapped);
            }
        }
        let pieces = by_tile.iter().flat_map(|(tile, rows)| {
            split::pieces(elements.remove(tile).unwrap_or_default(), rows)
        });
        let records = split::judge(pieces.collect(), fold, meter);
        let sums = by_tile.into_par_iter().map(|(tile, rows)| {
            let sum = meter.time(Stage::Reduce, || Sum::of(rows));
            (tile.0, (sum.digest, sum.last_ns))
        });
        (sums.collect(), records)
    }
}

/// Rows of tiles that count, of each of these tiles.
fn by_tile(
    rows: Ledger<EvidenceRow>,
    fold: &Fold,
    tiles: &BTreeSet<TileId>,
) -> BTreeMap<TileId, Vec<EvidenceRow>> {
    let mut by_tile: BTreeMap<TileId, Vec<EvidenceRow>> =
        tiles.iter().map(|&tile| (tile, Vec::new())).collect();
    let counting = rows.into_rows().into_iter();
    for row in counting.filter(|row| fold.counts(row.first_ns())) {
        by_tile.entry(TileId(row.tile)).or_default().push(row);
    }
    by_tile
}

/// Rows of the store, in the order of their tiles, until enough of them are there.
struct Waiting {
    by_tile: BTreeMap<TileId, Vec<EvidenceRow>>,
    /// The tile of the row that came last: more of it may come.
    last: Option<TileId>,
    count: usize,
}

impl Waiting {
    /// None yet, of these tiles.
    fn of(tiles: &BTreeSet<TileId>) -> Self {
        Self {
            by_tile: tiles.iter().map(|&tile| (tile, Vec::new())).collect(),
            last: None,
            count: 0,
        }
    }

    fn add(&mut self, row: EvidenceRow) {
        let tile = TileId(row.tile);
        self.last = Some(tile);
        self.count += 1;
        self.by_tile.entry(tile).or_default().push(row);
    }

    /// The tiles before the last: all of their rows have come.
    fn whole(&mut self) -> BTreeMap<TileId, Vec<EvidenceRow>> {
        let Some(last) = self.last else {
            return BTreeMap::new();
        };
        let rest = self.by_tile.split_off(&last);
        self.count = rest.get(&last).map_or(0, Vec::len);
        std::mem::replace(&mut self.by_tile, rest)
    }
}

/// The rows of parts.
struct Came {
    evidence: Vec<EvidenceRow>,
    sightings: Vec<Sighting>,
    footprints: Vec<Footprint>,
    counts: BTreeMap<usize, [u64; 3]>,
}

impl Came {
    fn read(reduction: &Reduction, parts: &[(usize, Part)]) -> Result<Self, EngineError> {
        let mut came = Self {
            evidence: Vec::new(),
            sightings: Vec::new(),
            footprints: Vec::new(),
            counts: BTreeMap::new(),
        };
        for (task, part) in parts {
            let counts = [
                add(&mut came.evidence, &part.evidence, reduction)?,
                add(&mut came.sightings, &part.sightings, reduction)?,
                add(&mut came.footprints, &part.footprints, reduction)?,
            ];
            if came.counts.insert(*task, counts).is_some() {
                return Err(EngineError::Cluster(format!(
                    "the part of map task {task} came twice to group {}",
                    reduction.group
                )));
            }
        }
        Ok(came)
    }
}

/// Adds what counts of a part's rows; returns how many came.
fn add<R: Testified>(
    all: &mut Vec<R>,
    bytes: &[u8],
    reduction: &Reduction,
) -> Result<u64, EngineError> {
    let rows: Vec<R> = wire::rows(bytes)?;
    let count = rows.len() as u64;
    let is_dropped = |row: &R| reduction.dropped.contains(&chunk(&row.chunk()));
    all.extend(rows.into_iter().filter(|row| !is_dropped(row)));
    Ok(count)
}
