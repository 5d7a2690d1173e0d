//! Reasons for refusing a sample or an estimate.

use core::fmt;

/// Reason why a sample was not added to the sums. The sums are unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejected {
    /// A value of the sample is infinite or NaN.
    NotFinite,
    /// The deformation is not above zero: no object presses on the sensor.
    Unpressed,
    /// Sigma is not above zero, or the sample's weight is outside the range of `f32`.
    Sigma,
}

impl fmt::Display for Rejected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "sample is not finite",
            Self::Unpressed => "deformation of the sample is not above zero",
            Self::Sigma => "sigma of the sample is out of range",
        })
    }
}

impl core::error::Error for Rejected {}

/// Reason why a ramp gives no stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RampRefusal {
    /// Fewer samples than unknowns, or too few to estimate the noise as well.
    TooFewSamples {
        /// Number of samples taken.
        have: u32,
        /// Number of samples needed.
        need: u32,
    },
    /// A term cannot be distinguished from the terms before it: the current did not change, or a
    /// drift term has the shape of the signal.
    IllConditioned {
        /// Index of the term in the basis.
        term: usize,
    },
    /// The result is outside the range of `f32`.
    NotFinite,
    /// The deformation does not clearly follow the regressor: no stiffness from zero to infinity
    /// can be excluded.
    SignalTooSmall {
        /// Slope divided by its standard error.
        significance: f32,
    },
    /// The deformation follows the regressor with the wrong sign: when the actuated layer softens,
    /// the sensing layer deforms more. The cause is cross-talk or a wrong sign in a calibration.
    SignalReversed {
        /// Slope divided by its standard error.
        significance: f32,
    },
    /// The whole interval of c_S/c_L is negative: the cause is a drift for which the basis has no
    /// term, or a wrong calibration.
    NegativeStiffness {
        /// Upper end of the interval of c_S/c_L, below zero.
        highest_load_ratio: f32,
    },
}

impl fmt::Display for RampRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooFewSamples { have, need } => write!(f, "{have} samples, {need} needed"),
            Self::IllConditioned { term } => {
                write!(f, "term {term} cannot be distinguished from the others")
            }
            Self::NotFinite => f.write_str("result is not finite"),
            Self::SignalTooSmall { significance } => {
                write!(f, "signal too small: {significance:.1} standard errors")
            }
            Self::SignalReversed { significance } => {
                write!(f, "signal reversed: {significance:.1} standard errors")
            }
            Self::NegativeStiffness { highest_load_ratio } => {
                write!(
                    f,
                    "negative stiffness: c_S/c_L at most {highest_load_ratio:.3}"
                )
            }
        }
    }
}

impl core::error::Error for RampRefusal {}
