//! Multiplication.

use crate::{BIAS, FRACTION, INFINITY, LEADING, NAN, SIGN};
use crate::{exponent, is_nan, is_normal, normalised, pack};

/// Returns the product of two numbers.
#[inline(always)]
pub const fn multiply(a: u32, b: u32) -> u32 {
    let (of_a, of_b) = (exponent(a), exponent(b));
    if !is_normal(of_a) || !is_normal(of_b) {
        return multiply_special(a, b);
    }
    multiply_normalised(
        (a ^ b) & SIGN,
        (of_a as i32, a & FRACTION | LEADING),
        (of_b as i32, b & FRACTION | LEADING),
    )
}

#[inline(always)]
const fn multiply_normalised(sign: u32, (at_a, a): (i32, u32), (at_b, b): (i32, u32)) -> u32 {
    // Multiplies halves of 16 bits, since the processor returns only 32 bits of a product. Of the 48
    // bits of the whole product, the lowest 16 matter only as a sticky bit.
    let (low_a, high_a) = (a & 0xFFFF, a >> 16);
    let (low_b, high_b) = (b & 0xFFFF, b >> 16);
    let low = low_a * low_b;
    let upper = ((high_a * high_b) << 16) + low_a * high_b + high_a * low_b + (low >> 16);
    // Upper 32 bits of the product, from 2^30 to below 2^32.
    let mut product = upper | (low << 16 != 0) as u32;
    let mut at = at_a + at_b - BIAS;
    if (product as i32) >= 0 {
        product <<= 1;
        at -= 1;
    }
    pack(sign, at, product)
}

/// Handles infinite, NaN, zero and subnormal operands.
#[cold]
#[inline(never)]
const fn multiply_special(a: u32, b: u32) -> u32 {
    let sign = (a ^ b) & SIGN;
    let (size_a, size_b) = (a & !SIGN, b & !SIGN);
    if is_nan(a) || is_nan(b) {
        return NAN;
    }
    if size_a == 0 || size_b == 0 {
        return if size_a == INFINITY || size_b == INFINITY {
            NAN
        } else {
            sign
        };
    }
    if size_a == INFINITY || size_b == INFINITY {
        return sign | INFINITY;
    }
    multiply_normalised(sign, normalised(a), normalised(b))
}
