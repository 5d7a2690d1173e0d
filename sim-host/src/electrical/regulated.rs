//! The driver's loop around the circuit, on a PC: period by period, in the plant's own time.

use coil_hbridge::{
    ATTENDED_WITHIN, Averages, Decay, Drive, Fault, Findings, Hardware, Limits, Order, Output,
    Refusal, Report, State, Supervisor, Waveform,
};

use super::circuit::{Circuit, Pins};
use super::edges;
use super::sense::{Converter, Filter};

/// Gain of the reference board's current amplifier, V/A, and its output without current, V.
const AMPLIFIER_V_PER_A: f64 = 0.125;
const AMPLIFIER_ZERO_V: f64 = 1.65;
/// From the middle of a period, where its second sample is taken, to the end of the control
/// interrupt: conversion, latency, and the law.
const INTERRUPT_S: f64 = 4.5e-6;
/// Periods from one look of the supervisor to the next: 1 ms.
const LOOK_PERIODS: u32 = 62;
/// Time constant of the supply's divider with its capacitor.
const SUPPLY_TAU_S: f64 = 1e-3;

/// The reference board: 62.5 kHz from 120 MHz, 0.125 V/A on 12 bits of 3.3 V.
#[must_use]
pub fn reference_hardware() -> Hardware {
    Hardware {
        period_s: 16e-6,
        full_level: 960,
        ampere_per_count: 3.3 / 4096.0 / 0.125,
        zero_count: 2048,
        zero_tolerance: 64,
        greatest_count: 4095,
        diode_v: 0.8,
        decay: Decay::Fast,
        reduced_limit_a: Some(2.0),
    }
}

/// Its limits.
#[must_use]
pub const fn reference_limits() -> Limits {
    palpate_procedure::board::DRIVE
}

/// What is measured slowly, or wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slow {
    /// Relative error of the current amplifier's gain, which drifts over weeks.
    pub gain_error: f64,
    /// Its offset, A, which drifts as well.
    pub offset_a: f64,
    /// Relative error of the measured supply.
    pub supply_error: f64,
    /// The amplifier's output is stuck here, V.
    pub stuck_v: Option<f64>,
    /// The bridge reports a fault.
    pub bridge_faults: bool,
    /// Whether it reports its limit as one; bridges differ.
    pub limit_faults: bool,
    /// The supervisor looks.
    pub attended: bool,
    /// What the limit is with its input for the self-test low, as a part.
    pub limit_low: f64,
}

impl Default for Slow {
    fn default() -> Self {
        Self {
            gain_error: 0.0,
            offset_a: 0.0,
            supply_error: 0.0,
            stuck_v: None,
            bridge_faults: false,
            limit_faults: true,
            attended: true,
            limit_low: 2.0 / 15.0,
        }
    }
}

/// One period, as it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    /// Its end, s.
    pub end_s: f64,
    /// True mean current, A.
    pub mean_a: f64,
    /// True current at its end, A.
    pub end_a: f64,
    /// The bridge's inputs in it.
    pub output: Output,
}

/// Blocks whose currents are kept.
pub(super) const HISTORY: usize = 512;

/// Circuit and driver.
pub struct Regulated {
    /// The circuit.
    pub circuit: Circuit,
    /// The converter of the current.
    pub converter: Converter,
    /// What is measured slowly, or wrong.
    pub slow: Slow,
    supply: Filter,
    drive: Drive,
    supervisor: Supervisor,
    averages: Averages<HISTORY>,
    /// In force, and to come.
    output: Output,
    periods: u32,
    looks: u32,
}

impl Regulated {
    /// At rest.
    ///
    /// # Errors
    /// Hardware or limits that the driver refuses.
    pub fn new(
        circuit: Circuit,
        converter: Converter,
        hardware: Hardware,
        limits: Limits,
    ) -> Result<Self, Refusal> {
        let (supervisor, drive) = Supervisor::new(hardware, limits)?;
        Ok(Self {
            supply: Filter {
                tau_s: SUPPLY_TAU_S,
                value: circuit.parameters.supply_v,
            },
            circuit,
            converter,
            slow: Slow::default(),
            drive,
            supervisor,
            averages: Averages::new(),
            output: Output::OFF,
            periods: 0,
            looks: 0,
        })
    }

    /// Where the drive stands.
    #[must_use]
    pub fn state(&self) -> State {
        self.drive.state()
    }

    /// What the supervisor sees.
    #[must_use]
    pub fn report(&self) -> Report {
        self.drive.report()
    }

    /// The supervisor.
    #[must_use]
    pub const fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    /// Periods so far.
    #[must_use]
    pub const fn periods(&self) -> u32 {
        self.periods
    }

    /// The averages.
    #[must_use]
    pub const fn averages(&self) -> &Averages<HISTORY> {
        &self.averages
    }

    /// The measured mean current from one period to another, A.
    #[must_use]
    pub fn reported_a(&self, from: u32, to: u32) -> Option<f64> {
        let mean_a = self
            .averages
            .mean_a(from.into(), to.into(), self.supervisor.hardware());
        mean_a.map(f64::from)
    }

    /// Gives an order.
    pub fn order(&mut self, order: &Order) {
        self.drive.apply(order);
    }

    /// Begins a waveform.
    ///
    /// # Errors
    /// What the driver refuses.
    pub fn run(&mut self, waveform: &Waveform) -> Result<(), Refusal> {
        let order = self.supervisor.run(&self.drive.report(), waveform)?;
        self.drive.apply(&order);
        Ok(())
    }

    /// Goes in a straight line to a current.
    ///
    /// # Errors
    /// What the driver refuses.
    pub fn go(&mut self, to_a: f32, over_s: f32) -> Result<(), Refusal> {
        let order = self.supervisor.go(&self.drive.report(), to_a, over_s)?;
        self.drive.apply(&order);
        Ok(())
    }

    /// Begins the self-test.
    ///
    /// # Errors
    /// What the driver refuses.
    pub fn begin_test(&mut self) -> Result<(), Refusal> {
        let supply_v = self.supply.value as f32;
        let order = self.supervisor.test(&self.drive.report(), supply_v)?;
        self.drive.apply(&order);
        Ok(())
    }

    /// Runs the self-test to its end.
    ///
    /// # Errors
    /// The fault that it found.
    pub fn test(&mut self) -> Result<Findings, Fault> {
        if self.begin_test().is_err() {
            return Err(Fault::Unattended);
        }
        // The longest takes 13 000 periods.
        for _ in 0..20_000 {
            self.period();
            match (self.state(), self.supervisor.findings()) {
                (State::Latched(fault), _) => return Err(fault),
                (State::Off { tested: true }, Some(findings)) => return Ok(*findings),
                _ => {}
            }
        }
        Err(Fault::Unattended)
    }

    /// Runs for so many periods.
    pub fn periods_of(&mut self, periods: u32) {
        for _ in 0..periods {
            self.period();
        }
    }

    /// Runs for a time without looking at single periods.
    pub fn run_for(&mut self, time_s: f64) {
        let period_s = f64::from(self.supervisor.hardware().period_s);
        self.periods_of((time_s / period_s).round() as u32);
    }

    /// One period of the PWM, with the control interrupt in its second half.
    pub fn period(&mut self) -> Period {
        let hardware = *self.supervisor.hardware();
        let period_s = f64::from(hardware.period_s);
        let before = self.circuit.totals();
        let output = self.output;
        let first = self.sample();
        self.bridge(0.0, 0.5, period_s);
        let second = self.sample();
        let decided = 0.5 + INTERRUPT_S / period_s;
        self.bridge(0.5, decided, period_s);
        let limits = self.slow.limit_faults && self.circuit.is_limiting();
        let faulty = self.slow.bridge_faults || limits;
        let mut next = self.drive.tick([first, second], faulty);
        if self.drive.account(&self.averages) {
            next = Output::OFF;
        }
        if !next.awake {
            self.output = next;
        }
        self.bridge(decided, 1.0, period_s);
        self.output = next;
        self.periods = self.periods.wrapping_add(1);
        let after = self.circuit.totals();
        self.supply
            .push((after.supply_v_s - before.supply_v_s) / period_s, period_s);
        if output.awake && !next.awake {
            self.supervisor.read_supply(self.supply_v());
        }
        self.looks += 1;
        if self.looks >= LOOK_PERIODS {
            self.looks = 0;
            self.look();
        }
        Period {
            end_s: after.time_s,
            mean_a: (after.charge_a_s - before.charge_a_s) / period_s,
            end_a: self.circuit.current_a(),
            output,
        }
    }

    fn look(&mut self) {
        if !self.slow.attended {
            return;
        }
        let supply_v = self.supply_v();
        self.supervisor.read_supply(supply_v);
        let elapsed_us = LOOK_PERIODS * 16;
        let report = self.drive.report();
        let order = self.supervisor.attend(&report, supply_v, elapsed_us);
        self.drive.apply(&order);
    }

    /// The supply as it is measured, V.
    fn supply_v(&self) -> f32 {
        (self.supply.value * (1.0 + self.slow.supply_error)) as f32
    }

    /// Lets the circuit pass through a part of the period, given from 0 to 1.
    fn bridge(&mut self, from: f64, to: f64, period_s: f64) {
        let Output {
            awake,
            levels,
            limit_low,
        } = self.output;
        let limit_a = self.circuit.parameters.limit_a;
        if limit_low {
            self.circuit.parameters.limit_a *= self.slow.limit_low;
        }
        let full = self.supervisor.hardware().full_level;
        let mut now = from;
        let mut inputs = [false; 2];
        for (at, next) in edges([levels.in1, levels.in2], full) {
            let until = at.min(to);
            if until > now {
                self.circuit
                    .advance(Pins { awake, inputs }, (until - now) * period_s);
                now = until;
            }
            inputs = next;
        }
        if to > now {
            self.circuit
                .advance(Pins { awake, inputs }, (to - now) * period_s);
        }
        self.circuit.parameters.limit_a = limit_a;
    }

    fn sample(&mut self) -> u16 {
        let current_a = self.circuit.current_a() + self.slow.offset_a;
        let volts = self.slow.stuck_v.unwrap_or(
            AMPLIFIER_ZERO_V + AMPLIFIER_V_PER_A * (1.0 + self.slow.gain_error) * current_a,
        );
        self.converter.code(volts)
    }

    /// The ripple of the current with the bridge's present inputs, peak to peak, A.
    #[must_use]
    pub fn ripple_a(&self) -> f64 {
        const STEPS: u32 = 200;
        let mut circuit = self.circuit;
        let hardware = self.supervisor.hardware();
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

    /// Longest time that a drive stays on without being looked after, s.
    #[must_use]
    pub fn longest_unattended_s(&self) -> f64 {
        f64::from(ATTENDED_WITHIN) * f64::from(self.supervisor.hardware().period_s)
    }
}
