//! Tiles as pieces of work of like size: a dense tile is cut between elements, and the largest piece
//! comes first, so that no core is left with one tile while the others have nothing to do.
//!
//! A verdict on an element depends on its rows alone, so the records are those of the whole tile.

use std::cmp::Reverse;

use rayon::prelude::*;
use tilefold_reducers::{Fold, TileInput, reduce_tile};
use tilefold_schemas::{ChangeRecord, EvidenceRow};
use tilefold_tiler::map_index::MappedElement;

use crate::meter::{Meter, Stage};

/// Rows of a piece, unless one element alone has more.
const ROWS: usize = 32 * 1024;

/// Elements of one tile and all of their rows, in the order of the ledger.
pub(crate) struct Piece<'a> {
    elements: Vec<&'a MappedElement>,
    rows: &'a [EvidenceRow],
}

/// The elements of a tile in pieces; `rows` are those of the tile that count, in the ledger's order.
pub(crate) fn pieces<'a>(
    mut elements: Vec<&'a MappedElement>,
    rows: &'a [EvidenceRow],
) -> Vec<Piece<'a>> {
    if rows.len() <= ROWS {
        return vec![Piece { elements, rows }];
    }
    elements.sort_by_key(|mapped| mapped.element.id.0);
    let mut pieces: Vec<Piece<'a>> = Vec::new();
    for same in elements.chunk_by(|a, b| a.element.id == b.element.id) {
        let id = same[0].element.id.0;
        let first = rows.partition_point(|row| row.element < id);
        let end = rows.partition_point(|row| row.element <= id);
        match pieces.last_mut() {
            // Rows of elements that are not asked for may lie between: they say nothing.
            Some(last) if end - start_of(rows, last) <= ROWS => {
                last.elements.extend(same);
                last.rows = &rows[start_of(rows, last)..end];
            }
            _ => pieces.push(Piece {
                elements: same.to_vec(),
                rows: &rows[first..end],
            }),
        }
    }
    pieces
}

/// Where the rows of a piece begin among those of its tile.
fn start_of(rows: &[EvidenceRow], piece: &Piece<'_>) -> usize {
    let id = piece.elements[0].element.id.0;
    rows.partition_point(|row| row.element < id)
}

/// What is said of the elements of pieces, in their order.
pub(crate) fn judge(pieces: Vec<Piece<'_>>, fold: &Fold, meter: &Meter) -> Vec<ChangeRecord> {
    let mut order: Vec<(usize, Piece<'_>)> = pieces.into_iter().enumerate().collect();
    order.sort_by_key(|(index, piece)| (Reverse(piece.rows.len()), *index));
    let judged = order.into_iter().par_bridge().map(|(index, piece)| {
        let input = TileInput {
            elements: piece.elements,
            rows: piece.rows.iter().collect(),
        };
        let records = meter.time(Stage::Reduce, || reduce_tile(&input, fold));
        (index, records)
    });
    let mut judged: Vec<(usize, Vec<ChangeRecord>)> = judged.collect();
    judged.sort_by_key(|(index, _)| *index);
    judged
        .into_iter()
        .flat_map(|(_, records)| records)
        .collect()
}
