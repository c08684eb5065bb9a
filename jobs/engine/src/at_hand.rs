//! The sightings and looks of a store that a job has read: the files that lie where it asks, and no
//! others. It asks again until nothing that it asks about is unread (decision 0029).

use std::collections::BTreeSet;
use std::mem;

use tilefold_reducers::groups::Extent;
use tilefold_schemas::{ChunkId, Footprint, Ledger, Sighting, Testified, TileId};
use tilefold_store::{DataFile, Snapshot, StoredTable, TileFilter, coarse};
use tilefold_tiler::tile;

use crate::error::EngineError;

/// Sightings and looks as they will be after a job, as far as they were read.
pub(crate) struct AtHand<'a> {
    base: &'a Snapshot,
    leaving: &'a BTreeSet<ChunkId>,
    pub(crate) sightings: Part<Sighting>,
    pub(crate) footprints: Part<Footprint>,
}

impl<'a> AtHand<'a> {
    /// The new rows, and nothing of the store yet; rows of chunks that leave will not be there.
    pub(crate) fn new(
        base: &'a Snapshot,
        leaving: &'a BTreeSet<ChunkId>,
        sightings: Vec<Sighting>,
        footprints: Vec<Footprint>,
    ) -> Result<Self, EngineError> {
        Ok(Self {
            base,
            leaving,
            sightings: Part::new(base, sightings)?,
            footprints: Part::new(base, footprints)?,
        })
    }

    pub(crate) fn read_all(&mut self) -> Result<(), EngineError> {
        self.read(|_| true).map(drop)
    }

    /// Reads the files that hold rows of tiles.
    pub(crate) fn read_tiles(&mut self, tiles: &BTreeSet<TileId>) -> Result<(), EngineError> {
        let wanted: BTreeSet<TileId> = tiles.iter().map(|&tile| coarse(tile)).collect();
        let holds = |tile| wanted.contains(&coarse(tile));
        self.read(|unread| unread.first_tile().is_some_and(holds))
            .map(drop)
    }

    /// Reads the files that reach into `places`; whether there were any that were not read.
    pub(crate) fn read_at(&mut self, places: &[Extent]) -> Result<bool, EngineError> {
        self.read(|unread| {
            let place = unread.place;
            place.is_none_or(|place| places.iter().any(|&other| meet(place, other)))
        })
    }

    fn read(&mut self, wanted: impl Fn(&Unread) -> bool) -> Result<bool, EngineError> {
        let seen = self.sightings.read(self.base, self.leaving, &wanted)?;
        let looked = self.footprints.read(self.base, self.leaving, &wanted)?;
        Ok(seen || looked)
    }
}

/// A file that was not read.
struct Unread {
    file: DataFile,
    /// Where its rows lie; none if that is not known.
    place: Option<Extent>,
}

impl Unread {
    fn first_tile(&self) -> Option<TileId> {
        self.file.tiles.map(|(first, _)| first)
    }
}

/// One table.
pub(crate) struct Part<R> {
    rows: Ledger<R>,
    vanished: Vec<R>,
    unread: Vec<Unread>,
}

impl<R: Testified + StoredTable> Part<R> {
    fn new(base: &Snapshot, rows: Vec<R>) -> Result<Self, EngineError> {
        let files = base.files::<R>(TileFilter::All)?.into_iter();
        let unread = files.map(|file| Unread {
            place: place::<R>(&file),
            file,
        });
        Ok(Self {
            rows: Ledger::of(rows),
            vanished: Vec::new(),
            unread: unread.collect(),
        })
    }

    /// Rows that were read and stay, and new ones, in canonical order.
    pub(crate) fn rows(&self) -> &[R] {
        self.rows.rows()
    }

    /// Rows that were read and leave.
    pub(crate) fn vanished(&self) -> &[R] {
        &self.vanished
    }

    fn read(
        &mut self,
        base: &Snapshot,
        leaving: &BTreeSet<ChunkId>,
        wanted: impl Fn(&Unread) -> bool,
    ) -> Result<bool, EngineError> {
        let (found, unread): (Vec<Unread>, Vec<Unread>) =
            mem::take(&mut self.unread).into_iter().partition(wanted);
        self.unread = unread;
        if found.is_empty() {
            return Ok(false);
        }
        let files = found.into_iter().map(|unread| unread.file);
        let (vanished, stays): (Vec<R>, Vec<R>) = base
            .read_files(files.collect())?
            .into_iter()
            .partition(|row: &R| leaving.contains(&row.chunk()));
        self.vanished.extend(vanished);
        self.rows = mem::take(&mut self.rows).merge(Ledger::of(stays));
        Ok(true)
    }
}

/// Where a file's rows lie: in the box around their geometries; what has none, in its tile.
fn place<R: StoredTable>(file: &DataFile) -> Option<Extent> {
    if !R::GEOMETRY.is_empty() {
        let [west, south, east, north] = file.bounds_deg()?;
        return Some(([west, south], [east, north]));
    }
    let (first, _) = file.tiles?;
    let bounds = tile::bounds(coarse(first)).ok()?;
    Some((
        [bounds.west_deg, bounds.south_deg],
        [bounds.east_deg, bounds.north_deg],
    ))
}

fn meet((low, high): Extent, (other_low, other_high): Extent) -> bool {
    [0, 1]
        .iter()
        .all(|&axis| low[axis] <= other_high[axis] && other_low[axis] <= high[axis])
}
