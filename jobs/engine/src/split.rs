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
    elements: Vec<&'a MappedElement>,
    rows: &'a [EvidenceRow],
) -> Vec<Piece<'a>> {
    cut(elements, rows, ROWS)
}

fn cut<'a>(
    mut elements: Vec<&'a MappedElement>,
    rows: &'a [EvidenceRow],
    most: usize,
) -> Vec<Piece<'a>> {
    if rows.len() <= most {
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
            Some(last) if end - start_of(rows, last) <= most => {
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

#[cfg(test)]
mod tests {
    use tilefold_reducers::FusionModel;
    use tilefold_schemas::evidence::{CLASS_BINS, METHOD_VERSION};
    use tilefold_schemas::fixed::ONE_Q8;
    use tilefold_schemas::{Color, Element, ElementId, ElementKind, Marking, SignClass};
    use tilefold_tiler::tile::DEFAULT_LEVEL;

    use super::*;

    /// A solid line of 30 m.
    fn line(id: i64) -> MappedElement {
        let north_deg = 48.0 + id as f64 * 1e-5;
        let element = Element {
            id: ElementId(id),
            kind: ElementKind::LaneMarking,
            marking: Marking::Solid,
            color: Color::White,
            sign: SignClass::Unknown,
            points: vec![[11.5, north_deg, 0.0], [11.5004, north_deg, 0.0]],
            tags: Default::default(),
        };
        MappedElement::new(element, DEFAULT_LEVEL).unwrap()
    }

    /// What a vehicle says of a section of it: seen ten times, matched `hit` times.
    fn row(mapped: &MappedElement, vehicle: i64, hit: i32) -> EvidenceRow {
        EvidenceRow {
            tile: mapped.tile.0,
            element: mapped.element.id.0,
            content: mapped.content.0,
            section: 0,
            vehicle,
            channel: 1,
            window: 1,
            method: METHOD_VERSION,
            model: 0,
            exposed: 10,
            hit,
            sum_v_q8: 9 * ONE_Q8,
            sum_w_no_q8: ONE_Q8,
            sum_w_add_q8: 0,
            sum_w_del_q8: ONE_Q8,
            sum_w_mod_q8: 0,
            residual_eta_q8: i64::from(hit) * ONE_Q8,
            residual_lambda_q8: i64::from(hit) * 10 * ONE_Q8,
            along_eta_q8: 0,
            along_lambda_q8: 0,
            seen: [0; CLASS_BINS],
            first_ms: vehicle as i32 * 1_000,
            last_after_ms: 1,
            best_after_ms: 0,
            best_v_q8: ONE_Q8,
        }
    }

    #[test]
    fn pieces_say_what_the_whole_tile_says() {
        let elements: Vec<MappedElement> = [7, 3, 9, 5, 1].map(line).into();
        let asked = || elements.iter().collect::<Vec<&MappedElement>>();
        // One that nobody saw, one that is gone, and rows of one that is no longer in the map.
        let seen = [line(1), line(3), line(4), line(5), line(7)];
        let mut rows: Vec<EvidenceRow> = (seen.iter())
            .flat_map(|mapped| {
                let hit = if mapped.element.id.0 == 5 { 0 } else { 9 };
                (1..6).map(move |vehicle| row(mapped, vehicle, hit))
            })
            .collect();
        rows.sort();
        let fold = Fold::of_fleet(FusionModel::Calibrated, Default::default());
        let in_order = |pieces: Vec<Piece<'_>>| {
            let mut records = judge(pieces, &fold, &Meter::default());
            records.sort_by_key(|record| (record.element, record.change));
            records
        };
        let whole = cut(asked(), &rows, usize::MAX);
        assert_eq!(whole.len(), 1);
        let whole = in_order(whole);
        assert!(whole.len() >= elements.len());
        for most in [1, 7, 12, 24] {
            let pieces = cut(asked(), &rows, most);
            assert!(pieces.len() > 1, "{most}");
            assert!(pieces.iter().all(|piece| piece.rows.len() <= most.max(5)));
            assert_eq!(in_order(pieces), whole, "{most} rows at most");
        }
    }
}
