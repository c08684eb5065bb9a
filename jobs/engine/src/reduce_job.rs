//! The reduce stage of a job: what a change has an effect on is judged again, and put under headers.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_reducers::groups::Extent;
use tilefold_reducers::{Fold, stale};
use tilefold_schemas::{
    ChangeRecord, EvidenceRow, Footprint, LayerHeader, Ledger, Sighting, TileId, Verdict,
};
use tilefold_store::digest_rows;
use tilefold_tiler::map_index::{MapIndex, MappedElement};

use crate::error::EngineError;
use crate::meter::{Meter, Stage};
use crate::progress::Progress;
use crate::scope::{Change, Refolded, Scope};

/// A tile's change records under their header.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Header.
    pub header: LayerHeader,
    /// Records.
    pub records: Vec<ChangeRecord>,
}

/// What a tile's header says of the ledger rows that its layer is made from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sum {
    /// Their digest.
    pub digest: String,
    /// When the last of them was seen, nanoseconds since the Unix epoch; none without rows.
    pub last_ns: Option<i64>,
}

impl Sum {
    /// That of a tile's rows that count.
    #[must_use]
    pub fn of(rows: Vec<EvidenceRow>) -> Self {
        Self {
            last_ns: rows.iter().map(EvidenceRow::last_ns).max(),
            digest: Ledger::of(rows).digest(),
        }
    }
}

/// Tiles whose elements were judged elsewhere, all of them, with all rows of the tile.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Judged {
    /// The tiles.
    pub tiles: BTreeMap<TileId, Sum>,
    /// What was said of their elements.
    pub records: Vec<ChangeRecord>,
}

/// What is folded, and how.
#[derive(Clone, Copy)]
pub struct Reduce<'a> {
    /// The base map.
    pub map: &'a MapIndex,
    /// Level of the tiles.
    pub tile_level: u32,
    /// All sightings, wherever they are asked for.
    pub sightings: &'a [Sighting],
    /// All footprints, wherever they are asked for.
    pub footprints: &'a [Footprint],
    /// How.
    pub fold: &'a Fold,
    /// Counts what is done.
    pub meter: &'a Meter,
    /// Hears of it.
    pub progress: &'a dyn Progress,
}

impl Reduce<'_> {
    /// The layers that a change has an effect on; `rows_of` gives the ledger rows of tiles.
    ///
    /// # Errors
    /// Rows cannot be read, or not be encoded for their digest.
    pub fn layers(
        &self,
        change: &Change,
        rows_of: impl FnMut(&BTreeSet<TileId>) -> Result<Ledger<EvidenceRow>, EngineError>,
    ) -> Result<Vec<Layer>, EngineError> {
        let (layers, _) = self.layers_with(change, &Judged::default(), rows_of)?;
        Ok(layers)
    }

    /// As [`Reduce::layers`], where some tiles were judged elsewhere: `rows_of` is not asked for them.
    /// Also says where sightings and looks were asked for: from those of all these places, and no
    /// others, come the layers.
    ///
    /// # Errors
    /// As [`Reduce::layers`].
    pub fn layers_with(
        &self,
        change: &Change,
        judged: &Judged,
        rows_of: impl FnMut(&BTreeSet<TileId>) -> Result<Ledger<EvidenceRow>, EngineError>,
    ) -> Result<(Vec<Layer>, Vec<Extent>), EngineError> {
        self.progress
            .begin(Stage::Reduce, change.tiles.len() as u64);
        let mut refolded = Scope::new(self, rows_of).taking(judged).refold(change)?;
        let asked = std::mem::take(&mut refolded.asked);
        let count = refolded.tiles.len() as u64;
        self.meter.count(Stage::Reduce, count, 0);
        self.progress.advance(Stage::Reduce, count, 0);
        let layers = self.under_headers(refolded, judged);
        self.progress.end(Stage::Reduce);
        Ok((layers?, asked))
    }

    fn under_headers(
        &self,
        refolded: Refolded,
        judged: &Judged,
    ) -> Result<Vec<Layer>, EngineError> {
        let mut rows = refolded.rows;
        let tiles = refolded.tiles.into_iter();
        let mut by_tile: BTreeMap<TileId, Vec<ChangeRecord>> =
            tiles.map(|tile| (tile, Vec::new())).collect();
        for record in refolded.records {
            if let Some(records) = by_tile.get_mut(&TileId(record.tile)) {
                records.push(record);
            }
        }
        let layer = |(tile, mut records): (TileId, Vec<ChangeRecord>)| {
            let sum = judged.tiles.get(&tile).cloned();
            let sum = sum.unwrap_or_else(|| Sum::of(rows.remove(&tile).unwrap_or_default()));
            stale::mark(&mut records, self.as_of_ns(&sum));
            let header = self.header(tile, &records, sum)?;
            Ok(Layer { header, records })
        };
        by_tile.into_iter().map(layer).collect()
    }

    /// The time that a tile's layer is as of: where none was asked for, that of its last evidence.
    fn as_of_ns(&self, sum: &Sum) -> i64 {
        self.fold.as_of_ns.or(sum.last_ns).unwrap_or(0)
    }

    fn header(
        &self,
        tile: TileId,
        records: &[ChangeRecord],
        sum: Sum,
    ) -> Result<LayerHeader, EngineError> {
        let as_of_ns = self.as_of_ns(&sum);
        let count = |verdict: Verdict| {
            let of = records.iter().filter(|r| r.verdict == verdict.code());
            of.count() as i32
        };
        Ok(LayerHeader {
            tile: tile.0,
            digest: digest_rows(records.to_vec())?,
            evidence_digest: sum.digest,
            fusion_model: self.fold.model.name().to_owned(),
            sensor_model: self.fold.sensor.id(),
            as_of_ns,
            no_change: count(Verdict::NoChange),
            added: count(Verdict::Added),
            removed: count(Verdict::Removed),
            modified: count(Verdict::Modified),
            unknown: count(Verdict::Unknown),
            stale: count(Verdict::Stale),
        })
    }
}

/// All tiles that own an element.
#[must_use]
pub fn owners(elements: &[MappedElement]) -> BTreeSet<TileId> {
    elements.iter().map(|element| element.tile).collect()
}
