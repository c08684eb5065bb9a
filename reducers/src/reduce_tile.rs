//! The reduce stage of one tile. This file only joins its siblings.

use std::collections::BTreeMap;

use tilefold_schemas::{ChangeRecord, EvidenceRow};
use tilefold_tiler::map_index::MappedElement;

use crate::elements;
use crate::fold::Fold;

/// All that is known of one tile.
#[derive(Debug, Clone, Default)]
pub struct TileInput<'a> {
    /// Elements that the tile owns, by id.
    pub elements: Vec<&'a MappedElement>,
    /// Ledger rows of these elements, in any order.
    pub rows: Vec<&'a EvidenceRow>,
    /// Additions that the tile owns.
    pub additions: Vec<&'a ChangeRecord>,
}

/// The change records of a tile: one or more an element, then the additions.
#[must_use]
pub fn reduce_tile(input: &TileInput<'_>, fold: &Fold) -> Vec<ChangeRecord> {
    let mut rows: BTreeMap<i64, Vec<&EvidenceRow>> = BTreeMap::new();
    for row in &input.rows {
        rows.entry(row.element).or_default().push(row);
    }
    let of = |element: &MappedElement| rows.get(&element.element.id.0).map_or(&[][..], |rows| rows);
    let mut records: Vec<ChangeRecord> = input
        .elements
        .iter()
        .flat_map(|element| elements::judge(element, of(element), fold))
        .collect();
    records.extend(input.additions.iter().map(|addition| (*addition).clone()));
    records
}
