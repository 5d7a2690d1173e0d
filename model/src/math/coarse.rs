//! Fast, coarse functions from `micromath`, for drive waveforms only.
//!
//! A demagnetising burst tolerates an envelope that is wrong by a thousandth; an inductance does
//! not. `tests/integration/math.rs` proves the error bounds over the stated domain.

use micromath::F32;

/// Sine of a phase in turns: absolute error at most 1.2e-3 for any phase small enough for its `f32`
/// to have a fractional part.
///
/// The phase is in turns because its reduction to one period is then exact: only the fractional
/// part reaches `micromath`, whose own reduction loses accuracy with the size of the angle.
///
/// ```
/// use palpate_model::math::coarse::sin_turns;
/// assert!((sin_turns(100.25) - 1.0).abs() < 1.2e-3);
/// ```
pub fn sin_turns(turns: f32) -> f32 {
    let fraction = turns - super::floor(turns);
    F32(fraction * core::f32::consts::TAU).sin().0
}

/// exp(-x) for a decaying envelope: relative error at most 8.0e-4 for `x` from 0 to 10; zero above
/// 80, one below zero.
///
/// Computed as a reciprocal: `micromath`'s exponential is off by 2.4e-3 for negative arguments.
///
/// ```
/// use palpate_model::math::coarse::decay;
/// assert!((decay(1.0) - 0.367_879).abs() < 3e-4);
/// ```
pub fn decay(x: f32) -> f32 {
    if x <= 0.0 {
        1.0
    } else if x > 80.0 {
        0.0
    } else {
        1.0 / F32(x).exp().0
    }
}
