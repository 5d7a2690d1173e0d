//! Calibration: values measured on this copy of the instrument.

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
    /// What the coil's current does to the reading of a channel without any deformation, taken as
    /// proportional to its square.
    pub struct Crosstalk {
        /// Converter: 0 first, 1 second.
        sensor: u8 ["", 0, 1],
        /// Channel.
        channel: u8 ["", 0, 3],
        /// Apparent deformation of the untouched sensor, per square of the current.
        apparent_m_per_a2: f32 ["m/A^2", -1e-5, 1e-5],
        /// Relative growth of that with the deformation.
        growth_per_m: f32 ["1/m", -1e5, 1e5],
        /// Relative standard uncertainty of the apparent deformation.
        uncertainty: f32 ["1", 0, 1],
    }
}

structure! {
    /// The two springs of the sensor. Uncertainties are standard uncertainties, relative where
    /// nothing else is said.
    pub struct Springs {
        /// c_S, the sensing layer.
        sensing_n_per_m: f32 ["N/m", 1, 1e8],
        /// Of c_S, the force scale apart.
        sensing_uncertainty: f32 ["1", 0, 1],
        /// c_D0, the actuated layer without current.
        actuated_n_per_m: f32 ["N/m", 1, 1e8],
        /// Of c_D0, the force scale apart.
        actuated_uncertainty: f32 ["1", 0, 1],
        /// Of the force scale that both have in common.
        force_scale_uncertainty: f32 ["1", 0, 1],
        /// Of the zero of the deformation.
        zero_uncertainty_m: f32 ["m", 0, 1e-3],
        /// By how much the lines of the calibration's own trains bend, root of the mean square.
        bend: f32 ["1", 0, 10],
    }
}

structure! {
    /// The magnetorheological effect as a law: c_D = c_D0 (1 + eps s(I)/s(I_peak)),
    /// s = B^2/(B^2 + B_half^2), B proportional to I.
    pub struct Stiffening {
        /// I_peak, the current at which eps was measured.
        peak_current_a: f32 ["A", 0.05, 20],
        /// eps, relative rise of the actuated spring at that current.
        rise_at_peak: f32 ["1", 1e-5, 100],
        /// Relative standard uncertainty of eps.
        rise_uncertainty: f32 ["1", 0, 1],
        /// Field at that current; 0 for the purely quadratic law.
        field_at_peak_t: f32 ["T", 0, 2],
        /// B_half, the field of half the greatest rise.
        field_half_t: f32 ["T", 0.001, 10],
    }
}

structure! {
    /// The coil of the actuated layer and its heat.
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
        /// Relative standard uncertainty of the current since the magnetorheological effect was
        /// calibrated.
        current_uncertainty: f32 ["1", 0, 1],
    }
}

structure! {
    /// Attraction of the actuated layer's halves by the coil's field, taken as proportional to the
    /// square of the current. It shortens the layer whatever presses on it.
    pub struct Attraction {
        /// Attraction per square of the current.
        attraction_n_per_a2: f32 ["N/A^2", -0.1, 0.1],
        /// Its relative standard uncertainty.
        uncertainty: f32 ["1", 0, 1],
    }
}

structure! {
    /// Uncertainty added by a temperature other than the calibration's: beyond what the coefficients of
    /// [`TemperatureCoefficients`] say, where they are set. Where they are not, springs and rise change by what a
    /// material may, and are taken as uniform within limits: the square root of three times these.
    pub struct TemperatureEffect {
        /// Temperature at the calibration.
        calibrated_at_c: f32 ["degC", -60, 250],
        /// Standard uncertainty of both springs, alike, for every kelvin of difference, relative.
        springs_uncertainty_per_k: f32 ["1/K", 0, 1],
        /// Standard uncertainty of the magnetorheological rise for every kelvin of difference,
        /// relative.
        rise_uncertainty_per_k: f32 ["1/K", 0, 1],
    }
}

structure! {
    /// How springs and magnetorheological rise change with the temperature, from
    /// [`TemperatureEffect::calibrated_at_c`] on: measurements are corrected by it. A quantity that has the
    /// coefficient b is exp(b dT) times as large dT kelvin above. Without this part it is as at the calibration.
    pub struct TemperatureCoefficients {
        /// Of both springs, alike.
        springs_per_k: f32 ["1/K", -0.05, 0.05],
        /// Of the magnetorheological rise.
        rise_per_k: f32 ["1/K", -0.05, 0.05],
    }
}

structure! {
    /// Which calibration the parts in force are.
    pub struct CalibrationIdentity {
        /// A number that the calibrating program gave it.
        id: u32,
        /// When it was made, in seconds since 1970-01-01 UTC, up to 2106; 0 if unknown.
        calibrated_at_s: u32 ["s"],
        /// Temperature of the sensor then.
        calibrated_at_c: f32 ["degC", -60, 250],
        /// `configuration_crc` over the commands that set its parts, without settings and identity. The
        /// device compares it with its own and refuses another one: a part that was lost or changed on
        /// the way is found.
        hash: u32,
    }
}
