//! 95 % intervals of a ratio, and of the stiffness derived from it.

use super::RampRefusal;
use crate::coverage::coverage_factor;
use crate::math::{hypot, sqrt, student::NORMAL_975};
use crate::units::NewtonPerMetre;

/// Load ratio kappa = c_S/c_L, with a 95 % interval: the load's compliance in units of the sensing
/// layer's compliance.
///
/// The error of kappa is nearly normal, that of the stiffness is not: a rigid load is an ordinary
/// value, kappa = 0, and noise may move an estimate a little below zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadRatio {
    /// Estimate of kappa.
    pub value: f32,
    /// Standard error of kappa.
    pub standard_error: f32,
    /// Lower end of kappa's 95 % interval.
    pub low: f32,
    /// Upper end of kappa's 95 % interval.
    pub high: f32,
}

/// Load stiffness with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadStiffness {
    /// The interval is bounded on both sides.
    Within {
        /// Estimate of c_L.
        value: NewtonPerMetre,
        /// Standard error of c_L, to first order.
        standard_error: NewtonPerMetre,
        /// Lower end of c_L's interval.
        low: NewtonPerMetre,
        /// Upper end of c_L's interval.
        high: NewtonPerMetre,
    },
    /// The load cannot be distinguished from a rigid one: the interval has no upper end.
    AtLeast {
        /// Lower end of c_L's interval.
        low: NewtonPerMetre,
    },
}

impl LoadStiffness {
    /// Lower end of the 95 % interval.
    pub const fn low(&self) -> NewtonPerMetre {
        match *self {
            Self::Within { low, .. } | Self::AtLeast { low } => low,
        }
    }

    /// Upper end of the 95 % interval; `None` if it has none.
    pub const fn high(&self) -> Option<NewtonPerMetre> {
        match *self {
            Self::Within { high, .. } => Some(high),
            Self::AtLeast { .. } => None,
        }
    }

    /// Best estimate of c_L; `None` if the load cannot be distinguished from a rigid one.
    pub const fn value(&self) -> Option<NewtonPerMetre> {
        match *self {
            Self::Within { value, .. } => Some(value),
            Self::AtLeast { .. } => None,
        }
    }

    /// Whether `truth` lies in the interval.
    pub fn contains(&self, truth: NewtonPerMetre) -> bool {
        truth >= self.low() && self.high().is_none_or(|high| truth <= high)
    }
}

impl LoadRatio {
    /// The ratio with a further standard uncertainty of kappa. It is added to the standard error
    /// and to both half-widths of the interval, each as the root of the sum of squares.
    #[must_use]
    pub fn with_uncertainty(&self, further: f32) -> Self {
        let reach = NORMAL_975 * further;
        Self {
            value: self.value,
            standard_error: hypot(self.standard_error, further),
            low: self.value - hypot(self.value - self.low, reach),
            high: self.value + hypot(self.high - self.value, reach),
        }
    }

    /// The ratio if its standard error contains errors that are uniform within limits and have the
    /// standard deviation `uniform`: [`coverage_factor`] replaces the normal quantile in both
    /// half-widths of the interval.
    #[must_use]
    pub fn with_uniform_part(&self, uniform: f32) -> Self {
        let factor = coverage_factor(uniform / self.standard_error) / NORMAL_975;
        Self {
            low: self.value - (self.value - self.low) * factor,
            high: self.value + (self.high - self.value) * factor,
            ..*self
        }
    }

    /// Stiffness c_L = c_S/kappa. The ends of its interval are c_S divided by the ends of kappa's
    /// interval, so both intervals have the same coverage.
    ///
    /// ```
    /// use palpate_model::ramp::{LoadRatio, LoadStiffness};
    /// use palpate_model::units::NewtonPerMetre;
    /// let soft = LoadRatio { value: 1.0, standard_error: 0.1, low: 0.8, high: 1.25 };
    /// let stiffness = soft.stiffness(NewtonPerMetre(6e3)).unwrap();
    /// assert_eq!(stiffness.low(), NewtonPerMetre(4.8e3));
    /// assert_eq!(stiffness.high(), Some(NewtonPerMetre(7.5e3)));
    ///
    /// let hard = LoadRatio { value: 0.02, standard_error: 0.1, low: -0.18, high: 0.25 };
    /// let stiffness = hard.stiffness(NewtonPerMetre(6e3)).unwrap();
    /// assert_eq!(stiffness, LoadStiffness::AtLeast { low: NewtonPerMetre(24e3) });
    /// ```
    pub fn stiffness(&self, sensing: NewtonPerMetre) -> Result<LoadStiffness, RampRefusal> {
        // Negated, so that NaN is refused.
        if !(self.high > 0.0) {
            return Err(RampRefusal::NegativeStiffness {
                highest_load_ratio: self.high,
            });
        }
        let low = sensing / self.high;
        let high = sensing / self.low;
        if self.low > 0.0 && high.0.is_finite() {
            let value = sensing / self.value;
            let standard_error = value * (self.standard_error / self.value);
            Ok(LoadStiffness::Within {
                value,
                standard_error,
                low,
                high,
            })
        } else {
            Ok(LoadStiffness::AtLeast { low })
        }
    }
}

/// Variances of the numerator and the denominator of a ratio, and their covariance.
#[derive(Clone, Copy, Debug)]
pub(super) struct RatioCovariance {
    pub(super) numerator: f32,
    pub(super) cross: f32,
    pub(super) denominator: f32,
}

/// Distances from the estimate `ratio` to the lower (negative) and the upper end of its interval.
///
/// Fieller (*Some problems in interval estimation*, J. R. Stat. Soc. B 16, 1954): the interval
/// contains all rho for which numerator - rho denominator is within t = `quantile` standard errors
/// of zero. A quadratic in delta = rho - ratio keeps the digits that the textbook's quadratic in
/// rho loses. With numerator a, denominator b, the variance V_bb of b, the covariance V_ab, and the
/// variance V_r of a - ratio b:
///
/// (b^2 - t^2 V_bb) delta^2 - 2 t^2 (ratio V_bb - V_ab) delta - t^2 V_r <= 0.
///
/// If b^2 <= t^2 V_bb, the interval is unbounded: `Err` contains b divided by its standard error.
pub(super) fn fieller(
    ratio: f32,
    denominator: f32,
    covariance: RatioCovariance,
    quantile: f32,
) -> Result<(f32, f32), f32> {
    let RatioCovariance {
        numerator,
        cross,
        denominator: variance,
    } = covariance;
    let squared = quantile * quantile;
    let leading = denominator * denominator - squared * variance;
    if !(leading > 0.0) {
        return Err(denominator / sqrt(variance));
    }
    let skew = squared * (ratio * variance - cross);
    let of_ratio = (numerator - 2.0 * ratio * cross + ratio * ratio * variance).max(0.0);
    let reach = sqrt(skew * skew + leading * squared * of_ratio);
    Ok(((skew - reach) / leading, (skew + reach) / leading))
}
