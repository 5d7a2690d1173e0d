//! What hangs at the bridge and at the ADC's inputs: the circuit of the coil, driven by the edges
//! of the PWM, sampled at the moments of the conversions.

use palpate_sim::electrical::{
    Circuit, CircuitParameters, Converter, ConverterParameters, Filter, Passed, Pins, Totals,
    thermistor_v,
};

use crate::bridge::BridgeInputs;
use crate::plant::PlantConditions;
use crate::pwm::Wave;

/// Divider of the coil's supply: 100 kiloohm over 10 kiloohm, with its capacitor.
const SUPPLY_RATIO: f64 = 11.0;
const SUPPLY_TAU_S: f64 = 1e-3;
/// Part of its limit to which the bridge limits with its input for the self-test low.
const LIMIT_LOW: f64 = 2.0 / 15.0;
/// The current amplifier.
const AMPLIFIER_V_PER_A: f64 = 0.125;
const AMPLIFIER_ZERO_V: f64 = 1.65;

/// Bridge and current measurement of a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BridgeCircuit {
    /// Limit of the bridge, A; infinite for one without.
    pub limit_a: f64,
    /// Resistance of the bridge's transistors and wires, ohm.
    pub bridge_ohm: f64,
    /// Dead time, s.
    pub dead_s: f64,
    /// Relative error of the current amplifier.
    pub gain_error: f64,
    /// Offset of the current amplifier, A.
    pub offset_a: f64,
    /// The converter.
    pub converter: ConverterParameters,
    /// Where the current amplifier's output is held, V: it is stuck or frozen.
    pub amplifier_v: Option<f64>,
    /// Where the thermometer's input is held, V: 3.3 of a thermistor that is open, 0 of a short.
    pub thermistor_v: Option<f64>,
    /// Whether the bridge pulls nFAULT.
    pub bridge_faults: bool,
}

impl Default for BridgeCircuit {
    /// A common bridge; a converter with wide codes and two codes of noise.
    fn default() -> Self {
        let common = CircuitParameters::common(1.0, 1.0, 1.0);
        Self {
            limit_a: common.limit_a,
            bridge_ohm: common.bridge_ohm,
            dead_s: common.dead_s,
            gain_error: 0.0,
            offset_a: 0.0,
            converter: ConverterParameters {
                noise_lsb: 2.0,
                wide_codes: true,
                ..ConverterParameters::EXACT
            },
            amplifier_v: None,
            thermistor_v: None,
            bridge_faults: false,
        }
    }
}

/// The circuit at its present.
#[derive(Clone, Debug)]
pub(crate) struct EmulatedCoil {
    drive: BridgeCircuit,
    circuit: Circuit,
    converter: Converter,
    supply: Filter,
    now_ps: u64,
    /// The sums when the plant last received its current.
    reported: Totals,
}

impl EmulatedCoil {
    pub(crate) fn new(drive: BridgeCircuit, seed: u64, conditions: &PlantConditions) -> Self {
        let mut coil = Self {
            drive,
            circuit: Circuit::new(CircuitParameters::common(1.0, 1.0, 1.0)),
            converter: Converter::new(drive.converter, seed),
            supply: Filter {
                tau_s: SUPPLY_TAU_S,
                value: conditions.supply_v,
            },
            now_ps: 0,
            reported: Totals::default(),
        };
        coil.follow(conditions, false);
        coil
    }

    /// The present of what changes slowly.
    pub(crate) fn follow(&mut self, conditions: &PlantConditions, limit_low: bool) {
        let drive = &self.drive;
        let limit_a = drive.limit_a * if limit_low { LIMIT_LOW } else { 1.0 };
        self.circuit.parameters = CircuitParameters {
            bridge_ohm: drive.bridge_ohm,
            dead_s: drive.dead_s,
            limit_a,
            supply_ohm: conditions.supply_ohm,
            ..CircuitParameters::common(
                conditions.coil_ohm,
                conditions.inductance_h,
                conditions.supply_v,
            )
        };
    }

    pub(crate) const fn circuit(&self) -> &Circuit {
        &self.circuit
    }

    pub(crate) const fn circuit_mut(&mut self) -> &mut Circuit {
        &mut self.circuit
    }

    pub(crate) const fn drive(&self) -> &BridgeCircuit {
        &self.drive
    }

    pub(crate) const fn drive_mut(&mut self) -> &mut BridgeCircuit {
        &mut self.drive
    }

    /// The present of the circuit.
    pub(crate) const fn now_ps(&self) -> u64 {
        self.now_ps
    }

    /// Whether nothing flows and nothing can.
    pub(crate) fn is_idle(&self, inputs: &BridgeInputs) -> bool {
        !inputs.awake && self.circuit.current_a() == 0.0
    }

    /// Mean current since this was last asked, and its ripple, root mean square, A. Nothing if no
    /// time has passed.
    pub(crate) fn current_since(&mut self) -> Option<(f64, f64)> {
        let now = self.circuit.totals();
        let before = std::mem::replace(&mut self.reported, now);
        let has_passed = now.time_s > before.time_s;
        has_passed.then(|| {
            let passed = Passed::between(&before, &now);
            (passed.mean_a, passed.ripple_a)
        })
    }

    /// Lets time pass: the pins stay as they are, the PWM goes on.
    pub(crate) fn advance(&mut self, to_ps: u64, inputs: &BridgeInputs, wave: &Wave) {
        let before = self.circuit.totals();
        while self.now_ps < to_ps {
            let levels = inputs.levels_at(wave, self.now_ps);
            let until_ps = if inputs.awake {
                inputs.next_edge(wave, self.now_ps).min(to_ps)
            } else {
                to_ps
            };
            let pins = Pins {
                awake: inputs.awake,
                inputs: levels,
            };
            self.circuit
                .advance(pins, (until_ps - self.now_ps) as f64 * 1e-12);
            self.now_ps = until_ps;
        }
        let after = self.circuit.totals();
        let passed_s = after.time_s - before.time_s;
        if passed_s > 0.0 {
            let passed = Passed::between(&before, &after);
            self.supply.push(passed.supply_v, passed_s);
        }
    }

    /// The code of an input now.
    pub(crate) fn convert(&mut self, input: usize, coil_c: f64) -> Option<u16> {
        let volts = match input {
            0 => {
                let current_a = self.circuit.current_a() + self.drive.offset_a;
                self.drive.amplifier_v.unwrap_or(
                    AMPLIFIER_ZERO_V
                        + AMPLIFIER_V_PER_A * (1.0 + self.drive.gain_error) * current_a,
                )
            }
            1 => self
                .drive
                .thermistor_v
                .unwrap_or_else(|| thermistor_v(coil_c)),
            2 => self.supply.value / SUPPLY_RATIO,
            // The processor's own temperature, 27 degrees Celsius (RP2040 datasheet 4.9.5).
            4 => 0.706,
            _ => return None,
        };
        Some(self.converter.code(volts))
    }
}
