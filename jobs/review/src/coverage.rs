//! Where vehicles looked and where they did not, and where to drive next.
//!
//! The map is laid on a grid of web tiles of zoom 20 (38 m at the equator). A cell knows how much paint the map
//! has in it and how many vehicles looked there. Cells with too few of them, and changes that are
//! still open, are added up over places of 8 by 8 cells; the places that want a drive most are named.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::table::Table;
use tilefold_schemas::{ChangeRecord, Footprint, Verdict, wkb};
use tilefold_store::{Snapshot, StoreError, TileFilter};

use crate::error::ReviewError;

const ZOOM: u32 = 20;
/// Cells of a place along a side, as a power of two.
const PLACE: u32 = 3;
/// Places that are named.
const NAMED: usize = 12;
/// Vehicles that a claim needs (V in the paper).
const ENOUGH: usize = 5;
/// Steps along paint, and along what a vehicle looked at, in metres.
const STEP_M: f64 = 5.0;
/// Looks count up to here; farther ones are of little worth.
const REACH_M: f64 = 40.0;
/// A change with a posterior between these is open: more looks would settle it.
const OPEN: std::ops::Range<f64> = 0.15..0.85;
/// Paint, in metres, that an open change is worth where places are ranked.
const OPEN_M: u64 = 50;
/// Metres of a degree of latitude.
const DEGREE_M: f64 = 111_195.0;

/// The grid, a column a property, and the places that want a drive.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Coverage {
    zoom: u32,
    enough: usize,
    column: Vec<u32>,
    row: Vec<u32>,
    /// Paint of the map, metres.
    paint_m: Vec<u32>,
    /// Vehicles that looked.
    vehicles: Vec<u32>,
    /// The last look, seconds since the Unix epoch; 0 where there was none.
    last_s: Vec<i64>,
    places: Vec<Place>,
}

/// A place that wants a drive.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Place {
    longitude: f64,
    latitude: f64,
    /// Paint that nobody looked at, metres.
    unseen_m: u64,
    /// Paint that some vehicles looked at, but too few.
    thin_m: u64,
    /// Verdicts that more looks would settle: unknown, stale, or neither likely nor unlikely.
    open: u64,
}

#[derive(Debug, Default)]
struct Cell {
    paint_m: f64,
    vehicles: BTreeSet<i64>,
    last_ns: i64,
    open: u64,
}

type Address = (u32, u32);

impl Coverage {
    /// Lays a version on the grid.
    pub(crate) fn read(snapshot: &Snapshot) -> Result<Self, ReviewError> {
        let mut cells: BTreeMap<Address, Cell> = BTreeMap::new();
        let elements: Vec<ElementRow> = snapshot.read(TileFilter::All)?;
        for row in &elements {
            add_paint(&mut cells, &row.geometry);
        }
        // Footprints are many: one data file at a time.
        for batch in snapshot.batches::<Footprint>(TileFilter::All)? {
            let rows = Footprint::from_batch(&batch?).map_err(|source| StoreError::Column {
                file: "footprints".to_owned(),
                table: "footprints".to_owned(),
                source,
            })?;
            for look in &rows {
                add_look(&mut cells, look);
            }
        }
        let records: Vec<ChangeRecord> = snapshot.read(TileFilter::All)?;
        for record in &records {
            add_open(&mut cells, record);
        }
        cells.retain(|_, cell| cell.paint_m >= 1.0 || cell.open > 0);
        Ok(Self::of(&cells))
    }

    fn of(cells: &BTreeMap<Address, Cell>) -> Self {
        let mut coverage = Self {
            zoom: ZOOM,
            enough: ENOUGH,
            places: places(cells),
            ..Self::default()
        };
        for (&(column, row), cell) in cells {
            coverage.column.push(column);
            coverage.row.push(row);
            coverage.paint_m.push(cell.paint_m.round() as u32);
            coverage.vehicles.push(cell.vehicles.len() as u32);
            coverage.last_s.push(cell.last_ns / 1_000_000_000);
        }
        coverage
    }
}

/// Walks along a geometry and adds its length to the cells it passes.
fn add_paint(cells: &mut BTreeMap<Address, Cell>, geometry: &[u8]) {
    let Ok(geometry) = wkb::read(geometry) else {
        return;
    };
    for pair in geometry.points.windows(2) {
        let [dx, dy] = metres(pair[0], pair[1]);
        let length_m = dx.hypot(dy);
        let steps = (length_m / STEP_M).ceil().max(1.0);
        for step in 0..steps as usize {
            let share = (step as f64 + 0.5) / steps;
            let at = [0, 1].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis]));
            cells.entry(address(at)).or_default().paint_m += length_m / steps;
        }
    }
}

/// The cells ahead of a vehicle, as far and as wide as it looked.
fn add_look(cells: &mut BTreeMap<Address, Cell>, look: &Footprint) {
    let here = look.place_deg();
    let yaw = look.yaw_rad();
    let (cos, sin) = (libm::cos(yaw), libm::sin(yaw));
    let scale = [DEGREE_M * libm::cos(here[1].to_radians()), DEGREE_M];
    let metres = |mm: i32| f64::from(mm) * 1e-3;
    let far_m = metres(look.range_to_mm).min(REACH_M);
    for ahead_m in steps(metres(look.range_from_mm), far_m) {
        for left_m in steps(metres(look.right_mm), metres(look.left_mm)) {
            let at = [
                here[0] + (ahead_m * cos - left_m * sin) / scale[0],
                here[1] + (ahead_m * sin + left_m * cos) / scale[1],
            ];
            let cell = cells.entry(address(at)).or_default();
            cell.vehicles.insert(look.vehicle);
            cell.last_ns = cell.last_ns.max(look.at_ns());
        }
    }
}

/// From one end to the other in steps of [`STEP_M`]; both ends are among them.
fn steps(from_m: f64, to_m: f64) -> impl Iterator<Item = f64> {
    let count = ((to_m - from_m) / STEP_M).ceil().max(0.0);
    (0..=count as usize).map(move |step| (from_m + step as f64 * STEP_M).min(to_m.max(from_m)))
}

fn add_open(cells: &mut BTreeMap<Address, Cell>, record: &ChangeRecord) {
    let posterior = 1.0 - record.p_no_change;
    let waiting = [Verdict::Unknown, Verdict::Stale].map(Verdict::code);
    let is_waiting = waiting.contains(&record.verdict);
    let geometry = record
        .geometry_new
        .as_ref()
        .or(record.geometry_old.as_ref());
    let read = geometry.and_then(|geometry| wkb::read(geometry).ok());
    let first = read.and_then(|geometry| geometry.points.first().copied());
    if let Some([longitude, latitude, _]) = first
        && (OPEN.contains(&posterior) || is_waiting)
    {
        cells
            .entry(address([longitude, latitude]))
            .or_default()
            .open += 1;
    }
}

/// The places that want a drive most, those first.
fn places(cells: &BTreeMap<Address, Cell>) -> Vec<Place> {
    let mut by_place: BTreeMap<Address, (Place, [f64; 3])> = BTreeMap::new();
    for (&(column, row), cell) in cells {
        let metres = cell.paint_m.round() as u64;
        let (unseen_m, thin_m) = match cell.vehicles.len() {
            0 => (metres, 0),
            1..ENOUGH => (0, metres),
            _ => (0, 0),
        };
        let wanted = unseen_m + thin_m + cell.open * OPEN_M;
        if wanted == 0 {
            continue;
        }
        let (place, middle) = by_place
            .entry((column >> PLACE, row >> PLACE))
            .or_insert_with(|| (Place::default(), [0.0; 3]));
        place.unseen_m += unseen_m;
        place.thin_m += thin_m;
        place.open += cell.open;
        for (sum, value) in middle.iter_mut().zip([column, row, 1]) {
            *sum += f64::from(value) * wanted as f64;
        }
    }
    let mut places: Vec<Place> = by_place
        .into_values()
        .map(|(place, [x, y, weight])| {
            let [longitude, latitude] = degrees([x / weight + 0.5, y / weight + 0.5]);
            Place {
                longitude,
                latitude,
                ..place
            }
        })
        .collect();
    // The sort is stable: places that are wanted as much stay in the order of the grid.
    places.sort_by_key(|place| std::cmp::Reverse(place.wanted()));
    places.truncate(NAMED);
    places
}

impl Default for Place {
    fn default() -> Self {
        Self {
            longitude: 0.0,
            latitude: 0.0,
            unseen_m: 0,
            thin_m: 0,
            open: 0,
        }
    }
}

impl Place {
    /// Paint nobody saw counts double.
    fn wanted(&self) -> u64 {
        2 * self.unseen_m + self.thin_m + self.open * OPEN_M
    }
}

fn metres(a: [f64; 3], b: [f64; 3]) -> [f64; 2] {
    let scale = libm::cos(a[1].to_radians());
    [(b[0] - a[0]) * DEGREE_M * scale, (b[1] - a[1]) * DEGREE_M]
}

/// Column and row under the Mercator projection on a sphere (EPSG:3857).
fn address([longitude_deg, latitude_deg]: [f64; 2]) -> Address {
    let sides = f64::from(1_u32 << ZOOM);
    let latitude = latitude_deg.clamp(-85.0, 85.0).to_radians();
    let y = 0.5 - 0.5 * libm::asinh(libm::tan(latitude)) / std::f64::consts::PI;
    let index = |share: f64| (share * sides).floor().clamp(0.0, sides - 1.0) as u32;
    (index(longitude_deg / 360.0 + 0.5), index(y))
}

/// Longitude and latitude of a point given in cells.
fn degrees([x, y]: [f64; 2]) -> [f64; 2] {
    let sides = f64::from(1_u32 << ZOOM);
    let latitude = libm::atan(libm::sinh(std::f64::consts::PI * (1.0 - 2.0 * y / sides)));
    [(x / sides - 0.5) * 360.0, latitude.to_degrees()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(longitude: f64, latitude: f64, yaw: f64, vehicle: i64) -> Footprint {
        Footprint {
            tile: 0,
            vehicle,
            channel: 0,
            window: 0,
            method: 0,
            model: 0,
            kinds: 0,
            at_ms: 7_000,
            longitude_e6: (longitude * 1e6) as i32,
            latitude_e6: (latitude * 1e6) as i32,
            yaw_mrad: (yaw * 1e3) as i32,
            frames: 1,
            range_from_mm: 4_000,
            range_to_mm: 30_000,
            left_mm: 5_000,
            right_mm: -5_000,
            v_q8: 0,
        }
    }

    #[test]
    fn a_cell_and_its_degrees_fit() {
        for place in [[8.4, 49.0], [113.9, 22.5], [-122.4, 37.8], [0.0, 0.0]] {
            let (column, row) = address(place);
            let middle = degrees([f64::from(column) + 0.5, f64::from(row) + 0.5]);
            assert_eq!(address(middle), (column, row));
            assert!((middle[0] - place[0]).abs() < 360.0 / f64::from(1 << 20));
        }
    }

    #[test]
    fn paint_that_nobody_looked_at_is_the_first_place_to_drive() {
        let mut cells = BTreeMap::new();
        let line = |longitude: f64| {
            let points = [[longitude, 49.0, 0.0], [longitude + 0.001, 49.0, 0.0]];
            wkb::line(&points)
        };
        add_paint(&mut cells, &line(8.4));
        add_paint(&mut cells, &line(8.5));
        let metres: f64 = cells.values().map(|cell| cell.paint_m).sum();
        assert!((metres - 2.0 * 72.95).abs() < 0.1, "{metres}");
        for vehicle in 0..5 {
            for step in -4..12 {
                add_look(
                    &mut cells,
                    &look(8.4 + f64::from(step) * 1e-4, 49.0, 0.0, vehicle),
                );
            }
        }
        cells.retain(|_, cell| cell.paint_m >= 1.0);
        let places = places(&cells);
        let near = |place: &Place| (8.4999..8.5011).contains(&place.longitude);
        assert!(!places.is_empty() && places.iter().all(near), "{places:?}");
        assert!(places[0].unseen_m >= 24, "{places:?}");
        let unseen_m: u64 = places.iter().map(|place| place.unseen_m).sum();
        // Cells round to the metre.
        assert!(unseen_m.abs_diff(73) <= 3, "{places:?}");
        assert!(places.iter().all(|place| place.thin_m == 0));
    }

    #[test]
    fn a_vehicle_looks_ahead_not_behind() {
        let mut cells = BTreeMap::new();
        add_look(&mut cells, &look(8.4, 49.0, std::f64::consts::FRAC_PI_2, 1));
        let rows: Vec<u32> = cells.keys().map(|(_, row)| *row).collect();
        let own = address([8.4, 49.0]).1;
        // Rows are counted from the north.
        assert!(rows.iter().all(|&row| row <= own), "{rows:?} {own}");
        assert!(rows.iter().any(|&row| row < own));
    }
}
