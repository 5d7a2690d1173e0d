//! Numbers that a matrix is made of: real, or complex for alternating fields.

use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Sub, SubAssign};

use num_complex::Complex64;

/// A number that a matrix can be factored in.
pub(super) trait Scalar:
    Copy
    + Default
    + Sum
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// One over the square root, if the number can be a pivot.
    fn reciprocal_root(self) -> Option<Self>;
}

impl Scalar for f64 {
    /// Pivots of a positive definite matrix are positive.
    fn reciprocal_root(self) -> Option<Self> {
        (self > 0.0).then(|| self.sqrt().recip())
    }
}

impl Scalar for Complex64 {
    /// Any number but zero; which of its two roots does not matter.
    fn reciprocal_root(self) -> Option<Self> {
        let root = self.sqrt();
        (root.is_finite() && root.norm_sqr() > 0.0).then(|| root.inv())
    }
}
