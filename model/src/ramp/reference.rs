//! Reference point from which a ramp's deviations are counted.

use crate::units::{Metre, OutOfRange, Requirement};

/// The point from which the samples' deviations are counted, stored exactly.
///
/// Any state near the ramp is suitable, preferably its first sample. The reference itself costs no
/// accuracy; but deviations that are far from it lose accuracy when they are rounded to `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    pub(super) deformation: Metre,
    pub(super) regressor: f32,
}

impl Reference {
    /// Creates a reference: x_ref above zero, g_ref at least zero.
    pub fn new(deformation: Metre, regressor: f32) -> Result<Self, OutOfRange> {
        Ok(Self {
            deformation: Metre::positive(deformation.0)?,
            regressor: OutOfRange::check(regressor, Requirement::NonNegative)?,
        })
    }

    /// Reference deformation x_ref.
    pub const fn deformation(&self) -> Metre {
        self.deformation
    }

    /// Reference regressor g_ref.
    pub const fn regressor(&self) -> f32 {
        self.regressor
    }
}
