//! The resonator: from frequency to inductance.
//!
//! The sensing coil and a fixed capacitor C resonate at f = 1 / (2 pi sqrt(L C)), so
//!
//! L = 1 / ((2 pi f)^2 C).
//!
//! What matters is the *change* of L. A micrometre of deformation changes f by about 1e-4 and a
//! converter resolves 1e-7 to 1e-8, while `f32` carries 6e-8: taken as absolute numbers, two
//! neighbouring frequencies are the same. So the change is formed from the converter's codes as
//! integers, which lose nothing, and stays a change from there on:
//!
//! delta = (D - D0) / D0 = f/f0 - 1, and L/L0 - 1 = -delta (2 + delta) / (1 + delta)^2.
//!
//! Damping lowers f by 1/(8 Q^2), 8e-5 at Q = 40; it cancels in the ratio as long as Q stays.

use crate::units::{Farad, Henry, Hertz, OutOfRange, Requirement};
use core::f32::consts::TAU;

/// A coil's capacitor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Tank {
    capacitance: Farad,
}

impl Tank {
    /// Takes the capacitance in parallel with the coil, wiring and converter included.
    pub const fn new(capacitance: Farad) -> Result<Self, OutOfRange> {
        match Farad::positive(capacitance.0) {
            Ok(capacitance) => Ok(Self { capacitance }),
            Err(error) => Err(error),
        }
    }

    /// L of the resonance at `frequency`: relative error at most 4.0e-7, `frequency`'s own
    /// rounding to `f32` not counted. `None` unless the frequency is finite and above zero.
    ///
    /// ```
    /// use palpate_model::{tank::Tank, units::{Farad, Hertz}};
    /// let tank = Tank::new(Farad(330e-12)).unwrap();
    /// let inductance = tank.inductance(Hertz(3.74e6)).unwrap();
    /// assert!((inductance.0 - 5.488e-6).abs() < 2e-9);
    /// ```
    pub fn inductance(&self, frequency: Hertz) -> Option<Henry> {
        let angular = TAU * frequency.0;
        let inductance = 1.0 / (angular * self.capacitance.0) / angular;
        Requirement::Positive
            .met_by(inductance)
            .then_some(Henry(inductance))
    }
}

/// f/f0 - 1 from two codes that are proportional to frequency, both with the same offset added:
/// relative error at most 1.8e-7 *of the change*, for codes below 2^31. Zero for a reference of 0.
///
/// ```
/// use palpate_model::tank::relative_frequency_change;
/// // One count in 2^27, which two `f32` frequencies could not tell apart.
/// let change = relative_frequency_change(1 << 27, (1 << 27) + 1);
/// assert_eq!(change, 1.0 / 134_217_728.0);
/// ```
pub fn relative_frequency_change(reference_code: u32, code: u32) -> f32 {
    if reference_code == 0 {
        return 0.0;
    }
    let difference = i64::from(code) - i64::from(reference_code);
    difference as f32 / reference_code as f32
}

/// L/L0 - 1 from delta = f/f0 - 1: relative error at most 6.0e-7 of the change, for delta from
/// -0.5 to 1.
///
/// ```
/// use palpate_model::tank::relative_inductance_change;
/// // The frequency falls, the inductance rises twice as much.
/// assert!((relative_inductance_change(-1e-6) - 2e-6).abs() < 1e-11);
/// ```
pub fn relative_inductance_change(frequency_change: f32) -> f32 {
    let ratio = 1.0 + frequency_change;
    -frequency_change * (2.0 + frequency_change) / (ratio * ratio)
}

/// delta = f/f0 - 1 from L/L0 - 1, the inverse of [`relative_inductance_change`]: relative error
/// at most 6.0e-7 of the change, for a change of inductance from -0.7 to 3.
pub fn relative_frequency_change_of(inductance_change: f32) -> f32 {
    let root = crate::math::sqrt(1.0 + inductance_change);
    -inductance_change / (root * (1.0 + root))
}

/// Takes a capacitor's drift out of an apparent L/L0 - 1.
///
/// The resonance measures the product L C. When C has changed by the fraction `capacitance_change`
/// (tempco times temperature difference), L/L0 = (apparent L/L0) / (1 + change). The result
/// depends on a difference of two small numbers: absolute error at most 1.2e-7 of the larger.
///
/// ```
/// use palpate_model::tank::without_capacitance_change;
/// let change = without_capacitance_change(250e-6, 150e-6);
/// assert!((change - 99.985e-6).abs() < 1e-10);
/// ```
pub fn without_capacitance_change(apparent: f32, capacitance_change: f32) -> f32 {
    (apparent - capacitance_change) / (1.0 + capacitance_change)
}
