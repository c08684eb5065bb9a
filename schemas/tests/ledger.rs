//! The ledger as an algebra: any split, order, duplication and retraction of the same chunks gives
//! the same bits.

use std::collections::BTreeSet;

use proptest::prelude::*;
use tilefold_schemas::evidence::CLASS_BINS;
use tilefold_schemas::{ChunkId, EvidenceRow, Footprint, Ledger, Testified, TileId, VehicleKey};

/// A row of a chunk; few values of everything, so that rows meet.
fn row() -> impl Strategy<Value = EvidenceRow> {
    let place = (0..3_i32, 0..3_i64, 0..2_i32);
    let chunk = (0..4_i64, 0..2_i64, 0..3_i64);
    (place, chunk, 0..3_i32, any::<i64>()).prop_map(|(place, chunk, hit, eta_q8)| EvidenceRow {
        tile: place.0,
        element: place.1,
        content: 0,
        section: place.2,
        vehicle: chunk.0,
        channel: chunk.1,
        window: chunk.2,
        method: 3,
        model: 0,
        exposed: 3,
        hit,
        sum_v_q8: 0,
        sum_w_no_q8: 0,
        sum_w_add_q8: 0,
        sum_w_del_q8: 0,
        sum_w_mod_q8: 0,
        residual_eta_q8: eta_q8,
        residual_lambda_q8: 0,
        along_eta_q8: 0,
        along_lambda_q8: 0,
        seen: [hit; CLASS_BINS],
        first_ms: 0,
        last_after_ms: 1,
        best_after_ms: 0,
        best_v_q8: 0,
    })
}

fn rows() -> impl Strategy<Value = Vec<EvidenceRow>> {
    prop::collection::vec(row(), 0..60)
}

fn of(rows: &[EvidenceRow]) -> Ledger<EvidenceRow> {
    Ledger::of(rows.to_vec())
}

fn vehicle(key: i64, rows: &[EvidenceRow]) -> BTreeSet<ChunkId> {
    let chunks = rows.iter().map(Testified::chunk);
    chunks.filter(|chunk| chunk.vehicle.0 == key).collect()
}

proptest! {
    #[test]
    fn split_shuffled_and_repeated_rows_are_the_same_ledger(
        (rows, shuffled) in rows().prop_flat_map(|rows| (Just(rows.clone()), Just(rows).prop_shuffle())),
        at in prop::collection::vec(any::<prop::sample::Index>(), 3),
    ) {
        let whole = of(&rows);
        let mut at: Vec<usize> = at.iter().map(|at| at.index(rows.len() + 1)).collect();
        at.sort_unstable();
        // Overlapping parts: the second and the third have rows in common.
        let parts = [&shuffled[..at[2]], &shuffled[at[0]..], &shuffled[at[1]..]];
        let [a, b, c] = parts.map(of);
        let left = a.clone().merge(b.clone()).merge(c.clone());
        let right = c.merge(b.merge(a));
        prop_assert_eq!(&left, &right);
        prop_assert_eq!(&left, &whole);
        prop_assert_eq!(left.digest(), whole.digest());
    }

    #[test]
    fn what_is_taken_out_was_never_there(rows in rows(), key in 0..4_i64, twice in any::<bool>()) {
        let never: Vec<_> = rows.iter().filter(|row| row.vehicle != key).cloned().collect();
        let chunks = vehicle(key, &rows);
        let mut without = of(&rows).subtract(&chunks);
        if twice {
            without = without.subtract(&chunks);
        }
        prop_assert_eq!(without.digest(), of(&never).digest());
        prop_assert_eq!(&without, &of(&never));
        let again = without.merge(of(&rows));
        prop_assert_eq!(again, of(&rows));
    }

    #[test]
    fn tiles_and_chunks_can_be_taken_in_any_order(rows in rows(), key in 0..4_i64, tile in 0..3_i32) {
        let (chunks, tiles) = (vehicle(key, &rows), BTreeSet::from([TileId(tile)]));
        let one = of(&rows).subtract(&chunks).within(&tiles);
        let other = of(&rows).within(&tiles).subtract(&chunks);
        prop_assert_eq!(one, other);
    }

    #[test]
    fn another_row_is_another_digest(rows in rows(), other in row()) {
        let with = of(&rows).merge(of(std::slice::from_ref(&other)));
        let is_new = !rows.contains(&other);
        prop_assert_eq!(with.digest() != of(&rows).digest(), is_new);
    }
}

#[test]
fn footprints_lie_by_time() {
    let footprint = |at_ms: i32, kinds: i16| Footprint {
        tile: 1,
        vehicle: 2,
        channel: 3,
        window: 4,
        method: 3,
        model: 0,
        kinds,
        at_ms,
        longitude_e6: 0,
        latitude_e6: 0,
        yaw_mrad: 0,
        frames: 1,
        range_from_mm: 0,
        range_to_mm: 0,
        left_mm: 0,
        right_mm: 0,
        v_q8: 0,
    };
    // Two looks at one time, for lines and for areas, are two.
    let ledger = Ledger::of(vec![
        footprint(7, 1),
        footprint(5, 8),
        footprint(5, 1),
        footprint(5, 8),
    ]);
    let found: Vec<(i32, i16)> = ledger
        .rows()
        .iter()
        .map(|row| (row.at_ms, row.kinds))
        .collect();
    assert_eq!(found, [(5, 1), (5, 8), (7, 1)]);
    let chunk = ChunkId {
        vehicle: VehicleKey(2),
        channel: 3,
        window: 4,
    };
    assert!(ledger.subtract(&BTreeSet::from([chunk])).rows().is_empty());
}
