//! A wide number for running sums, in integers.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number mantissa x 2^exponent whose mantissa has 62 bits, about 18 digits; its size is
/// practically unlimited.
///
/// For running sums whose differences are needed: these need more than the 7 digits of `f32`. Uses
/// integer operations only, so that every machine gives the same bits. The mantissa has 62 bits
/// because three 32-bit products give that many. On a Cortex-M0+, which multiplies integers in one
/// cycle and has no floating-point unit, a product and a sum together take 400 cycles; with `f64`
/// in software they take 790, and with two `f32` as a double word several thousand.
///
/// | operation | error at most |
/// |---|---|
/// | sum, difference | 8.7e-19 (2^-60) of the larger term |
/// | product | 2.7e-18 (3 x 2^-60) of the product |
/// | quotient | 8.7e-19 (2^-60) of the quotient |
/// | to and from `f32` | half an ulp, none |
///
/// Infinity and NaN do not exist: [`from_f32`](Self::from_f32) requires finite numbers.
///
/// ```
/// use palpate_model::math::Wide;
/// let [large, small] = [1e5, 1e-5].map(Wide::from_f32);
/// assert_eq!((large + small - large).to_f32(), 1e-5);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wide {
    /// Zero, or a magnitude from 2^61 to below 2^62.
    mantissa: i64,
    exponent: i32,
}

/// Exponent with which a normal mantissa is a number from 1 to below 2.
const UNIT: i32 = -61;
/// Number of bits of the mantissa's lower half.
const HALF: u32 = 31;

impl Wide {
    /// Zero.
    pub const ZERO: Self = Self {
        mantissa: 0,
        exponent: 0,
    };
    /// One.
    pub const ONE: Self = Self {
        mantissa: 1 << 61,
        exponent: UNIT,
    };

    /// Converts a finite number exactly; the result for others is meaningless.
    pub const fn from_f32(x: f32) -> Self {
        const FRACTION_BITS: u32 = 23;
        const FRACTION: u32 = (1 << FRACTION_BITS) - 1;
        const SMALLEST: i32 = -149;
        let bits = x.to_bits();
        let fraction = (bits & FRACTION) as i64;
        let exponent = ((bits >> FRACTION_BITS) & 0xFF) as i32;
        let (magnitude, exponent) = if exponent == 0 {
            (fraction, SMALLEST)
        } else {
            (
                fraction | 1 << FRACTION_BITS,
                exponent.wrapping_add(SMALLEST - 1),
            )
        };
        // The mantissa of an `f32` has 24 bits and is shifted to 62 bits.
        const UP: u32 = 62 - 24;
        let mantissa = magnitude << UP;
        let signed = if x.is_sign_negative() {
            mantissa.wrapping_neg()
        } else {
            mantissa
        };
        Self::normal(signed, exponent.wrapping_sub_unsigned(UP))
    }

    /// The nearest `f32`; zero below 1.2e-38, infinite above 3.4e38.
    pub const fn to_f32(self) -> f32 {
        const BIAS: i32 = 127;
        let from_one_to_two = self.mantissa as f32 / (1u64 << 61) as f32;
        let biased = self.exponent.wrapping_sub(UNIT).wrapping_add(BIAS);
        if biased < 1 {
            0.0
        } else if biased > 2 * BIAS {
            from_one_to_two * f32::INFINITY
        } else {
            from_one_to_two * f32::from_bits((biased as u32) << 23)
        }
    }

    /// The number as mantissa and exponent.
    pub const fn parts(self) -> (i64, i32) {
        (self.mantissa, self.exponent)
    }

    /// Product with a finite `f32`.
    #[must_use]
    pub fn scale(self, factor: f32) -> Self {
        self * Self::from_f32(factor)
    }

    /// Normalises a mantissa of any size, so that it has 62 bits.
    const fn normal(mantissa: i64, exponent: i32) -> Self {
        // The mantissa is nearly always at most one bit too long or too short; counting leading
        // zeros would take 115 cycles.
        match mantissa.unsigned_abs() >> 60 {
            2 | 3 => Self { mantissa, exponent },
            1 => Self {
                mantissa: mantissa << 1,
                exponent: exponent.wrapping_sub(1),
            },
            4..=7 => Self {
                mantissa: mantissa >> 1,
                exponent: exponent.wrapping_add(1),
            },
            _ => Self::from_far(mantissa, exponent),
        }
    }

    const fn from_far(mantissa: i64, exponent: i32) -> Self {
        /// Number of bits of an `i64` above a normal mantissa.
        const SPARE: u32 = 2;
        if mantissa == 0 {
            return Self::ZERO;
        }
        let zeros = mantissa.unsigned_abs().leading_zeros();
        if zeros >= SPARE {
            let up = zeros.wrapping_sub(SPARE);
            Self {
                mantissa: mantissa.wrapping_shl(up),
                exponent: exponent.wrapping_sub_unsigned(up),
            }
        } else {
            let down = SPARE.wrapping_sub(zeros);
            Self {
                mantissa: mantissa.wrapping_shr(down),
                exponent: exponent.wrapping_add_unsigned(down),
            }
        }
    }
}

/// A mantissa upper x 2^31 + lower; the sign is in the upper half.
struct Halves {
    upper: i32,
    lower: i32,
}

impl Halves {
    const fn of(mantissa: i64) -> Self {
        const LOWER: i64 = (1 << HALF) - 1;
        Self {
            upper: (mantissa >> HALF) as i32,
            lower: (mantissa & LOWER) as i32,
        }
    }
}

impl Add for Wide {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        if self.mantissa == 0 {
            return other;
        }
        if other.mantissa == 0 {
            return self;
        }
        let (large, small) = if self.exponent >= other.exponent {
            (self, other)
        } else {
            (other, self)
        };
        let apart = large.exponent.abs_diff(small.exponent);
        if apart > 62 {
            return large;
        }
        // Rounded and not truncated: otherwise the errors of a long sum would all have the same
        // sign.
        let aligned = match apart.checked_sub(1) {
            None => small.mantissa,
            Some(less) => small
                .mantissa
                .wrapping_shr(less)
                .wrapping_add(1)
                .wrapping_shr(1),
        };
        // The sum of two magnitudes of at most 2^62 does not overflow.
        Self::normal(large.mantissa.wrapping_add(aligned), large.exponent)
    }
}

impl Neg for Wide {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            mantissa: self.mantissa.wrapping_neg(),
            exponent: self.exponent,
        }
    }
}

impl Sub for Wide {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Wide {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        // The product of the two lower halves is below the last bit of the result and is left out.
        let (a, b) = (Halves::of(self.mantissa), Halves::of(other.mantissa));
        let product = |a: i32, b: i32| i64::from(a).wrapping_mul(i64::from(b));
        let middle = product(a.upper, b.lower).wrapping_add(product(a.lower, b.upper));
        let whole = product(a.upper, b.upper).wrapping_add(middle.wrapping_shr(HALF));
        let exponent = self
            .exponent
            .wrapping_add(other.exponent)
            .wrapping_add(2 * HALF as i32);
        Self::normal(whole, exponent)
    }
}

impl Div for Wide {
    type Output = Self;
    /// Divides bit by bit, which is slow: a fit needs a dozen divisions, adding a sample none. The
    /// result for a divisor of zero is meaningless.
    fn div(self, divisor: Self) -> Self {
        let below = divisor.mantissa.unsigned_abs();
        let mut rest = self.mantissa.unsigned_abs();
        let mut quotient = 0u64;
        for _ in 0..62 {
            quotient = quotient.wrapping_shl(1);
            if rest >= below {
                rest = rest.wrapping_sub(below);
                quotient |= 1;
            }
            rest = rest.wrapping_shl(1);
        }
        let negative = (self.mantissa < 0) != (divisor.mantissa < 0);
        let mantissa = quotient as i64;
        Self::normal(
            if negative {
                mantissa.wrapping_neg()
            } else {
                mantissa
            },
            self.exponent
                .wrapping_sub(divisor.exponent)
                .wrapping_add(UNIT),
        )
    }
}
