#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable,
        clippy::indexing_slicing
    )
)]
//! Arithmetic of `f32` on integers, for a processor that has a 32-bit multiplier and nothing else.
//!
//! The compiler's own routines are generic over every width and written for processors with a
//! multiplication to 64 bits; these are for one width and for the Cortex-M0+, which multiplies two
//! words to a word in a cycle and cannot count leading zeros. Results are those of IEEE 754 to the
//! bit - rounded to nearest, ties to even, subnormal numbers and infinities included - but for the
//! payload of a NaN, which is always [`NAN`].
//!
//! Numbers go in and out as their bits, `f32::to_bits`: nothing here calls what it replaces.

mod add;
mod convert;
mod divide;
mod multiply;

pub use add::{add, subtract};
pub use convert::{from_i32, from_u32, from_u64};
pub use divide::divide;
pub use multiply::multiply;

/// What an operation without a result gives.
pub const NAN: u32 = 0x7FC0_0000;

const SIGN: u32 = 0x8000_0000;
const INFINITY: u32 = 0x7F80_0000;
/// Lowest bit of the exponent.
const EXPONENT_AT: u32 = 23;
/// The leading bit of a normal number, which is not stored.
const LEADING: u32 = 1 << EXPONENT_AT;
const FRACTION: u32 = LEADING - 1;
/// The exponent's field of infinities and NaNs.
const EXPONENT_MAX: u32 = 0xFF;
/// The exponent's field of numbers from 1 to 2.
const BIAS: i32 = 127;

/// The exponent's field.
#[inline(always)]
const fn exponent(bits: u32) -> u32 {
    (bits >> EXPONENT_AT) & EXPONENT_MAX
}

/// Whether it is neither zero, subnormal, infinite nor NaN, by its exponent's field.
#[inline(always)]
const fn is_normal(exponent: u32) -> bool {
    exponent.wrapping_sub(1) < EXPONENT_MAX - 1
}

const fn is_nan(bits: u32) -> bool {
    bits & !SIGN > INFINITY
}

/// A significand from 2^23 to below 2^24 and the exponent's field that goes with it, which is
/// below one for subnormal numbers; not for zero.
const fn normalised(bits: u32) -> (i32, u32) {
    let field = exponent(bits);
    let fraction = bits & FRACTION;
    if field != 0 {
        return (field as i32, fraction | LEADING);
    }
    let shift = fraction.leading_zeros() as i32 - 8;
    (1 - shift, fraction << (shift & 31))
}

/// Rounds and packs a significand from 2^31, whose last eight bits are beyond a number's
/// precision, the very last standing for all that was cut off. `exponent` is the field's less one.
#[inline(always)]
const fn pack(sign: u32, exponent: i32, significand: u32) -> u32 {
    if exponent as u32 >= EXPONENT_MAX - 1 {
        return pack_extreme(sign, exponent, significand);
    }
    // The leading bit adds one to the exponent, and so does a carry out of the fraction.
    sign | (((exponent as u32) << EXPONENT_AT) + rounded(significand))
}

/// To nearest, ties to even.
#[inline(always)]
const fn rounded(significand: u32) -> u32 {
    let kept = significand >> 8;
    kept + (((significand & 0xFF) + 0x7F + (kept & 1)) >> 8)
}

/// Too large or too small for a normal number.
#[cold]
#[inline(never)]
const fn pack_extreme(sign: u32, exponent: i32, significand: u32) -> u32 {
    if exponent > 0 {
        return sign | INFINITY;
    }
    let shift = -exponent;
    if shift > 31 {
        return sign;
    }
    sign | rounded(shifted(significand, shift as u32))
}

/// Shifted to the right by less than 32, the last bit standing for what falls off.
#[inline(always)]
const fn shifted(significand: u32, by: u32) -> u32 {
    let by = by & 31;
    let kept = significand >> by;
    kept | (kept << by != significand) as u32
}
