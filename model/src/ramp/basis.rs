//! Unknowns of the estimator: the load, and the drifts of the deformation.

use crate::math;
use crate::units::{OutOfRange, Second};
use core::fmt;

/// A slow relative change of the deformation, x -> x (1 + d phi(t)); its size d is an unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriftModel {
    /// phi = t, in seconds: for warming, or for a hand that moves slowly. d is a rate, 1/s.
    Linear,
    /// phi = ln(1 + t/tau): for creep of rubber over decades of time.
    Logarithmic {
        /// tau, the time for which the load has been applied already.
        tau: Second,
    },
    /// phi = 1 - exp(-t/tau): for a single mode of creep.
    Exponential {
        /// tau, the mode's time constant.
        tau: Second,
    },
    /// phi = frac(t/period) - 1/2: for an effect that restarts with every falling ramp, such as the
    /// coil's heat.
    ///
    /// This shape resembles the signal, which repeats with the same period. It therefore raises the
    /// standard error by a factor of four, as a linear drift does over a single ramp.
    SawTooth {
        /// Time from one ramp's start to the next.
        period: Second,
    },
}

impl DriftModel {
    fn time_constant(&self) -> Option<Second> {
        match *self {
            Self::Linear => None,
            Self::Logarithmic { tau } | Self::Exponential { tau } => Some(tau),
            Self::SawTooth { period } => Some(period),
        }
    }

    /// Value of phi(t). Absolute error at most 2.0e-7 (1 + phi), except at the jumps of a
    /// saw-tooth.
    pub fn at(&self, time: Second) -> f32 {
        match *self {
            Self::Linear => time.0,
            Self::Logarithmic { tau } => math::ln_1p(time / tau),
            Self::Exponential { tau } => -math::exp_m1(-(time / tau)),
            Self::SawTooth { period } => {
                let turns = time / period;
                turns - math::floor(turns) - 0.5
            }
        }
    }
}

/// One unknown of the fit. `h` is the regressor's deviation g - g_ref.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term {
    /// alpha in x_ref/x = 1 + alpha + beta h.
    Level,
    /// beta in x_ref/x = 1 + alpha + beta h.
    Slope,
    /// gamma h^2: first term for a load that is not linear.
    Quadratic,
    /// delta h^3: second term for a load that is not linear.
    Cubic,
    /// A disturbance that depends on the time.
    Drift(DriftModel),
}

impl Term {
    /// Power of h in this term; `None` for a drift.
    pub(super) const fn power(&self) -> Option<u8> {
        match self {
            Self::Level => Some(0),
            Self::Slope => Some(1),
            Self::Quadratic => Some(2),
            Self::Cubic => Some(3),
            Self::Drift(_) => None,
        }
    }
}

/// Reason why terms do not form a basis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BasisError {
    /// The first two terms are not [`Term::Level`] and [`Term::Slope`].
    LevelAndSlopeFirst,
    /// There are more than [`MOST_TERMS`].
    TooMany,
    /// The term at `index` occurs twice.
    Repeated {
        /// Index of the second occurrence.
        index: usize,
    },
    /// A time constant is not above zero.
    TimeConstant(OutOfRange),
}

impl fmt::Display for BasisError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LevelAndSlopeFirst => f.write_str("a basis begins with level and slope"),
            Self::TooMany => write!(f, "a basis has at most {MOST_TERMS} terms"),
            Self::Repeated { index } => write!(f, "term {index} of the basis is repeated"),
            Self::TimeConstant(error) => write!(f, "time constant of a drift: {error}"),
        }
    }
}

impl core::error::Error for BasisError {}

/// Largest number of unknowns of a fit: four for the load and two drifts.
pub const MOST_TERMS: usize = 6;

/// The unknowns of a fit, checked. The computing time per sample grows with the square of their
/// number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basis {
    /// The terms; entries beyond the basis' own number are [`Term::Level`].
    terms: [Term; MOST_TERMS],
    count: usize,
}

impl Basis {
    /// A linear load without drift: eq. (2) of [`springs`](crate::springs) for a whole ramp.
    pub const LINEAR: Self = Self {
        terms: [
            Term::Level,
            Term::Slope,
            Term::Level,
            Term::Level,
            Term::Level,
            Term::Level,
        ],
        count: 2,
    };

    /// A basis of a linear load and one drift.
    pub fn with_drift(drift: DriftModel) -> Result<Self, BasisError> {
        Self::new(&[Term::Level, Term::Slope, Term::Drift(drift)])
    }

    /// Creates a basis of any unknowns: level and slope first, none twice.
    ///
    /// ```
    /// use palpate_model::ramp::{Basis, DriftModel, Term};
    /// use palpate_model::units::Second;
    /// let creep = DriftModel::Logarithmic { tau: Second(0.02) };
    /// assert!(Basis::new(&[Term::Level, Term::Slope, Term::Quadratic, Term::Drift(creep)]).is_ok());
    /// assert!(Basis::new(&[Term::Slope, Term::Level]).is_err());
    /// ```
    pub fn new(terms: &[Term]) -> Result<Self, BasisError> {
        let [Term::Level, Term::Slope, ..] = terms else {
            return Err(BasisError::LevelAndSlopeFirst);
        };
        for (index, term) in terms.iter().enumerate() {
            if terms.iter().take(index).any(|earlier| earlier == term) {
                return Err(BasisError::Repeated { index });
            }
            if let Term::Drift(drift) = term
                && let Some(tau) = drift.time_constant()
            {
                Second::positive(tau.0).map_err(BasisError::TimeConstant)?;
            }
        }
        let mut basis = Self::LINEAR;
        basis.count = terms.len();
        basis
            .terms
            .get_mut(..terms.len())
            .ok_or(BasisError::TooMany)?
            .copy_from_slice(terms);
        Ok(basis)
    }

    /// The basis of the first `count` unknowns; `None` if there are fewer, or if these are not at
    /// least level and slope.
    pub(super) fn first(&self, count: usize) -> Option<Self> {
        Self::new(self.terms().get(..count)?).ok()
    }

    /// The unknowns, in the order of the fit's coefficients.
    pub fn terms(&self) -> &[Term] {
        self.terms.get(..self.count).unwrap_or_default()
    }
}
