//! Entries of a matrix: real, or complex for alternating fields.

use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Sub, SubAssign};

use num_complex::Complex64;

/// A type of number for which a matrix can be factored.
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
    /// Reciprocal square root; `None` if the number cannot be a pivot.
    fn reciprocal_root(self) -> Option<Self>;
}

impl Scalar for f64 {
    /// The pivots of a positive definite matrix are positive.
    fn reciprocal_root(self) -> Option<Self> {
        (self > 0.0).then(|| self.sqrt().recip())
    }
}

impl Scalar for Complex64 {
    /// Any number except zero can be a pivot; either of its two square roots may be used.
    fn reciprocal_root(self) -> Option<Self> {
        let root = self.sqrt();
        (root.is_finite() && root.norm_sqr() > 0.0).then(|| root.inv())
    }
}

/// Sum of products, in four sums that do not wait for each other.
pub(super) fn dot<T: Scalar>(a: &[T], b: &[T]) -> T {
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest = a.remainder().iter().zip(b.remainder());
    let rest: T = rest.map(|(a, b)| *a * *b).sum();
    let mut sums = [T::default(); 4];
    for (a, b) in a.zip(b) {
        let both = a.iter().zip(b);
        sums.iter_mut()
            .zip(both)
            .for_each(|(sum, (a, b))| *sum += *a * *b);
    }
    sums.into_iter().sum::<T>() + rest
}
