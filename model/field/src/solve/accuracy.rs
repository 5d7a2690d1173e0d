//! Accuracy of a solution.

/// Requested accuracy of a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Estimated relative error of centre and core mean at which refinement ends.
    pub relative: f64,
    /// Order of the elements, 2 to 5.
    pub order: u32,
    /// Number of unknowns at which refinement ends in any case.
    pub most_unknowns: usize,
}

impl Default for Accuracy {
    /// 10⁻⁴ with cubic elements; see the benchmark in docs/field.md for the choice of the order.
    fn default() -> Self {
        Self {
            relative: 1e-4,
            order: 3,
            most_unknowns: 400_000,
        }
    }
}
