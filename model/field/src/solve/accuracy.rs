//! Accuracy of a solution.

/// Requested accuracy of a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Refinement ends when the estimated relative errors of centre and core mean are at most this.
    pub relative: f64,
    /// Order of the elements, 2 to 5.
    pub order: u32,
    /// Refinement ends at this number of unknowns, whatever the estimated errors.
    pub most_unknowns: usize,
}

impl Default for Accuracy {
    /// An accuracy of 10⁻⁴ with cubic elements; for the choice of the order see the benchmark in
    /// docs/field.md.
    fn default() -> Self {
        Self {
            relative: 1e-4,
            order: 3,
            most_unknowns: 400_000,
        }
    }
}
