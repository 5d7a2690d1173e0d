//! Circuit of the coil, with the bridge and the ADC inputs: the edges of the PWM drive it, and the
//! conversions sample it.

use ldc161x_sim::{Chip, Time};
use palpate_sim::electrical::{
    Circuit, CircuitParameters, Converter, ConverterParameters, Filter, Passed, Pins, Totals,
    thermistor_v,
};

use crate::board::bridge::BridgeInputs;
use crate::board::plant::{Plant, PlantConditions};
use crate::rp2040::pwm::Wave;

/// Interval, ps, at which the plant receives the coil's mean current while there is a current: two
/// periods of the bridge, over which the ripple averages out.
const REPORT_PS: u64 = 32_000_000;
/// Number of current reports from one reading of the plant's conditions to the next; the conditions
/// change slowly.
const REPORTS_PER_READING: u64 = 4;
/// Interval, ps, at which the plant's conditions are read while there is no current.
const IDLE_PS: u64 = 1_000_000_000;
/// Ratio of the coil's supply to the voltage at its ADC input: a divider of 100 over 10 kiloohm.
const SUPPLY_RATIO: f64 = 11.0;
/// Time constant of the supply's divider with its capacitor, s.
const SUPPLY_TAU_S: f64 = 1e-3;
/// Lag of the default bridge and its amplifier, s: 0.43 us of the bridge, which is a guess for an
/// integrated one, and 0.55 us of the amplifier. With half of the dead time it is 1.03 us.
const LAG_S: f64 = 0.98e-6;
/// Factor on the bridge's current limit while the bridge's self-test input is low.
const LIMIT_LOW: f64 = 2.0 / 15.0;
/// Gain of the current amplifier, V/A, and its output at zero current, V.
const AMPLIFIER_V_PER_A: f64 = 0.125;
const AMPLIFIER_ZERO_V: f64 = 1.65;

/// Bridge and current measurement of a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BridgeCircuit {
    /// Limit of the bridge, A; infinite for a bridge without one.
    pub limit_a: f64,
    /// Resistance of the bridge's transistors and wires, ohm.
    pub bridge_ohm: f64,
    /// Lag of the outputs, s, as in [`CircuitParameters`].
    pub lag_s: f64,
    /// Dead time, s.
    pub dead_s: f64,
    /// Charging time, s, as in [`CircuitParameters`].
    pub charged_s: f64,
    /// Wake-up time, s: from nSLEEP high until the outputs follow the inputs.
    pub wake_s: f64,
    /// Relative error of the current amplifier.
    pub gain_error: f64,
    /// Offset of the current amplifier, A.
    pub offset_a: f64,
    /// Errors of the analog-to-digital converter.
    pub converter: ConverterParameters,
    /// Fixed output of the current amplifier, V, if it is stuck or frozen.
    pub amplifier_v: Option<f64>,
    /// Voltage that replaces only the next sample of the current, V.
    pub wild_v: Option<f64>,
    /// Fixed voltage of the thermistor input, V: 3.3 for an open thermistor, 0 for a short.
    pub thermistor_v: Option<f64>,
    /// Whether the bridge pulls nFAULT.
    pub bridge_faults: bool,
}

impl Default for BridgeCircuit {
    /// A typical bridge with the lag for which the board is set, and an analog-to-digital converter
    /// with wide codes and noise of two codes.
    fn default() -> Self {
        let common = CircuitParameters::common(1.0, 1.0, 1.0);
        Self {
            lag_s: LAG_S,
            ..Self::of(&common)
        }
    }
}

impl BridgeCircuit {
    /// The carrier's bridge ([`CircuitParameters::carrier`]); the rest as by default.
    #[must_use]
    pub fn carrier() -> Self {
        Self::of(&CircuitParameters::common(1.0, 1.0, 1.0).carrier())
    }

    fn of(circuit: &CircuitParameters) -> Self {
        Self {
            limit_a: circuit.limit_a,
            bridge_ohm: circuit.bridge_ohm,
            lag_s: circuit.lag_s,
            dead_s: circuit.dead_s,
            charged_s: circuit.charged_s,
            wake_s: circuit.wake_s,
            gain_error: 0.0,
            offset_a: 0.0,
            converter: ConverterParameters {
                noise_lsb: 2.0,
                wide_codes: true,
                ..ConverterParameters::EXACT
            },
            amplifier_v: None,
            wild_v: None,
            thermistor_v: None,
            bridge_faults: false,
        }
    }
}

/// Circuit of the coil with its present state.
#[derive(Clone, Debug)]
pub(crate) struct EmulatedCoil {
    drive: BridgeCircuit,
    circuit: Circuit,
    converter: Converter,
    supply: Filter,
    inputs: BridgeInputs,
    /// Coil and supply, as last read from the plant.
    conditions: PlantConditions,
    now_ps: u64,
    /// Time of the last report to the plant; `reported` has the circuit's sums at that time.
    reported_ps: u64,
    reported: Totals,
}

impl EmulatedCoil {
    pub(crate) fn new(drive: BridgeCircuit, seed: u64, conditions: PlantConditions) -> Self {
        let mut coil = Self {
            drive,
            circuit: Circuit::new(CircuitParameters::common(1.0, 1.0, 1.0)),
            converter: Converter::new(drive.converter, seed),
            supply: Filter {
                tau_s: SUPPLY_TAU_S,
                value: conditions.supply_v,
            },
            inputs: BridgeInputs::default(),
            conditions,
            now_ps: 0,
            reported_ps: 0,
            reported: Totals::default(),
        };
        coil.set_parameters(false);
        coil
    }

    /// Sets the circuit's parameters for the present conditions.
    fn set_parameters(&mut self, limit_low: bool) {
        let (drive, conditions) = (&self.drive, &self.conditions);
        let limit_a = drive.limit_a * if limit_low { LIMIT_LOW } else { 1.0 };
        self.circuit.parameters = CircuitParameters {
            bridge_ohm: drive.bridge_ohm,
            lag_s: drive.lag_s,
            dead_s: drive.dead_s,
            charged_s: drive.charged_s,
            wake_s: drive.wake_s,
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

    pub(crate) const fn drive_mut(&mut self) -> &mut BridgeCircuit {
        &mut self.drive
    }

    pub(crate) const fn inputs(&self) -> BridgeInputs {
        self.inputs
    }

    /// Sets the bridge's inputs from the circuit's present time on.
    pub(crate) fn set_inputs(&mut self, inputs: BridgeInputs) {
        self.set_parameters(inputs.limit_low);
        self.inputs = inputs;
    }

    /// Whether the bridge pulls nFAULT: on a fault, and while it wakes, since its charge pump has
    /// no voltage yet.
    pub(crate) fn has_fault(&self) -> bool {
        self.circuit.is_limiting() || self.circuit.is_waking() || self.drive.bridge_faults
    }

    /// Whether no current flows and the bridge is asleep.
    fn is_idle(&self) -> bool {
        !self.inputs.awake && self.circuit.current_a() == 0.0
    }

    /// Time of the next report to the plant, but not before the circuit's present time, which may
    /// be later if the bridge has just woken.
    pub(crate) fn report_ps(&self) -> u64 {
        let period_ps = if self.is_idle() { IDLE_PS } else { REPORT_PS };
        (self.reported_ps + period_ps).max(self.now_ps)
    }

    /// Reports the current since the last report to the plant, and reads the plant's conditions
    /// when due.
    pub(crate) fn report<P: Plant>(&mut self, now_ps: u64, chip: &mut Chip<P>) {
        self.reported_ps = now_ps;
        if let Some((mean_a, ripple_a)) = self.current_since_report() {
            let now = Time::from_ps(now_ps);
            chip.advance_to(now);
            // The plant's time is still that of the last report, so this current acts since then.
            let plant = chip.sensors_mut();
            plant.set_current(mean_a, ripple_a);
            plant.advance_to(now);
        }
        if self.is_idle() || (now_ps / REPORT_PS).is_multiple_of(REPORTS_PER_READING) {
            self.conditions = chip.sensors().conditions();
            self.set_parameters(self.inputs.limit_low);
        }
    }

    /// Mean current since the last report, and its ripple, A rms; `None` if no time has passed.
    fn current_since_report(&mut self) -> Option<(f64, f64)> {
        let now = self.circuit.totals();
        let before = std::mem::replace(&mut self.reported, now);
        let has_passed = now.time_s > before.time_s;
        has_passed.then(|| {
            let passed = Passed::between(&before, &now);
            (passed.mean_a, passed.ripple_a)
        })
    }

    /// Advances time with constant pins; the PWM continues.
    pub(crate) fn advance(&mut self, to_ps: u64, wave: &Wave) {
        let inputs = self.inputs;
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

    /// Code of an ADC input; `None` for an unconnected one.
    pub(crate) fn convert(&mut self, input: usize) -> Option<u16> {
        let volts = match input {
            0 => {
                let current_a = self.circuit.current_a() + self.drive.offset_a;
                let fixed_v = self.drive.wild_v.take().or(self.drive.amplifier_v);
                fixed_v.unwrap_or(
                    AMPLIFIER_ZERO_V
                        + AMPLIFIER_V_PER_A * (1.0 + self.drive.gain_error) * current_a,
                )
            }
            1 => self
                .drive
                .thermistor_v
                .unwrap_or_else(|| thermistor_v(self.conditions.coil_c)),
            2 => self.supply.value / SUPPLY_RATIO,
            // Voltage of the processor's own temperature sensor at 27 degrees Celsius (RP2040
            // datasheet 4.9.5).
            4 => 0.706,
            _ => return None,
        };
        Some(self.converter.code(volts))
    }
}
