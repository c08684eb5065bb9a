//! `calibrate`: fits the sensor model to the store's ledger, and folds everything anew with it.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;
use tilefold_reducers::sensor::VehicleModel;
use tilefold_reducers::{Fold, FusionModel, SensorModel, fit};
use tilefold_schemas::{ChunkRow, EvidenceRow, SensorRow};
use tilefold_store::{Snapshot, Store, TileFilter};
use tilefold_tiler::map_index::{MapIndex, MappedElement};

use crate::error::EngineError;
use crate::meter::Meter;
use crate::progress::Progress;
use crate::update::{Revision, Update, read_elements};

/// A vehicle is reported if it sees less than this share of what its fleet sees...
const POOR_DETECTION: f64 = 0.6;
/// ... or places it this many times worse...
const POOR_SIGMA: f64 = 2.0;
/// ... or matches what is gone in more than this share of the frames.
const POOR_ABSENT: f64 = 0.4;

/// What a calibration found.
#[derive(Debug, Clone, Serialize)]
pub struct Calibration {
    /// Version that readers see now.
    pub version: i64,
    /// Tiles that were folded anew.
    pub tiles_reduced: usize,
    /// Id of the sensor model, as the layers name it.
    pub sensor_model: i64,
    /// The model in force before, and now.
    pub parameters: Vec<Fitted>,
    /// Vehicles whose detectors are far from their fleet's; they are believed less.
    pub outstanding: Vec<Outstanding>,
}

/// A parameter before and after the fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fitted {
    /// Name.
    pub parameter: String,
    /// Visibility at which it holds; 0 if it does not depend on it.
    pub visibility: f64,
    /// Built-in value.
    pub built_in: f64,
    /// Fitted value.
    pub fitted: f64,
}

/// A vehicle that is not like its fleet.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outstanding {
    /// Its key in the store.
    pub vehicle: i64,
    /// Its rate of matches as a share of the fleet's.
    pub detection: f64,
    /// Share of frames in which it matches what is gone.
    pub absent: f64,
    /// Spread of its residuals over the fleet's.
    pub sigma: f64,
}

/// The sensor model in force in a version.
///
/// # Errors
/// The store is damaged.
pub fn sensor_model(snapshot: &Snapshot) -> Result<SensorModel, EngineError> {
    let rows: Vec<SensorRow> = snapshot.read(TileFilter::All)?;
    Ok(SensorModel::from_rows(&rows))
}

/// Fits the sensor model to all evidence, folds all tiles with it, and commits a version.
///
/// # Errors
/// The store cannot be read or written, or another writer was faster. Nothing has changed then.
pub fn calibrate(location: &Path, progress: &dyn Progress) -> Result<Calibration, EngineError> {
    let meter = Meter::default();
    let store = Store::open(location.to_path_buf())?;
    let snapshot = store.snapshot(None)?;
    let tile_level = u32::from(store.properties().tile_level);
    let map = MapIndex::new(read_elements(&snapshot, tile_level)?);
    let rows: Vec<EvidenceRow> = snapshot.read(TileFilter::All)?;
    let known: Vec<ChunkRow> = snapshot.read(TileFilter::All)?;
    let sensor = fit_to(map.elements(), &rows);
    let mut transaction = store.begin_from(snapshot)?;
    transaction.overwrite(sensor.to_rows())?;
    let update = Update {
        map: &map,
        tile_level,
        fold: &Fold::of_fleet(FusionModel::Calibrated, sensor.clone()),
        meter: &meter,
        progress,
    };
    let (version, tiles_reduced) =
        update.commit("calibrate", transaction, known, Revision::default())?;
    Ok(Calibration {
        version,
        tiles_reduced,
        sensor_model: sensor.id(),
        parameters: fitted(&sensor),
        outstanding: outstanding(&sensor),
    })
}

/// The sensor model that fits a ledger.
pub(crate) fn fit_to(elements: &[MappedElement], rows: &[EvidenceRow]) -> SensorModel {
    fit::fit(&by_element(elements, rows))
}

fn by_element<'a>(
    elements: &'a [MappedElement],
    rows: &'a [EvidenceRow],
) -> Vec<(&'a MappedElement, Vec<&'a EvidenceRow>)> {
    let mut grouped: BTreeMap<i64, Vec<&EvidenceRow>> = BTreeMap::new();
    for row in rows {
        grouped.entry(row.element).or_default().push(row);
    }
    let mut all: Vec<(&MappedElement, Vec<&EvidenceRow>)> = elements
        .iter()
        .filter_map(|mapped| Some((mapped, grouped.remove(&mapped.element.id.0)?)))
        .collect();
    all.sort_by_key(|(mapped, _)| mapped.element.id);
    all
}

fn fitted(sensor: &SensorModel) -> Vec<Fitted> {
    let built_in = SensorModel::default();
    let number = |parameter: &str, built_in: f64, fitted: f64| Fitted {
        parameter: parameter.to_owned(),
        visibility: 0.0,
        built_in,
        fitted,
    };
    let mut all = vec![
        number("absent", built_in.absent, sensor.absent),
        number(
            "absent_concentration",
            built_in.absent_concentration,
            sensor.absent_concentration,
        ),
        number(
            "present_concentration",
            built_in.present_concentration,
            sensor.present_concentration,
        ),
        number(
            "residual_outliers",
            built_in.residual_outliers,
            sensor.residual_outliers,
        ),
        number("marking_read", built_in.marking_read, sensor.marking_read),
        number(
            "vehicle_sigma_m",
            built_in.vehicle_sigma_m,
            sensor.vehicle_sigma_m,
        ),
        number("removed", built_in.removed, sensor.removed),
        number("shifted", built_in.shifted, sensor.shifted),
        number("seen_well", built_in.levels[0], sensor.levels[0]),
        number("seen_less", built_in.levels[1], sensor.levels[1]),
        number("hidden_from_aside", built_in.levels[2], sensor.levels[2]),
    ];
    for (parameter, built_in, fitted) in [
        ("present", &built_in.present, &sensor.present),
        ("pass_sigma_m", &built_in.pass_sigma_m, &sensor.pass_sigma_m),
        (
            "place_sigma_m",
            &built_in.place_sigma_m,
            &sensor.place_sigma_m,
        ),
    ] {
        all.extend(fitted.0.iter().map(|&[visibility, fitted]| Fitted {
            parameter: parameter.to_owned(),
            visibility,
            built_in: built_in.at(visibility),
            fitted,
        }));
    }
    all
}

/// Why a vehicle is believed less than its fleet; none if it is not.
#[must_use]
pub fn believed_less(vehicle: &VehicleModel) -> Option<String> {
    let mut reasons = Vec::new();
    if vehicle.detection < POOR_DETECTION {
        reasons.push(format!(
            "sees {:.2} of what its fleet sees",
            vehicle.detection
        ));
    }
    if vehicle.absent > POOR_ABSENT {
        reasons.push(format!(
            "matches what is gone in {:.2} of its frames",
            vehicle.absent
        ));
    }
    if vehicle.sigma > POOR_SIGMA {
        reasons.push(format!(
            "places things {:.1} times worse than its fleet",
            vehicle.sigma
        ));
    }
    (!reasons.is_empty()).then(|| reasons.join(", "))
}

fn outstanding(sensor: &SensorModel) -> Vec<Outstanding> {
    let all = sensor.vehicles.iter();
    all.filter(|(_, vehicle)| believed_less(vehicle).is_some())
        .map(|(&key, vehicle)| Outstanding {
            vehicle: key,
            detection: vehicle.detection,
            absent: vehicle.absent,
            sigma: vehicle.sigma,
        })
        .collect()
}
