//! Things of the whole city by the 64 m square that they lie in, so that a picture takes up only
//! what is near.

use std::collections::BTreeMap;

/// Metres of a bucket's side.
const BUCKET_M: f64 = 64.0;

/// Numbers by square.
#[derive(Default)]
pub(super) struct Buckets {
    squares: BTreeMap<(i32, i32), Vec<u32>>,
}

impl Buckets {
    /// Enters `item` at a place (metres east and north).
    pub(super) fn add(&mut self, item: u32, place: [f64; 2]) {
        let square = place.map(|metres| (metres / BUCKET_M).floor() as i32);
        self.squares
            .entry((square[0], square[1]))
            .or_default()
            .push(item);
    }

    /// What lies in squares that come within `reach_m` of a place, in ascending order.
    pub(super) fn near(&self, place: [f64; 2], reach_m: f64) -> Vec<u32> {
        let low = place.map(|metres| ((metres - reach_m) / BUCKET_M).floor() as i32);
        let high = place.map(|metres| ((metres + reach_m) / BUCKET_M).floor() as i32);
        let mut items = Vec::new();
        for x in low[0]..=high[0] {
            for (_, square) in self.squares.range((x, low[1])..=(x, high[1])) {
                items.extend_from_slice(square);
            }
        }
        items.sort_unstable();
        items.dedup();
        items
    }
}
