//! Compliance of the actuated layer against the current.

use super::curve::chebyshev;

/// The calibrated actuated layer.
#[derive(Clone, Debug)]
pub struct Actuated {
    /// g0 = c_S/c_D0.
    pub ratio: f64,
    /// Coefficients of h(I) without the bend, in Chebyshev polynomials of I/I_peak that vanish at
    /// zero.
    pub regressor: Vec<f64>,
    /// Additional relative change of h's slope from the middle to the peak.
    pub bend: f64,
    /// Peak current of the train, A.
    pub peak_a: f64,
    /// Attraction of the layer's halves, N/A^2.
    pub attraction_n_per_a2: f64,
}

impl Actuated {
    /// h(I) = g(I) - g(0). The bend changes h neither at zero current nor at the peak.
    pub fn regressor(&self, current_a: f64) -> f64 {
        let straight = self.straight(current_a);
        let at_peak = self.straight(self.peak_a);
        straight * (1.0 + self.bend * (straight / at_peak - 1.0))
    }

    fn straight(&self, current_a: f64) -> f64 {
        let terms = chebyshev(current_a / self.peak_a).zip(&self.regressor);
        terms.map(|((term, _), c)| term * c).sum()
    }

    /// rho(I) = c_D/c_D0 - 1.
    pub fn rise(&self, current_a: f64) -> f64 {
        let regressor = self.regressor(current_a);
        -regressor / (self.ratio + regressor)
    }
}
