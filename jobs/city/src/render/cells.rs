//! Lists of things by the square of ground that they touch, for one picture.

use super::vector::{V2, v2};

/// A square of cells around a place; every cell lists numbers, in the order in which they came.
pub(super) struct Cells {
    corner: V2,
    cell_m: f32,
    side: usize,
    /// Where each cell's list begins in `items`.
    starts: Vec<u32>,
    items: Vec<u32>,
}

/// Collects what lies where, before it is sorted into lists.
pub(super) struct CellsBuilder {
    corner: V2,
    cell_m: f32,
    side: usize,
    entries: Vec<(u32, u32)>,
}

impl CellsBuilder {
    /// `side` by `side` cells of `cell_m`, around `middle`.
    pub(super) fn new(middle: V2, cell_m: f32, side: usize) -> Self {
        let half_m = side as f32 * cell_m / 2.0;
        Self {
            corner: middle - v2(half_m, half_m),
            cell_m,
            side,
            entries: Vec::new(),
        }
    }

    /// Adds `item` to the cells that come within `reach_m` of the line from `a` to `b`.
    pub(super) fn add(&mut self, item: u32, a: V2, b: V2, reach_m: f32) {
        let low = v2(a.x.min(b.x), a.y.min(b.y)) - v2(reach_m, reach_m) - self.corner;
        let high = v2(a.x.max(b.x), a.y.max(b.y)) + v2(reach_m, reach_m) - self.corner;
        let last = self.side as f32 - 1.0;
        if high.x < 0.0 || high.y < 0.0 || low.x.min(low.y) >= self.side as f32 * self.cell_m {
            return;
        }
        let index = |metres: f32| (metres / self.cell_m).clamp(0.0, last) as usize;
        if low.x >= self.side as f32 * self.cell_m || low.y >= self.side as f32 * self.cell_m {
            return;
        }
        // A cell's middle is at most half of a diagonal from any of its points.
        let near_m = reach_m + self.cell_m * 0.708;
        for y in index(low.y)..=index(high.y) {
            for x in index(low.x)..=index(high.x) {
                let middle = self.corner + v2(x as f32 + 0.5, y as f32 + 0.5) * self.cell_m;
                if distance(middle, a, b) <= near_m {
                    self.entries.push(((y * self.side + x) as u32, item));
                }
            }
        }
    }

    /// The lists.
    pub(super) fn finish(self) -> Cells {
        let mut starts = vec![0_u32; self.side * self.side + 1];
        for &(cell, _) in &self.entries {
            starts[cell as usize + 1] += 1;
        }
        for cell in 1..starts.len() {
            starts[cell] += starts[cell - 1];
        }
        let mut next = starts.clone();
        let mut items = vec![0; self.entries.len()];
        for (cell, item) in self.entries {
            let at = &mut next[cell as usize];
            items[*at as usize] = item;
            *at += 1;
        }
        Cells {
            corner: self.corner,
            cell_m: self.cell_m,
            side: self.side,
            starts,
            items,
        }
    }
}

impl Cells {
    /// What touches the cell of a place.
    pub(super) fn at(&self, place: V2) -> &[u32] {
        let at = (place - self.corner) * (1.0 / self.cell_m);
        let side = self.side as f32;
        if !(at.x >= 0.0 && at.y >= 0.0 && at.x < side && at.y < side) {
            return &[];
        }
        let cell = at.y as usize * self.side + at.x as usize;
        &self.items[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}

/// Distance from a point to the line from `a` to `b`.
pub(super) fn distance(point: V2, a: V2, b: V2) -> f32 {
    let along = b - a;
    let share = (point - a).dot(along) / along.dot(along).max(1e-12);
    (point - a - along * share.clamp(0.0, 1.0)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_listed_along_its_way_and_nowhere_else() {
        let mut builder = CellsBuilder::new(v2(0.0, 0.0), 2.0, 50);
        builder.add(7, v2(-20.0, -20.0), v2(20.0, 20.0), 0.1);
        builder.add(8, v2(300.0, 0.0), v2(310.0, 0.0), 0.1);
        let cells = builder.finish();
        assert_eq!(cells.at(v2(3.3, 3.1)), [7]);
        assert!(cells.at(v2(10.0, -10.0)).is_empty());
        assert!(cells.at(v2(49.0, 0.0)).is_empty());
        assert!(cells.at(v2(1e9, 0.0)).is_empty());
    }
}
