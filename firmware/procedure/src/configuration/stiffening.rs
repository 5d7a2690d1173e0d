//! The magnetorheological effect, as a law or as a curve.

use palpate_model::magnetorheological::{Rise, Saturating, Stiffening, Tabulated};
use palpate_model::units::{Ampere, NewtonPerMetre};
use palpate_wire::command::MAX_KNOTS;

/// The magnetorheological effect as a law or as a curve.
#[derive(Clone, Copy, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one of it, and no heap to put the curve on"
)]
pub enum Law {
    /// Saturation law.
    Saturating(Saturating),
    /// Calibrated curve.
    Tabulated(Tabulated<{ MAX_KNOTS as usize }>),
}

impl Law {
    /// Returns d ln rho/d ln I of the relative rise rho at the current I; zero without a rise.
    pub(crate) fn logarithmic_slope(&self, current: Ampere) -> f32 {
        let rise = self.rise(current);
        if rise.value > 0.0 {
            rise.per_ampere * current.0 / rise.value
        } else {
            0.0
        }
    }
}

impl Stiffening for Law {
    fn at_rest(&self) -> NewtonPerMetre {
        match self {
            Self::Saturating(law) => law.at_rest(),
            Self::Tabulated(curve) => curve.at_rest(),
        }
    }

    fn rise(&self, current: Ampere) -> Rise {
        match self {
            Self::Saturating(law) => law.rise(current),
            Self::Tabulated(curve) => curve.rise(current),
        }
    }
}
