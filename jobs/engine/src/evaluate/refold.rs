//! A version's evidence, folded anew without writing anything: with the other fusion model, or of
//! one vehicle alone.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_reducers::moved::{self, Gone};
use tilefold_reducers::{Fold, FusionModel, SensorModel, candidates, elements};
use tilefold_schemas::{
    ChangeRecord, EvidenceRow, Footprint, LayerHeader, Ledger, Sighting, TileId,
};
use tilefold_store::{Snapshot, TileFilter};
use tilefold_tiler::map_index::MapIndex;

use crate::calibrate;
use crate::error::EngineError;
use crate::meter::Meter;
use crate::progress::Silent;
use crate::reduce_job::{Reduce, owners};
use crate::run::read_elements;
use crate::scope::Change;

/// A version's layers, and the evidence that they were made from.
#[derive(Debug)]
pub struct Refold {
    map: MapIndex,
    tile_level: u32,
    ledger: Ledger<EvidenceRow>,
    sightings: Vec<Sighting>,
    footprints: Vec<Footprint>,
    records: Vec<ChangeRecord>,
    /// Fusion models that the layers were made with, by name.
    models: BTreeSet<String>,
    sensor: SensorModel,
}

impl Refold {
    /// Reads a version.
    ///
    /// # Errors
    /// The store is damaged.
    pub fn read(snapshot: &Snapshot) -> Result<Self, EngineError> {
        let tile_level = u32::from(snapshot.store().properties().tile_level);
        let headers: Vec<LayerHeader> = snapshot.read(TileFilter::All)?;
        Ok(Self {
            map: MapIndex::new(read_elements(snapshot, tile_level)?),
            tile_level,
            ledger: Ledger::of(snapshot.read(TileFilter::All)?),
            sightings: snapshot.read(TileFilter::All)?,
            footprints: snapshot.read(TileFilter::All)?,
            records: snapshot.read(TileFilter::All)?,
            sensor: calibrate::sensor_model(snapshot)?,
            models: headers
                .into_iter()
                .map(|header| header.fusion_model)
                .collect(),
        })
    }

    /// The base map.
    #[must_use]
    pub fn map(&self) -> &MapIndex {
        &self.map
    }

    /// All change records under a fusion model: those of the layers where they were made with it,
    /// else folded anew.
    ///
    /// # Errors
    /// Rows cannot be encoded.
    pub fn of_fleet(&self, model: FusionModel) -> Result<Vec<ChangeRecord>, EngineError> {
        if self.models.iter().all(|name| name == model.name()) {
            return Ok(self.records.clone());
        }
        let fold = Fold::of_fleet(model, self.sensor.clone());
        let reduce = Reduce {
            map: &self.map,
            tile_level: self.tile_level,
            sightings: &self.sightings,
            footprints: &self.footprints,
            fold: &fold,
            meter: &Meter::default(),
            progress: &Silent,
        };
        let rows_of = |tiles: &BTreeSet<TileId>| Ok(self.ledger.clone().within(tiles));
        let layers = reduce.layers(&Change::all(owners(self.map.elements())), rows_of)?;
        Ok(layers.into_iter().flat_map(|layer| layer.records).collect())
    }

    /// Keyed hashes of the vehicles that looked at anything, ascending.
    #[must_use]
    pub fn vehicles(&self) -> Vec<i64> {
        let vehicles: BTreeSet<i64> = self.footprints.iter().map(|look| look.vehicle).collect();
        vehicles.into_iter().collect()
    }

    /// What one vehicle says by itself, through the same reducers: change records of the elements
    /// that it was exposed to, and its additions.
    #[must_use]
    pub fn of_one(&self, model: FusionModel, vehicle: i64) -> Vec<ChangeRecord> {
        let fold = Fold::of_one(model, self.sensor.clone());
        let mut by_element: BTreeMap<i64, Vec<&EvidenceRow>> = BTreeMap::new();
        let rows = self.ledger.rows().iter();
        for row in rows.filter(|row| row.vehicle == vehicle) {
            by_element.entry(row.element).or_default().push(row);
        }
        let exposed = self.map.elements().iter().filter_map(|element| {
            let rows = by_element.get(&element.element.id.0)?;
            Some(elements::judge(element, rows, &fold))
        });
        let mut records: Vec<ChangeRecord> = exposed.flatten().collect();
        let of_vehicle = |row: &i64| *row == vehicle;
        let sightings = self.sightings.iter().filter(|row| of_vehicle(&row.vehicle));
        let mut additions = candidates::judge(
            &sightings.cloned().collect::<Vec<_>>(),
            &self.looks_of(vehicle),
            &self.map,
            &Gone::of(&records),
            self.tile_level,
            &fold,
        );
        moved::link(&mut records, &mut additions);
        records.extend(additions);
        records
    }

    /// Where one vehicle looked.
    #[must_use]
    pub fn looks_of(&self, vehicle: i64) -> Vec<Footprint> {
        let looks = self.footprints.iter();
        looks
            .filter(|look| look.vehicle == vehicle)
            .cloned()
            .collect()
    }
}
