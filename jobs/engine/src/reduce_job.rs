//! The reduce stage of a job: tiles on rayon, in key order; then what crosses their borders.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use tilefold_reducers::moved::{self, Gone};
use tilefold_reducers::{Fold, TileInput, area_candidates, candidates, reduce_tile, stale};
use tilefold_schemas::{
    ChangeRecord, ElementKind, EvidenceRow, Footprint, LayerHeader, Ledger, Sighting, TileId,
    Verdict, wkb,
};
use tilefold_store::digest_rows;
use tilefold_tiler::map_index::{MapIndex, MappedElement, bounds};

use crate::error::EngineError;
use crate::meter::{Meter, Stage};
use crate::progress::Progress;

/// New paint lies at most this far beside a line that was moved, in degrees (about 4 m).
const BESIDE_DEG: f64 = 4e-5;

/// A tile's change records under their header.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Header.
    pub header: LayerHeader,
    /// Records.
    pub records: Vec<ChangeRecord>,
}

/// What is folded, and how.
#[derive(Clone, Copy)]
pub struct Reduce<'a> {
    /// The base map.
    pub map: &'a MapIndex,
    /// Level of the tiles.
    pub tile_level: u32,
    /// All sightings.
    pub sightings: &'a [Sighting],
    /// All footprints.
    pub footprints: &'a [Footprint],
    /// How.
    pub fold: &'a Fold,
    /// Counts what is done.
    pub meter: &'a Meter,
    /// Hears of it.
    pub progress: &'a dyn Progress,
}

impl Reduce<'_> {
    /// The layers of `tiles`, and of all others on which a sighting can have an effect; `rows_of`
    /// gives the ledger rows of tiles.
    ///
    /// # Errors
    /// Rows cannot be read, or not be encoded for their digest.
    pub fn layers(
        &self,
        tiles: &BTreeSet<TileId>,
        mut rows_of: impl FnMut(&BTreeSet<TileId>) -> Result<Ledger<EvidenceRow>, EngineError>,
    ) -> Result<Vec<Layer>, EngineError> {
        let mut tiles: BTreeSet<TileId> = tiles
            .union(&self.tiles_beside(self.sightings))
            .copied()
            .collect();
        self.progress.begin(Stage::Reduce, tiles.len() as u64);
        let mut rows = self.by_tile(rows_of(&tiles)?);
        let mut records = self.elements(&tiles, &rows);
        let mut additions = self
            .meter
            .time(Stage::Reduce, || self.additions(&Gone::of(&records)));
        moved::link(&mut records, &mut additions);
        let owners = additions.iter().map(|record| TileId(record.tile));
        let others: BTreeSet<TileId> = owners.filter(|tile| !tiles.contains(tile)).collect();
        let rows_of_others = self.by_tile(rows_of(&others)?);
        records.extend(self.elements(&others, &rows_of_others));
        records.extend(additions);
        rows.extend(rows_of_others);
        tiles.extend(others);
        let layers = self.under_headers(&tiles, records, rows);
        self.progress.end(Stage::Reduce);
        layers
    }

    /// Rows that count, by tile.
    fn by_tile(&self, ledger: Ledger<EvidenceRow>) -> BTreeMap<TileId, Vec<EvidenceRow>> {
        let mut by_tile: BTreeMap<TileId, Vec<EvidenceRow>> = BTreeMap::new();
        let rows = ledger.into_rows().into_iter();
        for row in rows.filter(|row| self.fold.counts(row.first_ns)) {
            by_tile.entry(TileId(row.tile)).or_default().push(row);
        }
        by_tile
    }

    /// Owners of the lines that lie beside a sighting: what is new there may be such a line, moved.
    pub(crate) fn tiles_beside(&self, sightings: &[Sighting]) -> BTreeSet<TileId> {
        let lines = sightings
            .iter()
            .filter(|sighting| sighting.kind == ElementKind::LaneMarking.code());
        let mut tiles = BTreeSet::new();
        for geometry in lines.filter_map(|sighting| wkb::read(&sighting.geometry).ok()) {
            let (low, high) = bounds(&geometry.points);
            let around = self.map.within(
                low.map(|value| value - BESIDE_DEG),
                high.map(|value| value + BESIDE_DEG),
            );
            tiles.extend(around.into_iter().map(|mapped| mapped.tile));
        }
        tiles
    }

    /// Change records of the tiles' elements, by tile.
    fn elements(
        &self,
        tiles: &BTreeSet<TileId>,
        rows: &BTreeMap<TileId, Vec<EvidenceRow>>,
    ) -> Vec<ChangeRecord> {
        let mut inputs: BTreeMap<TileId, TileInput<'_>> = tiles
            .iter()
            .map(|&tile| (tile, TileInput::default()))
            .collect();
        for element in self.map.elements() {
            if let Some(input) = inputs.get_mut(&element.tile) {
                input.elements.push(element);
            }
        }
        for (tile, rows) in rows {
            if let Some(input) = inputs.get_mut(tile) {
                input.rows = rows.iter().collect();
            }
        }
        let reduced = inputs.into_par_iter().map(|(_, input)| {
            let records = self
                .meter
                .time(Stage::Reduce, || reduce_tile(&input, self.fold));
            self.meter.count(Stage::Reduce, 1, 0);
            self.progress.advance(Stage::Reduce, 1, 0);
            records
        });
        reduced.collect::<Vec<_>>().into_iter().flatten().collect()
    }

    /// All additions in the evidence, judged where they lie, whatever tiles they cross.
    fn additions(&self, gone: &Gone) -> Vec<ChangeRecord> {
        let (map, level, fold) = (self.map, self.tile_level, self.fold);
        let seen = self
            .sightings
            .iter()
            .filter(|seen| fold.counts(seen.first_ns));
        let looks = self
            .footprints
            .iter()
            .filter(|look| fold.counts(look.stamp_ns));
        let (seen, looks): (Vec<_>, Vec<_>) = (seen.cloned().collect(), looks.cloned().collect());
        let mut additions = candidates::judge(&seen, &looks, map, gone, level, fold);
        additions.extend(area_candidates::judge(&seen, &looks, map, level, fold));
        additions
    }

    fn under_headers(
        &self,
        tiles: &BTreeSet<TileId>,
        records: Vec<ChangeRecord>,
        mut rows: BTreeMap<TileId, Vec<EvidenceRow>>,
    ) -> Result<Vec<Layer>, EngineError> {
        let mut by_tile: BTreeMap<TileId, Vec<ChangeRecord>> =
            tiles.iter().map(|&tile| (tile, Vec::new())).collect();
        for record in records {
            by_tile.entry(TileId(record.tile)).or_default().push(record);
        }
        let layer = |(tile, mut records): (TileId, Vec<ChangeRecord>)| {
            let rows = rows.remove(&tile).unwrap_or_default();
            stale::mark(&mut records, self.as_of_ns(&rows));
            let header = self.header(tile, &records, rows)?;
            Ok(Layer { header, records })
        };
        by_tile.into_iter().map(layer).collect()
    }

    /// The time that a tile's layer is as of: where none was asked for, that of its last evidence.
    fn as_of_ns(&self, rows: &[EvidenceRow]) -> i64 {
        let last_ns = rows.iter().map(|row| row.last_ns).max();
        self.fold.as_of_ns.or(last_ns).unwrap_or(0)
    }

    fn header(
        &self,
        tile: TileId,
        records: &[ChangeRecord],
        rows: Vec<EvidenceRow>,
    ) -> Result<LayerHeader, EngineError> {
        let as_of_ns = self.as_of_ns(&rows);
        let count = |verdict: Verdict| {
            let of = records.iter().filter(|r| r.verdict == verdict.code());
            of.count() as i32
        };
        Ok(LayerHeader {
            tile: tile.0,
            digest: digest_rows(records.to_vec())?,
            evidence_digest: Ledger::of(rows).digest(),
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
