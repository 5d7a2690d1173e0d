//! Symmetric systems of four unknowns.

use crate::math::sqrt;

/// Number of unknowns: x, y, ln F, ln a.
pub(super) const UNKNOWNS: usize = 4;
pub(super) type Vector = [f32; UNKNOWNS];
pub(super) type Matrix = [Vector; UNKNOWNS];

/// Rows of the lower triangle L with L L' = a matrix; the diagonal holds the reciprocals.
pub(super) struct Cholesky(Matrix);

impl Cholesky {
    /// From the lower triangle of a matrix; `None` if it is not positive definite, or its digits are lost.
    pub(super) fn new(matrix: &Matrix) -> Option<Self> {
        // Fraction of a diagonal element that rounding may leave where it should be zero.
        const ROUNDING: f32 = 4.0 * f32::EPSILON;
        let mut rows: Matrix = [[0.0; UNKNOWNS]; UNKNOWNS];
        for (i, row) in matrix.iter().enumerate() {
            let mut new = [0.0; UNKNOWNS];
            for (j, (&entry, done)) in row.iter().zip(&rows).enumerate().take(i) {
                let rest = entry - dot(&new, done, j);
                *new.get_mut(j)? = rest * done.get(j)?;
            }
            let entry = *row.get(i)?;
            let rest = entry - dot(&new, &new, i);
            // NaN is refused too.
            if !(rest > ROUNDING * entry && rest.is_finite()) {
                return None;
            }
            *new.get_mut(i)? = 1.0 / sqrt(rest);
            *rows.get_mut(i)? = new;
        }
        Some(Self(rows))
    }

    /// Solution of the system.
    pub(super) fn solve(&self, right: &Vector) -> Vector {
        let mut solution = [0.0; UNKNOWNS];
        for (i, (row, right)) in self.0.iter().zip(right).enumerate() {
            let rest = right - dot(row, &solution, i);
            if let (Some(to), Some(inverse)) = (solution.get_mut(i), row.get(i)) {
                *to = rest * inverse;
            }
        }
        for (i, row) in self.0.iter().enumerate().rev() {
            let Some(of) = solution.get_mut(i).zip(row.get(i)) else {
                continue;
            };
            *of.0 *= of.1;
            let found = *of.0;
            for (to, entry) in solution.iter_mut().zip(row).take(i) {
                *to -= entry * found;
            }
        }
        solution
    }

    /// Inverse of the matrix.
    pub(super) fn inverse(&self) -> Matrix {
        let mut inverse = [[0.0; UNKNOWNS]; UNKNOWNS];
        for (i, column) in inverse.iter_mut().enumerate() {
            let mut unit = [0.0; UNKNOWNS];
            if let Some(one) = unit.get_mut(i) {
                *one = 1.0;
            }
            *column = self.solve(&unit);
        }
        inverse
    }
}

/// Sum of the first `count` products.
pub(super) fn dot(a: &Vector, b: &Vector, count: usize) -> f32 {
    a.iter().zip(b).take(count).map(|(a, b)| a * b).sum()
}
