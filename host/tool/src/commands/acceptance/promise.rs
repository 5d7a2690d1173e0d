//! What a design promises of the board that is built from it.

use std::path::Path;

use palpate_cli::failure::Failure;
use palpate_sim::parameters::{Parameters, central};
use palpate_sim::sensing_coil::tank::{SensingTank, TankState};
use palpate_sim::stack::{Disturbances, LoadError, Stack};

/// Resistance of bridge, shunts, fuse, wires and supply, ohm: at least the carrier's transistors and shunts
/// (`hardware/README.md`), at most those of a module with long wires and of the simulated supplies.
const AROUND_OHM: [f64; 2] = [0.02, 0.40];
/// Relative tolerance of the coil's resistance: 10 % of the copper's thickness (IPC-6012), and 20 K of warming.
const RESISTANCE: [f64; 2] = [0.90, 1.15];
/// Relative tolerance of the coil's inductance: 4 % of the self-test, and 8 % for the gap.
const INDUCTANCE: [f64; 2] = [0.88, 1.12];
/// Relative amount by which the self-test finds resistance and inductance too small, per dead time as a share of the
/// period: short pulses lose more than long ones (`hardware/README.md`). The carrier's bridge has 3.1 at most
/// (`sim-host/tests/integration/coil_drive.rs`).
const BIAS: f64 = 3.3;
/// Relative tolerance of the tank's frequency: 5 % of the capacitor and 5 % of the inductance, each by half.
const FREQUENCY: f64 = 0.05;
/// Range of the tank's quality factor relative to the design's: plates, boards and leads take up to half of it
/// (docs/field-ac.md), and drive currents are nominal.
const QUALITY: [f64; 2] = [0.5, 1.3];
/// Change of temperature in a drift measurement, K.
const WARMING_K: f64 = 2.0;

/// The promises of a design.
#[derive(Clone, Debug)]
pub(crate) struct Promise {
    pub(crate) stack: Stack,
    /// The sensor in the middle of the design's ranges.
    pub(crate) plant: Parameters,
    /// Frequency of the untouched sensor, Hz.
    frequency_hz: f64,
    quality: f64,
    /// Greatest relative change of the frequency by [`WARMING_K`].
    drift: f64,
}

impl Promise {
    /// Promises of a stack, by its name or file. `frequency_hz` replaces the frequency of the reference coil.
    pub(crate) fn of(name: &str, frequency_hz: Option<f64>) -> Result<Self, Failure> {
        let stack = Stack::named(name, Path::new(""))?;
        let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
        let plant = central(&stack, &disturbances);
        let tank = SensingTank::new(&plant.tank);
        let resonance = tank.resonance(&TankState::default());
        let (_, growth_m_per_k) = disturbances.thermal.growth_m_per_k.range();
        let (_, capacitance_per_k) = disturbances.tank.capacitance_tempco_per_k.range();
        let per_kelvin = 0.5 * capacitance_per_k
            + (resonance.per_apparent / resonance.frequency_hz).abs() * growth_m_per_k;
        let frequency_hz = frequency_hz.unwrap_or(resonance.frequency_hz);
        Ok(Self {
            frequency_hz,
            quality: tank.quality_factor(frequency_hz),
            drift: WARMING_K * per_kelvin,
            stack,
            plant,
        })
    }

    /// Resistance of coil and circuit, ohm, with this dead time as a share of the period.
    pub(crate) fn resistance_ohm(&self, lost: f64) -> ([f64; 2], String) {
        let (least, greatest) = self.stack.coil_resistance_ohm.range();
        let range = [
            (1.0 - BIAS * lost) * (RESISTANCE[0] * least + AROUND_OHM[0]),
            RESISTANCE[1] * greatest + AROUND_OHM[1],
        ];
        let [around, up_to] = AROUND_OHM;
        let because = format!(
            "coil of {least:.3} to {greatest:.3} ohm; bridge, wires and supply of {around:.2} to {up_to:.2} ohm{}",
            too_little(lost)
        );
        (range, because)
    }

    /// Inductance of the coil, H, with this dead time as a share of the period.
    pub(crate) fn inductance_h(&self, lost: f64) -> ([f64; 2], String) {
        let (least, greatest) = self.stack.coil_inductance_h.range();
        let range = [
            (1.0 - BIAS * lost) * INDUCTANCE[0] * least,
            INDUCTANCE[1] * greatest,
        ];
        let tolerance = 100.0 * (INDUCTANCE[1] - 1.0);
        (
            range,
            format!("the design's, within {tolerance:.0} %{}", too_little(lost)),
        )
    }

    /// Frequency of the untouched sensor, Hz.
    pub(crate) fn frequency_hz(&self) -> ([f64; 2], String) {
        let range = [1.0 - FREQUENCY, 1.0 + FREQUENCY].map(|part| part * self.frequency_hz);
        let capacitance_pf = 1e12 * self.plant.tank.capacitance_f;
        (
            range,
            format!(
                "tank of {capacitance_pf:.0} pF, within {:.0} %",
                100.0 * FREQUENCY
            ),
        )
    }

    /// Quality factor of the tank.
    pub(crate) fn quality(&self) -> ([f64; 2], String) {
        let range = QUALITY.map(|part| part * self.quality);
        (
            range,
            format!("{:.0} without plates, leads and boards", self.quality),
        )
    }

    /// Characteristic impedance, ohm: the tank's parallel resistance is the quality factor times this.
    pub(crate) fn impedance_ohm(&self) -> f64 {
        1.0 / (core::f64::consts::TAU * self.frequency_hz * self.plant.tank.capacitance_f)
    }

    /// Relative drift of the frequency.
    pub(crate) fn drift(&self) -> ([f64; 2], String) {
        (
            [-self.drift, self.drift],
            format!("{WARMING_K:.0} K of warming"),
        )
    }

    /// What a frequency far off means: a capacitor of another value.
    pub(crate) fn capacitor(&self, frequency_hz: f64) -> String {
        let fitted_f = self.plant.tank.capacitance_f;
        let found_pf = 1e12 * fitted_f * (self.frequency_hz / frequency_hz).powi(2);
        format!(
            "Check the tank's capacitor: with the design's coil, {found_pf:.0} pF make this frequency, and {:.0} pF are \
             meant. If it is right, check the coil's turns, its distance from the elastomer, and for metal near it",
            1e12 * fitted_f
        )
    }
}

/// Words for the amount by which the self-test's result is too small.
fn too_little(lost: f64) -> String {
    format!(
        "; the self-test finds up to {:.0} % too little through this bridge",
        100.0 * BIAS * lost
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_tank_is_promised_near_3_mhz() {
        let promise = Promise::of("ultrasoft", None).unwrap();
        let ([least, greatest], _) = promise.frequency_hz();
        assert!(least < 3.1e6 && greatest > 2.9e6, "{least} {greatest}");
        let ([_, drift], _) = promise.drift();
        // 2 K at 30 ppm/K of the capacitor alone change the frequency by 30 ppm.
        assert!((30e-6..1e-3).contains(&drift), "{drift}");
        // A capacitance that is twice as large lowers the frequency by the root of two.
        let action = promise.capacitor(promise.frequency_hz / 2.0_f64.sqrt());
        assert!(action.contains(" 660 pF"), "{action}");
    }
}
