//! A store with as many ledger rows as are asked for, to fold them within a limit of memory.
//!
//! `many_rows FOLDER ROWS` makes a square of 100 km with a line of paint of 40 m every 200 m, and the
//! evidence of vehicles that each looked at every line once and matched nine times in ten. Then
//! `tilefold run FOLDER --as-of 2030-01-01T00:00:00Z --memory 8GB` folds all of it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use clap::Parser;
use tilefold_engine::run::read_elements;
use tilefold_schemas::evidence::{CLASS_BINS, METHOD_VERSION};
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{ElementKind, EvidenceRow, TileId, wkb};
use tilefold_store::{Parameters, Store, StoreProperties, coarse};
use tilefold_tiler::map_index::MappedElement;
use tilefold_tiler::tile::{DEFAULT_LEVEL, tile_of};

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// A metre in degrees of latitude; of longitude it is taken half as long again, as at 48 degrees.
const METRE_DEG: f64 = 1.0 / 111_195.0;
const SIDE: usize = 500;
const APART_M: f64 = 200.0;
const LINE_M: f64 = 40.0;
const SECTIONS: i32 = 4;
/// 1 in a sum, and a second.
const ONE_FX: i64 = 1 << 24;
const SECOND_NS: i64 = 1_000_000_000;
const BEGIN_NS: i64 = 1_770_000_000 * SECOND_NS;

#[derive(Parser)]
struct Asked {
    /// Folder of the new store.
    folder: PathBuf,
    /// Ledger rows, about.
    rows: usize,
}

fn main() -> Result<(), Failure> {
    let asked = Asked::parse();
    let properties = StoreProperties {
        salt: [0; 32],
        tile_level: u8::try_from(DEFAULT_LEVEL)?,
        parameters: Parameters::new(),
    };
    let store = Store::create(asked.folder, properties)?;
    let mut transaction = store.begin()?;
    let elements: Result<Vec<ElementRow>, Failure> = (0..SIDE * SIDE).map(element).collect();
    transaction.overwrite(elements?)?;
    transaction.commit("init", Parameters::new())?;

    let snapshot = store.snapshot(None)?;
    let mut files: BTreeMap<TileId, Vec<MappedElement>> = BTreeMap::new();
    for mapped in read_elements(&snapshot, DEFAULT_LEVEL)? {
        files.entry(coarse(mapped.tile)).or_default().push(mapped);
    }
    let passes = asked.rows / (SIDE * SIDE * SECTIONS as usize);
    let mut transaction = store.begin()?;
    for (number, elements) in files.values().enumerate() {
        eprintln!("file {} of {}", number + 1, files.len());
        let tiles: BTreeSet<TileId> = elements.iter().map(|mapped| mapped.tile).collect();
        let rows = elements.iter().flat_map(|mapped| {
            (0..passes as i64)
                .flat_map(move |pass| (0..SECTIONS).map(move |at| row(mapped, pass, at)))
        });
        transaction.replace_tiles(&tiles, rows.collect::<Vec<_>>())?;
    }
    transaction.commit("run", Parameters::new())?;
    Ok(())
}

fn element(index: usize) -> Result<ElementRow, Failure> {
    let [east_m, north_m] = [index % SIDE, index / SIDE].map(|step| step as f64 * APART_M);
    let vertices = [0.0, LINE_M].map(|along_m| {
        let longitude_deg = 11.5 + (east_m + along_m) * METRE_DEG * 1.5;
        [longitude_deg, 48.0 + north_m * METRE_DEG, 0.0]
    });
    let [first, last] = vertices;
    let TileId(tile) = tile_of(first[0], first[1], DEFAULT_LEVEL)?;
    Ok(ElementRow {
        tile,
        element: index as i64,
        content: index as i64,
        kind: ElementKind::LaneMarking.code(),
        marking: 1,
        color: 1,
        sign: 0,
        geometry: wkb::line(&vertices),
        xmin: first[0],
        ymin: first[1],
        xmax: last[0],
        ymax: last[1],
        tags: "{}".to_owned(),
        source: "square".to_owned(),
    })
}

/// What one vehicle says of a section: ten looks, nine matches, 5 cm off to one side or the other.
fn row(mapped: &MappedElement, pass: i64, section: i32) -> EvidenceRow {
    let lot = (mapped.element.id.0 * 31 + pass * 7 + i64::from(section)) % 11;
    let lambda_fx = 100 * ONE_FX;
    let residual_fx = (lot - 5) * ONE_FX / 100;
    let first_ns = BEGIN_NS + (pass * 3_600 + mapped.element.id.0 % 3_600) * SECOND_NS;
    let mut seen = [0; CLASS_BINS];
    seen[1] = 9;
    EvidenceRow {
        tile: mapped.tile.0,
        element: mapped.element.id.0,
        content: mapped.content.0,
        section,
        // Spread over all numbers, as keyed hashes are.
        vehicle: (pass + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15_u64.cast_signed()),
        channel: 1,
        window: first_ns / (20 * SECOND_NS),
        method: METHOD_VERSION,
        model: 0,
        exposed: 10,
        hit: 9,
        sum_v_fx: 9 * ONE_FX + lot * 1_000,
        sum_v2_fx: 8 * ONE_FX + lot * 900,
        sum_v_miss_fx: ONE_FX / 2,
        sum_w_no_fx: 9 * ONE_FX,
        sum_w_add_fx: 0,
        sum_w_del_fx: ONE_FX,
        sum_w_mod_fx: 0,
        sum_w_fx: 10 * ONE_FX,
        residuals: 9,
        residual_eta_fx: residual_fx * 100,
        residual_lambda_fx: lambda_fx,
        residual_chi2_fx: residual_fx,
        along_eta_fx: 0,
        along_lambda_fx: 0,
        seen,
        first_ns,
        last_ns: first_ns + SECOND_NS,
        best_ns: first_ns + SECOND_NS / 2,
        best_v_fx: ONE_FX,
    }
}
