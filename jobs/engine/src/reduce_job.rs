//! The reduce stage of a job: tiles on rayon, in key order.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use tilefold_reducers::{Fold, TileInput, area_candidates, candidates, reduce_tile};
use tilefold_schemas::{
    ChangeRecord, EvidenceRow, Footprint, LayerHeader, Sighting, TileId, Verdict,
};
use tilefold_store::digest_rows;
use tilefold_tiler::map_index::{MapIndex, MappedElement};

use crate::error::EngineError;
use crate::meter::{Meter, Stage};
use crate::progress::Progress;

/// A tile's change records under their header.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Header.
    pub header: LayerHeader,
    /// Records.
    pub records: Vec<ChangeRecord>,
}

/// All additions in the evidence, judged where they lie, whatever tiles they cross.
#[must_use]
pub fn additions(
    sightings: &[Sighting],
    footprints: &[Footprint],
    map: &MapIndex,
    tile_level: u32,
    fold: &Fold,
) -> Vec<ChangeRecord> {
    let mut additions = candidates::judge(sightings, footprints, map, tile_level, fold);
    additions.extend(area_candidates::judge(
        sightings, footprints, map, tile_level, fold,
    ));
    additions
}

/// Reduces `tiles`: all that they own of elements, rows and additions.
///
/// # Errors
/// Rows cannot be encoded for their digest.
pub fn reduce_tiles(
    tiles: &BTreeSet<TileId>,
    elements: &[MappedElement],
    rows: &[EvidenceRow],
    additions: &[ChangeRecord],
    fold: &Fold,
    meter: &Meter,
    progress: &dyn Progress,
) -> Result<Vec<Layer>, EngineError> {
    let mut inputs: BTreeMap<TileId, TileInput<'_>> = tiles
        .iter()
        .map(|&tile| (tile, TileInput::default()))
        .collect();
    for element in elements {
        if let Some(input) = inputs.get_mut(&element.tile) {
            input.elements.push(element);
        }
    }
    for row in rows {
        if let Some(input) = inputs.get_mut(&TileId(row.tile)) {
            input.rows.push(row);
        }
    }
    for addition in additions {
        if let Some(input) = inputs.get_mut(&TileId(addition.tile)) {
            input.additions.push(addition);
        }
    }
    progress.begin(Stage::Reduce, inputs.len() as u64);
    let layers = inputs
        .into_par_iter()
        .map(|(tile, input)| {
            let layer = meter.time(Stage::Reduce, || layer(tile, &input, fold));
            meter.count(Stage::Reduce, 1, 0);
            progress.advance(Stage::Reduce, 1, 0);
            layer
        })
        .collect();
    progress.end(Stage::Reduce);
    layers
}

fn layer(tile: TileId, input: &TileInput<'_>, fold: &Fold) -> Result<Layer, EngineError> {
    let records = reduce_tile(input, fold);
    let rows: Vec<EvidenceRow> = input.rows.iter().map(|row| (*row).clone()).collect();
    let as_of_ns = rows.iter().map(|row| row.last_ns).max().unwrap_or(0);
    let count = |verdict: Verdict| {
        records
            .iter()
            .filter(|record| record.verdict == verdict.code())
            .count() as i32
    };
    Ok(Layer {
        header: LayerHeader {
            tile: tile.0,
            digest: digest_rows(records.clone())?,
            evidence_digest: digest_rows(rows)?,
            fusion_model: fold.model.name().to_owned(),
            sensor_model: fold.sensor.id(),
            as_of_ns,
            no_change: count(Verdict::NoChange),
            added: count(Verdict::Added),
            removed: count(Verdict::Removed),
            modified: count(Verdict::Modified),
            unknown: count(Verdict::Unknown),
        },
        records,
    })
}
