//! Adds the calibration's uncertainty to the uncertainty due to noise.
//!
//! A ramp measures the total compliance at the reference state, T = 1/c_L + 1/c_S + 1/c_D0, in
//! units of the change of 1/c_D that the current caused. The load's compliance is the remainder,
//! 1/c_L = T - 1/c_S - 1/c_D0. With kappa = c_S/c_L, g = c_S/c_D0 and W = 1 + kappa + g, an error
//! of a calibrated quantity changes kappa as follows, where the c_S in kappa keeps its true value:
//!
//! | calibrated quantity | change of kappa |
//! |---|---|
//! | c_S too high by the fraction e | e |
//! | c_D0 too high by e | -(1 + kappa) e |
//! | both too high by e (the calibration's force scale) | -kappa e |
//! | stiffening eps too high by e | W e / (1 + rho) |
//! | current read too high by e | W e n / (1 + rho), n = d ln rho/d ln I |
//! | deformation read too high by o at all points | W o/x |
//!
//! where rho is the relative rise of c_D, and n its logarithmic slope, both at the peak of the ramp (the
//! ramp's ends determine the slope); x is the deformation on the ramp. The relative error of c_L is minus
//! the change over kappa: a T that is too high by e makes c_L too low by e/w_L, where w_L = kappa/W is the
//! load's fraction of the compliance. With three equal springs, an eps that is 5 % too high makes c_L
//! 13 % too low. So the interval due to noise alone must not be stated as the result's interval.
//!
//! The formulas are of first order in e, and are stated for kappa rather than c_L because first
//! order is a good approximation for kappa. At a stiffening of 10 % they are within 3 % of a ramp
//! evaluated with a wrong calibration (`tests/integration/uncertainty.rs`).

pub use crate::coverage::coverage_factor;
use crate::math::hypot;
use crate::ramp::LoadRatio;
use crate::units::Metre;

/// Standard uncertainties of the calibrated quantities.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Calibration {
    /// Relative uncertainty of the force scale, which c_S and c_D0 have in common (the rig's load
    /// cell).
    pub force_scale: f32,
    /// Relative uncertainty of c_S, without that of the force scale.
    pub sensing: f32,
    /// Relative uncertainty of c_D0, without that of the force scale.
    pub actuated: f32,
    /// Relative uncertainty of the stiffening eps.
    pub stiffening: f32,
    /// Relative uncertainty of how much the gain of the current has changed since the stiffening
    /// was calibrated. A gain error that was the same at that time is already contained in eps.
    pub current: f32,
    /// Uncertainty of the deformation's zero.
    pub zero: Metre,
}

/// Operating point of the sensor on the ramp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatingPoint {
    /// Ratio g = c_S/c_D0.
    pub actuated_ratio: f32,
    /// Rise rho at the peak of the ramp.
    pub rise: f32,
    /// Logarithmic slope n = d ln rho/d ln I at the peak: 2 for a quadratic law.
    pub logarithmic_slope: f32,
    /// Deformation x_S on the ramp, above zero.
    pub deformation: Metre,
}

/// Standard uncertainties of kappa = c_S/c_L, by origin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Budget {
    /// Contribution of the force scale.
    pub force_scale: f32,
    /// Contribution of c_S.
    pub sensing: f32,
    /// Contribution of c_D0.
    pub actuated: f32,
    /// Contribution of the stiffening.
    pub stiffening: f32,
    /// Contribution of the current.
    pub current: f32,
    /// Contribution of the zero of the deformation.
    pub zero: f32,
}

impl Budget {
    /// Contribution of the springs c_S and c_D0, including that of the force scale.
    pub fn springs(&self) -> f32 {
        hypot(hypot(self.force_scale, self.sensing), self.actuated)
    }

    /// Root of the sum of the squares of all contributions.
    pub fn total(&self) -> f32 {
        [
            self.force_scale,
            self.sensing,
            self.actuated,
            self.stiffening,
            self.current,
            self.zero,
        ]
        .into_iter()
        .fold(0.0, hypot)
    }
}

impl Calibration {
    /// Contributions of all uncertainties to kappa; see the [module](self).
    pub fn budget(&self, load_ratio: f32, at: &OperatingPoint) -> Budget {
        let whole = 1.0 + load_ratio + at.actuated_ratio;
        let of_stiffening = whole / (1.0 + at.rise);
        Budget {
            force_scale: (load_ratio * self.force_scale).abs(),
            sensing: self.sensing.abs(),
            actuated: ((1.0 + load_ratio) * self.actuated).abs(),
            stiffening: (of_stiffening * self.stiffening).abs(),
            current: (of_stiffening * at.logarithmic_slope * self.current).abs(),
            zero: (whole * (self.zero / at.deformation)).abs(),
        }
    }

    /// Widens a ramp's result by the calibration's uncertainty, which is added to the standard
    /// error and to both half-widths of the interval, each as the root of the sum of squares.
    ///
    /// ```
    /// use palpate_model::ramp::LoadRatio;
    /// use palpate_model::uncertainty::{Calibration, OperatingPoint};
    /// use palpate_model::units::{Metre, NewtonPerMetre};
    /// let calibration = Calibration { stiffening: 0.05, ..Calibration::default() };
    /// let at = OperatingPoint {
    ///     actuated_ratio: 1.0,
    ///     rise: 0.0,
    ///     logarithmic_slope: 2.0,
    ///     deformation: Metre(0.3e-3),
    /// };
    /// let of_noise = LoadRatio { value: 1.0, standard_error: 0.005, low: 0.99, high: 1.01 };
    /// let claim = calibration.widen(&of_noise, &at);
    /// assert!((claim.standard_error - 0.15).abs() < 1e-3);
    /// // One standard uncertainty up in kappa is 13 % down in c_L.
    /// assert!((1.0 / (1.0 + claim.standard_error) - 0.87).abs() < 1e-3);
    /// ```
    #[must_use]
    pub fn widen(&self, ratio: &LoadRatio, at: &OperatingPoint) -> LoadRatio {
        ratio.with_uncertainty(self.budget(ratio.value, at).total())
    }
}
