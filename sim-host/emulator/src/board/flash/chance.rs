//! Reproducible random numbers, for power cuts and the unique identifier.

/// SplitMix64 (Steele, Lea and Flood, 2014), with a seed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Chance(u64);

impl Chance {
    pub(super) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(super) const fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let word = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let word = (word ^ word >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        word ^ word >> 31
    }

    /// Uniform in [0, 1).
    pub(super) fn fraction(&mut self) -> f64 {
        // The 53 bits of a double's mantissa.
        (self.word() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A byte whose bits are each set with a probability.
    pub(super) fn bits(&mut self, probability: f64) -> u8 {
        (0..8).fold(0, |bits, bit| {
            bits | u8::from(self.fraction() < probability) << bit
        })
    }
}
