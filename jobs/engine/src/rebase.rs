//! `rebase`: a new version of the base map under the evidence that is there.
//!
//! Elements that go on keep their evidence, under their new names; edited ones start anew. What
//! chunks said where the map has changed was said with the old map in hand: these chunks are marked,
//! and mapped again as soon as their logs are given again.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Serialize;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{ChangeRecord, ChunkId, ChunkRow, EvidenceRow, SetAside, Testified, TileId};
use tilefold_store::{Parameters, Snapshot, Store, TileFilter, digest_rows};
use tilefold_tiler::map_index::MapIndex;

use crate::accepted::{Accepted, accepted};
use crate::base_map;
use crate::error::EngineError;
use crate::meter::Meter;
use crate::progress::Progress;
use crate::succession::Succession;
use crate::update::{Rekey, Revision, Update, fold_of};

/// What a rebase did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RebaseReport {
    /// Version that readers see now.
    pub version: i64,
    /// Whether it is a new one.
    pub is_new_version: bool,
    /// Elements of the new map.
    pub elements: usize,
    /// Those with id and content as before.
    pub unchanged: usize,
    /// Those at the same place under another id, or drawn a little otherwise.
    pub same_place: usize,
    /// Those that are new, or edited: they start without evidence.
    pub new: usize,
    /// Elements of the old map that are no more, or edited.
    pub gone: usize,
    /// Ledger rows that left with them.
    pub rows_dropped: usize,
    /// Claims of the version before that the new map confirms.
    pub accepted: Vec<Accepted>,
    /// Chunks that were mapped where the map has changed.
    pub outdated: usize,
    /// Logs of these chunks: `run` maps them anew.
    pub run_again: Vec<String>,
    /// Tiles that were reduced.
    pub tiles_reduced: usize,
    /// Map elements that could not be read.
    pub set_aside: Vec<SetAside>,
}

/// Lays a new base map under the store, folds what it touches, and commits a version.
///
/// # Errors
/// A map cannot be read or has no paint, the store cannot be read or written, or another writer was
/// faster. Nothing has changed then.
pub fn rebase(
    location: &Path,
    maps: &[PathBuf],
    progress: &dyn Progress,
) -> Result<RebaseReport, EngineError> {
    let store = Store::open(location.to_path_buf())?;
    let snapshot = store.snapshot(None)?;
    let tile_level = u32::from(store.properties().tile_level);
    let (new_rows, set_aside) = base_map::read_painted(maps, tile_level)?;
    let old_rows: Vec<ElementRow> = snapshot.read(TileFilter::All)?;
    let mut known: Vec<ChunkRow> = snapshot.read(TileFilter::All)?;
    let change = MapChange::new(old_rows, new_rows, tile_level)?;
    let records: Vec<ChangeRecord> = snapshot.read(TileFilter::All)?;
    let dropped = change.follow(&snapshot, &mut known)?;
    let run_again = change.mark(&mut known);
    let mut report = RebaseReport {
        version: snapshot.version(),
        is_new_version: false,
        elements: change.new_rows.len(),
        unchanged: change.succession.unchanged,
        same_place: change.succession.same_place,
        new: change.new_rows.len() - change.succession.inherited.len(),
        gone: change.old.elements().len() - change.succession.inherited.len(),
        rows_dropped: dropped,
        accepted: change.accepted(&records),
        outdated: known.iter().filter(|row| row.map == 0).count(),
        run_again,
        tiles_reduced: 0,
        set_aside,
    };
    if change.old_rows == change.new_rows {
        return Ok(report);
    }
    let mut transaction = store.begin_from(snapshot.clone())?;
    transaction.overwrite(change.new_rows.clone())?;
    let update = Update {
        map: &change.new,
        tile_level,
        fold: &fold_of(&snapshot)?,
        meter: &Meter::default(),
        progress,
    };
    let revision = Revision {
        rekey: Some(&change.succession),
        also: change.tiles(),
        parameters: change.parameters(&report)?,
        ..Revision::default()
    };
    let (version, tiles_reduced) = update.commit("rebase", transaction, known, revision)?;
    report.is_new_version = version != report.version;
    report.version = version;
    report.tiles_reduced = tiles_reduced;
    Ok(report)
}

/// The two maps, and what of the old one goes on in the new one.
struct MapChange {
    old_rows: Vec<ElementRow>,
    new_rows: Vec<ElementRow>,
    old: MapIndex,
    new: MapIndex,
    succession: Succession,
}

impl MapChange {
    fn new(
        mut old_rows: Vec<ElementRow>,
        mut new_rows: Vec<ElementRow>,
        tile_level: u32,
    ) -> Result<Self, EngineError> {
        old_rows.sort_by_key(|row| row.element);
        new_rows.sort_by_key(|row| row.element);
        let index = |rows: &[ElementRow]| {
            let rows = rows.iter().cloned();
            let elements: Result<Vec<_>, _> = rows
                .map(|row| base_map::from_row(row, tile_level))
                .collect();
            Ok::<_, EngineError>(MapIndex::new(elements?))
        };
        let (old, new) = (index(&old_rows)?, index(&new_rows)?);
        let succession = Succession::of(&old, &new);
        Ok(Self {
            old_rows,
            new_rows,
            old,
            new,
            succession,
        })
    }

    /// Tiles of elements that come, go, or are drawn otherwise, however little.
    fn tiles(&self) -> BTreeSet<TileId> {
        let drawn = |rows: &[ElementRow]| -> BTreeSet<(i64, i64, Vec<u8>, i32)> {
            let key = |row: &ElementRow| (row.element, row.content, row.geometry.clone(), row.tile);
            rows.iter().map(key).collect()
        };
        let (old, new) = (drawn(&self.old_rows), drawn(&self.new_rows));
        let differ = old.symmetric_difference(&new);
        differ.map(|&(_, _, _, tile)| TileId(tile)).collect()
    }

    /// Adds the tiles to which a chunk's rows move; returns how many rows leave.
    fn follow(&self, snapshot: &Snapshot, known: &mut [ChunkRow]) -> Result<usize, EngineError> {
        let tiles = self.tiles();
        let rows: Vec<EvidenceRow> = snapshot.read(TileFilter::Tiles(&tiles))?;
        let mut dropped = 0;
        let mut moved: BTreeMap<ChunkId, BTreeSet<i32>> = BTreeMap::new();
        for row in rows {
            let chunk = Testified::chunk(&row);
            let tile = row.tile;
            match self.succession.rekeyed(row) {
                None => dropped += 1,
                Some(row) if row.tile != tile => {
                    moved.entry(chunk).or_default().insert(row.tile);
                }
                Some(_) => {}
            }
        }
        for row in known {
            if let Some(more) = moved.remove(&row.chunk()) {
                let mut tiles: BTreeSet<i32> = row
                    .tiles
                    .split(',')
                    .filter_map(|tile| tile.parse().ok())
                    .collect();
                tiles.extend(more);
                let tiles: Vec<String> = tiles.iter().map(i32::to_string).collect();
                row.tiles = tiles.join(",");
            }
        }
        Ok(dropped)
    }

    /// Marks the chunks around which the map is another one now; returns the logs of all marked ones.
    fn mark(&self, known: &mut [ChunkRow]) -> Vec<String> {
        let mut logs: BTreeSet<&str> = BTreeSet::new();
        for row in known {
            let (low, high) = ([row.xmin, row.ymin], [row.xmax, row.ymax]);
            if row.map != self.new.digest_within(low, high) {
                row.map = 0;
                logs.extend(row.log.lines());
            }
        }
        logs.into_iter().map(str::to_owned).collect()
    }

    fn accepted(&self, records: &[ChangeRecord]) -> Vec<Accepted> {
        accepted(records, &self.new, &|mapped| {
            !self.succession.inherited.contains(&mapped.element.id)
        })
    }

    fn parameters(&self, report: &RebaseReport) -> Result<Parameters, EngineError> {
        let digest = digest_rows(self.new_rows.clone())?;
        Ok(Parameters::from([
            ("map_digest".to_owned(), digest.into()),
            ("unchanged".to_owned(), report.unchanged.into()),
            ("same_place".to_owned(), report.same_place.into()),
            ("new".to_owned(), report.new.into()),
            ("gone".to_owned(), report.gone.into()),
            ("accepted".to_owned(), report.accepted.len().into()),
            ("outdated".to_owned(), report.outdated.into()),
        ]))
    }
}
