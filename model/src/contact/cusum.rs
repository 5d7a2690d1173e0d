//! Page's cumulative sum.

/// A one-sided cumulative sum. Each sample changes the sum to S = max(0, S + z - k), where z is the
/// sample's deviation in standard deviations and k the allowance. An alarm is raised when S exceeds
/// the threshold (Page, *Continuous inspection schemes*, Biometrika 41, 1954).
///
/// Of all tests with the same rate of false alarms it detects a shift of 2 k soonest (Moustakides
/// 1986).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cusum {
    /// k: the part of each deviation that does not count, in standard deviations.
    pub allowance: f32,
    /// Sum above which the alarm is raised, in standard deviations.
    pub threshold: f32,
}

impl Cusum {
    /// k = 1, threshold 10: best for a shift of two standard deviations. The mean distance between
    /// false alarms is 2.3e9 samples of white noise, a month at 1 kHz; a shift of 2 is detected in
    /// 11 samples, a shift of 10 in 2 (Brook and Evans' Markov chain, Biometrika 59, 1972).
    pub const WATCH: Self = Self {
        allowance: 1.0,
        threshold: 10.0,
    };

    /// The sum after a sample with this deviation, never below zero. A NaN deviation gives zero.
    pub const fn after(&self, sum: f32, deviation: f32) -> f32 {
        (sum + deviation - self.allowance).max(0.0)
    }

    /// Whether `sum` raises an alarm.
    pub const fn alarms(&self, sum: f32) -> bool {
        sum > self.threshold
    }
}
