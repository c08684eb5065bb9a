//! `export`: a version's changes for programs that are not ours, and for the map itself.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};

use tilefold_formats::export::{
    ExportError, Scene, write_flatgeobuf, write_geoparquet, write_pmtiles, write_scene,
};
use tilefold_formats::geojson::write_changes;
use tilefold_formats::map::{self, LocalFrames, MapError};
use tilefold_formats::map_patch::{NewIds, OsmText, Patch};
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{ChangeRecord, SetAside, SetAsideKind, Verdict, wkb};
use tilefold_store::{Snapshot, TileFilter};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::bounds;

use crate::base_map;
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

/// A form in which changes are brought into the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Amendment {
    /// The map with the changes in it.
    Lanelet2,
    /// The changes as an OsmChange.
    Osc,
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

/// A map's file with changes in it, or the changes of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AmendedMap {
    /// The name of the map's file, without its folder.
    pub name: String,
    /// What it is now.
    pub bytes: Vec<u8>,
}

/// What of the records came into the maps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Amended {
    /// The maps, in their order; a divided map by its tiles.
    pub maps: Vec<AmendedMap>,
    /// Records that are in a patch.
    pub applied: usize,
    /// Records about elements of the store's other maps.
    pub elsewhere: usize,
    /// Records that could not be written into a map.
    pub set_aside: Vec<SetAside>,
}

/// Brings `records` of a version into `maps`, which must be maps of that version, and Lanelet2.
///
/// Each record goes into one map. What is new gets ids that none of the maps has.
///
/// # Errors
/// The store or a map cannot be read, or their elements differ.
pub fn amend(
    snapshot: &Snapshot,
    records: Vec<ChangeRecord>,
    maps: &[PathBuf],
    form: Amendment,
) -> Result<Amended, EngineError> {
    let ours: Vec<ElementRow> = snapshot.read(TileFilter::All)?;
    let mut opened = Vec::new();
    for map in maps {
        for file in map::files(map)? {
            opened.push(OpenMap::read(snapshot, &ours, &file)?);
        }
    }
    let texts = opened.iter().map(|map| &map.text);
    let mut ids = match form {
        Amendment::Lanelet2 => NewIds::behind(texts),
        Amendment::Osc => NewIds::before(texts),
    };
    let mut amended = Amended::default();
    let shares = share_out(&ours, records, &opened, &mut amended);
    for (map, records) in opened.iter().zip(shares) {
        let patch = Patch::plan(&map.text, &records, &mut ids)?;
        amended.take(map, &patch, form)?;
    }
    Ok(amended)
}

/// A map to be patched.
struct OpenMap {
    file: PathBuf,
    text: OsmText,
    elements: BTreeSet<i64>,
}

impl OpenMap {
    fn read(snapshot: &Snapshot, ours: &[ElementRow], file: &Path) -> Result<Self, EngineError> {
        let elements = same_map(snapshot, ours, file)?;
        let name = file.display().to_string();
        let bytes = std::fs::read(file).map_err(|source| MapError::Io {
            file: name.clone(),
            source,
        })?;
        let text = OsmText::read(bytes, &name)?.located(&mut LocalFrames::beside(file));
        Ok(Self {
            file: file.to_owned(),
            text,
            elements,
        })
    }

    fn name(&self) -> String {
        let name = self.file.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }
}

/// The records of each map. Where two maps share an element, a patch of each would contradict the other.
fn share_out(
    ours: &[ElementRow],
    records: Vec<ChangeRecord>,
    maps: &[OpenMap],
    amended: &mut Amended,
) -> Vec<Vec<ChangeRecord>> {
    let mut shares: Vec<Vec<ChangeRecord>> = maps.iter().map(|_| Vec::new()).collect();
    for record in records {
        let element = record.element.or_else(|| nearest(ours, &record));
        let has_it = |map: &&OpenMap| element.is_none_or(|id| map.elements.contains(&id));
        let having: Vec<&OpenMap> = maps.iter().filter(has_it).collect();
        let first = maps.iter().position(|map| has_it(&map));
        match (first, &having[..]) {
            (Some(_), [one, other, ..]) if record.element.is_some() => {
                let reason = format!(
                    "change {:016x}: its element is also in {}; edit both by hand",
                    record.change,
                    other.file.display()
                );
                let file = one.file.display().to_string();
                let lost = SetAside::new(SetAsideKind::Element, &file, reason);
                amended.set_aside.push(lost);
            }
            (Some(first), _) => shares[first].push(record),
            (None, _) => amended.elsewhere += 1,
        }
    }
    shares
}

impl Amended {
    fn take(&mut self, map: &OpenMap, patch: &Patch, form: Amendment) -> Result<(), EngineError> {
        let mut bytes = Vec::new();
        match form {
            Amendment::Lanelet2 => bytes = patch.lanelet2(&map.text),
            Amendment::Osc => patch
                .osc(&map.text, &mut bytes)
                .map_err(ExportError::from)?,
        }
        self.applied += patch.applied;
        let file = map.file.display().to_string();
        self.set_aside
            .extend(patch.not_applied.iter().map(|change| {
                let reason = format!("change {:016x}: {}", change.change, change.reason);
                SetAside::new(SetAsideKind::Element, &file, reason)
            }));
        self.maps.push(AmendedMap {
            name: map.name(),
            bytes,
        });
        Ok(())
    }
}

/// The elements of `map`, each of which must be in the store as it is.
fn same_map(
    snapshot: &Snapshot,
    ours: &[ElementRow],
    map: &Path,
) -> Result<BTreeSet<i64>, EngineError> {
    let tile_level = u32::from(snapshot.store().properties().tile_level);
    let known: BTreeMap<i64, i64> = ours.iter().map(|row| (row.element, row.content)).collect();
    let (theirs, _) = base_map::read(&[map.to_owned()], tile_level)?;
    let differs = |row: &&ElementRow| known.get(&row.element) != Some(&row.content);
    let count = theirs.iter().filter(differs).count();
    let file_name = map.file_name().map(|name| name.to_string_lossy());
    let lacking = ours.iter().filter(|row| {
        file_name.as_deref() == Some(row.source.as_str())
            && theirs
                .binary_search_by_key(&row.element, |row| row.element)
                .is_err()
    });
    let lacking = lacking.count();
    if count + lacking > 0 || theirs.is_empty() {
        let first = theirs.iter().find(differs).map(|row| row.element);
        return Err(EngineError::OtherMap {
            map: map.display().to_string(),
            version: snapshot.version(),
            differ: count,
            lacking,
            first,
        });
    }
    Ok(theirs.iter().map(|row| row.element).collect())
}

/// The element nearest to a change, by their vertices.
fn nearest(elements: &[ElementRow], record: &ChangeRecord) -> Option<i64> {
    let bytes = record.geometry_new.as_deref()?;
    let [x, y, _] = *wkb::read(bytes).ok()?.points.first()?;
    let scale = y.to_radians().cos();
    let away = |row: &&ElementRow| {
        let beside = |low: f64, high: f64, value: f64| (low - value).max(value - high).max(0.0);
        let [east, north] = [
            beside(row.xmin, row.xmax, x) * scale,
            beside(row.ymin, row.ymax, y),
        ];
        east.hypot(north)
    };
    let nearest = elements.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
    nearest.map(|row| row.element)
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
        .and_then(|row| wkb::read(&row.geometry).ok())
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
