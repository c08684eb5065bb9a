//! What a commit that changes one tile costs, by how many tiles and versions a store has.
//!
//! `commits TILES VERSIONS` makes a store with a layer header of each tile, then commits as many
//! versions that change one of them each. It prints one JSON line at every fiftieth: milliseconds of
//! opening the latest version, of staging and of committing (medians of the last fifty).

use std::collections::BTreeSet;
use std::time::Instant;

use clap::Parser;
use tilefold_schemas::{LayerHeader, TileId};
use tilefold_store::{Parameters, Store, StoreProperties};
use tilefold_tiler::tile::{DEFAULT_LEVEL, tile_of};

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Versions that a line of figures is about.
const SOME: usize = 50;
/// Side of a tile in degrees at the default level.
const TILE_DEG: f64 = 360.0 / 65_536.0;

#[derive(Parser)]
struct Asked {
    /// Tiles, in a square.
    tiles: usize,
    /// Versions.
    versions: usize,
}

fn main() -> Result<(), Failure> {
    let asked = Asked::parse();
    let folder = tempfile::tempdir()?;
    let properties = StoreProperties {
        salt: [0; 32],
        tile_level: u8::try_from(DEFAULT_LEVEL)?,
        parameters: Parameters::new(),
    };
    let store = Store::create(folder.path().join("store"), properties)?;
    let tiles = square(asked.tiles)?;
    let mut first = store.begin()?;
    first.overwrite(tiles.iter().map(|&tile| header(tile, 0)).collect())?;
    first.commit("init", Parameters::new())?;
    let mut taken = Vec::new();
    for version in 1..=asked.versions {
        let tile = tiles[version * 7919 % tiles.len()];
        taken.push(change(&store, tile, i32::try_from(version)?)?);
        if taken.len() == SOME {
            print(&tiles, version, &mut taken);
        }
    }
    Ok(())
}

/// Changes one tile; milliseconds of opening, staging and committing.
fn change(store: &Store, tile: TileId, version: i32) -> Result<[f64; 3], Failure> {
    let begun = Instant::now();
    let mut transaction = store.begin()?;
    let opened = begun.elapsed();
    transaction.replace_tiles(&BTreeSet::from([tile]), vec![header(tile, version)])?;
    let staged = begun.elapsed();
    transaction.commit("run", Parameters::new())?;
    let done = begun.elapsed();
    Ok([opened, staged - opened, done - staged].map(|part| part.as_secs_f64() * 1e3))
}

fn print(tiles: &[TileId], version: usize, taken: &mut Vec<[f64; 3]>) {
    let median = |part: usize| {
        let mut of: Vec<f64> = taken.iter().map(|parts| parts[part]).collect();
        of.sort_by(f64::total_cmp);
        of[of.len() / 2]
    };
    let figures = serde_json::json!({
        "tiles": tiles.len(),
        "version": version,
        "open_ms": median(0),
        "stage_ms": median(1),
        "commit_ms": median(2),
    });
    println!("{figures}");
    taken.clear();
}

/// Tiles of a square around a town.
fn square(count: usize) -> Result<Vec<TileId>, Failure> {
    let side = (count as f64).sqrt().ceil() as usize;
    let places = (0..count).map(|index| {
        let (row, column) = (index / side, index % side);
        let (lon, lat) = (8.4 + column as f64 * TILE_DEG, 48.0 + row as f64 * TILE_DEG);
        Ok(tile_of(lon, lat, DEFAULT_LEVEL)?)
    });
    places.collect()
}

fn header(tile: TileId, no_change: i32) -> LayerHeader {
    LayerHeader {
        tile: tile.0,
        digest: "0".repeat(64),
        evidence_digest: "0".repeat(64),
        fusion_model: "calibrated".to_owned(),
        sensor_model: 0,
        as_of_ns: 0,
        no_change,
        added: 0,
        removed: 0,
        modified: 0,
        unknown: 0,
        stale: 0,
    }
}
