//! From a change of the ledger to a committed version: what `run`, `retract`, `rebase` and
//! `calibrate` have in common.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_reducers::{Fold, FusionModel};
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{ChunkId, ChunkRow, EvidenceRow, LayerHeader, Ledger, Testified, TileId};
use tilefold_store::{Parameters, Snapshot, StoredTable, TileFilter, Transaction};
use tilefold_tiler::map_index::{MapIndex, MappedElement};

use crate::at_hand::AtHand;
use crate::base_map;
use crate::calibrate;
use crate::cluster::Exchanged;
use crate::error::EngineError;
use crate::map_job::Mapped;
use crate::meter::{Meter, Stage};
use crate::progress::Progress;
use crate::reduce_job::{Judged, Layer, Reduce};
use crate::scope::Change;

/// Parameter of a commit: the time that it is as of.
pub(crate) const AS_OF: &str = "as_of_ns";
/// Parameter of a commit: the fusion model.
const FUSION_MODEL: &str = "fusion_model";

/// The base map of a version.
///
/// # Errors
/// The store is damaged.
pub fn read_elements(
    snapshot: &Snapshot,
    tile_level: u32,
) -> Result<Vec<MappedElement>, EngineError> {
    let rows: Vec<ElementRow> = snapshot.read(TileFilter::All)?;
    rows.into_iter()
        .map(|row| base_map::from_row(row, tile_level))
        .collect()
}

/// How a version was folded: jobs that bring no evidence keep to it.
///
/// # Errors
/// The store is damaged.
pub(crate) fn fold_of(snapshot: &Snapshot) -> Result<Fold, EngineError> {
    let parameters = &snapshot.info().parameters;
    let name = parameters
        .get(FUSION_MODEL)
        .and_then(serde_json::Value::as_str);
    let named = FusionModel::ALL
        .into_iter()
        .find(|model| Some(model.name()) == name);
    let as_of_ns = parameters.get(AS_OF).and_then(serde_json::Value::as_i64);
    Ok(Fold {
        as_of_ns,
        ..Fold::of_fleet(
            named.unwrap_or_default(),
            calibrate::sensor_model(snapshot)?,
        )
    })
}

pub(crate) fn tiles_of(row: &ChunkRow) -> impl Iterator<Item = TileId> + '_ {
    let tiles = row.tiles.split(',').filter_map(|tile| tile.parse().ok());
    tiles.map(TileId)
}

/// What becomes of ledger rows when the base map changes.
pub(crate) trait Rekey: Sync {
    /// The row under the new map; none if its element is no more, or no more the same.
    fn rekeyed(&self, row: EvidenceRow) -> Option<EvidenceRow>;
}

/// A change of the ledger.
#[derive(Default)]
pub(crate) struct Revision<'a> {
    /// Chunks that come, or take the place of what they said before.
    pub(crate) mapped: Vec<Mapped>,
    /// Chunks that leave.
    pub(crate) gone: BTreeSet<ChunkId>,
    /// What becomes of the rows that stay; none: nothing.
    pub(crate) rekey: Option<&'a dyn Rekey>,
    /// What was exchanged and judged elsewhere: the rows of `mapped` are not looked at then.
    pub(crate) exchanged: Option<Exchanged>,
    /// Tiles whose elements or rows change for another reason.
    pub(crate) also: BTreeSet<TileId>,
    /// What the commit says beside how it was folded.
    pub(crate) parameters: Parameters,
}

impl Revision<'_> {
    fn is_empty(&self) -> bool {
        self.mapped.is_empty() && self.gone.is_empty() && self.also.is_empty()
    }
}

/// From mapped chunks to a committed version.
pub(crate) struct Update<'a> {
    pub(crate) map: &'a MapIndex,
    pub(crate) tile_level: u32,
    pub(crate) fold: &'a Fold,
    pub(crate) meter: &'a Meter,
    pub(crate) progress: &'a dyn Progress,
}

impl Update<'_> {
    /// Commits; returns the version and how many tiles were reduced.
    pub(crate) fn commit(
        &self,
        operation: &str,
        mut transaction: Transaction,
        known: Vec<ChunkRow>,
        revision: Revision<'_>,
    ) -> Result<(i64, usize), EngineError> {
        let headers: Vec<LayerHeader> = transaction.base().read(TileFilter::All)?;
        if revision.is_empty() && !self.changes_model(transaction.base(), &headers) {
            tracing::info!(operation, "nothing new: no version was made");
            return Ok((transaction.base().version(), 0));
        }
        let (mut chunks, mut rows, mut sightings, mut footprints) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for mapped in revision.mapped {
            chunks.push(mapped.row);
            rows.extend(mapped.evidence.rows);
            sightings.extend(mapped.evidence.sightings);
            footprints.extend(mapped.evidence.footprints);
        }
        let mut leaving: BTreeSet<ChunkId> = chunks.iter().map(ChunkRow::chunk).collect();
        leaving.extend(revision.gone);
        let (replaced, kept): (Vec<ChunkRow>, Vec<ChunkRow>) = known
            .into_iter()
            .partition(|row| leaving.contains(&row.chunk()));
        let mut touched: BTreeSet<TileId> =
            chunks.iter().chain(&replaced).flat_map(tiles_of).collect();
        touched.extend(revision.also);

        let is_all = revision.rekey.is_some() || self.changes_model(transaction.base(), &headers);
        let mut change = Change {
            tiles: touched.clone(),
            is_all,
            ..Change::default()
        };
        change.layers(&headers);
        change.sightings(&sightings);
        change.footprints(&footprints);
        self.progress.begin(Stage::Exchange, 3);
        let exchange = Exchange {
            touched: &touched,
            leaving: &leaving,
        };
        let rekeyed = |row| match revision.rekey {
            Some(rekey) => rekey.rekeyed(row),
            None => Some(row),
        };
        let (rows, judged) = match revision.exchanged {
            Some(exchanged) => (Ledger::default(), exchanged.take_over(&mut transaction)?),
            None => {
                let rows = self.exchange(&mut transaction, &exchange, rows, rekeyed)?;
                self.exchange(&mut transaction, &exchange, sightings.clone(), Some)?;
                self.exchange(&mut transaction, &exchange, footprints.clone(), Some)?;
                (rows, Judged::default())
            }
        };
        self.progress.end(Stage::Exchange);
        tracing::info!(
            chunks = chunks.len(),
            tiles = touched.len(),
            "evidence exchanged"
        );
        let base = transaction.base().clone();
        let mut at_hand = AtHand::new(&base, &leaving, sightings, footprints)?;
        match is_all {
            true => at_hand.read_all()?,
            false => at_hand.read_tiles(&touched)?,
        }
        change.sightings(at_hand.sightings.vanished());
        change.footprints(at_hand.footprints.vanished());
        chunks.extend(kept);
        let tiles_of_chunks: BTreeSet<TileId> = chunks.iter().flat_map(tiles_of).collect();
        transaction.overwrite(chunks)?;

        let layers = self.layers(&change, &judged, &mut at_hand, |tiles| {
            self.rows_of(&base, tiles, &touched, &rows)
        })?;
        let folded = layers.len();
        let layers = changed(headers, layers, &tiles_of_chunks);
        let count = layers.len();
        tracing::info!(tiles = folded, changed = count, "reduced");
        let mut parameters = self.parameters();
        parameters.extend(revision.parameters);
        self.progress.begin(Stage::Commit, count as u64);
        let version = self.meter.time(Stage::Commit, || {
            write_layers(&mut transaction, layers)?;
            Ok::<_, EngineError>(transaction.commit(operation, parameters)?)
        })?;
        self.meter.count(Stage::Commit, count as u64, 0);
        self.progress.end(Stage::Commit);
        tracing::info!(operation, version, tiles = count, "committed");
        Ok((version, count))
    }

    /// What the commit says of how it was folded.
    fn parameters(&self) -> Parameters {
        let model = self.fold.model.name().to_owned();
        let mut parameters = Parameters::from([(FUSION_MODEL.to_owned(), model.into())]);
        if let Some(as_of_ns) = self.fold.as_of_ns {
            parameters.insert(AS_OF.to_owned(), as_of_ns.into());
        }
        parameters
    }

    /// Whether layers were made as of another time than the one asked for.
    fn is_as_of_other_time(&self, base: &Snapshot) -> bool {
        let as_of_ns = base.info().parameters.get(AS_OF);
        as_of_ns.and_then(serde_json::Value::as_i64) != self.fold.as_of_ns
    }

    /// Whether layers were made with another model than the one asked for, or as of another time.
    pub(crate) fn changes_model(&self, base: &Snapshot, headers: &[LayerHeader]) -> bool {
        self.is_as_of_other_time(base) || headers.iter().any(|header| self.is_other_model(header))
    }

    fn is_other_model(&self, header: &LayerHeader) -> bool {
        header.fusion_model != self.fold.model.name()
            || header.sensor_model != self.fold.sensor.id()
    }

    /// Replaces what the touched tiles hold of the chunks that leave, and takes every other row through
    /// `keep`; returns all their rows.
    pub(crate) fn exchange<R: Testified + StoredTable>(
        &self,
        transaction: &mut Transaction,
        exchange: &Exchange<'_>,
        rows: Vec<R>,
        keep: impl Fn(R) -> Option<R>,
    ) -> Result<Ledger<R>, EngineError> {
        let count = rows.len() as u64;
        let touched = exchange.touched;
        let ledger = self.meter.time(Stage::Exchange, || {
            let known = Ledger::of(transaction.base().read(TileFilter::Tiles(touched))?);
            let stays = known.subtract(exchange.leaving).into_rows().into_iter();
            let stays = Ledger::of(stays.filter_map(keep).collect());
            let ledger = stays.merge(Ledger::of(rows));
            transaction.replace_tiles(touched, ledger.rows().to_vec())?;
            Ok::<_, EngineError>(ledger)
        })?;
        self.meter.count(Stage::Exchange, count, 0);
        self.progress.advance(Stage::Exchange, 1, 0);
        Ok(ledger)
    }

    /// The layers that a change has an effect on. What they turn out to depend on, and was not read, is
    /// read, and then they are made anew.
    fn layers(
        &self,
        change: &Change,
        judged: &Judged,
        at_hand: &mut AtHand<'_>,
        rows_of: impl Fn(&BTreeSet<TileId>) -> Result<Ledger<EvidenceRow>, EngineError>,
    ) -> Result<Vec<Layer>, EngineError> {
        at_hand.read_at(&change.places())?;
        loop {
            let reduce = Reduce {
                map: self.map,
                tile_level: self.tile_level,
                sightings: at_hand.sightings.rows(),
                footprints: at_hand.footprints.rows(),
                fold: self.fold,
                meter: self.meter,
                progress: self.progress,
            };
            let (layers, asked) = reduce.layers_with(change, judged, &rows_of)?;
            if !at_hand.read_at(&asked)? {
                return Ok(layers);
            }
        }
    }

    /// Ledger rows of tiles: those at hand of touched ones, and the store's of others.
    fn rows_of(
        &self,
        base: &Snapshot,
        tiles: &BTreeSet<TileId>,
        touched: &BTreeSet<TileId>,
        at_hand: &Ledger<EvidenceRow>,
    ) -> Result<Ledger<EvidenceRow>, EngineError> {
        let at_hand = at_hand.clone().within(tiles);
        let others: BTreeSet<TileId> = tiles.difference(touched).copied().collect();
        if others.is_empty() {
            return Ok(at_hand);
        }
        let stored = Ledger::of(base.read(TileFilter::Tiles(&others))?);
        Ok(at_hand.merge(stored))
    }
}

/// The layers that are not in the store as they are. A tile without records in which no chunk has
/// anything has no layer, whatever was there before.
fn changed(
    headers: Vec<LayerHeader>,
    layers: Vec<Layer>,
    tiles_of_chunks: &BTreeSet<TileId>,
) -> BTreeMap<TileId, Option<Layer>> {
    let with_tile = |header: LayerHeader| (header.tile, header);
    let mut known: BTreeMap<i32, LayerHeader> = headers.into_iter().map(with_tile).collect();
    let mut changed = BTreeMap::new();
    for layer in layers {
        let tile = TileId(layer.header.tile);
        let before = known.remove(&tile.0);
        let stays = !layer.records.is_empty() || tiles_of_chunks.contains(&tile);
        let layer = stays.then_some(layer);
        if before.as_ref() != layer.as_ref().map(|layer| &layer.header) {
            changed.insert(tile, layer);
        }
    }
    changed
}

/// Which tiles' rows are exchanged, and whose leave them.
pub(crate) struct Exchange<'a> {
    pub(crate) touched: &'a BTreeSet<TileId>,
    pub(crate) leaving: &'a BTreeSet<ChunkId>,
}

fn write_layers(
    transaction: &mut Transaction,
    layers: BTreeMap<TileId, Option<Layer>>,
) -> Result<(), EngineError> {
    let tiles: BTreeSet<TileId> = layers.keys().copied().collect();
    let (headers, records): (Vec<_>, Vec<_>) = layers
        .into_values()
        .flatten()
        .map(|layer| (layer.header, layer.records))
        .unzip();
    transaction.replace_tiles(&tiles, records.into_iter().flatten().collect())?;
    transaction.replace_tiles(&tiles, headers)?;
    Ok(())
}
