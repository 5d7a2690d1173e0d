//! All functions beyond the four basic operations, each with its maximum error.
//!
//! The four operations and `sqrt` are correctly rounded by IEEE 754, in hardware and in software;
//! `libm` is plain Rust that uses only these and never fuses a product and a sum. So a formula
//! written with this module gives the same bits on a Cortex-M0+ without a floating-point unit and
//! on a PC. The `f32` methods of `std` and a fused multiply-add do not guarantee that; this crate
//! uses neither.
//!
//! The error bounds below are relative to the result, and `tests/integration/math.rs` checks them
//! against `f64`. Half a unit in the last place (ulp) of `f32` is at most 6.0e-8 of the value.

pub mod student;
mod wide;

pub use wide::Wide;

/// Square root, correctly rounded: relative error at most 6.0e-8. NaN below zero.
pub fn sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Natural logarithm: relative error at most 1.2e-7 for normal `x` above zero.
pub fn ln(x: f32) -> f32 {
    libm::logf(x)
}

/// ln(1 + x), also accurate for small `x`: relative error at most 1.2e-7 for `x` above -0.999.
pub fn ln_1p(x: f32) -> f32 {
    libm::log1pf(x)
}

/// Exponential: relative error at most 1.2e-7 wherever the result is a normal number.
pub fn exp(x: f32) -> f32 {
    libm::expf(x)
}

/// exp(x) - 1, also accurate for small `x`: relative error at most 1.2e-7 from -80 to 80.
pub fn exp_m1(x: f32) -> f32 {
    libm::expm1f(x)
}

/// Arc tangent: relative error at most 1.2e-7.
pub fn atan(x: f32) -> f32 {
    libm::atanf(x)
}

/// Largest whole number not above `x`, exact.
pub fn floor(x: f32) -> f32 {
    libm::floorf(x)
}

/// Square root of the sum of two squares, without intermediate overflow or underflow: relative
/// error at most 2.0e-7.
pub fn hypot(a: f32, b: f32) -> f32 {
    let (a, b) = (a.abs(), b.abs());
    let (large, small) = if a > b { (a, b) } else { (b, a) };
    if large == 0.0 || large.is_infinite() {
        return large;
    }
    let ratio = small / large;
    large * sqrt(1.0 + ratio * ratio)
}
