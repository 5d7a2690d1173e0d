//! The driver's control loop and its supervisor around the circuit, on a PC.

use core::ops::{Deref, DerefMut};
use std::collections::VecDeque;

use coil_hbridge::{
    CurrentLine, DriveState, Fault, Findings, Hardware, Limits, Order, Refusal, Report, Supervisor,
};

use super::circuit::Circuit;
use super::control_loop::{ControlLoop, Period};
use super::sense::Converter;

/// Periods from one poll of the supervisor to the next: 1 ms.
const POLL_PERIODS: u32 = 62;

/// Hardware constants of the reference board, as compiled into the firmware.
#[must_use]
pub const fn reference_hardware() -> Hardware {
    palpate_node::board::HARDWARE
}

/// Limits of the reference board.
#[must_use]
pub const fn reference_limits() -> Limits {
    palpate_node::board::DRIVE_LIMITS
}

/// Control loop and supervisor.
pub struct Regulated {
    control: ControlLoop,
    supervisor: Supervisor,
    /// Current lines after the present one, each given by its end, A, and its duration, s.
    lines: VecDeque<(f32, f32)>,
    polls: u32,
}

impl Deref for Regulated {
    type Target = ControlLoop;

    fn deref(&self) -> &ControlLoop {
        &self.control
    }
}

impl DerefMut for Regulated {
    fn deref_mut(&mut self) -> &mut ControlLoop {
        &mut self.control
    }
}

impl Regulated {
    /// A loop at rest.
    ///
    /// # Errors
    /// If the driver refuses the hardware constants or the limits.
    pub fn new(
        circuit: Circuit,
        converter: Converter,
        hardware: Hardware,
        limits: Limits,
    ) -> Result<Self, Refusal> {
        let (supervisor, drive) = Supervisor::new(hardware, limits)?;
        Ok(Self {
            control: ControlLoop::new(circuit, converter, drive, hardware),
            supervisor,
            lines: VecDeque::new(),
            polls: 0,
        })
    }

    /// State of the drive.
    #[must_use]
    pub fn state(&self) -> DriveState {
        self.control.drive.state()
    }

    /// Latest report of the supervisor.
    #[must_use]
    pub fn report(&self) -> Report {
        self.control.drive.report()
    }

    /// The supervisor.
    #[must_use]
    pub const fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    /// Measured mean current from one period to another, A.
    #[must_use]
    pub fn reported_a(&self, from: u32, to: u32) -> Option<f64> {
        let hardware = self.supervisor.hardware();
        let mean_a = self
            .control
            .averages()
            .mean_a(from.into(), to.into(), hardware);
        mean_a.map(f64::from)
    }

    /// Sends an order to the drive.
    pub fn order(&mut self, order: &Order) {
        self.lines.clear();
        self.control.drive.apply(order);
    }

    /// Follows a current line, whose times count on the circuit's clock ([`now_us`](Self::now_us)).
    ///
    /// # Errors
    /// The driver's refusal.
    pub fn follow(&mut self, line: &CurrentLine) -> Result<(), Refusal> {
        self.lines.clear();
        self.apply(line)
    }

    /// Moves the current to `to_a` in a straight line.
    ///
    /// # Errors
    /// The driver's refusal.
    pub fn go(&mut self, to_a: f32, over_s: f32) -> Result<(), Refusal> {
        self.follow(&CurrentLine::at_once(to_a, over_s))
    }

    /// Follows current lines one after the other, each given by its end, A, and its duration, s.
    /// Another order ends the sequence, and so does a line that the driver refuses.
    ///
    /// # Errors
    /// The driver's refusal of the first line.
    pub fn follow_all(
        &mut self,
        lines: impl IntoIterator<Item = (f32, f32)>,
    ) -> Result<(), Refusal> {
        self.lines = lines.into_iter().collect();
        self.next_line()
    }

    fn next_line(&mut self) -> Result<(), Refusal> {
        let Some((to_a, over_s)) = self.lines.pop_front() else {
            return Ok(());
        };
        let result = self.apply(&CurrentLine::at_once(to_a, over_s));
        if result.is_err() {
            self.lines.clear();
        }
        result
    }

    fn apply(&mut self, line: &CurrentLine) -> Result<(), Refusal> {
        let now_us = self.now_us();
        let report = self.control.drive.report();
        let order = self.supervisor.follow(&report, line, || now_us)?;
        self.control.drive.apply(&order);
        Ok(())
    }

    /// Time of the circuit, us: the clock of [`follow`](Self::follow).
    #[must_use]
    pub fn now_us(&self) -> u64 {
        (self.control.circuit.totals().time_s * 1e6).round() as u64
    }

    /// Starts the self-test.
    ///
    /// # Errors
    /// The driver's refusal.
    pub fn begin_test(&mut self) -> Result<(), Refusal> {
        let supply_v = self.control.supply_v();
        let order = self
            .supervisor
            .test(&self.control.drive.report(), supply_v)?;
        self.control.drive.apply(&order);
        Ok(())
    }

    /// Runs the self-test to its end.
    ///
    /// # Errors
    /// The fault that the test finds.
    pub fn test(&mut self) -> Result<Findings, Fault> {
        if self.begin_test().is_err() {
            return Err(Fault::Unattended);
        }
        // The longest test takes 13 000 periods.
        for _ in 0..20_000 {
            self.period();
            match (self.state(), self.supervisor.findings()) {
                (DriveState::Latched(fault), _) => return Err(fault),
                (DriveState::Off { tested: true }, Some(findings)) => return Ok(*findings),
                _ => {}
            }
        }
        Err(Fault::Unattended)
    }

    /// Runs for `periods` periods.
    pub fn periods_of(&mut self, periods: u32) {
        for _ in 0..periods {
            self.period();
        }
    }

    /// Runs for a time.
    pub fn run_for(&mut self, time_s: f64) {
        let period_s = f64::from(self.supervisor.hardware().period_s);
        self.periods_of((time_s / period_s).round() as u32);
    }

    /// Runs one PWM period, and polls the supervisor when it is due.
    pub fn period(&mut self) -> Period {
        let period = self.control.period();
        if let Some(supply_v) = self.control.take_supply_at_off_v() {
            self.supervisor.read_supply(supply_v);
        }
        if !self.lines.is_empty() && self.report().holds {
            // A refused line ends the sequence.
            let _ = self.next_line();
        }
        self.polls += 1;
        if self.polls >= POLL_PERIODS {
            self.polls = 0;
            self.poll();
        }
        period
    }

    fn poll(&mut self) {
        if !self.control.slow.attended {
            return;
        }
        let supply_v = self.control.supply_v();
        self.supervisor.read_supply(supply_v);
        let elapsed_us = POLL_PERIODS * 16;
        let report = self.control.drive.report();
        let order = self.supervisor.attend(&report, supply_v, elapsed_us);
        self.control.drive.apply(&order);
    }
}
