//! A symmetric positive definite system with two off-diagonals, solved in place.
//!
//! The smoothness of a trajectory couples each position with the two before it, so its normal
//! equations are pentadiagonal; an LDL' factorisation of the band is exact, linear in time and
//! needs no symbolic step.

/// The lower band of a symmetric matrix: `diagonal[i] = A[i][i]`, `first[i] = A[i][i-1]`,
/// `second[i] = A[i][i-2]` (entries that would lie outside are ignored).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Banded {
    pub(crate) diagonal: Vec<f64>,
    pub(crate) first: Vec<f64>,
    pub(crate) second: Vec<f64>,
}

impl Banded {
    pub(crate) fn zero(size: usize) -> Self {
        Self {
            diagonal: vec![0.0; size],
            first: vec![0.0; size],
            second: vec![0.0; size],
        }
    }

    /// Adds `weight * c c'` for a row `c` with entries at `i-2`, `i-1` and `i`.
    pub(crate) fn add_row(&mut self, i: usize, c: [f64; 3], weight: f64) {
        let [a, b, d] = c;
        self.diagonal[i - 2] += weight * a * a;
        self.diagonal[i - 1] += weight * b * b;
        self.diagonal[i] += weight * d * d;
        self.first[i - 1] += weight * a * b;
        self.first[i] += weight * b * d;
        self.second[i] += weight * a * d;
    }

    /// Factorises as L D L' in place. `None` if the matrix is not positive definite.
    pub(crate) fn factorise(mut self) -> Option<Factor> {
        for i in 0..self.diagonal.len() {
            if i >= 2 {
                let second = self.second[i];
                self.first[i] -= second * self.first[i - 1];
                self.second[i] = second / self.diagonal[i - 2];
                self.diagonal[i] -= second * self.second[i];
            }
            if i >= 1 {
                let first = self.first[i];
                self.first[i] = first / self.diagonal[i - 1];
                self.diagonal[i] -= first * self.first[i];
            }
            if self.diagonal[i].is_nan() || self.diagonal[i] <= 0.0 {
                return None;
            }
        }
        Some(Factor(self))
    }
}

/// The factors L and D of a [`Banded`] matrix.
#[derive(Debug, Clone)]
pub(crate) struct Factor(Banded);

impl Factor {
    /// Solves A x = `rhs`.
    pub(crate) fn solve(&self, mut rhs: Vec<f64>) -> Vec<f64> {
        let Banded {
            diagonal,
            first,
            second,
        } = &self.0;
        let size = rhs.len();
        for i in 0..size {
            if i >= 1 {
                rhs[i] -= first[i] * rhs[i - 1];
            }
            if i >= 2 {
                rhs[i] -= second[i] * rhs[i - 2];
            }
        }
        for i in 0..size {
            rhs[i] /= diagonal[i];
        }
        for i in (0..size).rev() {
            if i + 1 < size {
                rhs[i] -= first[i + 1] * rhs[i + 1];
            }
            if i + 2 < size {
                rhs[i] -= second[i + 2] * rhs[i + 2];
            }
        }
        rhs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_what_a_dense_solver_solves() {
        let size = 7;
        let mut banded = Banded::zero(size);
        let mut dense = nalgebra::DMatrix::<f64>::zeros(size, size);
        for i in 0..size {
            banded.diagonal[i] += 0.3 + i as f64;
            dense[(i, i)] += 0.3 + i as f64;
        }
        for i in 2..size {
            let row = [1.0, -2.0 - 0.1 * i as f64, 1.2];
            banded.add_row(i, row, 5.0);
            for (a, &left) in row.iter().enumerate() {
                for (b, &right) in row.iter().enumerate() {
                    dense[(i - 2 + a, i - 2 + b)] += 5.0 * left * right;
                }
            }
        }
        let rhs: Vec<f64> = (0..size).map(|i| (i as f64).sin()).collect();
        let expected = dense
            .lu()
            .solve(&nalgebra::DVector::from_column_slice(&rhs))
            .unwrap();
        let found = banded.factorise().unwrap().solve(rhs);
        for (found, expected) in found.iter().zip(expected.iter()) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }

    #[test]
    fn refuses_what_is_not_positive_definite() {
        let mut banded = Banded::zero(3);
        assert!(banded.clone().factorise().is_none());
        banded.diagonal = vec![1.0, f64::NAN, 1.0];
        assert!(banded.factorise().is_none());
    }
}
