//! The model's own random number generator.
//!
//! SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA
//! 2014) instead of a crate: a recorded run must give the same bytes in ten years, and random
//! number crates do not guarantee that across versions. The generator's period, 2⁶⁴, and its
//! statistics suffice here.

const INCREMENT: u64 = 0x9E37_79B9_7F4A_7C15;

/// State of one stream of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Random(u64);

impl Random {
    /// Creates one of several independent streams of a seed. Noise and faults use different
    /// streams, so that scheduling a fault does not change the noise.
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        let mut mixed = Self(seed ^ stream.wrapping_mul(0xD1B5_4A32_D192_ED03));
        let start = mixed.next();
        Self(start)
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(INCREMENT);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A random number, uniform in [0, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// True with the given probability.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// A random one of the eight bits of a byte, as a mask.
    pub(crate) fn bit(&mut self) -> u8 {
        1 << (self.next() >> 61)
    }

    /// A random number, normally distributed with mean 0 and variance 1 (Box and Muller 1958).
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        radius * libm::cos(core::f64::consts::TAU * self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generator_is_splitmix64() {
        // Results of the published algorithm for the state 1234567.
        let mut random = Random(1_234_567);
        assert_eq!(random.next(), 6_457_827_717_110_365_317);
        assert_eq!(random.next(), 3_203_168_211_198_807_973);
        assert_eq!(random.next(), 9_817_491_932_198_370_423);
    }

    #[test]
    fn the_normal_numbers_have_mean_zero_and_variance_one() {
        let mut random = Random::new(1, 0);
        let count = 100_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..count {
            let x = random.normal();
            sum += x;
            squares += x * x;
        }
        assert!((sum / f64::from(count)).abs() < 0.015);
        assert!((squares / f64::from(count) - 1.0).abs() < 0.02);
    }

    #[test]
    fn every_bit_of_a_byte_is_hit() {
        let mut random = Random::new(2, 0);
        let seen = (0..200).fold(0_u8, |seen, _| seen | random.bit());
        assert_eq!(seen, 0xFF);
    }
}
