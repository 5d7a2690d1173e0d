//! Page's cumulative sum.

use crate::math;

/// A one-sided cumulative sum: each sample changes it to S = max(0, S + z - k), where z is the
/// sample's deviation in units of its standard deviation, and it raises an alarm when S exceeds the
/// threshold (Page, *Continuous inspection schemes*, Biometrika 41, 1954).
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
    /// 11 samples, a shift of 10 in 2.
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

    /// Mean number of samples of white normal noise from a sum of zero to the alarm, if the mean of
    /// the noise is `shift` (in standard deviations): without a shift the distance between false
    /// alarms, with a shift the delay of detection.
    ///
    /// Siegmund's approximation (*Sequential Analysis*, 1985), with D = shift - k and
    /// b = threshold + 1.166: (exp(-2 D b) + 2 D b - 1) / (2 D^2). Within 8 % of the exact value (a
    /// Markov chain, `tests/integration/contact.rs`) for k from 0.25 to 1, thresholds of 3 to 12
    /// and shifts from 0 to k + 1; for larger shifts the delay of a few samples is too short by up
    /// to one.
    ///
    /// ```
    /// use palpate_model::contact::Cusum;
    /// let cusum = Cusum { allowance: 0.5, threshold: 4.0 };
    /// assert!((cusum.average_run_length(0.0) / 336.0 - 1.0).abs() < 0.02);
    /// ```
    pub fn average_run_length(&self, shift: f32) -> f32 {
        let reach = self.threshold + 1.166;
        let drift = shift - self.allowance;
        let way = 2.0 * drift * reach;
        if way.abs() < 1e-2 {
            // Series of the quotient about drift = 0; the next term is 4e-6 of the result.
            return reach * reach * (1.0 - way / 3.0 + way * way / 12.0);
        }
        (math::exp_m1(-way) + way) / (2.0 * drift * drift)
    }
}
