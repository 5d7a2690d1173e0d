//! Agreement of several estimates of the same quantity.

use crate::math::sqrt;

/// Running weighted mean of estimates with standard errors, and the scatter of the estimates about
/// it.
///
/// One fit over a train of ramps derives its standard error from white noise. A disturbance slower
/// than a sample and faster than the train - vibration, or creep that the regressor omits - shifts
/// the estimate of every single ramp, and the scatter of these estimates shows it. So fit each ramp
/// separately as well ([`Basis::LINEAR`](super::Basis::LINEAR) is enough) and add its kappa here.
///
/// ```
/// use palpate_model::ramp::Scatter;
/// let mut scatter = Scatter::default();
/// for kappa in [1.00, 1.10, 0.90, 1.00] {
///     scatter.add(kappa, 0.02);
/// }
/// assert!((scatter.mean() - 1.0).abs() < 1e-6);
/// // The four disagree by four times their own errors: widen by this factor.
/// assert!((scatter.birge_ratio().unwrap() - 4.08).abs() < 0.01);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scatter {
    weight: f32,
    mean: f32,
    /// Sum of the squared deviations from the mean, each divided by its variance; the expected
    /// value is count - 1.
    chi_square: f32,
    /// Sum of the squared differences between successive estimates, each divided by the variance of
    /// the difference.
    successive: f32,
    /// The last estimate with its variance.
    last: Option<(f32, f32)>,
    count: u32,
}

impl Scatter {
    /// Adds an estimate. An estimate that is not finite, or whose error is not positive, is
    /// ignored.
    pub fn add(&mut self, value: f32, standard_error: f32) {
        let variance = standard_error * standard_error;
        let weight = 1.0 / variance;
        if !(value.is_finite() && weight.is_finite() && weight > 0.0) {
            return;
        }
        // West's updating formulas (Comm. ACM 22, 1979): deviations are from the mean, so no digits
        // cancel.
        let total = self.weight + weight;
        let deviation = value - self.mean;
        self.chi_square += deviation * deviation * weight * (self.weight / total);
        self.mean += deviation * (weight / total);
        self.weight = total;
        if let Some((before, of_before)) = self.last {
            let difference = value - before;
            self.successive += difference * difference / (variance + of_before);
        }
        self.last = Some((value, variance));
        self.count = self.count.saturating_add(1);
    }

    /// Weighted mean of the estimates; zero without an estimate.
    pub const fn mean(&self) -> f32 {
        self.mean
    }

    /// Square root of chi-square per degree of freedom: the factor by which the stated errors are
    /// too small. `None` for fewer than two estimates.
    pub fn birge_ratio(&self) -> Option<f32> {
        (self.count > 1).then(|| sqrt(self.chi_square / self.count.saturating_sub(1) as f32))
    }

    /// Factor by which the stated error of the mean is too small: the Birge ratio, increased if
    /// successive estimates are correlated. `None` for fewer than two estimates.
    ///
    /// A slow disturbance, such as a vibration near the rate of the ramps, does not average out
    /// like noise. The correlation r of successive estimates follows from their differences (von
    /// Neumann, Ann. Math. Stat. 12, 1941, p. 367): 1 - r is the sum of the squared differences
    /// divided by that of the squared deviations from the mean, each in units of its own variance.
    /// The variance of the mean is (1 + r)/(1 - r) times as large. The contribution of noise to
    /// r^2, 1/count, is subtracted. The error of the mean is limited to that of one estimate.
    pub fn of_mean(&self) -> Option<f32> {
        let birge_ratio = self.birge_ratio()?;
        let count = self.count as f32;
        let alike = 1.0 - self.successive / self.chi_square;
        if alike.is_nan() || alike <= 0.0 {
            return Some(birge_ratio);
        }
        let beyond_noise = sqrt((alike * alike - 1.0 / count).max(0.0));
        let turns = (1.0 + beyond_noise) / (1.0 - beyond_noise);
        Some(birge_ratio * sqrt(turns.min(count)))
    }
}
