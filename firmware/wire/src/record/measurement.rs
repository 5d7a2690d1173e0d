//! Results of a stiffness measurement.

use crate::code::RefusalReason;

structure! {
    /// The load's stiffness c_L with its uncertainty. The ends of the interval and the standard
    /// errors contain the calibration's uncertainty as well as the noise.
    pub struct Estimate {
        /// Number of the measurement since the start, from 1.
        measurement: u32,
        /// c_L; absent if the load cannot be distinguished from a rigid one.
        stiffness_n_per_m: Option<f32> ["N/m", 0, 1e12],
        /// Standard error of c_L, to first order; absent if c_L is.
        standard_error_n_per_m: Option<f32> ["N/m", 0, 1e12],
        /// Lower end of the 95 % interval of c_L.
        lower_n_per_m: f32 ["N/m", 0, 1e12],
        /// Upper end of the 95 % interval of c_L; absent if there is none, that is at infinity.
        upper_n_per_m: Option<f32> ["N/m", 0, 1e12],
        /// c_S/c_L, whose error is more nearly normal than that of c_L. A little below zero by
        /// noise for a rigid load.
        load_ratio: f32 ["1", -1e6, 1e6],
        /// Standard error of c_S/c_L.
        load_ratio_standard_error: f32 ["1", 0, 1e6],
        /// Samples used.
        samples: u32 ["1"],
        /// Falling ramps used.
        ramps: u16 ["1"],
        /// Chi-square of the fit over its degrees of freedom; absent if there are none.
        reduced_chi_square: Option<f32> ["1", 0, 1e12],
        /// Tangent stiffness of a non-linear load at the reference state; absent if not evaluated.
        tangent_n_per_m: Option<f32> ["N/m", -1e12, 1e12],
        /// Standard error of the tangent stiffness.
        tangent_standard_error_n_per_m: Option<f32> ["N/m", 0, 1e12],
        /// What the plain formula for two states, eq. (2), gives from the ends of the ramps: no
        /// estimate, only to compare with. Absent if it gives no finite number.
        two_state_n_per_m: Option<f32> ["N/m", -1e30, 1e30],
        /// Contact force at the reference state.
        force_n: f32 ["N", 0, 1e4],
        /// Deformation of sensing layer, actuated layer and load together, x_0.
        total_displacement_m: f32 ["m", 0, 1],
        /// Temperature for which springs, rise and uncertainties are: that of the coil's thermometer as the
        /// train began. Absent without one: nothing is corrected, and the interval holds from 0 to 60 degrees
        /// Celsius.
        temperature_c: Option<f32> ["degC", -60, 250],
        /// From the rise of the current to the end of the last ramp.
        duration_s: f32 ["s", 0, 3600],
        /// Number of `load_point` records that follow.
        load_points: u8 ["1", 0, 64],
    }
}

structure! {
    /// A point of the curve of force against the load's displacement, from the ramps of one
    /// measurement. Only the way from one point to another is measured: how far the load had given
    /// way before the ramps is computed as if it were linear from its first touch on.
    pub struct LoadPoint {
        /// Number of the measurement.
        measurement: u32,
        /// Index of the point, from 0.
        index: u8 ["", 0, 63],
        /// Number of points of this measurement.
        points: u8 ["1", 1, 64],
        /// Displacement of the load, x_L.
        displacement_m: f32 ["m", -1, 1],
        /// Standard uncertainty of the way from the middle of the ramps, the calibration's part
        /// included.
        displacement_sigma_m: f32 ["m", 0, 1],
        /// Force.
        force_n: f32 ["N", -1e4, 1e4],
        /// Standard uncertainty of the force by noise.
        force_sigma_n: f32 ["N", 0, 1e4],
    }
}

structure! {
    /// What a measurement's interval is made of: standard errors of c_S/c_L by their causes, each with all that
    /// widens it. Their root of the sum of squares is the `load_ratio_standard_error` of the estimate that follows, but for
    /// rounding.
    pub struct UncertaintyBudget {
        /// Number of the measurement since the start, from 1.
        measurement: u32,
        /// Noise of the conversions, and what the ramps disagree by: vibration, an unsteady hold.
        noise: f32 ["1", 0, 1e6],
        /// The calibrated springs, force scale included.
        springs: f32 ["1", 0, 1e6],
        /// The calibrated stiffening, with attraction, cross-talk and the measured current.
        stiffening: f32 ["1", 0, 1e6],
        /// The zero of the deformation: what the untouched sensor reads.
        zero: f32 ["1", 0, 1e6],
        /// Another temperature than the calibration's.
        temperature: f32 ["1", 0, 1e6],
        /// What bends the line of the ramps, as a load that stiffens.
        bend: f32 ["1", 0, 1e6],
        /// Temperature of the measurement less that of the calibration; absent without a thermometer, or without
        /// a `temperature_effect`.
        off_calibration_k: Option<f32> ["K", -500, 500],
    }
}

structure! {
    /// Why there is no estimate.
    pub struct Refusal {
        /// Number of the measurement since the start, from 1; 0 if it did not begin.
        measurement: u32,
        /// Why.
        reason: RefusalReason,
        /// What was found; the reason says what it is and its unit.
        value: Option<f32> ["", -1e30, 1e30],
        /// What is allowed or needed; the reason says what it is and its unit.
        limit: Option<f32> ["", -1e30, 1e30],
        /// How long to wait before it can be measured; absent where waiting does not help.
        wait_s: Option<f32> ["s", 0, 1e6],
    }
}
