//! The reduce stage of one tile. This file only joins its siblings.

use std::collections::BTreeMap;

use tilefold_schemas::{ChangeRecord, EvidenceRow};
use tilefold_tiler::map_index::MappedElement;

use crate::elements;

/// How evidence becomes a posterior.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FusionModel {
    /// The paper's equations as printed.
    Paper,
    /// Likelihood ratios of a detection model.
    #[default]
    Calibrated,
}

impl FusionModel {
    /// All models.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Calibrated];

    /// The name in records and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Calibrated => "calibrated",
        }
    }
}

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
pub fn reduce_tile(input: &TileInput<'_>, model: FusionModel) -> Vec<ChangeRecord> {
    let mut rows: BTreeMap<i64, Vec<&EvidenceRow>> = BTreeMap::new();
    for row in &input.rows {
        rows.entry(row.element).or_default().push(row);
    }
    let of = |element: &MappedElement| rows.get(&element.element.id.0).map_or(&[][..], |rows| rows);
    let mut records: Vec<ChangeRecord> = input
        .elements
        .iter()
        .flat_map(|element| elements::judge(element, of(element), model))
        .collect();
    records.extend(input.additions.iter().map(|addition| (*addition).clone()));
    records
}
