//! The LC resonator: from frequency to inductance.
//!
//! The sensing coil and a fixed capacitor C resonate at f = 1 / (2 pi sqrt(L C)), so
//!
//! L = 1 / ((2 pi f)^2 C).
//!
//! Only the *change* of L matters. A micrometre of deformation changes f by about 1e-4 and a
//! converter resolves 1e-7 to 1e-8, while `f32` resolves 6e-8: as absolute `f32` numbers, two
//! neighbouring frequencies would be equal. So the change is computed from the converter's codes as
//! exact integers, and all further formulas use the change:
//!
//! delta = (D - D0) / D0 = f/f0 - 1, and L/L0 - 1 = -delta (2 + delta) / (1 + delta)^2.
//!
//! Damping lowers f by the fraction 1/(8 Q^2), 8e-5 at Q = 40; this cancels in the ratio while Q is
//! constant.

/// Relative frequency change f/f0 - 1, from two codes that are proportional to frequency and
/// contain the same offset. Relative error at most 1.8e-7 *of the change*, for codes below 2^31.
/// Zero for a reference of 0.
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

/// Relative inductance change L/L0 - 1 from delta = f/f0 - 1: relative error at most 6.0e-7 of the
/// change, for delta from -0.5 to 1.
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
