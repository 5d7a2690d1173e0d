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
//! `f32` arithmetic on integers, for a processor with a 32-bit multiplier and no FPU.
//!
//! The compiler's own routines are generic over every width and assume a 64-bit product. These are for
//! one width and for the Cortex-M0+, which multiplies two words to one word in a cycle and cannot count
//! leading zeros. Results equal those of IEEE 754 to the bit - rounded to nearest, ties to even,
//! subnormal numbers and infinities included - except for the payload of a NaN, which is always [`NAN`].
//!
//! Arguments and results are the bits of numbers, `f32::to_bits`: no function here calls a routine that
//! it replaces.

mod add;
mod convert;
mod divide;
mod multiply;

pub use add::{add, subtract};
pub use convert::{from_i32, from_u32, from_u64};
pub use divide::divide;
pub use multiply::multiply;

/// NaN that an invalid operation returns.
pub const NAN: u32 = 0x7FC0_0000;

const SIGN: u32 = 0x8000_0000;
const INFINITY: u32 = 0x7F80_0000;
/// Position of the exponent field's lowest bit in a number.
const EXPONENT_AT: u32 = 23;
/// Leading bit of a normal number, which is not stored.
const LEADING: u32 = 1 << EXPONENT_AT;
const FRACTION: u32 = LEADING - 1;
/// Exponent field of infinities and NaNs.
const EXPONENT_MAX: u32 = 0xFF;
/// Exponent field of numbers from 1 to below 2.
const BIAS: i32 = 127;

/// Returns the exponent field.
#[inline(always)]
const fn exponent(bits: u32) -> u32 {
    (bits >> EXPONENT_AT) & EXPONENT_MAX
}

/// Returns whether an exponent field is that of a normal number: not zero, subnormal, infinite or NaN.
#[inline(always)]
const fn is_normal(exponent: u32) -> bool {
    exponent.wrapping_sub(1) < EXPONENT_MAX - 1
}

const fn is_nan(bits: u32) -> bool {
    bits & !SIGN > INFINITY
}

/// Returns the exponent field and a significand from 2^23 to below 2^24 of a number other than zero. For
/// a subnormal number the returned field is below one.
const fn normalised(bits: u32) -> (i32, u32) {
    let field = exponent(bits);
    let fraction = bits & FRACTION;
    if field != 0 {
        return (field as i32, fraction | LEADING);
    }
    let shift = fraction.leading_zeros() as i32 - 8;
    (1 - shift, fraction << (shift & 31))
}

/// Rounds a significand of at least 2^31 to 24 bits and packs it with sign and exponent. The last eight
/// bits of `significand` are beyond the precision; the very last is a sticky bit. `exponent` is the
/// exponent field minus one.
#[inline(always)]
const fn pack(sign: u32, exponent: i32, significand: u32) -> u32 {
    if exponent as u32 >= EXPONENT_MAX - 1 {
        return pack_extreme(sign, exponent, significand);
    }
    // The significand's leading bit adds one to the exponent field, and so does a carry out of the
    // fraction.
    sign | (((exponent as u32) << EXPONENT_AT) + rounded(significand))
}

/// Removes the last eight bits; rounds to nearest, ties to even.
#[inline(always)]
const fn rounded(significand: u32) -> u32 {
    let kept = significand >> 8;
    kept + (((significand & 0xFF) + 0x7F + (kept & 1)) >> 8)
}

/// Packs a result that is too large or too small for a normal number.
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

/// Shifts right by less than 32; the last bit of the result is also set if a bit that is shifted out was
/// set.
#[inline(always)]
const fn shifted(significand: u32, by: u32) -> u32 {
    let by = by & 31;
    let kept = significand >> by;
    kept | (kept << by != significand) as u32
}
