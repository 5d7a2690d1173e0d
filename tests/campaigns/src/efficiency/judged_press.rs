//! A press beside its bounds.

use super::rung::InformationLevel;

/// A press with its bounds. Variances are of ln(c_L).
#[derive(Clone, Copy, Debug)]
pub(super) struct JudgedPress {
    /// Load, in units of c_S, without its frame.
    pub(super) ratio: f64,
    /// ln(estimate/truth).
    pub(super) error_ln: f64,
    /// Least variances, in the order of [`InformationLevel::ALL`].
    pub(super) bounds: [f64; InformationLevel::ALL.len()],
    /// Variance that `palpate plan` predicts.
    pub(super) planned: f64,
}
