//! The base map as the map stage looks it up: by place.

use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use tilefold_schemas::id::first_i64;
use tilefold_schemas::{ContentHash, Element, TileId};

use crate::station::Polyline;
use crate::tile::{TileError, tile_of};

/// An element with what was derived from it once.
#[derive(Debug, Clone, PartialEq)]
pub struct MappedElement {
    /// As read.
    pub element: Element,
    /// Owner tile: that of the first vertex.
    pub tile: TileId,
    /// Hash of what it is.
    pub content: ContentHash,
    /// Length of its line in metres, from which every chunk and tile counts its sections; 0 for
    /// what is no line.
    pub length_m: f64,
}

impl MappedElement {
    /// The element with its owner tile at `level`.
    ///
    /// # Errors
    /// The first vertex is on no tile: its coordinates are no degrees, or there is none.
    pub fn new(element: Element, level: u32) -> Result<Self, TileError> {
        let [longitude_deg, latitude_deg, _] =
            element.points.first().copied().unwrap_or([f64::NAN; 3]);
        Ok(Self {
            tile: tile_of(longitude_deg, latitude_deg, level)?,
            content: element.content_hash(),
            length_m: Polyline::of_element(&element.points)
                .map_or(0.0, |(_, line)| line.length_m()),
            element,
        })
    }
}

/// Elements by bounding box in degrees.
#[derive(Debug)]
pub struct MapIndex {
    elements: Vec<MappedElement>,
    boxes: RTree<GeomWithData<Rectangle<[f64; 2]>, usize>>,
}

impl MapIndex {
    /// An index over `elements`.
    #[must_use]
    pub fn new(mut elements: Vec<MappedElement>) -> Self {
        elements.sort_by_key(|mapped| (mapped.element.id, mapped.content));
        let boxes = elements
            .iter()
            .enumerate()
            .map(|(index, mapped)| {
                let (low, high) = bounds(&mapped.element.points);
                GeomWithData::new(Rectangle::from_corners(low, high), index)
            })
            .collect();
        Self {
            elements,
            boxes: RTree::bulk_load(boxes),
        }
    }

    /// All elements, by id.
    #[must_use]
    pub fn elements(&self) -> &[MappedElement] {
        &self.elements
    }

    /// Elements whose bounding box meets the one from `low` to `high` (`[longitude_deg,
    /// latitude_deg]`), by id.
    #[must_use]
    pub fn within(&self, low: [f64; 2], high: [f64; 2]) -> Vec<&MappedElement> {
        let envelope = AABB::from_corners(low, high);
        let mut found: Vec<usize> = self
            .boxes
            .locate_in_envelope_intersecting(envelope)
            .map(|entry| entry.data)
            .collect();
        found.sort_unstable();
        found.iter().map(|&index| &self.elements[index]).collect()
    }

    /// Digest of what [`MapIndex::within`] finds: ids and contents. Never 0.
    #[must_use]
    pub fn digest_within(&self, low: [f64; 2], high: [f64; 2]) -> i64 {
        let mut hasher = blake3::Hasher::new();
        for mapped in self.within(low, high) {
            hasher.update(&mapped.element.id.0.to_le_bytes());
            hasher.update(&mapped.content.0.to_le_bytes());
        }
        match first_i64(&hasher.finalize()) {
            0 => 1,
            digest => digest,
        }
    }
}

/// South-west and north-east corner of a set of vertices, in degrees.
#[must_use]
pub fn bounds(points: &[[f64; 3]]) -> ([f64; 2], [f64; 2]) {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for point in points {
        for axis in 0..2 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    (low, high)
}
