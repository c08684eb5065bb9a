//! A store with as many changes as are asked for, to open the review page on.
//!
//! `review_store FOLDER CHANGES` makes a town of straight roads, 50 m of each with three lines of
//! paint, one of which has changed: on a layer of 100,000 changes that is a square of 16 km with
//! 300,000 elements. Nothing drove there: what speaks for a change is not in the store.

use std::path::PathBuf;

use clap::Parser;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{ChangeRecord, ElementKind, LayerHeader, TileId, Verdict, wkb};
use tilefold_store::{Parameters, Store, StoreProperties};
use tilefold_tiler::tile::{DEFAULT_LEVEL, tile_of};

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// A metre in degrees of latitude; of longitude it is taken half as long again, as at 48 degrees.
const METRE_DEG: f64 = 1.0 / 111_195.0;
const SQUARE_M: f64 = 50.0;
const LANE_M: f64 = 3.5;
const LINES: i64 = 3;
/// Of a line, with vertices every 8 m.
const LINE_M: f64 = 40.0;
const DAY_NS: i64 = 86_400_000_000_000;

#[derive(Parser)]
struct Asked {
    /// Folder of the new store.
    folder: PathBuf,
    /// Changes.
    changes: usize,
}

fn main() -> Result<(), Failure> {
    let asked = Asked::parse();
    let properties = StoreProperties {
        salt: [0; 32],
        tile_level: u8::try_from(DEFAULT_LEVEL)?,
        parameters: Parameters::new(),
    };
    let store = Store::create(asked.folder, properties)?;
    let side = (asked.changes as f64).sqrt().ceil() as usize;
    let (mut elements, mut changes) = (Vec::new(), Vec::new());
    for index in 0..asked.changes {
        let south_west = [
            (index % side) as f64 * SQUARE_M,
            (index / side) as f64 * SQUARE_M,
        ];
        for line in 0..LINES {
            let id = index as i64 * LINES + line;
            let points = line_at(south_west, line as f64 * LANE_M);
            elements.push(element(id, &points)?);
        }
        changes.push(change(index, &line_at(south_west, LANE_M + 0.6))?);
    }
    let tiles: std::collections::BTreeSet<i32> = changes.iter().map(|change| change.tile).collect();
    let mut transaction = store.begin()?;
    transaction.overwrite(elements)?;
    transaction.commit("init", Parameters::new())?;
    let mut transaction = store.begin()?;
    transaction.overwrite(changes)?;
    transaction.overwrite(tiles.into_iter().map(header).collect())?;
    transaction.commit("run", Parameters::new())?;
    Ok(())
}

/// Vertices of a line to the east, metres north of the square's corner.
fn line_at([east_m, north_m]: [f64; 2], beside_m: f64) -> Vec<[f64; 3]> {
    let vertices = (0..=5).map(|step| {
        let along_m = f64::from(step) * LINE_M / 5.0;
        [
            11.5 + (east_m + along_m) * METRE_DEG * 1.5,
            48.0 + (north_m + beside_m) * METRE_DEG,
            0.0,
        ]
    });
    vertices.collect()
}

fn element(id: i64, points: &[[f64; 3]]) -> Result<ElementRow, Failure> {
    let (first, last) = (points[0], points[points.len() - 1]);
    let TileId(tile) = tile_of(first[0], first[1], DEFAULT_LEVEL)?;
    Ok(ElementRow {
        tile,
        element: id,
        content: id,
        kind: ElementKind::LaneMarking.code(),
        marking: if id % LINES == 1 { 2 } else { 1 },
        color: 1,
        sign: 0,
        geometry: wkb::line(points),
        xmin: first[0],
        ymin: first[1],
        xmax: last[0],
        ymax: last[1],
        tags: "{}".to_owned(),
        source: "town".to_owned(),
    })
}

fn change(index: usize, points: &[[f64; 3]]) -> Result<ChangeRecord, Failure> {
    let verdicts = [
        Verdict::Added,
        Verdict::Removed,
        Verdict::Modified,
        Verdict::Unknown,
    ];
    let verdict = verdicts[index * 7 / 3 % verdicts.len()];
    let posterior = match verdict {
        Verdict::Unknown => 0.02,
        _ => 0.5 + 0.5 * (index * 7919 % 1000) as f64 / 1000.0,
    };
    let of = |other| if verdict == other { posterior } else { 0.0 };
    let TileId(tile) = tile_of(points[0][0], points[0][1], DEFAULT_LEVEL)?;
    let id = index as i64;
    let element = (verdict != Verdict::Added).then_some(id * LINES + 1);
    let geometry = Some(wkb::line(points));
    let is_new = matches!(verdict, Verdict::Added | Verdict::Modified);
    Ok(ChangeRecord {
        tile,
        change: id.wrapping_mul(0x9e37_79b9_7f4a_7c15_u64 as i64),
        element,
        content: 0,
        kind: ElementKind::LaneMarking.code(),
        from_m: 0.0,
        to_m: LINE_M,
        verdict: verdict.code(),
        p_no_change: 1.0 - posterior,
        p_added: of(Verdict::Added),
        p_removed: of(Verdict::Removed),
        p_modified: of(Verdict::Modified),
        log_odds: 3.0,
        evidence_fx: 0,
        vehicles: (index % 30) as i32,
        passes: (index % 40) as i32,
        exposed: 400,
        hit: 100,
        first_ns: 20_500 * DAY_NS,
        last_ns: (20_500 + id % 30) * DAY_NS,
        changed_after_ns: None,
        changed_before_ns: None,
        shift_m: None,
        shift_sigma_m: None,
        class_observed: Some(1),
        geometry_old: geometry.clone().filter(|_| element.is_some()),
        geometry_new: geometry.filter(|_| is_new),
        best_vehicle: 0,
        best_ns: 0,
        fusion_model: "calibrated".to_owned(),
    })
}

fn header(tile: i32) -> LayerHeader {
    LayerHeader {
        tile,
        digest: "0".repeat(64),
        evidence_digest: "0".repeat(64),
        fusion_model: "calibrated".to_owned(),
        sensor_model: 0,
        as_of_ns: 0,
        no_change: 0,
        added: 0,
        removed: 0,
        modified: 0,
        unknown: 0,
        stale: 0,
    }
}
