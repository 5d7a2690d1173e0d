//! Quotients.

use crate::{BIAS, FRACTION, INFINITY, LEADING, NAN, SIGN};
use crate::{exponent, is_nan, is_normal, normalised, pack};

/// The quotient of two numbers.
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
    // A quotient from 1 to below 2.
    let mut rest = a;
    if a < b {
        rest <<= 1;
        at -= 1;
    }
    // Two digits of 13 bits, 2^26 times the quotient in all, which is two bits more than a number
    // has. Each is found from the reciprocal, too small by four at most, and put right by what it
    // leaves.
    let reciprocal = reciprocal(b);
    let (first, rest) = digit(rest, b, reciprocal);
    let (second, rest) = digit(rest, b, reciprocal);
    let quotient = (first << DIGIT) + second;
    pack(sign, at, quotient << (31 - 2 * DIGIT) | (rest != 0) as u32)
}

/// Bits of a digit of the quotient.
const DIGIT: u32 = 13;
/// By how much the last step of [`reciprocal`] may be too large: 3.6 (`tests/integration/bits.rs` tries all).
const ABOVE: u32 = 4;

/// Of a number from 2^23 to below 2^24: 2^39 over it, from 2^15 to 2^16, never above.
#[inline(always)]
const fn reciprocal(b: u32) -> u32 {
    // d from 1/2 to 1, of which 48/17 - 32/17 d is within 1/17 of the reciprocal (the straight
    // line that is nearest); each step of Newton's squares the relative error: 1/289, 1.2e-5.
    let d = b >> 8;
    // Units of 2^-14.
    let r = 46_260 - ((30_841 * d) >> 16);
    // 2 - d r in units of 2^-14, and the product.
    let r = (r * (32_768 - ((r * d) >> 16))) >> 14;
    // The same in units of 2^-15.
    let r = (r * (65_536 - ((r * d) >> 15))) >> 14;
    r - ABOVE
}

/// 2^13 times the quotient of `rest` and `b` as a whole number, and what is left. `rest` is below
/// 2 `b`.
#[inline(always)]
const fn digit(rest: u32, b: u32, reciprocal: u32) -> (u32, u32) {
    let mut digit = ((rest >> 9) * reciprocal) >> (30 - DIGIT);
    // What is left is small, though what it is the difference of does not fit.
    let mut left = (rest << DIGIT).wrapping_sub(digit.wrapping_mul(b));
    while left >= b {
        left -= b;
        digit += 1;
    }
    (digit, left)
}

/// When one is not finite, or one is zero or subnormal.
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
