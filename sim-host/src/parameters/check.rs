//! Valid ranges of the parameters.

use core::fmt;

use super::Parameters;

/// A parameter out of its valid range.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterError {
    /// Name of the parameter.
    pub name: &'static str,
    /// Rejected value.
    pub value: f64,
    /// Least allowed value.
    pub min: f64,
    /// Greatest allowed value.
    pub max: f64,
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            value,
            min,
            max,
        } = self;
        write!(f, "{name} is {value:e}; allowed are {min:e} to {max:e}")
    }
}

impl core::error::Error for ParameterError {}

/// Refuses a value out of its range, and NaN.
pub(crate) fn within(
    name: &'static str,
    value: f64,
    min: f64,
    max: f64,
) -> Result<(), ParameterError> {
    if value >= min && value <= max {
        return Ok(());
    }
    Err(ParameterError {
        name,
        value,
        min,
        max,
    })
}

impl Parameters {
    /// Refuses parameters outside of the model's valid range. Every result of [`super::draw`]
    /// passes.
    ///
    /// # Errors
    /// [`ParameterError`] names the first parameter out of its range.
    pub fn check(&self) -> Result<(), ParameterError> {
        self.check_layers()?;
        self.check_field()?;
        self.check_heat()?;
        self.check_electronics()?;
        self.check_surroundings()
    }

    fn check_layers(&self) -> Result<(), ParameterError> {
        for layer in [&self.sensing, &self.actuated] {
            within("spring_n_per_m", layer.spring_n_per_m, 10.0, 1e8)?;
            within("spring_per_kelvin", layer.spring_per_kelvin, -0.05, 0.05)?;
            for mode in &layer.creep {
                within("creep amplitude", mode.amplitude, 0.0, 1.0)?;
                within("creep tau_s", mode.tau_s, 1e-3, 1e6)?;
            }
        }
        let friction = &self.friction;
        within("friction spring_n_per_m", friction.spring_n_per_m, 0.0, 1e6)?;
        within("friction stick_n", friction.stick_n, 0.0, 10.0)?;
        within("friction slip_n", friction.slip_n, 0.0, friction.stick_n)
    }

    fn check_field(&self) -> Result<(), ParameterError> {
        let law = &self.magnetorheological;
        within("stiffening_at_peak", law.stiffening_at_peak, 0.0, 20.0)?;
        within("field_at_peak_t", law.field_at_peak_t, 1e-4, 3.0)?;
        within("field_half_t", law.field_half_t, 1e-3, 10.0)?;
        let object = &self.object;
        within("object reflection", object.reflection, -1.0, 1.0)?;
        within("object lost_at_peak", object.lost_at_peak, 0.0, 0.5)?;
        within("object n_per_a2", object.n_per_a2, 0.0, 0.1)?;
        let contact = &self.contact;
        within("contact lost_per_m2", contact.lost_per_m2, -1e5, 1e5)?;
        within("contact radius_m", contact.radius_m, 1e-4, 20e-3)?;
        within("contact tilted_share", contact.tilted_share, 0.1, 1.0)?;
        within("memory", law.memory, 0.0, 0.9)?;
        within("lag_s", law.lag_s, 0.0, 1.0)?;
        within(
            "stiffening_per_kelvin",
            law.stiffening_per_kelvin,
            -0.05,
            0.05,
        )?;
        within("attraction n_per_a2", self.attraction.n_per_a2, 0.0, 0.1)?;
        within(
            "attraction gradient_per_m",
            self.attraction.gradient_per_m,
            0.0,
            1e4,
        )?;
        within("crosstalk at_peak_m", self.crosstalk.at_peak_m, 0.0, 1e-4)?;
        let slope = self.crosstalk.slope_per_press_depth;
        within("crosstalk slope_per_press_depth", slope, -0.9, 0.9)
    }

    fn check_heat(&self) -> Result<(), ParameterError> {
        let thermal = &self.thermal;
        within("ambient_change_k", thermal.ambient_change_k, -50.0, 50.0)?;
        within("growth_m_per_k", thermal.growth_m_per_k, 0.0, 1e-4)?;
        within("copper_j_per_k", thermal.copper_j_per_k, 1e-3, 1e5)?;
        within("pad_j_per_k", thermal.pad_j_per_k, 1e-3, 1e5)?;
        within(
            "copper_to_pad_k_per_w",
            thermal.copper_to_pad_k_per_w,
            1e-3,
            1e4,
        )?;
        within(
            "pad_to_ambient_k_per_w",
            thermal.pad_to_ambient_k_per_w,
            1e-3,
            1e4,
        )?;
        within("resistance_ohm", thermal.resistance_ohm, 1e-3, 1e3)?;
        within(
            "resistance_per_kelvin",
            thermal.resistance_per_kelvin,
            0.0,
            0.01,
        )?;
        within("heating", thermal.heating, 0.0, 1.0)
    }

    fn check_electronics(&self) -> Result<(), ParameterError> {
        within("capacitance_f", self.tank.capacitance_f, 1e-12, 1e-6)?;
        within(
            "capacitance_per_kelvin",
            self.tank.capacitance_per_kelvin,
            -1e-3,
            1e-3,
        )?;
        within("curvature_per_m", self.tank.curvature_per_m, 0.0, 1e6)?;
        let design = self.tank.coil.check();
        design.map_err(|error| ParameterError {
            name: error.quantity,
            value: error.value,
            min: error.min,
            max: error.max,
        })?;
        within(
            "reference_clock_error",
            self.ldc.reference_clock_error,
            -0.01,
            0.01,
        )?;
        within(
            "white_noise_relative",
            self.ldc.white_noise_relative,
            0.0,
            1e-3,
        )?;
        let current = &self.current;
        within("peak_a", current.peak_a, 0.01, 100.0)?;
        within("inductance_h", current.inductance_h, 1e-7, 1.0)?;
        within("supply_v", current.supply_v, 0.5, f64::INFINITY)?;
        within("supply_ohm", current.supply_ohm, 0.0, 10.0)?;
        within("gain_error", current.gain_error, -0.5, 0.5)?;
        within("nonlinearity_lsb", current.nonlinearity_lsb, 0.0, 200.0)?;
        within(
            "nonlinearity_phase",
            current.nonlinearity_phase,
            -10.0,
            10.0,
        )?;
        within("noise_lsb", current.noise_lsb, 0.0, 200.0)?;
        within("ripple", current.ripple, 0.0, 1.0)?;
        let interference = &self.interference;
        within(
            "interference volt_per_volt",
            interference.volt_per_volt,
            0.0,
            1.0,
        )?;
        within("interference edge_s", interference.edge_s, 0.0, 1e-5)
    }

    fn check_surroundings(&self) -> Result<(), ParameterError> {
        within("depth_m", self.press.depth_m, 1e-6, 0.8e-3)?;
        for shake in [&self.press.vibration, &self.press.tremor] {
            within("shake amplitude_m", shake.amplitude_m, 0.0, 1e-3)?;
            within("shake hertz", shake.hertz, 0.1, 200.0)?;
            within("shake phase", shake.phase, -10.0, 10.0)?;
        }
        within("jumps size_m", self.press.jumps.size_m, 0.0, 1e-3)?;
        if self.press.jumps.size_m > 0.0 {
            within("jumps interval_s", self.press.jumps.interval_s, 0.01, 1e3)?;
        }
        for frame_m_per_n in [self.press.frame_m_per_n, self.rig.frame_m_per_n] {
            within("frame_m_per_n", frame_m_per_n, 0.0, 1e-3)?;
        }
        within("load_cell_noise_n", self.rig.load_cell_noise_n, 0.0, 1.0)?;
        within(
            "load_cell_gain_error",
            self.rig.load_cell_gain_error,
            -0.1,
            0.1,
        )?;
        within("stage_error_m", self.rig.stage_error_m, 0.0, 1e-3)?;
        within("stage_phase", self.rig.stage_phase, -10.0, 10.0)?;
        within("spring_tolerance", self.rig.spring_tolerance, 0.0, 0.5)?;
        within("rig tilt_rad", self.rig.tilt_rad, 0.0, 0.1)
    }
}
