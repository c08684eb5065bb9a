//! The reduce stage of one tile. This file only joins its siblings.

use tilefold_schemas::{ChangeRecord, EvidenceRow};
use tilefold_tiler::map_index::MappedElement;

use crate::elements;
use crate::fold::Fold;
use crate::sections::SectionIndex;

/// All that is known of the elements of one tile.
#[derive(Debug, Clone, Default)]
pub struct TileInput<'a> {
    /// Elements that the tile owns, by id.
    pub elements: Vec<&'a MappedElement>,
    /// Ledger rows of these elements, in any order.
    pub rows: Vec<&'a EvidenceRow>,
}

/// The change records of a tile's elements: one or more an element.
#[must_use]
pub fn reduce_tile(input: &TileInput<'_>, fold: &Fold) -> Vec<ChangeRecord> {
    let ids = input.elements.iter().map(|mapped| mapped.element.id.0);
    let index = SectionIndex::new(ids.map(|id| (id, 1)));
    let mut rows: Vec<Vec<&EvidenceRow>> = vec![Vec::new(); index.len()];
    for row in &input.rows {
        // Rows of elements that are no longer in the map say nothing.
        if let Some(place) = index.first(row.element) {
            rows[place as usize].push(row);
        }
    }
    let elements = input.elements.iter().zip(&rows);
    elements
        .flat_map(|(mapped, rows)| elements::judge(mapped, rows, fold))
        .collect()
}
