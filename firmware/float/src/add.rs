//! Addition and subtraction.

use crate::{EXPONENT_MAX, FRACTION, INFINITY, LEADING, NAN, SIGN};
use crate::{exponent, is_nan, is_normal, normalised, pack, shifted};

/// Returns the sum of two numbers.
#[inline(always)]
pub const fn add(a: u32, b: u32) -> u32 {
    // Larger magnitude first: without the sign, the bits of two numbers order as their magnitudes do.
    let (large, small) = if a << 1 < b << 1 { (b, a) } else { (a, b) };
    let (of_large, of_small) = (exponent(large), exponent(small));
    if of_large == EXPONENT_MAX || of_small == 0 {
        return add_special(large, small);
    }
    add_normalised(
        large,
        small,
        (of_large as i32, large & FRACTION | LEADING),
        (of_small as i32, small & FRACTION | LEADING),
    )
}

/// Returns the difference of two numbers.
#[inline(always)]
pub const fn subtract(a: u32, b: u32) -> u32 {
    add(a, b ^ SIGN)
}

/// Adds two ordered normal numbers with the signs of `large` and `small`.
#[inline(always)]
const fn add_normalised(
    large: u32,
    small: u32,
    (at, significand): (i32, u32),
    (small_at, small_significand): (i32, u32),
) -> u32 {
    let apart = (at - small_at) as u32;
    let sign = large & SIGN;
    let significand = significand << 7;
    let small_significand = if apart < 32 {
        shifted(small_significand << 7, apart)
    } else {
        1
    };
    if (large ^ small) & SIGN == 0 {
        let sum = significand + small_significand;
        return if (sum as i32) < 0 {
            pack(sign, at, sum)
        } else {
            pack(sign, at - 1, sum << 1)
        };
    }
    let mut difference = (significand - small_significand) << 1;
    if difference == 0 {
        return 0;
    }
    let mut at = at - 1;
    // A loop instead of an instruction that counts leading zeros, which the processor lacks: usually one
    // step of the second loop is enough.
    while difference < 1 << 23 {
        difference <<= 8;
        at -= 8;
    }
    while (difference as i32) >= 0 {
        difference <<= 1;
        at -= 1;
    }
    pack(sign, at, difference)
}

/// Handles infinite, NaN, zero and subnormal operands.
#[cold]
#[inline(never)]
const fn add_special(large: u32, small: u32) -> u32 {
    if is_nan(large) {
        return NAN;
    }
    if large & !SIGN == INFINITY {
        return if small == large ^ SIGN { NAN } else { large };
    }
    if small & !SIGN == 0 {
        // Zeros of opposite sign add to a positive zero.
        return if large & !SIGN == 0 {
            large & small
        } else {
            large
        };
    }
    add_normalised(large, small, normalised(large), normalised(small))
}

const _: () = assert!(is_normal(1) && is_normal(254) && !is_normal(0) && !is_normal(255));
