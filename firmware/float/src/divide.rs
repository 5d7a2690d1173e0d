//! Division.

use crate::{BIAS, FRACTION, INFINITY, LEADING, NAN, SIGN};
use crate::{exponent, is_nan, is_normal, normalised, pack};

/// Returns the quotient of two numbers.
#[inline(always)]
pub const fn divide(a: u32, b: u32) -> u32 {
    let (of_a, of_b) = (exponent(a), exponent(b));
    if !is_normal(of_a) || !is_normal(of_b) {
        return divide_special(a, b);
    }
    divide_normalised(
        (a ^ b) & SIGN,
        (of_a as i32, a & FRACTION | LEADING),
        (of_b as i32, b & FRACTION | LEADING),
    )
}

#[inline(always)]
const fn divide_normalised(sign: u32, (at_a, a): (i32, u32), (at_b, b): (i32, u32)) -> u32 {
    let mut at = at_a - at_b + BIAS - 1;
    // Doubles the dividend if needed, so that the quotient is at least 1 and less than 2.
    let mut rest = a;
    if a < b {
        rest <<= 1;
        at -= 1;
    }
    // Two digits of 13 bits give 2^26 times the quotient, two bits more than the significand. Each digit
    // is first estimated from the reciprocal, which makes it too small by four at most, and then
    // corrected by its remainder.
    let reciprocal = reciprocal(b);
    let (first, rest) = digit(rest, b, reciprocal);
    let (second, rest) = digit(rest, b, reciprocal);
    let quotient = (first << DIGIT) + second;
    pack(sign, at, quotient << (31 - 2 * DIGIT) | (rest != 0) as u32)
}

/// Number of bits of a quotient digit.
const DIGIT: u32 = 13;
/// Subtracted from the last step of [`reciprocal`], which may be too large by up to 3.6
/// (`tests/integration/bits.rs` tries all divisors).
const ABOVE: u32 = 4;

/// Returns 2^39 / b, between 2^15 and 2^16 and never too large, for `b` from 2^23 to below 2^24.
#[inline(always)]
const fn reciprocal(b: u32) -> u32 {
    // d, in units of 2^-16, is from 1/2 to 1. The best straight line, 48/17 - 32/17 d, approximates 1/d
    // with a relative error of at most 1/17; each Newton step squares the relative error: 1/289, 1.2e-5.
    let d = b >> 8;
    // 1/d by the straight line, in units of 2^-14.
    let r = 46_260 - ((30_841 * d) >> 16);
    // First Newton step, r (2 - d r), in units of 2^-14.
    let r = (r * (32_768 - ((r * d) >> 16))) >> 14;
    // Second Newton step; the result is in units of 2^-15.
    let r = (r * (65_536 - ((r * d) >> 15))) >> 14;
    r - ABOVE
}

/// Returns the integer part of 2^13 times the quotient of `rest` and `b`, and the remainder. `rest` is
/// below 2 `b`.
#[inline(always)]
const fn digit(rest: u32, b: u32, reciprocal: u32) -> (u32, u32) {
    let mut digit = ((rest >> 9) * reciprocal) >> (30 - DIGIT);
    // The remainder fits into 32 bits although both sides of the subtraction overflow.
    let mut left = (rest << DIGIT).wrapping_sub(digit.wrapping_mul(b));
    while left >= b {
        left -= b;
        digit += 1;
    }
    (digit, left)
}

/// Handles infinite, NaN, zero and subnormal operands.
#[cold]
#[inline(never)]
const fn divide_special(a: u32, b: u32) -> u32 {
    let sign = (a ^ b) & SIGN;
    let (size_a, size_b) = (a & !SIGN, b & !SIGN);
    if is_nan(a) || is_nan(b) || size_a == size_b && (size_a == 0 || size_a == INFINITY) {
        return NAN;
    }
    if size_a == INFINITY || size_b == 0 {
        return sign | INFINITY;
    }
    if size_a == 0 || size_b == INFINITY {
        return sign;
    }
    divide_normalised(sign, normalised(a), normalised(b))
}
