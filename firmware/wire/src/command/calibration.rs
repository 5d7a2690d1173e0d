//! Calibration: values measured on this copy of the instrument.

use crate::code::TipShape;

structure! {
    /// The resonator of a channel.
    pub struct Tank {
        /// Converter: 0 first, 1 second.
        sensor: u8 ["", 0, 1],
        /// Channel.
        channel: u8 ["", 0, 3],
        /// Capacitance in parallel with the coil, wiring and converter included.
        capacitance_f: f32 ["F", 1e-12, 1e-6],
        /// Resonance frequency of the untouched sensor.
        rest_frequency_hz: f64 ["Hz", 1e3, 1e7],
    }
}

structure! {
    /// Effect of the coil's current on the reading of a channel without deformation, taken as
    /// proportional to its square.
    pub struct Crosstalk {
        /// Converter: 0 first, 1 second.
        sensor: u8 ["", 0, 1],
        /// Channel.
        channel: u8 ["", 0, 3],
        /// Apparent deformation of the untouched sensor per square of the current.
        apparent_m_per_a2: f32 ["m/A^2", -1e-5, 1e-5],
        /// Relative growth of the apparent deformation with the deformation.
        growth_per_m: f32 ["1/m", -1e5, 1e5],
        /// Relative standard uncertainty of the apparent deformation.
        uncertainty: f32 ["1", 0, 1],
    }
}

structure! {
    /// The two springs of the sensor. Uncertainties are standard uncertainties, relative unless stated
    /// otherwise.
    pub struct Springs {
        /// c_S, stiffness of the sensing layer.
        sensing_n_per_m: f32 ["N/m", 1, 1e8],
        /// Uncertainty of c_S, without the force scale.
        sensing_uncertainty: f32 ["1", 0, 1],
        /// c_D0, stiffness of the actuated layer without current.
        actuated_n_per_m: f32 ["N/m", 1, 1e8],
        /// Uncertainty of c_D0, without the force scale.
        actuated_uncertainty: f32 ["1", 0, 1],
        /// Uncertainty of the force scale, common to both springs.
        force_scale_uncertainty: f32 ["1", 0, 1],
        /// Uncertainty of the deformation's zero.
        zero_uncertainty_m: f32 ["m", 0, 1e-3],
        /// RMS bend of the lines of the calibration's own trains.
        bend: f32 ["1", 0, 10],
    }
}

structure! {
    /// The magnetorheological effect as a law: c_D = c_D0 (1 + eps s(I)/s(I_peak)),
    /// s = B^2/(B^2 + B_half^2), B proportional to I.
    pub struct Stiffening {
        /// I_peak, the current at which eps was measured.
        peak_current_a: f32 ["A", 0.05, 20],
        /// eps, relative rise of the actuated spring at I_peak.
        rise_at_peak: f32 ["1", 1e-5, 100],
        /// Relative standard uncertainty of eps.
        rise_uncertainty: f32 ["1", 0, 1],
        /// Field at I_peak; 0 for the purely quadratic law.
        field_at_peak_t: f32 ["T", 0, 2],
        /// B_half, field at half of the saturated rise.
        field_half_t: f32 ["T", 0.001, 10],
    }
}

structure! {
    /// The coil of the actuated layer and its thermal data.
    pub struct Coil {
        /// Resistance at 20 degrees Celsius.
        resistance_ohm: f32 ["ohm", 0.001, 1000],
        /// Heat capacity of the copper.
        copper_capacity_j_per_k: f32 ["J/K", 0.001, 10000],
        /// Heat capacity of the layer around it.
        pad_capacity_j_per_k: f32 ["J/K", 0.001, 100000],
        /// Thermal resistance from copper to layer.
        copper_to_pad_k_per_w: f32 ["K/W", 0.001, 1000],
        /// Thermal resistance from layer to surroundings.
        pad_to_ambient_k_per_w: f32 ["K/W", 0.001, 1000],
        /// Relative standard uncertainty of the current since the calibration of the magnetorheological
        /// effect.
        current_uncertainty: f32 ["1", 0, 1],
    }
}

structure! {
    /// Attraction between the halves of the actuated layer by the coil's field, taken as proportional to
    /// the square of the current. It shortens the layer under any load.
    pub struct Attraction {
        /// Attraction per square of the current.
        attraction_n_per_a2: f32 ["N/A^2", -0.1, 0.1],
        /// Relative standard uncertainty of the attraction.
        uncertainty: f32 ["1", 0, 1],
    }
}

structure! {
    /// Uncertainty added by a temperature other than the calibration's, beyond the correction by
    /// [`TemperatureCoefficients`] if these are set. Without them, springs and rise change by the limits
    /// of the material, taken as uniform: the square root of three times these values.
    pub struct TemperatureEffect {
        /// Temperature of the calibration.
        calibrated_at_c: f32 ["degC", -60, 250],
        /// Relative standard uncertainty of both springs, in common, per kelvin of difference.
        springs_uncertainty_per_k: f32 ["1/K", 0, 1],
        /// Relative standard uncertainty of the magnetorheological rise per kelvin of difference.
        rise_uncertainty_per_k: f32 ["1/K", 0, 1],
    }
}

structure! {
    /// Change of springs and magnetorheological rise with temperature, relative to
    /// [`TemperatureEffect::calibrated_at_c`]; measurements are corrected by it. A quantity with the
    /// coefficient b is exp(b dT) times as large at dT kelvin above. Without this part it is as at the
    /// calibration.
    pub struct TemperatureCoefficients {
        /// Coefficient of both springs, in common.
        springs_per_k: f32 ["1/K", -0.05, 0.05],
        /// Coefficient of the magnetorheological rise.
        rise_per_k: f32 ["1/K", -0.05, 0.05],
    }
}

structure! {
    /// Tip on the sensor and the object that it presses on, as declared. A host computes a modulus from
    /// them; the device stores and reports them, and computes nothing with them. They are no part of the
    /// calibration's identity.
    pub struct Tip {
        /// Shape of the tip.
        shape: TipShape,
        /// Radius of the pin's face or of the ball.
        radius_m: f32 ["m", 1e-5, 0.1],
        /// Relative standard uncertainty of the radius.
        radius_uncertainty: f32 ["1", 0, 1],
        /// Thickness of the object, whose back is bonded to a rigid base; 0 for a thick object.
        thickness_m: f32 ["m", 0, 1],
        /// Relative standard uncertainty of the thickness.
        thickness_uncertainty: f32 ["1", 0, 1],
        /// Poisson's ratio that is assumed of the object.
        poisson_ratio: f32 ["1", 0, 0.5],
        /// Standard uncertainty of Poisson's ratio.
        poisson_uncertainty: f32 ["1", 0, 0.5],
        /// Compliance of what the object stands on, in series with it; 0 for a rigid stand.
        support_m_per_n: f32 ["m/N", 0, 1],
        /// Relative standard uncertainty of the stand's compliance.
        support_uncertainty: f32 ["1", 0, 1],
    }
}

structure! {
    /// Contacts for which intervals hold: place and tilt within a tolerance. Without this part, and with
    /// zeros, the contact is that of the calibration exactly.
    pub struct ContactTolerance {
        /// Greatest distance of the contact from the calibrated place.
        within_m: f32 ["m", 0, 0.1],
        /// Greatest angle between the object's face and the sensor's.
        tilt_rad: f32 ["rad", 0, 0.5],
        /// Relative standard uncertainty of the rise that the place adds.
        rise_uncertainty: f32 ["1", 0, 1],
        /// Standard uncertainty of the deformation's zero that the tilt adds.
        zero_uncertainty_m: f32 ["m", 0, 0.001],
    }
}

structure! {
    /// Creep of the sensor's layers: growth of a layer's deformation at the same force, relative to the
    /// deformation, while its age grows by a factor of e. Without this part both layers are assumed to
    /// creep by 0.018, with a standard uncertainty of 0.0104.
    pub struct Creep {
        /// Creep of the sensing layer.
        sensing: f32 ["1", -0.1, 0.2],
        /// Creep of the actuated layer, with what the coil's heat adds to it.
        actuated: f32 ["1", -0.1, 0.2],
        /// Standard uncertainty of either.
        uncertainty: f32 ["1", 0, 0.2],
    }
}

impl Creep {
    /// Creep of a sensor on which it was not measured: three modes of 6 % each, averaged over the times
    /// from 0.05 to 1000 s (sim-host/stacks/disturbances.toml), and from zero to twice as much.
    pub const TYPICAL: Self = Self {
        sensing: 0.018,
        actuated: 0.018,
        uncertainty: 0.0104,
    };
}

structure! {
    /// Identity of the active calibration.
    pub struct CalibrationIdentity {
        /// Number from the calibrating program.
        id: u32,
        /// Time of the calibration, in seconds since 1970-01-01 UTC, up to 2106; 0 if unknown.
        calibrated_at_s: u32 ["s"],
        /// Temperature of the sensor at the calibration.
        calibrated_at_c: f32 ["degC", -60, 250],
        /// `configuration_crc` over the commands that set the calibration's parts, without settings and
        /// identity. The device compares it with its own value and refuses a different one: this detects
        /// a part that was lost or changed in transit.
        hash: u32,
    }
}
