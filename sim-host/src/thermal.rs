//! Heat: the actuating copper and the pad around it, each at one temperature.
//!
//! C_c dT_c/dt = I² R(T_c) − (T_c − T_p)/R_cp,  C_p dT_p/dt = (T_c − T_p)/R_cp − (T_p − T_a)/R_pa
//!
//! Indices: c copper, p pad, a ambient. The values are those of the disturbances' `[thermal]`. The
//! pad is the body of the sensor: both layers and the tank are assumed to be at its temperature,
//! the pessimistic choice for the sensing side. The sources do not give it.

/// Temperature of calibration, °C (guess: a room; only differences from it matter).
pub const CALIBRATION_C: f64 = 25.0;

/// Temperature coefficient of copper's resistance, 1/K (published; SOURCES.md section 3).
pub const COPPER_PER_KELVIN: f64 = 3.9e-3;

/// Parameters of the two nodes and of their surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalParameters {
    /// Ambient temperature less [`CALIBRATION_C`], K, ±50.
    pub ambient_change_k: f64,
    /// Growth of the sensor in the direction of the press, m/K, 0 to 10⁻⁴.
    pub growth_m_per_k: f64,
    /// Heat capacity of the copper, J/K, 10⁻³ to 10⁵.
    pub copper_j_per_k: f64,
    /// Heat capacity of the pad, J/K, 10⁻³ to 10⁵.
    pub pad_j_per_k: f64,
    /// Thermal resistance from copper to pad, K/W, 10⁻³ to 10⁴.
    pub copper_to_pad_k_per_w: f64,
    /// Thermal resistance from pad to ambient, K/W, 10⁻³ to 10⁴.
    pub pad_to_ambient_k_per_w: f64,
    /// Resistance of the coils at [`CALIBRATION_C`], ohm, 10⁻³ to 10³.
    pub resistance_ohm: f64,
    /// Relative change of the coils' resistance with temperature, 1/K: [`COPPER_PER_KELVIN`] or
    /// none.
    pub resistance_per_kelvin: f64,
    /// Share of the electrical power that becomes heat here: 1, or 0 with heating disabled.
    pub heating: f64,
}

/// Temperatures and the heat transferred so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ThermalState {
    /// Copper above [`CALIBRATION_C`], K.
    pub copper_k: f64,
    /// Pad above [`CALIBRATION_C`], K.
    pub pad_k: f64,
    /// Heat put into the copper so far, J.
    pub heat_in_j: f64,
    /// Heat given to the surroundings so far, J.
    pub heat_out_j: f64,
}

impl ThermalParameters {
    /// State with everything at ambient temperature.
    #[must_use]
    pub fn at_rest(&self) -> ThermalState {
        ThermalState {
            copper_k: self.ambient_change_k,
            pad_k: self.ambient_change_k,
            ..ThermalState::default()
        }
    }

    /// Resistance of the coils, ohm.
    #[must_use]
    pub fn coil_resistance_ohm(&self, state: &ThermalState) -> f64 {
        self.resistance_ohm * (1.0 + self.resistance_per_kelvin * state.copper_k)
    }

    /// The state after a time with a mean square current, A².
    ///
    /// Implicit midpoint rule, its linear equations solved exactly: heat is conserved to rounding,
    /// and any step is stable. Its rates have a relative error of (step / 0.4 s)²/12, 5·10⁻⁷ at 1 ms.
    #[must_use]
    pub fn advance(&self, from: &ThermalState, square_a2: f64, duration_s: f64) -> ThermalState {
        let power = self.heating * square_a2 * self.resistance_ohm;
        let slope = power * self.resistance_per_kelvin;
        let (inner, outer) = (
            1.0 / self.copper_to_pad_k_per_w,
            1.0 / self.pad_to_ambient_k_per_w,
        );
        // Heat flows at the start, W, and their change with the temperature rises.
        let heating = power + slope * from.copper_k;
        let across = inner * (from.copper_k - from.pad_k);
        let loss = outer * (from.pad_k - self.ambient_change_k);

        let half = 0.5 * duration_s;
        let copper = self.copper_j_per_k + half * (inner - slope);
        let pad = self.pad_j_per_k + half * (inner + outer);
        let coupling = half * inner;
        let (into_copper, into_pad) = (
            duration_s * (heating - across),
            duration_s * (across - loss),
        );
        let determinant = copper * pad - coupling * coupling;
        let copper_rise = (into_copper * pad + coupling * into_pad) / determinant;
        let pad_rise = (into_pad * copper + coupling * into_copper) / determinant;
        ThermalState {
            copper_k: from.copper_k + copper_rise,
            pad_k: from.pad_k + pad_rise,
            heat_in_j: from.heat_in_j + duration_s * heating + half * slope * copper_rise,
            heat_out_j: from.heat_out_j + duration_s * loss + half * outer * pad_rise,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REFERENCE: ThermalParameters = ThermalParameters {
        ambient_change_k: 4.0,
        growth_m_per_k: 1e-6,
        copper_j_per_k: 0.8,
        pad_j_per_k: 60.0,
        copper_to_pad_k_per_w: 0.5,
        pad_to_ambient_k_per_w: 8.0,
        resistance_ohm: 0.389,
        resistance_per_kelvin: COPPER_PER_KELVIN,
        heating: 1.0,
    };

    fn run(
        parameters: &ThermalParameters,
        current_a: f64,
        step_s: f64,
        steps: u32,
    ) -> ThermalState {
        (0..steps).fold(parameters.at_rest(), |state, _| {
            parameters.advance(&state, current_a * current_a, step_s)
        })
    }

    #[test]
    fn heat_is_conserved() {
        let state = run(&REFERENCE, 10.0, 1e-3, 20_000);
        let stored = 0.8 * (state.copper_k - 4.0) + 60.0 * (state.pad_k - 4.0);
        let balance = state.heat_in_j - state.heat_out_j - stored;
        assert!(balance.abs() < 1e-10 * state.heat_in_j, "{balance}");
    }

    #[test]
    fn the_first_moment_is_adiabatic() {
        let state = run(&REFERENCE, 10.0, 1e-4, 10);
        let rate = (state.copper_k - 4.0) / 1e-3;
        let expected = 38.9 * (1.0 + COPPER_PER_KELVIN * 4.0) / 0.8;
        assert!((rate / expected - 1.0).abs() < 3e-3, "{rate} K/s");
        let pad = run(&REFERENCE, 10.0, 1e-2, 1000);
        let rate = (pad.pad_k - run(&REFERENCE, 10.0, 1e-2, 900).pad_k) / 1.0;
        assert!((0.4..1.0).contains(&rate), "{rate} K/s");
    }

    #[test]
    fn the_end_is_ohms_law_of_heat() {
        let cold = ThermalParameters {
            resistance_per_kelvin: 0.0,
            ..REFERENCE
        };
        let state = run(&cold, 1.0, 10.0, 2_000);
        assert!((state.pad_k - 4.0 - 0.389 * 8.0).abs() < 1e-9);
        assert!((state.copper_k - state.pad_k - 0.389 * 0.5).abs() < 1e-9);
    }

    #[test]
    fn it_converges_with_the_square_of_the_step() {
        let exact = run(&REFERENCE, 10.0, 1e-5, 100_000).copper_k;
        let coarse = run(&REFERENCE, 10.0, 4e-3, 250).copper_k - exact;
        let fine = run(&REFERENCE, 10.0, 2e-3, 500).copper_k - exact;
        assert!((coarse / fine - 4.0).abs() < 0.1, "{coarse} {fine}");
    }

    #[test]
    fn without_heating_the_temperature_stays() {
        let none = ThermalParameters {
            heating: 0.0,
            ..REFERENCE
        };
        assert_eq!(run(&none, 10.0, 1e-3, 1000), none.at_rest());
    }
}
