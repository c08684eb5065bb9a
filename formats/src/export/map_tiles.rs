//! The map alone as vector tiles, each cut when it is asked for: the ground of a viewer of ours.
//!
//! Far out, where a lane is thinner than a pixel, lines keep only the vertices that can be told apart.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::wkb;

use super::cut::{Address, Shape, cut};
use super::error::ExportError;
use super::pmtiles::{MAX_ZOOM, MIN_MAP_ZOOM, of_element};
use super::vector_tile::{Layer, Property, encode};

/// The first zoom of the tiles.
pub const FIRST_ZOOM: u8 = 12;
/// Before [`MIN_MAP_ZOOM`], vertices of a line keep this far apart, in units of the tile.
const APART: i32 = 8;

/// The elements of a map, found by tile.
#[derive(Debug)]
pub struct MapTiles {
    elements: Vec<(Shape, Vec<(&'static str, Property)>)>,
    /// Elements in each column and row of [`MIN_MAP_ZOOM`], ascending.
    by_tile: BTreeMap<(u32, u32), Vec<usize>>,
}

impl MapTiles {
    /// Places elements in tiles.
    ///
    /// # Errors
    /// The geometry of one is none.
    pub fn of(elements: &[ElementRow]) -> Result<Self, ExportError> {
        let mut by_tile: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
        let mut placed = Vec::with_capacity(elements.len());
        for (index, row) in elements.iter().enumerate() {
            let geometry = wkb::read(&row.geometry).map_err(|source| ExportError::Element {
                element: row.element,
                source,
            })?;
            let shape = Shape::of(&geometry);
            cut(&shape, (MIN_MAP_ZOOM, MIN_MAP_ZOOM), &mut |address, _| {
                let (_, column, row) = address;
                by_tile.entry((column, row)).or_default().push(index);
            });
            placed.push((shape, of_element(row)));
        }
        Ok(Self {
            elements: placed,
            by_tile,
        })
    }

    /// A tile with the layer `map`, as Mapbox Vector Tiles 2.1 say; none where nothing lies, or at
    /// zooms other than [`FIRST_ZOOM`] to [`MAX_ZOOM`].
    #[must_use]
    pub fn tile(&self, zoom: u8, column: u32, row: u32) -> Option<Vec<u8>> {
        let address = (zoom, column, row);
        let mut layer = Layer::default();
        for index in self.in_tile(address) {
            let (shape, properties) = &self.elements[index];
            let Some(piece) = shape.within(address) else {
                continue;
            };
            let mut parts = piece.in_tile(address);
            if zoom < MIN_MAP_ZOOM {
                parts.iter_mut().for_each(thin);
            }
            layer.add(piece.is_area, &parts, properties);
        }
        encode([("map", layer)])
    }

    /// The tiles in which something lies, from far to near.
    #[must_use]
    pub fn addresses(&self) -> Vec<Address> {
        let mut found: BTreeSet<Address> = BTreeSet::new();
        for (shape, _) in &self.elements {
            cut(shape, (FIRST_ZOOM, MAX_ZOOM), &mut |address, _| {
                found.insert(address);
            });
        }
        found.into_iter().collect()
    }

    /// Elements that may lie in a tile.
    fn in_tile(&self, (zoom, column, row): Address) -> BTreeSet<usize> {
        if !(FIRST_ZOOM..=MAX_ZOOM).contains(&zoom) {
            return BTreeSet::new();
        }
        let nearer = zoom.saturating_sub(MIN_MAP_ZOOM);
        let farther = MIN_MAP_ZOOM.saturating_sub(zoom);
        let span = |index: u32| {
            let first = u64::from(index >> nearer) << farther;
            first..first + (1 << farther)
        };
        let tiles = span(column).flat_map(|column| span(row).map(move |row| (column, row)));
        let known = tiles.filter_map(|(column, row)| {
            let address = (u32::try_from(column).ok()?, u32::try_from(row).ok()?);
            self.by_tile.get(&address)
        });
        known.flatten().copied().collect()
    }
}

/// Leaves out vertices that are too near to the one before; the last one stays.
fn thin(part: &mut Vec<[i32; 2]>) {
    let Some(&last) = part.last() else { return };
    let mut kept: Option<[i32; 2]> = None;
    part.retain(|&[x, y]| {
        let is_far = kept.is_none_or(|[kx, ky]| (x - kx).abs().max((y - ky).abs()) >= APART);
        if is_far {
            kept = Some([x, y]);
        }
        is_far
    });
    if part.last() != Some(&last) {
        part.push(last);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(points: &[[f64; 2]]) -> ElementRow {
        let points: Vec<[f64; 3]> = points.iter().map(|&[x, y]| [x, y, 0.0]).collect();
        ElementRow {
            tile: 0,
            element: 7,
            content: 0,
            kind: 0,
            marking: 1,
            color: 1,
            sign: 0,
            geometry: wkb::line(&points),
            xmin: 0.0,
            ymin: 0.0,
            xmax: 0.0,
            ymax: 0.0,
            tags: String::new(),
            source: String::new(),
        }
    }

    #[test]
    fn every_address_has_a_tile_and_no_other_has() {
        let tiles = MapTiles::of(&[line(&[[8.4, 49.0], [8.41, 49.003]])]).unwrap();
        let addresses = tiles.addresses();
        assert!(addresses.iter().any(|&(zoom, ..)| zoom == FIRST_ZOOM));
        for (zoom, column, row) in addresses {
            assert!(
                tiles.tile(zoom, column, row).is_some(),
                "{zoom}/{column}/{row}"
            );
        }
        assert!(tiles.tile(14, 0, 0).is_none());
        assert!(tiles.tile(200, u32::MAX, u32::MAX).is_none());
        assert!(tiles.tile(FIRST_ZOOM, u32::MAX, u32::MAX).is_none());
    }

    #[test]
    fn far_out_only_vertices_that_can_be_told_apart_are_left() {
        let mut part = vec![[0, 0], [1, 0], [7, 3], [8, 0], [12, 0], [13, 0]];
        thin(&mut part);
        assert_eq!(part, [[0, 0], [8, 0], [13, 0]]);
    }
}
