//! `export`: a version's changes for programs that are not ours, and for the map itself.

use std::io::Write;

use tilefold_formats::export::{
    ExportError, Scene, write_flatgeobuf, write_geoparquet, write_pmtiles, write_scene,
};
use tilefold_formats::geojson::write_changes;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{ChangeRecord, Verdict};
use tilefold_store::{Snapshot, TileFilter};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::bounds;

use crate::error::EngineError;
use crate::evaluate::Criteria;

/// A form in which changes are seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// RFC 7946.
    GeoJson,
    /// GeoParquet 1.1.
    GeoParquet,
    /// FlatGeobuf with its index.
    FlatGeobuf,
    /// PMTiles 3 with vector tiles, over the map.
    PmTiles,
    /// MCAP with Foxglove's scenes, over the map.
    Scene,
}

/// Which records are taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Choice {
    /// All, also what did not change and what is unknown.
    All,
    /// Those that claim a change.
    Claims(Criteria),
}

/// The records of a version that are chosen, in the order of the store.
///
/// # Errors
/// The store cannot be read.
pub fn chosen(snapshot: &Snapshot, choice: Choice) -> Result<Vec<ChangeRecord>, EngineError> {
    let mut records: Vec<ChangeRecord> = snapshot.read(TileFilter::All)?;
    if let Choice::Claims(criteria) = choice {
        records.retain(|record| criteria.admit(record));
    }
    Ok(records)
}

/// Writes `records` of a version; the number of records that the form has no place for.
///
/// # Errors
/// The store cannot be read, or `out` does not take the bytes.
pub fn write_view(
    snapshot: &Snapshot,
    records: &[ChangeRecord],
    view: View,
    out: &mut (impl Write + Send),
) -> Result<usize, EngineError> {
    match view {
        View::GeoJson => write_changes(records, out)?,
        View::GeoParquet => write_geoparquet(records, out)?,
        View::FlatGeobuf => return Ok(write_flatgeobuf(records, out)?),
        View::PmTiles => {
            let elements: Vec<ElementRow> = snapshot.read(TileFilter::All)?;
            write_pmtiles(records, &elements, out)?;
        }
        View::Scene => {
            let elements: Vec<ElementRow> = snapshot.read(TileFilter::All)?;
            scene(records, &elements, out)?;
        }
    }
    Ok(0)
}

/// A scene around the middle of the map, at the height of its first vertex.
fn scene(
    records: &[ChangeRecord],
    elements: &[ElementRow],
    out: &mut impl Write,
) -> Result<(), ExportError> {
    let corners: Vec<[f64; 3]> = elements
        .iter()
        .flat_map(|row| [[row.xmin, row.ymin, 0.0], [row.xmax, row.ymax, 0.0]])
        .collect();
    let (low, high) = match corners.is_empty() {
        true => ([0.0; 2], [0.0; 2]),
        false => bounds(&corners),
    };
    let elevation_m = elements
        .first()
        .and_then(|row| tilefold_schemas::wkb::read(&row.geometry).ok())
        .and_then(|geometry| geometry.points.first().map(|point| point[2]));
    let origin = [
        low[0].midpoint(high[0]),
        low[1].midpoint(high[1]),
        elevation_m.unwrap_or(0.0),
    ];
    let frame = LocalFrame::new(origin);
    let scene = Scene {
        records,
        elements,
        origin,
        to_map_m: &|wgs84| frame.to_enu(wgs84),
    };
    write_scene(&scene, out)
}

impl Criteria {
    /// Whether a record claims a change under these criteria.
    #[must_use]
    pub fn admit(self, record: &ChangeRecord) -> bool {
        let posterior = match Verdict::from_code(record.verdict) {
            Some(Verdict::Added) => record.p_added,
            Some(Verdict::Removed) => record.p_removed,
            Some(Verdict::Modified) => record.p_modified,
            _ => return false,
        };
        record.vehicles >= self.min_vehicles && posterior >= self.threshold
    }
}
