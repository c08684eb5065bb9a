//! Assignment with dummies: each row takes a column or stays alone, and so does each column, so that
//! the sum is least. To stay alone is a choice with a price, not an accident.
//!
//! Shortest augmenting paths (Jonker and Volgenant, 1987), on a square of rows and dummies against
//! columns and dummies.

/// For each row its column, if it has one. `cost` is row by row; a pair without a cost is none.
/// `alone` is what a row without a column and a column without a row cost, each.
#[must_use]
pub fn assign(cost: &[Vec<Option<f64>>], columns: usize, alone: f64) -> Vec<Option<usize>> {
    let rows = cost.len();
    let size = rows + columns;
    // Never taken: dearer than all rows and columns alone.
    let never = (size as f64 + 1.0) * (2.0 * alone + 1.0);
    let price = |row: usize, column: usize| match (row < rows, column < columns) {
        (true, true) => cost[row].get(column).copied().flatten().unwrap_or(never),
        // Each row and column has a dummy of its own.
        (true, false) if column - columns == row => alone,
        (false, true) if row - rows == column => alone,
        (false, false) => 0.0,
        _ => never,
    };
    let row_of = square(size, price);
    let mut assigned = vec![None; rows];
    for (column, row) in row_of.into_iter().take(columns).enumerate() {
        if let Some(slot) = assigned.get_mut(row)
            && price(row, column) < never
        {
            *slot = Some(column);
        }
    }
    assigned
}

/// For each column its row, at the least total price.
fn square(size: usize, price: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    // Potentials; the last column is where a path begins.
    let (mut of_row, mut of_column) = (vec![0.0; size], vec![0.0; size + 1]);
    let mut row_of = vec![usize::MAX; size + 1];
    for row in 0..size {
        row_of[size] = row;
        let mut at = size;
        let mut least = vec![f64::INFINITY; size];
        let mut before = vec![size; size];
        let mut is_done = vec![false; size + 1];
        while row_of[at] != usize::MAX {
            is_done[at] = true;
            let from = row_of[at];
            let (mut step, mut next) = (f64::INFINITY, size);
            for column in (0..size).filter(|column| !is_done[*column]) {
                let reduced = price(from, column) - of_row[from] - of_column[column];
                if reduced < least[column] {
                    (least[column], before[column]) = (reduced, at);
                }
                if least[column] < step {
                    (step, next) = (least[column], column);
                }
            }
            for column in 0..=size {
                if is_done[column] {
                    of_row[row_of[column]] += step;
                    of_column[column] -= step;
                } else if column < size {
                    least[column] -= step;
                }
            }
            at = next;
        }
        while at != size {
            row_of[at] = row_of[before[at]];
            at = before[at];
        }
    }
    row_of.truncate(size);
    row_of
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn total(
        cost: &[Vec<Option<f64>>],
        columns: usize,
        alone: f64,
        chosen: &[Option<usize>],
    ) -> f64 {
        let pairs = chosen
            .iter()
            .enumerate()
            .filter_map(|(r, c)| Some((r, (*c)?)));
        let (sum, count) = pairs.fold((0.0, 0), |(sum, count), (r, c)| {
            (sum + cost[r][c].unwrap(), count + 1)
        });
        sum + alone * (cost.len() + columns - 2 * count) as f64
    }

    /// The least total of all choices for rows from `row` on.
    fn least(cost: &[Vec<Option<f64>>], row: usize, used: &mut Vec<bool>, alone: f64) -> f64 {
        if row == cost.len() {
            return alone * used.iter().filter(|used| !**used).count() as f64;
        }
        let mut best = alone + least(cost, row + 1, used, alone);
        for column in 0..used.len() {
            if let (false, Some(price)) = (used[column], cost[row][column]) {
                used[column] = true;
                best = best.min(price + least(cost, row + 1, used, alone));
                used[column] = false;
            }
        }
        best
    }

    proptest! {
        #[test]
        fn no_other_choice_is_cheaper(
            rows in 0_usize..5,
            columns in 0_usize..5,
            prices in proptest::collection::vec(proptest::option::of(0_u8..40), 25),
        ) {
            let row = |r: usize| (0..columns).map(|c| prices[r * 5 + c].map(|p| f64::from(p) / 16.0)).collect();
            let cost: Vec<Vec<Option<f64>>> = (0..rows).map(row).collect();
            let chosen = assign(&cost, columns, 0.5);
            let best = least(&cost, 0, &mut vec![false; columns], 0.5);
            prop_assert_eq!(total(&cost, columns, 0.5, &chosen), best);
        }
    }

    #[test]
    fn what_fits_nothing_stays_alone() {
        assert_eq!(
            assign(&[vec![None], vec![Some(0.2)]], 1, 0.5),
            [None, Some(0)]
        );
        assert_eq!(assign(&[vec![Some(1.1)]], 1, 0.5), [None]);
        assert_eq!(assign(&[], 3, 0.5), []);
    }
}
