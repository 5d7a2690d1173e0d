//! Conversion of integers to floating point.

use crate::{BIAS, SIGN, pack};

/// Returns the nearest `f32`.
#[inline(always)]
pub const fn from_u32(number: u32) -> u32 {
    if number == 0 {
        return 0;
    }
    let mut at = BIAS + 30;
    let mut significand = number;
    while significand < 1 << 24 {
        significand <<= 8;
        at -= 8;
    }
    while significand & SIGN == 0 {
        significand <<= 1;
        at -= 1;
    }
    pack(0, at, significand)
}

/// Returns the nearest `f32`.
#[inline(always)]
pub const fn from_i32(number: i32) -> u32 {
    number as u32 & SIGN | from_u32(number.unsigned_abs())
}

/// Returns the nearest `f32`.
#[inline(always)]
pub const fn from_u64(number: u64) -> u32 {
    let (mut high, mut low) = ((number >> 32) as u32, number as u32);
    if high == 0 {
        return from_u32(low);
    }
    let mut at = BIAS + 62;
    while high & SIGN == 0 {
        high = high << 1 | low >> 31;
        low <<= 1;
        at -= 1;
    }
    pack(0, at, high | (low != 0) as u32)
}
