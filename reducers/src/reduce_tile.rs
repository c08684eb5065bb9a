//! The reduce stage of one tile. This file only joins its siblings.

use std::collections::BTreeMap;

use tilefold_schemas::{ChangeRecord, EvidenceRow};
use tilefold_tiler::map_index::MappedElement;

use crate::elements;
use crate::fold::Fold;

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
    let mut rows: BTreeMap<i64, Vec<&EvidenceRow>> = BTreeMap::new();
    for row in &input.rows {
        rows.entry(row.element).or_default().push(row);
    }
    let of = |element: &MappedElement| rows.get(&element.element.id.0).map_or(&[][..], |rows| rows);
    input
        .elements
        .iter()
        .flat_map(|element| elements::judge(element, of(element), fold))
        .collect()
}
