//! Fourier transforms on a square grid, for convolutions.
//!
//! The forward transform leaves the wave numbers in bit-reversed order (decimation in frequency),
//! and the inverse expects that order: a product in between needs no reordering (Gentleman and
//! Sande 1966). Own code: its results have the same bits on every platform.

use core::f64::consts::TAU;

/// A complex number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Complex {
    pub(super) re: f64,
    pub(super) im: f64,
}

impl Complex {
    fn times(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }
}

/// Transforms of a grid of `size` by `size`, a power of two.
#[derive(Clone, Debug)]
pub(super) struct Fft {
    size: usize,
    /// e^(−2πij/n) for j below n/2, for n = size, size/2, ..., 2.
    levels: Vec<Vec<Complex>>,
}

impl Fft {
    /// Transforms of a grid with 2^`bits` points a side.
    pub(super) fn new(bits: u32) -> Self {
        let level = |n: u32| {
            let angle = |j: u32| -TAU * f64::from(j) / f64::from(n);
            let turn = |j: u32| Complex {
                re: libm::cos(angle(j)),
                im: libm::sin(angle(j)),
            };
            (0..n / 2).map(turn).collect()
        };
        Self {
            size: 1 << bits,
            levels: (1..=bits).rev().map(|bit| level(1 << bit)).collect(),
        }
    }

    /// Signed wave numbers in the order of the forward transform, in units of one per period.
    pub(super) fn waves(&self) -> Vec<f64> {
        let bits = self.levels.len() as u32;
        let size = self.size as u32;
        let wave = |index: u32| {
            let index = index.reverse_bits() >> (u32::BITS - bits);
            f64::from(index)
                - if 2 * index < size {
                    0.0
                } else {
                    f64::from(size)
                }
        };
        (0..size).map(wave).collect()
    }

    /// Replaces the grid by its transform.
    pub(super) fn forward(&self, grid: &mut [Complex]) {
        let size = self.size;
        for row in grid.chunks_exact_mut(size) {
            // Contacts are small: most rows of a pressure are zero.
            if row.iter().any(|value| *value != Complex::default()) {
                self.each_level(row, 1, Self::apart);
            }
        }
        self.each_level(grid, size, Self::apart);
    }

    /// Replaces the transform by its grid times the number of points.
    pub(super) fn inverse(&self, grid: &mut [Complex]) {
        let size = self.size;
        for row in grid.chunks_exact_mut(size) {
            self.each_level_back(row, 1);
        }
        self.each_level_back(grid, size);
    }

    /// Butterflies from long to short blocks; an element is `width` numbers.
    fn each_level(
        &self,
        data: &mut [Complex],
        width: usize,
        pair: impl Fn(&mut Complex, &mut Complex, Complex),
    ) {
        for turns in &self.levels {
            butterflies(data, width, turns, &pair);
        }
    }

    fn each_level_back(&self, data: &mut [Complex], width: usize) {
        for turns in self.levels.iter().rev() {
            butterflies(data, width, turns, &Self::together);
        }
    }

    fn apart(a: &mut Complex, b: &mut Complex, turn: Complex) {
        let difference = Complex {
            re: a.re - b.re,
            im: a.im - b.im,
        };
        a.re += b.re;
        a.im += b.im;
        *b = difference.times(turn);
    }

    fn together(a: &mut Complex, b: &mut Complex, turn: Complex) {
        let back = Complex {
            re: turn.re,
            im: -turn.im,
        };
        let turned = b.times(back);
        *b = Complex {
            re: a.re - turned.re,
            im: a.im - turned.im,
        };
        a.re += turned.re;
        a.im += turned.im;
    }
}

fn butterflies(
    data: &mut [Complex],
    width: usize,
    turns: &[Complex],
    pair: &impl Fn(&mut Complex, &mut Complex, Complex),
) {
    let half = turns.len() * width;
    for block in data.chunks_exact_mut(2 * half) {
        let (first, second) = block.split_at_mut(half);
        if width == 1 {
            for ((a, b), &turn) in first.iter_mut().zip(second).zip(turns) {
                pair(a, b, turn);
            }
            continue;
        }
        let elements = first
            .chunks_exact_mut(width)
            .zip(second.chunks_exact_mut(width));
        for ((first, second), &turn) in elements.zip(turns) {
            for (a, b) in first.iter_mut().zip(second) {
                pair(a, b, turn);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_has_one_coefficient_and_comes_back() {
        let fft = Fft::new(4);
        let mut grid: Vec<Complex> = (0..256)
            .map(|index| {
                let angle =
                    TAU * (3.0 * f64::from(index % 16) - 5.0 * f64::from(index / 16)) / 16.0;
                Complex {
                    re: angle.cos(),
                    im: angle.sin(),
                }
            })
            .collect();
        let before = grid.clone();
        fft.forward(&mut grid);
        let waves = fft.waves();
        for (row, y) in grid.chunks(16).zip(&waves) {
            for (value, x) in row.iter().zip(&waves) {
                let expected = if (*x, *y) == (3.0, -5.0) { 256.0 } else { 0.0 };
                assert!(
                    (value.re - expected).abs() < 1e-11 && value.im.abs() < 1e-11,
                    "{x} {y}"
                );
            }
        }
        fft.inverse(&mut grid);
        for (now, before) in grid.iter().zip(before) {
            assert!((now.re / 256.0 - before.re).abs() < 1e-13);
            assert!((now.im / 256.0 - before.im).abs() < 1e-13);
        }
    }
}
