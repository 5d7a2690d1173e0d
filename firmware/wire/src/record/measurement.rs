//! Results of a stiffness measurement.

use crate::code::RefusalReason;

structure! {
    /// Stiffness c_L of the load with its uncertainty. The ends of the interval and the standard errors
    /// contain the uncertainty of the calibration as well as the noise.
    pub struct Estimate {
        /// Number of the measurement since the start, from 1.
        measurement: u32,
        /// c_L; absent if the load cannot be distinguished from a rigid one.
        stiffness_n_per_m: Option<f32> ["N/m", 0, 1e12],
        /// Standard error of c_L, to first order; absent if c_L is.
        standard_error_n_per_m: Option<f32> ["N/m", 0, 1e12],
        /// Lower end of the 95 % interval of c_L.
        lower_n_per_m: f32 ["N/m", 0, 1e12],
        /// Upper end of the 95 % interval of c_L; absent if it is infinite.
        upper_n_per_m: Option<f32> ["N/m", 0, 1e12],
        /// c_S/c_L, whose error is closer to normal than that of c_L. Noise can make it slightly
        /// negative for a rigid load.
        load_ratio: f32 ["1", -1e6, 1e6],
        /// Standard error of c_S/c_L.
        load_ratio_standard_error: f32 ["1", 0, 1e6],
        /// Number of samples used.
        samples: u32 ["1"],
        /// Number of falling ramps used.
        ramps: u16 ["1"],
        /// Chi-square of the fit over its degrees of freedom; absent if there are none.
        reduced_chi_square: Option<f32> ["1", 0, 1e12],
        /// Tangent stiffness of a non-linear load at the reference state; absent if not evaluated.
        tangent_n_per_m: Option<f32> ["N/m", -1e12, 1e12],
        /// Standard error of the tangent stiffness.
        tangent_standard_error_n_per_m: Option<f32> ["N/m", 0, 1e12],
        /// Result of the plain formula for two states, eq. (2), from the ends of the ramps, for
        /// comparison only. Absent if it is not finite.
        two_state_n_per_m: Option<f32> ["N/m", -1e30, 1e30],
        /// Contact force at the reference state.
        force_n: f32 ["N", 0, 1e4],
        /// Deformation of sensing layer, actuated layer and load together, x_0.
        total_displacement_m: f32 ["m", 0, 1],
        /// Temperature for which springs, rise and uncertainties are valid: that of the coil's
        /// thermometer at the start of the train. Absent without a thermometer: nothing is corrected,
        /// and the interval holds from 0 to 60 degrees Celsius.
        temperature_c: Option<f32> ["degC", -60, 250],
        /// Time from the rise of the current to the end of the last ramp.
        duration_s: f32 ["s", 0, 3600],
        /// Number of `load_point` records that follow.
        load_points: u8 ["1", 0, 64],
    }
}

structure! {
    /// A point of the curve of force against the load's displacement, from the ramps of one measurement.
    /// Only the distance between points is measured: the displacement of the load before the ramps is
    /// computed as if it were linear from its first contact.
    pub struct LoadPoint {
        /// Number of the measurement.
        measurement: u32,
        /// Index of the point, from 0.
        index: u8 ["", 0, 63],
        /// Number of points of this measurement.
        points: u8 ["1", 1, 64],
        /// Displacement of the load, x_L.
        displacement_m: f32 ["m", -1, 1],
        /// Standard uncertainty of the distance from the middle of the ramps, including the
        /// calibration's part.
        displacement_sigma_m: f32 ["m", 0, 1],
        /// Force.
        force_n: f32 ["N", -1e4, 1e4],
        /// Standard uncertainty of the force from noise.
        force_sigma_n: f32 ["N", 0, 1e4],
    }
}

structure! {
    /// Contributions to a measurement's interval: standard errors of c_S/c_L by cause, with their
    /// widening. The root of the sum of their squares is the `load_ratio_standard_error` of the
    /// following estimate, except for rounding.
    pub struct UncertaintyBudget {
        /// Number of the measurement since the start, from 1.
        measurement: u32,
        /// Noise of the conversions, and the scatter of the ramps: vibration, an unsteady hold.
        noise: f32 ["1", 0, 1e6],
        /// Calibrated springs, including the force scale.
        springs: f32 ["1", 0, 1e6],
        /// Calibrated stiffening, with attraction, cross-talk and the measured current.
        stiffening: f32 ["1", 0, 1e6],
        /// Zero of the deformation: reading of the untouched sensor.
        zero: f32 ["1", 0, 1e6],
        /// Difference to the temperature of the calibration.
        temperature: f32 ["1", 0, 1e6],
        /// Bend of the ramps' line, as from a load that stiffens.
        bend: f32 ["1", 0, 1e6],
        /// Temperature of the measurement minus that of the calibration; absent without a thermometer or
        /// without a `temperature_effect`.
        off_calibration_k: Option<f32> ["K", -500, 500],
    }
}

structure! {
    /// How much further the pressed object, with what it stands on, gives way at the same force. A
    /// press that moves, as in a hand, looks the same.
    ///
    /// The sensor's own creep, by the part `creep`, is subtracted; its uncertainty is most of the standard
    /// error where the object hardly relaxes.
    pub struct Relaxation {
        /// Number of the measurement since the start, from 1.
        measurement: u32,
        /// Time for which the press was held, from the steady press before the train.
        held_s: f32 ["s", 0, 1e4],
        /// Growth of the compression at the same force in this time, in units of the force over the
        /// stiffness of the estimate. For an object whose force is proportional to its compression it
        /// is the relative growth of the compression.
        relaxation: f32 ["1", -1e3, 1e3],
        /// Standard error of the relaxation.
        standard_error: f32 ["1", 0, 1e3],
    }
}

structure! {
    /// Reason of a missing estimate.
    pub struct Refusal {
        /// Number of the measurement since the start, from 1; 0 if it did not start.
        measurement: u32,
        /// Reason of the refusal.
        reason: RefusalReason,
        /// Measured value; the reason gives its meaning and unit.
        value: Option<f32> ["", -1e30, 1e30],
        /// Allowed or required value; the reason gives its meaning and unit.
        limit: Option<f32> ["", -1e30, 1e30],
        /// Time to wait before a measurement is possible; absent if waiting does not help.
        wait_s: Option<f32> ["s", 0, 1e6],
    }
}
