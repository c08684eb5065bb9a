//! A store of two maps: two towns far from each other, with their drives.

#![allow(clippy::unwrap_used)] // What cannot be made ends its test.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use tilefold_city::{CityFiles, CitySpec};
use tilefold_engine::{InitOptions, init};

use crate::trial::{Trial, small_spec};

/// Two towns with no tile between them in common, nor a file of the store.
#[derive(Debug)]
pub struct Towns {
    _folder: TempDir,
    near: CityFiles,
    far: CityFiles,
    /// Their maps.
    pub maps: [PathBuf; 2],
}

impl Towns {
    /// Draws them.
    ///
    /// # Panics
    /// They cannot be written.
    #[must_use]
    #[expect(clippy::new_without_default, reason = "it writes files")]
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let town = |name: &str, longitude_deg: f64, vehicles: u32| {
            let spec = CitySpec {
                anchor: [longitude_deg, 50.0, 300.0],
                change_share: 0.2,
                vehicles,
                drives: vehicles,
                ..small_spec()
            };
            tilefold_city::write(&spec, &folder.path().join(name)).unwrap()
        };
        let (near, mut far) = (town("near", 10.0, 6), town("far", 11.0, 12));
        // All towns' vehicles have the same names, and nobody is in two towns at once.
        far.logs.drain(..near.logs.len());
        let renumbered = folder.path().join("far.osm");
        fs::write(&renumbered, with_other_ids(&far.before_map)).unwrap();
        Self {
            maps: [near.before_map.clone(), renumbered],
            _folder: folder,
            near,
            far,
        }
    }

    /// A new store of both maps.
    ///
    /// # Panics
    /// It cannot be made.
    #[must_use]
    pub fn store(&self) -> Trial {
        let folder = tempfile::tempdir().unwrap();
        let store = folder.path().join("store");
        let options = InitOptions {
            tile_level: 15,
            salt: None,
        };
        init(&store, &self.maps, &options).unwrap();
        Trial::of(folder, store)
    }

    /// All logs but the last of the near town; and that one.
    ///
    /// # Panics
    /// Nobody drove there.
    #[must_use]
    pub fn days(&self) -> (Vec<PathBuf>, Vec<PathBuf>) {
        let (last, others) = self.near.logs.split_last().unwrap();
        ([others, &self.far.logs].concat(), vec![last.clone()])
    }
}

/// The map with a digit more in every id: two maps of a store share none.
fn with_other_ids(map: &Path) -> String {
    let text = fs::read_to_string(map).unwrap();
    text.replace(" id='", " id='9").replace(" ref='", " ref='9")
}
