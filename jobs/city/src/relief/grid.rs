//! Ground heights on a regular grid, fitted to scattered points.
//!
//! A height between four knots is bilinear. The fit spreads what each point is off over its four
//! knots, a few times, as SIRT does in tomography; knots that no point reaches then take the mean of
//! their neighbourhood, from the next coarser grid that knows one (pull-push; Gortler et al., 1996).

use super::Ground;

/// Least distance of knots in metres, and most knots along a side.
const LEAST_STEP_M: f64 = 1.0;
const MOST_KNOTS: f64 = 1_000.0;
/// Rounds of the fit; on real maps more of them gain less than a millimetre.
const ROUNDS: usize = 20;

/// Heights at knots, row by row from the south-west.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Grid {
    south_west: [f64; 2],
    step_m: f64,
    columns: usize,
    rows: usize,
    heights_m: Vec<f64>,
}

/// A knot and its share in the height of a place.
type Share = (usize, f64);

impl Grid {
    /// The grid through `points` (metres east, north and up); none without a point.
    pub(super) fn fit(points: &[Ground]) -> Option<Self> {
        let mut grid = Self::around(points)?;
        let mut known = vec![0.0; grid.heights_m.len()];
        for _ in 0..ROUNDS {
            known = grid.correct(points);
        }
        grid.heights_m = filled(&grid.heights_m, &known, [grid.columns, grid.rows]);
        Some(grid)
    }

    /// A level grid that covers `points`.
    fn around(points: &[Ground]) -> Option<Self> {
        let mut corners = [*points.first()?; 2];
        for point in points {
            for (axis, value) in point.iter().enumerate() {
                corners[0][axis] = corners[0][axis].min(*value);
                corners[1][axis] = corners[1][axis].max(*value);
            }
        }
        let [low, high] = corners;
        let sides = [high[0] - low[0], high[1] - low[1]];
        let step_m = LEAST_STEP_M.max(sides[0].max(sides[1]) / MOST_KNOTS);
        let knots = |side: f64| (side / step_m) as usize + 2;
        let [columns, rows] = sides.map(knots);
        let middle_m = (low[2] + high[2]) / 2.0;
        Some(Self {
            south_west: [low[0], low[1]],
            step_m,
            columns,
            rows,
            heights_m: vec![middle_m; columns * rows],
        })
    }

    /// The height at a place; beyond the grid, that of its border.
    pub(super) fn height_m(&self, place: [f64; 2]) -> f64 {
        let shares = self.shares(place);
        shares
            .iter()
            .map(|&(knot, share)| share * self.heights_m[knot])
            .sum()
    }

    fn shares(&self, place: [f64; 2]) -> [Share; 4] {
        let along = |axis: usize, knots: usize| {
            let at = (place[axis] - self.south_west[axis]) / self.step_m;
            let at = at.clamp(0.0, (knots - 1) as f64);
            let knot = (at as usize).min(knots - 2);
            (knot, at - knot as f64)
        };
        let (column, east) = along(0, self.columns);
        let (row, north) = along(1, self.rows);
        let knot = row * self.columns + column;
        [
            (knot, (1.0 - east) * (1.0 - north)),
            (knot + 1, east * (1.0 - north)),
            (knot + self.columns, (1.0 - east) * north),
            (knot + self.columns + 1, east * north),
        ]
    }

    /// Moves every knot by the mean of what the points around it are off; gives the weights.
    fn correct(&mut self, points: &[Ground]) -> Vec<f64> {
        let mut off_m = vec![0.0; self.heights_m.len()];
        let mut weights = vec![0.0; self.heights_m.len()];
        for &[east_m, north_m, up_m] in points {
            let place = [east_m, north_m];
            let missing_m = up_m - self.height_m(place);
            for (knot, share) in self.shares(place) {
                off_m[knot] += share * missing_m;
                weights[knot] += share;
            }
        }
        for ((height_m, off_m), weight) in self.heights_m.iter_mut().zip(off_m).zip(&weights) {
            if *weight > 0.0 {
                *height_m += off_m / weight;
            }
        }
        weights
    }
}

/// The values, where unknown ones (weight 0) come from coarser grids.
fn filled(values: &[f64], weights: &[f64], size: [usize; 2]) -> Vec<f64> {
    if size == [1, 1] || weights.iter().all(|weight| *weight > 0.0) {
        return values.to_vec();
    }
    let half = size.map(|side| side.div_ceil(2));
    let coarser = |knot: usize| knot / size[0] / 2 * half[0] + knot % size[0] / 2;
    let mut sums = vec![0.0; half[0] * half[1]];
    let mut counts = vec![0.0; sums.len()];
    for (knot, value) in values.iter().enumerate() {
        if weights[knot] > 0.0 {
            sums[coarser(knot)] += value;
            counts[coarser(knot)] += 1.0;
        }
    }
    for (sum, count) in sums.iter_mut().zip(&counts) {
        *sum /= f64::max(*count, 1.0);
    }
    let coarse = Coarse {
        size: half,
        values: filled(&sums, &counts, half),
    };
    let fill = |(knot, value): (usize, &f64)| match weights[knot] > 0.0 {
        true => *value,
        false => coarse.at([knot % size[0], knot / size[0]]),
    };
    values.iter().enumerate().map(fill).collect()
}

/// A grid of half the resolution; its knots lie in the middle of four of the finer one.
struct Coarse {
    size: [usize; 2],
    values: Vec<f64>,
}

impl Coarse {
    /// Bilinear at a knot of the finer grid: three quarters of the nearest, one of the next.
    fn at(&self, knot: [usize; 2]) -> f64 {
        let pair = |axis: usize| {
            let near = knot[axis] / 2;
            let next = match knot[axis] % 2 {
                0 => near.saturating_sub(1),
                _ => (near + 1).min(self.size[axis] - 1),
            };
            [(near, 0.75), (next, 0.25)]
        };
        let mut sum = 0.0;
        for (row, down) in pair(1) {
            for (column, across) in pair(0) {
                sum += across * down * self.values[row * self.size[0] + column];
            }
        }
        sum
    }
}
