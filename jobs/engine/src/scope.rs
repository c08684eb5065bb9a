//! What a change of the ledger can have an effect on: which candidates are judged again, and which
//! tiles' layers are made anew. Everything else keeps its rows and bytes.
//!
//! A verdict on an element depends on the rows of its tile. A candidate depends on the sightings of
//! its group, on who looked there, and on lines that are gone beside it. A line that is gone and a
//! candidate beside it may be one line that was moved, and each of them may have to choose: so
//! candidates and gone lines that lie beside each other are worked on together, as far as that goes.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_reducers::groups::{Extent, Groups, grown};
use tilefold_reducers::moved::{self, Gone};
use tilefold_reducers::{area_candidates, candidates};
use tilefold_schemas::{
    ChangeRecord, ElementKind, EvidenceRow, Footprint, LayerHeader, Ledger, Sighting, TileId,
    Verdict, wkb,
};
use tilefold_tiler::map_index::{MappedElement, bounds};
use tilefold_tiler::tile::{self, Bounds};

use crate::error::EngineError;
use crate::meter::Stage;
use crate::reduce_job::{Judged, Reduce};
use crate::split;

/// A candidate, and whatever mapped line it is weighed against, lies within this of a sighting that it
/// is made from, in metres: it is followed over gaps of 12 m.
const FOLLOWED_M: f64 = 20.0;
/// A look, and whatever it says about, lie within this of each other, in metres: nobody is trusted
/// farther than 40 m.
const LOOKED_M: f64 = 60.0;

/// A change of the ledger.
#[derive(Debug, Clone, Default)]
pub struct Change {
    /// Tiles whose rows or elements change.
    pub tiles: BTreeSet<TileId>,
    /// Where sightings come or leave.
    pub sighted: Vec<Extent>,
    /// Where looks come or leave.
    pub looked: Vec<Extent>,
    /// Tiles that had claims of their own: additions, or verdicts that are stale by now.
    pub had_added: BTreeSet<TileId>,
    /// Tiles that had a layer.
    pub had_layer: BTreeSet<TileId>,
    /// Whether all of it is to be folded anew, wherever it lies.
    pub is_all: bool,
}

impl Change {
    /// Everything, in these tiles and all others.
    #[must_use]
    pub fn all(tiles: BTreeSet<TileId>) -> Self {
        Self {
            tiles,
            is_all: true,
            ..Self::default()
        }
    }

    /// Adds sightings that come or leave.
    pub fn sightings(&mut self, sightings: &[Sighting]) {
        let read = sightings
            .iter()
            .filter_map(|one| wkb::read(&one.geometry).ok());
        self.sighted
            .extend(read.map(|geometry| bounds(&geometry.points)));
    }

    /// Adds looks that come or leave.
    pub fn footprints(&mut self, footprints: &[Footprint]) {
        let places = footprints.iter().map(|look| {
            let at = look.place_deg();
            (at, at)
        });
        self.looked.extend(places);
    }

    /// Adds the layers that there were.
    pub fn layers(&mut self, headers: &[LayerHeader]) {
        let had = headers
            .iter()
            .filter(|header| header.added > 0 || header.stale > 0);
        self.had_added.extend(had.map(|header| TileId(header.tile)));
        self.had_layer
            .extend(headers.iter().map(|header| TileId(header.tile)));
    }

    /// Where something comes or leaves, with a margin.
    pub(crate) fn places(&self) -> Vec<Extent> {
        let all = self.sighted.iter().chain(&self.looked);
        all.map(|&place| grown(place, LOOKED_M)).collect()
    }
}

/// Records of the tiles that a change has an effect on.
pub(crate) struct Refolded {
    /// The tiles.
    pub(crate) tiles: BTreeSet<TileId>,
    /// Their records, and some of others.
    pub(crate) records: Vec<ChangeRecord>,
    /// Their rows that count, and some of others.
    pub(crate) rows: BTreeMap<TileId, Vec<EvidenceRow>>,
    /// Where sightings and looks were asked for.
    pub(crate) asked: Vec<Extent>,
}

/// Element in the order of a version's records.
type Key = (TileId, i64, i64);

fn key(mapped: &MappedElement) -> Key {
    (mapped.tile, mapped.element.id.0, mapped.content.0)
}

/// The work on a change, as far as it has come.
pub(crate) struct Scope<'a, F> {
    reduce: &'a Reduce<'a>,
    rows_of: F,
    by_tile: BTreeMap<TileId, Vec<&'a MappedElement>>,
    lines: Groups<'a>,
    areas: Groups<'a>,
    rows: BTreeMap<TileId, Vec<EvidenceRow>>,
    records: BTreeMap<Key, Vec<ChangeRecord>>,
    judged: Option<&'a Judged>,
    asked: Vec<Extent>,
}

impl<'a, F> Scope<'a, F>
where
    F: FnMut(&BTreeSet<TileId>) -> Result<Ledger<EvidenceRow>, EngineError>,
{
    pub(crate) fn new(reduce: &'a Reduce<'a>, rows_of: F) -> Self {
        let mut by_tile: BTreeMap<TileId, Vec<&MappedElement>> = BTreeMap::new();
        for element in reduce.map.elements() {
            by_tile.entry(element.tile).or_default().push(element);
        }
        let seen = || {
            let all = reduce.sightings.iter();
            all.filter(|seen| reduce.fold.counts(seen.first_ns()))
        };
        let (lines, areas) = reduce.meter.time(Stage::Reduce, || {
            (Groups::of_lines(seen()), Groups::of_areas(seen()))
        });
        Self {
            reduce,
            rows_of,
            by_tile,
            lines,
            areas,
            rows: BTreeMap::new(),
            records: BTreeMap::new(),
            judged: None,
            asked: Vec::new(),
        }
    }

    /// Takes over what was judged elsewhere: of these tiles no rows are asked for.
    pub(crate) fn taking(mut self, judged: &'a Judged) -> Self {
        let tiles = judged.tiles.keys();
        let elements = tiles.filter_map(|tile| self.by_tile.get(tile)).flatten();
        let keys = elements.map(|mapped| (key(mapped), Vec::new()));
        self.records.extend(keys);
        for record in &judged.records {
            self.keep(record.clone());
        }
        self.judged = Some(judged);
        self
    }

    fn keep(&mut self, record: ChangeRecord) {
        let of = (
            TileId(record.tile),
            record.element.unwrap_or(0),
            record.content,
        );
        self.records.entry(of).or_default().push(record);
    }

    /// Judges again what the change has an effect on.
    pub(crate) fn refold(mut self, change: &Change) -> Result<Refolded, EngineError> {
        let mut tiles = change.tiles.clone();
        if change.is_all {
            tiles.extend(self.by_tile.keys());
            tiles.extend(&change.had_layer);
        }
        self.judge_tiles(&tiles)?;
        let mut places = change.places();
        places.extend(self.lines_of(&tiles));
        let lines = match change.is_all {
            true => self.lines.numbers(),
            false => BTreeSet::new(),
        };
        let touched = self.beside(lines, &places, &change.sighted)?;
        let areas = match change.is_all {
            true => self.areas.numbers(),
            false => self.areas_meeting(&places),
        };
        let mut additions = Additions {
            lines: self.new_lines(&touched.lines),
            areas: self.new_areas(&areas),
        };
        tiles.extend(touched.gone.iter().map(|&(tile, _, _)| tile));
        tiles.extend(additions.tiles());
        tiles.extend(self.had_added_at(change, &touched.lines, &areas));
        self.judge_tiles(&tiles)?;

        // What else lies in these tiles is what it was, but must be known to be written again.
        let mut around = borders(&tiles);
        around.extend(self.gone_in(&tiles));
        let others = self.beside(touched.lines.clone(), &around, &[])?;
        let more: BTreeSet<usize> = others.lines.difference(&touched.lines).copied().collect();
        additions.lines.extend(self.new_lines(&more));
        let more = self.areas_meeting(&around);
        let more: BTreeSet<usize> = more.difference(&areas).copied().collect();
        additions.areas.extend(self.new_areas(&more));

        let mut records: Vec<ChangeRecord> = self.records.into_values().flatten().collect();
        let mut additions = additions.in_order();
        let meter = self.reduce.meter;
        meter.time(Stage::Reduce, || moved::link(&mut records, &mut additions));
        records.extend(additions);
        Ok(Refolded {
            tiles,
            records,
            rows: self.rows,
            asked: self.asked,
        })
    }

    fn areas_meeting(&mut self, places: &[Extent]) -> BTreeSet<usize> {
        let found = self.areas.meeting(places);
        ask(&mut self.asked, places, &self.areas, &found);
        found
    }

    fn lines_meeting(&mut self, places: &[Extent]) -> BTreeSet<usize> {
        let found = self.lines.meeting(places);
        ask(&mut self.asked, places, &self.lines, &found);
        found
    }

    /// Lines that were sighted where `places` are, or in `lines`, with all that they and the lines gone
    /// beside them have to do with; lines gone beside `left` are of these, too.
    fn beside(
        &mut self,
        lines: BTreeSet<usize>,
        places: &[Extent],
        left: &[Extent],
    ) -> Result<Beside, EngineError> {
        let mut found = Beside {
            lines,
            gone: BTreeSet::new(),
        };
        let mut new = self.lines_meeting(places);
        new.extend(&found.lines);
        let mut looked_at: Vec<Extent> = left.to_vec();
        while !new.is_empty() || !looked_at.is_empty() {
            looked_at.extend(new.iter().map(|&number| self.lines.extent(number)));
            found.lines.extend(&new);
            let gone = self.gone_around(&looked_at)?;
            let gone: Vec<Key> = gone.difference(&found.gone).copied().collect();
            found.gone.extend(&gone);
            let places: Vec<Extent> = gone.iter().flat_map(|key| self.stretches(key)).collect();
            let met = self.lines_meeting(&places);
            new = met.difference(&found.lines).copied().collect();
            looked_at.clear();
        }
        Ok(found)
    }

    /// Mapped lines around places that are gone, or in part.
    fn gone_around(&mut self, places: &[Extent]) -> Result<BTreeSet<Key>, EngineError> {
        let map = self.reduce.map;
        let mut lines: BTreeMap<Key, &MappedElement> = BTreeMap::new();
        for &place in places {
            let (low, high) = grown(place, FOLLOWED_M);
            let near = map.within(low, high).into_iter();
            let near = near.filter(|mapped| mapped.element.kind == ElementKind::LaneMarking);
            lines.extend(near.map(|mapped| (key(mapped), mapped)));
        }
        self.judge(lines.values().copied())?;
        let is_gone = |record: &ChangeRecord| record.verdict == Verdict::Removed.code();
        let records = |key: &Key| self.records.get(key).into_iter().flatten();
        let gone = lines.into_keys().filter(|key| records(key).any(is_gone));
        Ok(gone.collect())
    }

    /// Where an element is gone, with a margin.
    fn stretches(&self, key: &Key) -> Vec<Extent> {
        let records = self.records.get(key).into_iter().flatten();
        let gone = records.filter(|record| record.verdict == Verdict::Removed.code());
        let old = gone.filter_map(|record| wkb::read(record.geometry_old.as_deref()?).ok());
        old.map(|geometry| grown(bounds(&geometry.points), FOLLOWED_M))
            .collect()
    }

    fn gone_in(&self, tiles: &BTreeSet<TileId>) -> Vec<Extent> {
        let keys = self
            .records
            .keys()
            .filter(|(tile, _, _)| tiles.contains(tile));
        keys.flat_map(|key| self.stretches(key)).collect()
    }

    /// Where the lines of tiles are, with a margin.
    fn lines_of(&self, tiles: &BTreeSet<TileId>) -> Vec<Extent> {
        let elements = tiles
            .iter()
            .filter_map(|tile| self.by_tile.get(tile))
            .flatten();
        elements
            .filter(|mapped| mapped.element.kind == ElementKind::LaneMarking)
            .map(|mapped| grown(bounds(&mapped.element.points), FOLLOWED_M))
            .collect()
    }

    /// Tiles with additions of their own, beside what was sighted and what was before.
    fn had_added_at(
        &self,
        change: &Change,
        lines: &BTreeSet<usize>,
        areas: &BTreeSet<usize>,
    ) -> BTreeSet<TileId> {
        let lines = lines.iter().map(|&number| self.lines.extent(number));
        let areas = areas.iter().map(|&number| self.areas.extent(number));
        let places = lines.chain(areas).chain(change.sighted.iter().copied());
        let level = self.reduce.tile_level;
        let tiles = places.flat_map(|place| tiles_of(grown(place, FOLLOWED_M), level));
        tiles
            .filter(|tile| change.had_added.contains(tile))
            .collect()
    }

    /// Judges all elements of tiles.
    fn judge_tiles(&mut self, tiles: &BTreeSet<TileId>) -> Result<(), EngineError> {
        let elements = tiles.iter().filter_map(|tile| self.by_tile.get(tile));
        let elements: Vec<&MappedElement> = elements.flatten().copied().collect();
        self.load(tiles)?;
        self.judge(elements.into_iter())
    }

    /// Judges elements that are not judged yet.
    fn judge<'e>(
        &mut self,
        elements: impl Iterator<Item = &'e MappedElement>,
    ) -> Result<(), EngineError> {
        let mut wanted: BTreeMap<TileId, Vec<&MappedElement>> = BTreeMap::new();
        for mapped in elements.filter(|mapped| !self.records.contains_key(&key(mapped))) {
            wanted.entry(mapped.tile).or_default().push(mapped);
        }
        self.load(&wanted.keys().copied().collect())?;
        let Reduce { meter, fold, .. } = *self.reduce;
        let keys = wanted
            .values()
            .flatten()
            .map(|mapped| (key(mapped), Vec::new()));
        self.records.extend(keys);
        let pieces = wanted.into_iter().flat_map(|(tile, elements)| {
            let rows = self.rows.get(&tile).map_or(&[][..], Vec::as_slice);
            split::pieces(elements, rows)
        });
        for record in split::judge(pieces.collect(), fold, meter) {
            self.keep(record);
        }
        Ok(())
    }

    /// Reads the rows of tiles that are not at hand yet.
    fn load(&mut self, tiles: &BTreeSet<TileId>) -> Result<(), EngineError> {
        let is_judged = |tile| {
            let judged = self.judged;
            judged.is_some_and(|judged| judged.tiles.contains_key(tile))
        };
        let missing = tiles.iter().filter(|tile| !self.rows.contains_key(tile));
        let missing: BTreeSet<TileId> = missing.filter(|tile| !is_judged(tile)).copied().collect();
        if missing.is_empty() {
            return Ok(());
        }
        let rows = (self.rows_of)(&missing)?.into_rows().into_iter();
        self.rows
            .extend(missing.into_iter().map(|tile| (tile, Vec::new())));
        for row in rows.filter(|row| self.reduce.fold.counts(row.first_ns())) {
            self.rows.entry(TileId(row.tile)).or_default().push(row);
        }
        Ok(())
    }

    fn new_lines(&self, numbers: &BTreeSet<usize>) -> Vec<ChangeRecord> {
        let reduce = self.reduce;
        let seen = clones(&self.lines, numbers);
        let looks = self.looks_around(&self.lines, numbers);
        let gone = Gone::of(self.records.values().flatten());
        reduce.meter.time(Stage::Reduce, || {
            candidates::judge(
                &seen,
                &looks,
                reduce.map,
                &gone,
                reduce.tile_level,
                reduce.fold,
            )
        })
    }

    fn new_areas(&self, numbers: &BTreeSet<usize>) -> Vec<ChangeRecord> {
        let reduce = self.reduce;
        let seen = clones(&self.areas, numbers);
        let looks = self.looks_around(&self.areas, numbers);
        reduce.meter.time(Stage::Reduce, || {
            area_candidates::judge(&seen, &looks, reduce.map, reduce.tile_level, reduce.fold)
        })
    }

    /// The footprints of all tiles around sightings.
    fn looks_around(&self, groups: &Groups<'_>, numbers: &BTreeSet<usize>) -> Vec<Footprint> {
        let extents = numbers.iter().map(|&number| groups.extent(number));
        let level = self.reduce.tile_level;
        let tiles = extents.flat_map(|extent| tiles_of(grown(extent, LOOKED_M), level));
        let tiles: BTreeSet<TileId> = tiles.collect();
        let looks = self.reduce.footprints.iter();
        looks
            .filter(|look| self.reduce.fold.counts(look.at_ns()))
            .filter(|look| tiles.contains(&TileId(look.tile)))
            .cloned()
            .collect()
    }
}

/// Sightings of lines, and lines gone beside them.
struct Beside {
    lines: BTreeSet<usize>,
    gone: BTreeSet<Key>,
}

/// Additions of a change.
struct Additions {
    lines: Vec<ChangeRecord>,
    areas: Vec<ChangeRecord>,
}

impl Additions {
    fn tiles(&self) -> impl Iterator<Item = TileId> + '_ {
        let all = self.lines.iter().chain(&self.areas);
        all.map(|record| TileId(record.tile))
    }

    /// In the order in which they are made from all sightings at once.
    fn in_order(mut self) -> Vec<ChangeRecord> {
        self.lines
            .sort_by_key(|record| (record.tile, record.change));
        self.areas
            .sort_by_key(|record| (record.tile, record.change));
        self.lines.extend(self.areas);
        self.lines
    }
}

/// Whoever asks for groups at `places` asks for all sightings there, for whatever touches those that are
/// found, and for all looks around them.
fn ask(asked: &mut Vec<Extent>, places: &[Extent], groups: &Groups<'_>, found: &BTreeSet<usize>) {
    asked.extend(places);
    let found = found.iter();
    asked.extend(found.map(|&number| grown(groups.extent(number), LOOKED_M)));
}

fn clones(groups: &Groups<'_>, numbers: &BTreeSet<usize>) -> Vec<Sighting> {
    let numbers = numbers.iter();
    numbers
        .map(|&number| groups.sighting(number).clone())
        .collect()
}

fn tiles_of((low, high): Extent, level: u32) -> Vec<TileId> {
    let bounds = Bounds {
        west_deg: low[0],
        south_deg: low[1],
        east_deg: high[0],
        north_deg: high[1],
    };
    tile::tiles_in_bbox(&bounds, level).unwrap_or_default()
}

/// A tile with a margin in which candidates that it owns may have been sighted.
fn border(tile: TileId) -> Option<Extent> {
    let bounds = tile::bounds(tile).ok()?;
    let corners = (
        [bounds.west_deg, bounds.south_deg],
        [bounds.east_deg, bounds.north_deg],
    );
    Some(grown(corners, FOLLOWED_M))
}

fn borders(tiles: &BTreeSet<TileId>) -> Vec<Extent> {
    tiles.iter().filter_map(|&tile| border(tile)).collect()
}
