//! `init`: a store from a base map.

use std::path::{Path, PathBuf};

use serde::Serialize;
use tilefold_reducers::{Fold, FusionModel, SensorModel};
use tilefold_schemas::{Ledger, SetAside};
use tilefold_store::{Parameters, Store, StoreError, StoreProperties, digest_rows};
use tilefold_tiler::map_index::MapIndex;

use crate::base_map;
use crate::error::EngineError;
use crate::meter::Meter;
use crate::progress::Silent;
use crate::reduce_job::{Reduce, owners};
use crate::scope::Change;

/// How a store is made.
#[derive(Debug, Clone)]
pub struct InitOptions {
    /// Level of the tiles (0 to 15).
    pub tile_level: u8,
    /// Secret of the keyed hash of vehicle ids. Without one it is derived from the map, so that
    /// the same inputs give the same store.
    pub salt: Option<[u8; 32]>,
}

/// What was made.
#[derive(Debug, Clone, Serialize)]
pub struct InitReport {
    /// Where.
    pub store: String,
    /// First version with a layer in every tile of the map.
    pub version: i64,
    /// Elements of the base map.
    pub elements: usize,
    /// Tiles that own elements.
    pub tiles: usize,
    /// Map elements that could not be read.
    pub set_aside: Vec<SetAside>,
}

/// Creates a store at `location` from map files.
///
/// # Errors
/// A map cannot be read, there is a store already, or the storage refuses.
pub fn init(
    location: &Path,
    maps: &[PathBuf],
    options: &InitOptions,
) -> Result<InitReport, EngineError> {
    let tile_level = u32::from(options.tile_level);
    let (rows, set_aside) = base_map::read_painted(maps, tile_level)?;
    let digest = digest_rows(rows.clone())?;
    let salt = options
        .salt
        .unwrap_or_else(|| *blake3::hash(format!("tilefold {digest}").as_bytes()).as_bytes());
    let properties = StoreProperties {
        salt,
        tile_level: options.tile_level,
        parameters: Parameters::from([("map_digest".to_owned(), digest.into())]),
    };
    let elements = rows
        .iter()
        .cloned()
        .map(|row| base_map::from_row(row, tile_level))
        .collect::<Result<Vec<_>, _>>()?;
    let tiles = owners(&elements);
    let fold = Fold::of_fleet(FusionModel::default(), SensorModel::default());
    let nothing = Reduce {
        map: &MapIndex::new(elements),
        tile_level,
        sightings: &[],
        footprints: &[],
        fold: &fold,
        meter: &Meter::default(),
        progress: &Silent,
    };
    let layers = nothing.layers(&Change::all(tiles.clone()), |_| Ok(Ledger::default()))?;

    let store = create(location, properties)?;
    let mut transaction = store.begin()?;
    let report = InitReport {
        store: store.location(),
        version: 0,
        elements: rows.len(),
        tiles: tiles.len(),
        set_aside,
    };
    transaction.overwrite(rows)?;
    let (headers, records): (Vec<_>, Vec<_>) = layers
        .into_iter()
        .map(|layer| (layer.header, layer.records))
        .unzip();
    transaction.overwrite(headers)?;
    transaction.overwrite(records.into_iter().flatten().collect())?;
    let version = transaction.commit("init", Parameters::new())?;
    Ok(InitReport { version, ..report })
}

/// A store without a map: a new one, or what a killed `init` of the same map left.
fn create(location: &Path, properties: StoreProperties) -> Result<Store, EngineError> {
    match Store::create(location.to_path_buf(), properties.clone()) {
        Err(exists @ StoreError::Exists { .. }) => {
            let store = Store::open(location.to_path_buf())?;
            let is_left = *store.properties() == properties && store.latest_version()? == 0;
            is_left.then_some(store).ok_or(exists.into())
        }
        made => Ok(made?),
    }
}
