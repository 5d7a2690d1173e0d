//! Compares every operation with the host processor's own, to the bit.

use palpate_float::{NAN, add, divide, from_i32, from_u32, from_u64, multiply, subtract};
use proptest::prelude::*;

/// Returns the bits of a result; all NaNs give the same bits.
fn bits(number: f32) -> u32 {
    if number.is_nan() {
        NAN
    } else {
        number.to_bits()
    }
}

#[track_caller]
fn check(a: u32, b: u32) {
    let (x, y) = (f32::from_bits(a), f32::from_bits(b));
    let cases = [
        ("+", add(a, b), x + y),
        ("-", subtract(a, b), x - y),
        ("*", multiply(a, b), x * y),
        ("/", divide(a, b), x / y),
    ];
    for (sign, ours, right) in cases {
        assert_eq!(
            ours,
            bits(right),
            "{x:e} {sign} {y:e} is {right:e}, not {:e} ({a:#x}, {b:#x})",
            f32::from_bits(ours)
        );
    }
}

/// Returns numbers near which the algorithms take another branch, as bits: zero, subnormal numbers,
/// powers of two and their neighbours, infinity and NaN, of both signs.
fn edges() -> Vec<u32> {
    let mut edges = vec![0x7F80_0001, 0x7FFF_FFFF];
    for exponent in [
        0, 1, 2, 23, 24, 25, 64, 103, 104, 126, 127, 128, 150, 151, 152, 230, 253, 254, 255,
    ] {
        for fraction in [
            0, 1, 2, 3, 0x3F_FFFF, 0x40_0000, 0x40_0001, 0x55_5555, 0x7F_FFFE, 0x7F_FFFF,
        ] {
            edges.push(exponent << 23 | fraction);
        }
    }
    let negative: Vec<u32> = edges.iter().map(|edge| edge | 1 << 31).collect();
    edges.extend(negative);
    edges
}

#[test]
fn edges_meet_edges() {
    let edges = edges();
    for &a in &edges {
        for &b in &edges {
            check(a, b);
        }
    }
}

/// Random generator that is fast enough for millions of numbers (Marsaglia 2003, xorshift32).
fn random(state: &mut u32) -> u32 {
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    *state
}

#[test]
fn millions_of_random_bits() {
    let mut state = 0x2026_1121;
    for _ in 0..3_000_000 {
        let (a, b) = (random(&mut state), random(&mut state));
        check(a, b);
        // Second operand close to the first: the leading bits of a difference cancel, and a quotient is
        // near one.
        check(a, a ^ (b >> (8 + (b & 15))));
        // Two operands of similar magnitude: all bits of both affect a sum.
        check(a & 0x83FF_FFFF | 0x3C00_0000, b & 0x83FF_FFFF | 0x3C00_0000);
    }
}

#[test]
fn every_divisor_has_its_reciprocal() {
    for fraction in 0..1 << 23 {
        let divisor = 127 << 23 | fraction;
        for numerator in [1.0_f32, 1.999_999_9, f32::from_bits(divisor) * 0.5] {
            let right = numerator / f32::from_bits(divisor);
            assert_eq!(
                divide(numerator.to_bits(), divisor),
                right.to_bits(),
                "{numerator} / {divisor:#x}"
            );
        }
    }
}

#[test]
fn whole_numbers() {
    let near_powers = (0..64).flat_map(|n| {
        let power = 1_u64 << n;
        [
            power.wrapping_sub(1),
            power,
            power + 1,
            power | power >> 24,
            power | power >> 25,
            power | power >> 24 | 1,
        ]
    });
    let mut state = 7;
    let some = (0..100_000).map(|_| {
        let wide = u64::from(random(&mut state)) << 32 | u64::from(random(&mut state));
        wide >> (random(&mut state) & 63)
    });
    for number in near_powers.chain(some) {
        assert_eq!(from_u64(number), (number as f32).to_bits(), "{number}");
        let short = number as u32;
        assert_eq!(from_u32(short), (short as f32).to_bits(), "{short}");
        let signed = short as i32;
        assert_eq!(from_i32(signed), (signed as f32).to_bits(), "{signed}");
    }
    assert_eq!(from_i32(i32::MIN), (i32::MIN as f32).to_bits());
}

proptest! {
    #[test]
    fn any_two_numbers(a: f32, b: f32) {
        check(a.to_bits(), b.to_bits());
    }
}
