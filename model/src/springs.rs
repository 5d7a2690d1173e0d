//! Three springs in series: sensing layer c_S, actuated layer c_D, load c_L.
//!
//! All three carry the same force, F = c_S x_S = c_D x_D = c_L x_L, and the total length is
//! constant, x_L + x_S + x_D = x_0. With g = c_S/c_D and kappa = c_S/c_L,
//!
//! x_S = x_0 / (1 + kappa + g),
//!
//! so softening the actuated layer (a larger g) reduces the deformation of the sensing layer. The
//! stiffer the load, the stronger is this effect. Equation numbers are those of the paper on the
//! sensor.

use crate::units::{Metre, NewtonPerMetre};

/// The stiffnesses of the three springs in one state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Springs {
    /// Load c_L, the touched object.
    pub load: NewtonPerMetre,
    /// Sensing layer c_S, whose deformation is read.
    pub sensing: NewtonPerMetre,
    /// Actuated layer c_D, whose stiffness the current sets.
    pub actuated: NewtonPerMetre,
}

/// Fractions of the total compliance, w_i = (1/c_i) / sum(1/c), of the three springs; they add up
/// to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    /// Fraction of the load, w_L.
    pub load: f32,
    /// Fraction of the sensing layer, w_S.
    pub sensing: f32,
    /// Fraction of the actuated layer, w_D.
    pub actuated: f32,
}

impl Shares {
    /// Computes the fractions from kappa = c_S/c_L and g = c_S/c_D.
    pub fn new(load_ratio: f32, actuated_ratio: f32) -> Self {
        let whole = 1.0 + load_ratio + actuated_ratio;
        Self {
            load: load_ratio / whole,
            sensing: 1.0 / whole,
            actuated: actuated_ratio / whole,
        }
    }
}

impl Springs {
    /// Stiffness of the three springs in series, eq. (1): 1/c = 1/c_L + 1/c_S + 1/c_D. Relative
    /// error at most 4.0e-7.
    ///
    /// ```
    /// use palpate_model::{springs::Springs, units::NewtonPerMetre};
    /// let c = NewtonPerMetre(6e3);
    /// let whole = Springs { load: c, sensing: c, actuated: c }.in_series();
    /// assert!((whole.0 - 2e3).abs() < 1e-3);
    /// ```
    pub fn in_series(&self) -> NewtonPerMetre {
        NewtonPerMetre(1.0 / (1.0 / self.load.0 + 1.0 / self.sensing.0 + 1.0 / self.actuated.0))
    }

    /// The fractions w_L, w_S, w_D of the total compliance.
    pub fn shares(&self) -> Shares {
        Shares::new(self.sensing / self.load, self.sensing / self.actuated)
    }
}

/// Load stiffness c_L by eq. (2), the plain formula for two states. Its inputs are the deformations
/// x_S1, x_S2 of the sensing layer at the actuated layer's stiffnesses c_D1, c_D2.
///
/// c_L = c_S c_D1 c_D2 (x_S1 - x_S2) / [x_S2 (c_D1 c_D2 + c_S c_D1) - x_S1 (c_D1 c_D2 + c_S c_D2)]
///
/// The result depends on the *ratio* of the deformations only, so their zero must be known. The
/// formula has no noise model, no drift and no interval, and in `f32` its differences lose five
/// digits of seven at a stiffening of 1 %. It serves as a comparison: the estimator of
/// [`ramp`](crate::ramp) reduces to it for two samples, without that loss.
///
/// The result is not finite, or negative, if the deformations fit no spring.
///
/// ```
/// use palpate_model::{springs::two_state_load, units::{Metre, NewtonPerMetre}};
/// let load = two_state_load(
///     NewtonPerMetre(6e3),
///     [NewtonPerMetre(9e3), NewtonPerMetre(6e3)],
///     [Metre(0.375e-3), Metre(1e-3 / 3.0)],
/// );
/// assert!((load.0 - 6e3).abs() < 5.0);
/// ```
pub fn two_state_load(
    sensing: NewtonPerMetre,
    actuated: [NewtonPerMetre; 2],
    deformation: [Metre; 2],
) -> NewtonPerMetre {
    let [NewtonPerMetre(d1), NewtonPerMetre(d2)] = actuated;
    let [Metre(x1), Metre(x2)] = deformation;
    let NewtonPerMetre(s) = sensing;
    // Numerator and denominator are divided by c_D1 c_D2, which avoids large products.
    NewtonPerMetre(s * (x1 - x2) / (x2 * (1.0 + s / d2) - x1 * (1.0 + s / d1)))
}
