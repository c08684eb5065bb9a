//! Points on the plane by place, to find what is near.

use std::collections::HashMap;

use super::course::distance_m;
use super::within;
use crate::error::CityError;
use crate::world::Lane;

/// Side of a cell in metres: how far [`Places::near`] looks.
pub(super) const CELL_M: f64 = 4.0;
/// Most points in a cell. A junction of thirty lanes has some hundred; what has more is a map drawn
/// over itself, in which every point is near every other.
const MOST_IN_CELL: f64 = 1_000.0;

/// Points with their owners.
#[derive(Debug, Default)]
pub(super) struct Places {
    cells: HashMap<[i64; 2], Vec<Spot>>,
}

/// A point and whose it is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// Which lane.
    pub(super) lane: usize,
    /// Which of its points.
    pub(super) point: usize,
    pub(super) at: [f64; 2],
}

impl Places {
    pub(super) fn insert(&mut self, spot: Spot) -> Result<(), CityError> {
        let cell = self.cells.entry(cell(spot.at)).or_default();
        cell.push(spot);
        let what = "number of lane points within four metres";
        within(what, cell.len() as f64, MOST_IN_CELL)
    }

    /// What lies within `radius_m`, at most [`CELL_M`], of a place; by cell, in order of insertion.
    pub(super) fn near(&self, at: [f64; 2], radius_m: f64) -> impl Iterator<Item = &Spot> {
        let [column, row] = cell(at);
        let around = (-1..=1).flat_map(move |dx| (-1..=1).map(move |dy| [column + dx, row + dy]));
        around
            .filter_map(|cell| self.cells.get(&cell))
            .flatten()
            .filter(move |spot| distance_m(spot.at, at) <= radius_m)
    }
}

fn cell(at: [f64; 2]) -> [i64; 2] {
    at.map(|value| (value / CELL_M).floor() as i64)
}

/// The points of all lanes' middles.
pub(super) fn middles(lanes: &[Lane]) -> Result<Places, CityError> {
    let mut places = Places::default();
    for (lane, course) in lanes.iter().enumerate() {
        for (point, &[east_m, north_m, _]) in course.centre.iter().enumerate() {
            let at = [east_m, north_m];
            places.insert(Spot { lane, point, at })?;
        }
    }
    Ok(places)
}
