//! Does the line of a train bend where the calibrated stiffening says it is straight?

use super::{Coefficient, Fit, Term};
use crate::math::sqrt;

/// The bend of a fitted line, as the relative change of its slope from the middle to an end of the
/// ramp.
///
/// Over all falls together a straight line 1 + alpha + beta h is fitted, and beside it one with
/// gamma h^2. The bend is b = gamma H/beta, H the regressor's whole span, and slope and load ratio
/// of the straight line are no better than what bends it lets them be:
///
/// | what the calibration leaves out | error of the slope, in units of b |
/// |---|---|
/// | lag of the stiffening, 0.5 / 1 / 2 / 5 / 10 ms on falls of 60 ms | 0.7 / 0.5 / 0.4 / 0.2 / 0 |
/// | play (memory) of 1 to 30 % | 0.2 to 0.3 |
/// | saturation of the stiffening, its rise at the peak being right | 0 to 0.1 |
///
/// An error of the signal's own shape does not bend the line, and is not seen: the rise at the peak
/// itself, and creep that is over when the train begins.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Bend {
    /// b, and its standard error.
    pub relative: Coefficient,
}

/// Relative standard uncertainty of the slope, in units of the bend: twice this is above all of the
/// table of [`Bend`].
pub const SLOPE_BY_BEND: f32 = 0.4;

/// A bend is none of noise if it exceeds this many of its own standard errors.
const SIGNIFICANT: f32 = 3.0;

impl Bend {
    /// The bend of `bent`, which has a quadratic term, over the `span` of the regressor. `None`
    /// without such a term, or without a slope.
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

    /// Standard uncertainty of kappa = c_S/c_L that the bend leaves open, noise being larger than
    /// the fit says by the factor `scatter`. `whole` is W = 1 + kappa + g. What noise adds to the
    /// bend's square in the mean is taken out.
    pub fn uncertainty(&self, whole: f32, scatter: f32) -> f32 {
        self.beyond(scatter) * SLOPE_BY_BEND * whole
    }

    /// The same of as much of the bend as cannot be noise: what a refusal may rest on.
    pub fn significant_uncertainty(&self, whole: f32, scatter: f32) -> f32 {
        self.beyond(SIGNIFICANT * scatter) * SLOPE_BY_BEND * whole
    }

    /// The bend without so many of its standard errors, as variances.
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
