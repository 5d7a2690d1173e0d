//! Coverage factor of a sum of normal and uniform errors.

use crate::math::student::NORMAL_975;

/// Half the width of a 95 % interval in standard errors. `uniform` is the standard deviation of the
/// errors that are uniform within limits, divided by the standard error; all other errors are
/// normal. The result is 1.960 for 0 and falls to 1.645 for 1.
///
/// A uniform error has no tails: 1.96 of its standard errors contain all of it, and 1.645 contain
/// 95 % (JCGM 100:2008, 4.3.7 and G.1.2). A mixture has the convolution of both distributions. Its
/// departure from the normal distribution starts at the fourth power of `uniform`; a polynomial in
/// that power is within 0.002 of the quantile.
///
/// ```
/// use palpate_model::uncertainty::coverage_factor;
/// assert!((coverage_factor(0.0) - 1.960).abs() < 1e-3);
/// assert!((coverage_factor(1.0) - 1.645).abs() < 1e-3);
/// ```
pub fn coverage_factor(uniform: f32) -> f32 {
    let square = (uniform * uniform).min(1.0);
    let fourth = square * square;
    let eighth = fourth * fourth;
    NORMAL_975 - 0.133_62 * fourth - 0.141_04 * eighth - 0.039_81 * eighth * eighth
}
