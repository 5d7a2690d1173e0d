//! A press on an array of coils.

use crate::code::TouchVerdict;

structure! {
    /// Place, force and contact radius of a press, from one scan of all coils of an array. The header's
    /// time is that of the `sample` with the last of these conversions; with two converters, those of
    /// the other one are up to one scan older. Uncertainties
    /// include those of readings, calibration and indenter.
    pub struct Touch {
        /// What the readings say; the other fields are absent unless it claims them.
        verdict: TouchVerdict,
        /// Place.
        x_m: Option<f32> ["m", -1, 1],
        /// Place.
        y_m: Option<f32> ["m", -1, 1],
        /// Standard uncertainty of x.
        x_sigma_m: Option<f32> ["m", 0, 1],
        /// Standard uncertainty of y.
        y_sigma_m: Option<f32> ["m", 0, 1],
        /// Correlation of the errors of x and y.
        correlation: Option<f32> ["1", -1, 1],
        /// Force normal to the surface.
        force_n: Option<f32> ["N", 0, 1e4],
        /// Relative standard uncertainty of the force.
        force_uncertainty: Option<f32> ["1", 0, 1e3],
        /// Radius of the contact with Hertz's pressure: of a flat pin sqrt(5/3) of its radius.
        radius_m: Option<f32> ["m", 0, 1],
        /// Relative standard uncertainty of the radius.
        radius_uncertainty: Option<f32> ["1", 0, 1e3],
        /// Sum of the squared residuals over their variances.
        chi_square: Option<f32> ["1", 0, 1e9],
    }
}

impl Touch {
    /// A touch of which only the verdict is known.
    pub const fn without_claim(verdict: TouchVerdict) -> Self {
        Self {
            verdict,
            x_m: None,
            y_m: None,
            x_sigma_m: None,
            y_sigma_m: None,
            correlation: None,
            force_n: None,
            force_uncertainty: None,
            radius_m: None,
            radius_uncertainty: None,
            chi_square: None,
        }
    }
}
