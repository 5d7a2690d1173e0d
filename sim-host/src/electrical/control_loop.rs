//! The control interrupt around the circuit, on a PC: one PWM period at a time, in virtual time.

use std::rc::Rc;

use coil_hbridge::{Averages, Drive, Hardware, Output, Trace};

use super::circuit::{Circuit, Pins, Totals};
use super::edges;
use super::sense::{Converter, Filter};

/// Gain of the reference board's current amplifier, V/A, and its output at zero current, V.
const AMPLIFIER_V_PER_A: f64 = 0.125;
const AMPLIFIER_ZERO_V: f64 = 1.65;
/// Delay from the start of a period to its first sample, and from its middle to its second, s: the
/// firmware image starts the converter this long after the PWM
/// (docs/decisions/0063-hal-and-own-registers.md).
const SAMPLED_S: f64 = 25e-9;
/// Time from the middle of a period (its second sample) to the end of the control interrupt, s:
/// conversion, latency, and the control law in 270 cycles at 200 MHz.
const INTERRUPT_S: f64 = 3.6e-6;
/// Time constant of the supply's divider with its capacitor, s.
const SUPPLY_TAU_S: f64 = 1e-3;

/// Slow errors and injected faults of the measurements and of the bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slow {
    /// Relative error of the current amplifier's gain, which drifts over weeks.
    pub gain_error: f64,
    /// Offset of the current amplifier, A, which drifts over weeks.
    pub offset_a: f64,
    /// Relative error of the measured supply.
    pub supply_error: f64,
    /// Voltage at which the amplifier's output is stuck, V; `None` for a working amplifier.
    pub stuck_v: Option<f64>,
    /// Voltage that replaces the next sample of the current, and only that one, V; `None` for a
    /// true sample.
    pub wild_v: Option<f64>,
    /// Whether the bridge reports a fault.
    pub bridge_faults: bool,
    /// Whether the bridge reports its current limit as a fault; bridges differ.
    pub limit_faults: bool,
    /// Delay of the samples behind the PWM, s: `palpate_node::board::BRIDGE_DELAY_NS` for the
    /// carrier's bridge, and 0 for one without lag, as in [`CircuitParameters::common`].
    ///
    /// [`CircuitParameters::common`]: super::CircuitParameters::common
    pub sample_delay_s: f64,
    /// Whether the supervisor is polled.
    pub attended: bool,
    /// Factor on the current limit while its self-test input is low.
    pub limit_low: f64,
}

impl Default for Slow {
    fn default() -> Self {
        Self {
            gain_error: 0.0,
            offset_a: 0.0,
            supply_error: 0.0,
            stuck_v: None,
            wild_v: None,
            bridge_faults: false,
            limit_faults: true,
            sample_delay_s: 0.0,
            attended: true,
            limit_low: 2.0 / 15.0,
        }
    }
}

/// Currents and outputs of one finished PWM period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    /// End of the period, s.
    pub end_s: f64,
    /// True mean current, A.
    pub mean_a: f64,
    /// True current at the end, A.
    pub end_a: f64,
    /// Inputs of the bridge in the period.
    pub output: Output,
}

/// Number of blocks of the measured current that are kept.
pub const HISTORY: usize = 512;

/// Number of currents in a trace record.
pub const TRACED: usize = 128;

/// Edges of one period, each with its time as a fraction of the period and both levels after it;
/// unused places have an infinite time.
type Edges = [(f64, [bool; 2]); 5];

/// Circuit, current measurement, and the drive that the control interrupt calls.
pub struct ControlLoop {
    /// The circuit.
    pub circuit: Circuit,
    /// Analog-to-digital converter of the current.
    pub converter: Converter,
    /// Slow errors and injected faults.
    pub slow: Slow,
    /// The drive.
    pub drive: Drive,
    hardware: Hardware,
    supply: Filter,
    averages: Rc<Averages<HISTORY>>,
    trace: Rc<Trace<TRACED>>,
    /// Output of the drive that the bridge applies now.
    output: Output,
    periods: u32,
    supply_at_off_v: Option<f32>,
}

impl ControlLoop {
    /// A loop at rest.
    #[must_use]
    pub fn new(circuit: Circuit, converter: Converter, drive: Drive, hardware: Hardware) -> Self {
        Self {
            supply: Filter {
                tau_s: SUPPLY_TAU_S,
                value: circuit.parameters.supply_v,
            },
            circuit,
            converter,
            slow: Slow::default(),
            drive,
            hardware,
            averages: Rc::default(),
            trace: Rc::default(),
            output: Output::OFF,
            periods: 0,
            supply_at_off_v: None,
        }
    }

    /// Number of periods so far.
    #[must_use]
    pub const fn periods(&self) -> u32 {
        self.periods
    }

    /// The measured current, in blocks.
    #[must_use]
    pub const fn averages(&self) -> &Rc<Averages<HISTORY>> {
        &self.averages
    }

    /// The measured current, period by period, where a trace was requested.
    #[must_use]
    pub const fn trace(&self) -> &Rc<Trace<TRACED>> {
        &self.trace
    }

    /// Measured supply, V.
    #[must_use]
    pub fn supply_v(&self) -> f32 {
        (self.supply.value * (1.0 + self.slow.supply_error)) as f32
    }

    /// Takes the supply voltage at the time at which the bridge was switched off, V.
    pub const fn take_supply_at_off_v(&mut self) -> Option<f32> {
        self.supply_at_off_v.take()
    }

    /// Switches the bridge off at once.
    pub const fn bridge_off(&mut self) {
        self.output = Output::OFF;
    }

    /// Runs one PWM period, with the control interrupt in its second half.
    pub fn period(&mut self) -> Period {
        let period_s = f64::from(self.hardware.period_s);
        let before = self.circuit.totals();
        let output = self.output;
        let edges = self.edges();
        let sampled = (SAMPLED_S + self.slow.sample_delay_s) / period_s;
        self.bridge(&edges, 0.0, sampled, period_s);
        let first = self.sample();
        self.bridge(&edges, sampled, 0.5 + sampled, period_s);
        let second = self.sample();
        let decided = 0.5 + (INTERRUPT_S + self.slow.sample_delay_s) / period_s;
        self.bridge(&edges, 0.5 + sampled, decided, period_s);
        let limits = self.slow.limit_faults && self.circuit.is_limiting();
        // A bridge may report an undervoltage until its charge pump works.
        let wakes = self.circuit.is_waking();
        let faulty = self.slow.bridge_faults || limits || wakes;
        let mut next = self.drive.tick(faulty, || Some([first, second]));
        if self.drive.account(&self.averages) {
            next = Output::OFF;
        }
        self.trace.push(self.drive.measured());
        if next.awake {
            self.bridge(&edges, decided, 1.0, period_s);
        } else {
            self.output = next;
            self.bridge(&self.edges(), decided, 1.0, period_s);
        }
        self.output = next;
        self.periods = self.periods.wrapping_add(1);
        let after = self.circuit.totals();
        let passed = Passed::between(&before, &after);
        self.supply.push(passed.supply_v, period_s);
        if output.awake && !next.awake {
            self.supply_at_off_v = Some(self.supply_v());
        }
        Period {
            end_s: after.time_s,
            mean_a: passed.mean_a,
            end_a: self.circuit.current_a(),
            output,
        }
    }

    /// Edges of the present output.
    fn edges(&self) -> Edges {
        let levels = self.output.levels;
        let mut all = [(f64::INFINITY, [false; 2]); 5];
        let found = edges([levels.in1, levels.in2], self.hardware.full_level);
        for (place, edge) in all.iter_mut().zip(found) {
            *place = edge;
        }
        all
    }

    /// Advances the circuit from `from` to `to`, both as a fraction of the period, 0 to 1.
    fn bridge(&mut self, edges: &Edges, from: f64, to: f64, period_s: f64) {
        let Output {
            awake, limit_low, ..
        } = self.output;
        let limit_a = self.circuit.parameters.limit_a;
        if limit_low {
            self.circuit.parameters.limit_a *= self.slow.limit_low;
        }
        let mut now = from;
        let mut inputs = [false; 2];
        for &(at, next) in edges.iter().take_while(|(at, _)| *at < to) {
            if at > now {
                self.circuit
                    .advance(Pins { awake, inputs }, (at - now) * period_s);
                now = at;
            }
            inputs = next;
        }
        self.circuit
            .advance(Pins { awake, inputs }, (to - now) * period_s);
        self.circuit.parameters.limit_a = limit_a;
    }

    fn sample(&mut self) -> u16 {
        let current_a = self.circuit.current_a() + self.slow.offset_a;
        let volts = self.slow.wild_v.take().or(self.slow.stuck_v).unwrap_or(
            AMPLIFIER_ZERO_V + AMPLIFIER_V_PER_A * (1.0 + self.slow.gain_error) * current_a,
        );
        self.converter.code(volts)
    }

    /// Ripple of the current with the bridge's present inputs, peak to peak, A.
    #[must_use]
    pub fn ripple_a(&self) -> f64 {
        const STEPS: u32 = 200;
        let mut circuit = self.circuit.clone();
        let hardware = &self.hardware;
        let levels = self.output.levels;
        let step_s = f64::from(hardware.period_s) / f64::from(STEPS);
        let (mut low_a, mut high_a) = (f64::INFINITY, f64::NEG_INFINITY);
        for step in 0..STEPS {
            let at = f64::from(step) / f64::from(STEPS);
            let inputs = edges([levels.in1, levels.in2], hardware.full_level)
                .take_while(|&(from, _)| from <= at)
                .last()
                .map_or([false; 2], |(_, inputs)| inputs);
            let awake = self.output.awake;
            circuit.advance(Pins { awake, inputs }, step_s);
            low_a = low_a.min(circuit.current_a());
            high_a = high_a.max(circuit.current_a());
        }
        high_a - low_a
    }
}

/// Means over a time span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passed {
    /// Mean current, A.
    pub mean_a: f64,
    /// Root mean square of the current about its mean, A.
    pub ripple_a: f64,
    /// Mean supply voltage, V.
    pub supply_v: f64,
}

impl Passed {
    /// Means between two sums; `after` is the later one.
    #[must_use]
    pub fn between(before: &Totals, after: &Totals) -> Self {
        let passed_s = after.time_s - before.time_s;
        let mean = |before: f64, after: f64| (after - before) / passed_s;
        let mean_a = mean(before.charge_a_s, after.charge_a_s);
        let square_a2 = mean(before.square_a2_s, after.square_a2_s);
        Self {
            mean_a,
            ripple_a: libm::sqrt((square_a2 - mean_a * mean_a).max(0.0)),
            supply_v: mean(before.supply_v_s, after.supply_v_s),
        }
    }
}
