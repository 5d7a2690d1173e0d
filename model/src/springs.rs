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
