//! A symmetric positive definite system whose entries lie within a narrow band, solved in place.
//!
//! A trajectory couples each state with those shortly before it and with nothing else, so its normal
//! equations are banded; an LDL' factorisation of the band is exact, linear in time and needs no
//! symbolic step. The part of the inverse within the band (covariances of neighbouring states)
//! follows from the factors by Takahashi's recursion, in linear time as well.

/// The lower band of a symmetric matrix with half bandwidth `W`: `rows[i][d] = A[i][i-d]` for `d`
/// up to `W` (entries that would lie outside are ignored). `N` is `W + 1`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Banded<const N: usize> {
    rows: Vec<[f64; N]>,
}

impl<const N: usize> Banded<N> {
    pub(crate) fn zero(size: usize) -> Self {
        Self {
            rows: vec![[0.0; N]; size],
        }
    }

    /// Adds `weight * c c'` for a row `c` with these entries by index, which lie within a bandwidth
    /// of each other.
    pub(crate) fn add_row(&mut self, entries: &[(usize, f64)], weight: f64) {
        for &(i, a) in entries {
            for &(j, b) in entries {
                if j <= i {
                    self.rows[i][i - j] += weight * a * b;
                }
            }
        }
    }

    /// Factorises as L D L' in place. `None` if the matrix is not positive definite.
    pub(crate) fn factorise(mut self) -> Option<Factor<N>> {
        for i in 0..self.rows.len() {
            let mut row = self.rows[i];
            // `row[d]` is L[i][i-d] D[i-d] until the row is done.
            for d in (1..N.min(i + 1)).rev() {
                let above = &self.rows[i - d];
                let mut value = row[d];
                for e in 1..N - d {
                    value -= row[d + e] * above[e];
                }
                row[d] = value;
            }
            let mut pivot = row[0];
            for (d, value) in row.iter_mut().enumerate().take(i + 1).skip(1) {
                let scaled = *value / self.rows[i - d][0];
                pivot -= *value * scaled;
                *value = scaled;
            }
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            row[0] = pivot;
            // Entries outside of the matrix are ignored from here on.
            row[N.min(i + 1)..].fill(0.0);
            self.rows[i] = row;
        }
        Some(Factor(self))
    }
}

/// The factors L and D of a [`Banded`] matrix: D on the diagonal, L below it.
#[derive(Debug, Clone)]
pub(crate) struct Factor<const N: usize>(Banded<N>);

impl<const N: usize> Factor<N> {
    /// Solves A x = `rhs`.
    pub(crate) fn solve(&self, mut rhs: Vec<f64>) -> Vec<f64> {
        let rows = &self.0.rows;
        for i in 0..rhs.len() {
            for d in 1..N.min(i + 1) {
                rhs[i] -= rows[i][d] * rhs[i - d];
            }
        }
        for i in (0..rhs.len()).rev() {
            let value = rhs[i] / rows[i][0];
            rhs[i] =
                (1..N.min(rhs.len() - i)).fold(value, |sum, d| sum - rows[i + d][d] * rhs[i + d]);
        }
        rhs
    }

    /// The entries of the inverse within the band.
    pub(crate) fn inverse(&self) -> Inverse<N> {
        let rows = &self.0.rows;
        let size = rows.len();
        let mut inverse = Inverse(vec![[0.0; N]; size]);
        for i in (0..size).rev() {
            let reach = N.min(size - i);
            // Z[j][i] = [i = j] / D[i] - sum_k L[k][i] Z[k][j], k from i+1 within the band.
            for ahead in (0..reach).rev() {
                let j = i + ahead;
                let start = if ahead == 0 { 1.0 / rows[i][0] } else { 0.0 };
                let value = (1..reach).fold(start, |sum, d| {
                    sum - rows[i + d][d] * inverse.entry(i + d, j)
                });
                inverse.0[j][ahead] = value;
            }
        }
        inverse
    }
}

/// The entries of the inverse of a [`Banded`] matrix within its band.
#[derive(Debug, Clone)]
pub(crate) struct Inverse<const N: usize>(Vec<[f64; N]>);

impl<const N: usize> Inverse<N> {
    /// An entry; the indices lie within a bandwidth of each other.
    pub(crate) fn entry(&self, i: usize, j: usize) -> f64 {
        let (low, high) = (i.min(j), i.max(j));
        self.0[high][high - low]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    /// A matrix of random rows in both forms.
    fn twice<const N: usize>(size: usize, rows: &[(usize, Vec<f64>)]) -> (Banded<N>, DMatrix<f64>) {
        let mut banded = Banded::zero(size);
        let mut dense = DMatrix::<f64>::zeros(size, size);
        for i in 0..size {
            banded.add_row(&[(i, 1.0)], 0.3);
            dense[(i, i)] += 0.3;
        }
        for (first, values) in rows {
            let entries: Vec<(usize, f64)> = (values.iter().enumerate())
                .map(|(index, value)| (first % size + index, *value))
                .filter(|(index, _)| *index < size)
                .collect();
            banded.add_row(&entries, 2.0);
            for (i, a) in &entries {
                for (j, b) in &entries {
                    dense[(*i, *j)] += 2.0 * a * b;
                }
            }
        }
        (banded, dense)
    }

    proptest! {
        #[test]
        fn solves_and_inverts_as_a_dense_solver_does(
            size in 1_usize..24,
            rows in prop::collection::vec((0_usize..24, prop::collection::vec(-2.0..2.0_f64, 1..5)), 0..40),
        ) {
            let (banded, dense) = twice::<5>(size, &rows);
            let factor = banded.factorise().unwrap();
            let rhs: Vec<f64> = (0..size).map(|i| (1.0 + i as f64).sin()).collect();
            let expected = dense.clone().lu().solve(&DVector::from_column_slice(&rhs)).unwrap();
            for (found, expected) in factor.solve(rhs).iter().zip(expected.iter()) {
                prop_assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            }
            let expected = dense.try_inverse().unwrap();
            let inverse = factor.inverse();
            for i in 0..size {
                for j in i.saturating_sub(4)..=i {
                    let (found, expected) = (inverse.entry(i, j), expected[(i, j)]);
                    prop_assert!((found - expected).abs() < 1e-9, "{i} {j}: {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn refuses_what_is_not_positive_definite() {
        let mut banded = Banded::<3>::zero(3);
        assert!(banded.clone().factorise().is_none());
        banded.add_row(&[(0, 1.0), (1, f64::NAN), (2, 1.0)], 1.0);
        assert!(banded.factorise().is_none());
    }
}
