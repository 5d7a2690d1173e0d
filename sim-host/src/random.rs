//! Random numbers: one stream for each named quantity.
//!
//! Each quantity draws from its own stream, selected by the seed and the quantity's name. Adding,
//! removing or disabling a quantity does not change any other, so a plant keeps its values while
//! the model grows. The generator is PCG XSL RR 128/64 (O'Neill 2014).

use core::f64::consts::TAU;

use rand_pcg::{Pcg64, rand_core::Rng};

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Stream(Pcg64);

impl Stream {
    /// The stream of the quantity `name` under `seed`.
    ///
    /// ```
    /// use palpate_sim::random::Stream;
    ///
    /// let draw = |seed, name| Stream::named(seed, name).uniform();
    /// assert_eq!(draw(1, "creep.amplitude"), draw(1, "creep.amplitude"));
    /// assert_ne!(draw(1, "creep.amplitude"), draw(1, "creep.tau"));
    /// assert_ne!(draw(1, "creep.amplitude"), draw(2, "creep.amplitude"));
    /// ```
    #[must_use]
    pub fn named(seed: u64, name: &str) -> Self {
        let name = fnv_1a(name.as_bytes());
        // PCG's streams are uncorrelated only if the states differ too, so the name sets both.
        let state = u128::from(seed) << 64 | u128::from(seed ^ name);
        let mut generator = Pcg64::new(state, u128::from(name));
        generator.next_u64();
        Self(generator)
    }

    /// Uniform in [0, 1), 53 bits.
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [`min`, `max`).
    pub fn between(&mut self, min: f64, max: f64) -> f64 {
        min + (max - min) * self.uniform()
    }

    /// Log-uniform in [`min`, `max`), both above zero.
    pub fn log_between(&mut self, min: f64, max: f64) -> f64 {
        libm::exp(self.between(libm::log(min), libm::log(max)))
    }

    /// A phase, uniform in [0, 2π) rad.
    pub fn phase(&mut self) -> f64 {
        self.between(0.0, TAU)
    }

    /// Normally distributed with mean 0 and variance 1 (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        radius * libm::cos(TAU * self.uniform())
    }
}

/// Hash of a name (Fowler, Noll and Vo 1991). The standard library's hasher may change with its
/// version; a plant must not.
fn fnv_1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xCBF2_9CE4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_fnv_1a() {
        // Known answers of the published algorithm.
        assert_eq!(fnv_1a(b""), 0xCBF2_9CE4_8422_2325);
        assert_eq!(fnv_1a(b"a"), 0xAF63_DC4C_8601_EC8C);
        assert_eq!(fnv_1a(b"foobar"), 0x8594_4171_F739_67E8);
    }

    #[test]
    fn streams_are_uniform_and_do_not_follow_each_other() {
        let count = 20_000;
        let mut one = Stream::named(1, "one");
        let mut other = Stream::named(2, "one");
        let (mut mean, mut product) = (0.0, 0.0);
        for _ in 0..count {
            let (a, b) = (one.uniform() - 0.5, other.uniform() - 0.5);
            mean += a;
            product += a * b;
        }
        let count = f64::from(count);
        assert!((mean / count).abs() < 4.0 * 0.289 / count.sqrt());
        assert!((product / count).abs() < 4.0 / 12.0 / count.sqrt());
    }

    #[test]
    fn first_draws_of_successive_seeds_fill_the_range() {
        let mut counts = [0_u32; 10];
        for seed in 0..10_000 {
            let draw = Stream::named(seed, "x").uniform();
            counts[(draw * 10.0) as usize] += 1;
        }
        for count in counts {
            assert!((850..1150).contains(&count), "{counts:?}");
        }
    }

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let mut stream = Stream::named(3, "normal");
        let count = 100_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..count {
            let x = stream.normal();
            sum += x;
            squares += x * x;
        }
        assert!((sum / f64::from(count)).abs() < 0.015);
        assert!((squares / f64::from(count) - 1.0).abs() < 0.02);
    }

    #[test]
    fn logarithms_are_uniform() {
        let mut stream = Stream::named(4, "tau");
        let below = (0..10_000)
            .filter(|_| {
                let tau = stream.log_between(0.05, 5.0);
                assert!((0.05..=5.0).contains(&tau));
                tau < 0.5
            })
            .count();
        assert!((4_800..5_200).contains(&below), "{below} of 10000");
    }
}
