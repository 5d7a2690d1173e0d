//! Test for a bend of the line fitted to a train of ramps. With the right stiffening the line would
//! be straight.

use super::{Coefficient, Fit, Term};
use crate::math::sqrt;

/// The bend of a fitted line: the relative change of its slope from the middle to an end of the
/// ramp.
///
/// Over all falls of a train together, a straight line 1 + alpha + beta h is fitted, and a second
/// line with the term gamma h^2. The bend is b = gamma H/beta, with H the whole span of the
/// regressor. The cause of a bend also falsifies the slope and the load ratio of the straight line:
///
/// | effect that the calibration omits | error of the slope, in units of b |
/// |---|---|
/// | lag of the stiffening, 0.5 / 1 / 2 / 5 / 10 ms on falls of 60 ms | 0.7 / 0.5 / 0.4 / 0.2 / 0 |
/// | play (memory) of 1 to 30 % | 0.2 to 0.3 |
/// | saturation of the stiffening, with the right rise at the peak | 0 to 0.1 |
///
/// An error with the shape of the signal itself does not bend the line and is not detected: an
/// error of the rise at the peak, or creep that is over when the train starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bend {
    /// The bend b and its standard error.
    pub relative: Coefficient,
}

/// Relative standard uncertainty of the slope, in units of the bend b: twice this value is above
/// all entries of the table of [`Bend`].
pub const SLOPE_BY_BEND: f32 = 0.4;

/// A bend is significant if it is larger than this many of its standard errors.
const SIGNIFICANT: f32 = 3.0;

impl Bend {
    /// Computes the bend from the straight line, from the line `bent` with a quadratic term, and
    /// from the `span` of the regressor. `None` if `bent` has no such term, or the straight line no
    /// slope.
    pub fn of(straight: &Fit, bent: &Fit, span: f32) -> Option<Self> {
        let slope = straight.coefficient(1)?.value;
        let terms = bent.basis().terms();
        let index = terms.iter().position(|term| *term == Term::Quadratic)?;
        let gamma = bent.coefficient(index)?;
        let relative = Coefficient {
            value: gamma.value * (span / slope),
            standard_error: gamma.standard_error * (span / slope).abs(),
        };
        relative.value.is_finite().then_some(Self { relative })
    }

    /// Standard uncertainty of kappa = c_S/c_L due to the bend. `scatter` is the factor by which
    /// the noise is larger than the fit states, `whole` is W = 1 + kappa + g. The mean contribution
    /// of noise to the square of the bend is subtracted.
    pub fn uncertainty(&self, whole: f32, scatter: f32) -> f32 {
        self.beyond(scatter) * SLOPE_BY_BEND * whole
    }

    /// Standard uncertainty of kappa due to the significant part of the bend only; a refusal may be
    /// based on it.
    pub fn significant_uncertainty(&self, whole: f32, scatter: f32) -> f32 {
        self.beyond(SIGNIFICANT * scatter) * SLOPE_BY_BEND * whole
    }

    /// Magnitude of the bend b beyond noise: sqrt(b^2 - (k sigma)^2), where k is `standard_errors`
    /// and sigma the standard error of b.
    fn beyond(&self, standard_errors: f32) -> f32 {
        let Coefficient {
            value,
            standard_error,
        } = self.relative;
        let by_noise = standard_error * standard_errors;
        let beyond = (value - by_noise) * (value + by_noise);
        sqrt(beyond.max(0.0))
    }
}
