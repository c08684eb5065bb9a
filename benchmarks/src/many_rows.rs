//! A store with as many ledger rows as are asked for, to fold them within a limit of memory.
//!
//! `tilefold-benchmarks many-rows FOLDER ROWS` makes a square of 100 km with a line of paint of 40 m every 200 m, and the
//! evidence of vehicles that each looked at every line once and matched nine times in ten. Then
//! `tilefold run FOLDER --as-of 2030-01-01T00:00:00Z --memory 8GB` folds all of it.

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::path::Path;

use tilefold_schemas::evidence::{CLASS_BINS, METHOD_VERSION, WINDOW_NS, to_window_ms};
use tilefold_schemas::fixed::ONE_Q8;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{
    Color, Element, ElementId, ElementKind, EvidenceRow, Marking, SignClass, TileId, wkb,
};
use tilefold_store::{Parameters, Store, StoreProperties, coarse};
use tilefold_tiler::map_index::{MappedElement, bounds};
use tilefold_tiler::tile::DEFAULT_LEVEL;

/// A metre in degrees of latitude; of longitude it is taken half as long again, as at 48 degrees.
const METRE_DEG: f64 = 1.0 / 111_195.0;
const SIDE: usize = 500;
const APART_M: f64 = 200.0;
const LINE_M: f64 = 40.0;
const SECTIONS: i32 = 4;
const SECOND_NS: i64 = 1_000_000_000;
const BEGIN_NS: i64 = 1_770_000_000 * SECOND_NS;

/// Makes the store.
pub(crate) fn make(folder: &Path, rows: usize) -> Result<(), Box<dyn Error>> {
    let properties = StoreProperties {
        salt: [0; 32],
        tile_level: u8::try_from(DEFAULT_LEVEL)?,
        parameters: Parameters::new(),
    };
    let store = Store::create(folder.to_owned(), properties)?;
    let elements: Result<Vec<MappedElement>, _> = (0..SIDE * SIDE).map(element).collect();
    let elements = elements?;
    let mut transaction = store.begin()?;
    transaction.overwrite(elements.iter().map(to_row).collect())?;
    transaction.commit("init", Parameters::new())?;

    let mut files: BTreeMap<TileId, Vec<MappedElement>> = BTreeMap::new();
    for mapped in elements {
        files.entry(coarse(mapped.tile)).or_default().push(mapped);
    }
    let passes = rows / (SIDE * SIDE * SECTIONS as usize);
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

fn element(index: usize) -> Result<MappedElement, Box<dyn Error>> {
    let [east_m, north_m] = [index % SIDE, index / SIDE].map(|step| step as f64 * APART_M);
    let vertices = [0.0, LINE_M].map(|along_m| {
        let longitude_deg = 11.5 + (east_m + along_m) * METRE_DEG * 1.5;
        [longitude_deg, 48.0 + north_m * METRE_DEG, 0.0]
    });
    let element = Element {
        id: ElementId(index as i64),
        kind: ElementKind::LaneMarking,
        marking: Marking::Solid,
        color: Color::White,
        sign: SignClass::Unknown,
        points: vertices.into(),
        tags: BTreeMap::new(),
    };
    Ok(MappedElement::new(element, DEFAULT_LEVEL)?)
}

fn to_row(mapped: &MappedElement) -> ElementRow {
    let element = &mapped.element;
    let (low, high) = bounds(&element.points);
    ElementRow {
        tile: mapped.tile.0,
        element: element.id.0,
        content: mapped.content.0,
        kind: element.kind.code(),
        marking: element.marking.code(),
        color: element.color.code(),
        sign: element.sign.code(),
        geometry: wkb::line(&element.points),
        xmin: low[0],
        ymin: low[1],
        xmax: high[0],
        ymax: high[1],
        tags: "{}".to_owned(),
        source: "square".to_owned(),
    }
}

/// What one vehicle says of a section: ten looks, nine matches, 5 cm off to one side or the other.
fn row(mapped: &MappedElement, pass: i64, section: i32) -> EvidenceRow {
    let lot = (mapped.element.id.0 * 31 + pass * 7 + i64::from(section)) % 11;
    let lambda_q8 = 100 * ONE_Q8;
    let residual_q8 = (lot - 5) * ONE_Q8 / 100;
    let at_ns = BEGIN_NS + (pass * 3_600 + mapped.element.id.0 % 3_600) * SECOND_NS;
    let window = at_ns.div_euclid(WINDOW_NS);
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
        window,
        method: METHOD_VERSION,
        model: 0,
        exposed: 10,
        hit: 9,
        sum_v_q8: 9 * ONE_Q8 + lot,
        sum_w_no_q8: 9 * ONE_Q8,
        sum_w_add_q8: 0,
        sum_w_del_q8: ONE_Q8,
        sum_w_mod_q8: 0,
        residual_eta_q8: residual_q8 * 100,
        residual_lambda_q8: lambda_q8,
        along_eta_q8: 0,
        along_lambda_q8: 0,
        seen,
        first_ms: to_window_ms(window, at_ns),
        last_after_ms: 1_000,
        best_after_ms: 500,
        best_v_q8: ONE_Q8,
    }
}
