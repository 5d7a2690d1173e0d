//! Linear least squares with a covariance.

use faer::linalg::solvers::{DenseSolveCore, SolveLstsq};
use faer::{Col, Mat};

use super::Unusable;

/// Rows of an overdetermined system: coefficients, right side, weight (one over its sigma, up to a
/// common factor).
#[derive(Clone, Debug, Default)]
pub(super) struct System {
    unknowns: usize,
    rows: Vec<(Vec<f64>, f64)>,
}

/// The solution with the covariance of the unknowns.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub(super) unknowns: Vec<f64>,
    pub(super) covariance: Mat<f64>,
    /// Standard deviation of a row of weight 1.
    pub(super) sigma: f64,
}

impl System {
    pub(super) fn new(unknowns: usize) -> Self {
        Self {
            unknowns,
            rows: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, coefficients: Vec<f64>, right: f64, weight: f64) {
        let weighted = coefficients.into_iter().map(|c| c * weight).collect();
        self.rows.push((weighted, right * weight));
    }

    /// Solves; `what` names the unknowns in the error.
    pub(super) fn solve(&self, what: &'static str) -> Result<Solution, Unusable> {
        let (m, n) = (self.rows.len(), self.unknowns);
        if m <= n {
            return Err(Unusable::Undetermined(what));
        }
        let entry = |i: usize, j: usize| {
            let row = self.rows.get(i).map(|(row, _)| row.as_slice());
            row.and_then(|row| row.get(j)).copied().unwrap_or(0.0)
        };
        // Columns of one length, so that neither solution nor inverse depends on units.
        let lengths: Vec<f64> = (0..n)
            .map(|j| (0..m).map(|i| entry(i, j).powi(2)).sum::<f64>().sqrt())
            .collect();
        if lengths
            .iter()
            .any(|length| *length == 0.0 || length.is_nan())
        {
            return Err(Unusable::Undetermined(what));
        }
        let length = |j: usize| lengths.get(j).copied().unwrap_or(1.0);
        let matrix = Mat::from_fn(m, n, |i, j| entry(i, j) / length(j));
        let right = Col::from_fn(m, |i| self.rows.get(i).map_or(0.0, |(_, right)| *right));
        let scaled = matrix.qr().solve_lstsq(&right);
        let residual = &matrix * &scaled - &right;
        let variance = residual.squared_norm_l2() / (m - n) as f64;
        let normal = matrix.transpose() * &matrix;
        let inverse = normal.partial_piv_lu().inverse();
        let unknowns: Vec<f64> = (0..n).map(|j| scaled[j] / length(j)).collect();
        if unknowns.iter().any(|unknown| !unknown.is_finite()) {
            return Err(Unusable::Undetermined(what));
        }
        let covariance = Mat::from_fn(n, n, |i, j| {
            inverse[(i, j)] * variance / (length(i) * length(j))
        });
        Ok(Solution {
            unknowns,
            covariance,
            sigma: variance.sqrt(),
        })
    }
}
