//! The part of the driver that runs in the PWM interrupt: integers only, without waiting, the same
//! few steps in every period.

use crate::averages::Averages;
use crate::correction::Correction;
use crate::fault::Fault;
use crate::line::{Ahead, FixedPointLine};
use crate::output::{Levels, Output, Shaper};
use crate::regulator::{Gains, Regulator};
use crate::self_test::{SelfTest, TestPlan, TestStep, TestSums};
use crate::watch::{self, ATTENDED_WITHIN, Bounds, Watch};

/// Largest difference of measured current and setpoint, in units, at which the current counts as on
/// track: 0.15 A on the reference board, twice the noise at the converter's worst codes.
const NEAR: i32 = 48;
/// Number of periods after a current off its setpoint in which the control law is evaluated in
/// every period.
const BUSY_PERIODS: u32 = 16;

/// Number of periods after which an order from the supervisor is overdue.
const PATIENCE: u32 = ATTENDED_WITHIN + 1;

/// A straight line of the current: its end and its duration, in integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RawLine {
    /// Current at the end, units.
    pub(crate) to: i32,
    pub(crate) periods: u32,
}

/// An order to the drive. Made by [`Supervisor`](crate::Supervisor) outside of any lock.
#[derive(Clone, Debug)]
pub struct Order(pub(crate) Orders);

#[derive(Clone, Debug)]
pub(crate) enum Orders {
    /// No change: only shows that the supervisor runs.
    Attended,
    Stop,
    Clear,
    Latch(Fault),
    /// The cause of the latched fault, which replaces the fault.
    Cause(Fault),
    Test(TestPlan),
    /// Result of the self-test: the reading without current and the control law.
    Fit {
        twice_zero: i32,
        gains: Gains,
        coast_q8: i32,
    },
    /// Control law for a changed supply or resistance.
    Adapt {
        gains: Gains,
        coast_q8: i32,
    },
    /// Follow this line, and then the next one, if any.
    Run {
        line: RawLine,
        next: Option<RawLine>,
    },
    /// Hold this current, in units; ignored unless a current is held already.
    Hold(i32),
    Correct(Correction),
}

/// State of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveState {
    /// The bridge is off. `tested`: whether it may be driven.
    Off {
        /// Whether the self-test has found a coil.
        tested: bool,
    },
    /// The self-test is running.
    Testing,
    /// The current is regulated.
    Driving,
    /// A fault switched the bridge off.
    Latched(Fault),
}

/// State and sums for the supervisor; a copy takes a few cycles.
#[derive(Clone, Copy, Debug)]
pub struct Report {
    /// State of the drive.
    pub state: DriveState,
    /// Whether the line has ended and its end current is held.
    pub holds: bool,
    /// Number of periods with the bridge on since it was switched on.
    pub on_periods: u32,
    pub(crate) setpoint: i32,
    /// Sums over all complete blocks of level times current, of levels, and of currents in units;
    /// they wrap.
    pub(crate) power: i64,
    pub(crate) levels: i32,
    pub(crate) units: i32,
    pub(crate) blocks: u32,
    pub(crate) outcome: Option<TestSums>,
    pub(crate) tripped: i32,
}

/// The drive: from two samples every period it computes the bridge's inputs.
///
/// The fields that every period needs come first and in this order: a load instruction of the
/// processor reaches only 124 bytes from an address.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Drive {
    mode: Mode,
    /// Whether the previous period had a sample beyond the trip level.
    is_wild: bool,
    /// Whether a correction is set.
    corrects: bool,
    /// Whether the self-test has set a control law.
    tested: bool,
    /// Whether the line in `next` follows when the present one ends.
    goes_on: bool,
    /// Twice the converter's reading without current.
    twice_zero: i32,
    /// -1 if the current measurement is reversed, otherwise 0.
    sign: i32,
    /// Smallest sample that does not trip.
    least: i32,
    /// How far a sample may be above `least` without a trip.
    range: u32,
    /// Measured current of the period.
    measured: i32,
    /// Number of periods left in which the control law is evaluated in every period.
    busy: u32,
    /// Number of periods left until an order from the supervisor is overdue.
    patience: u32,
    shaper: Shaper,
    /// Greatest level that may be applied.
    top: i32,
    line: FixedPointLine,
    sums: watch::BlockSums,
    regulator: Regulator,
    gains: Gains,
    // The fields from here on are needed in few periods only.
    /// Number of periods that the bridge needs to wake.
    wake_periods: u16,
    /// Number of periods left until the bridge is awake.
    waking: u16,
    correction: Correction,
    next: RawLine,
    /// The line in `next` with its division already done, valid if `is_prepared`.
    ahead: Ahead,
    is_prepared: bool,
    watch: Watch,
    bounds: Bounds,
    /// Greatest setpoint and trip level of the current, units.
    current: i32,
    trip: i32,
    nominal_twice_zero: i32,
    fault: Fault,
    /// Measured current when the drive tripped, units.
    tripped: i32,
    test: SelfTest,
    report: Sum,
    outcome: Option<TestSums>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    power: i64,
    levels: i32,
    units: i32,
    blocks: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Off,
    /// The self-test runs, in `test`.
    Testing,
    /// The bridge wakes; then the mode changes to `Driving`.
    Waking,
    Driving,
    /// A fault is latched, in `fault`.
    Latched,
}

/// Constants of a drive, in integers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fixed {
    pub(crate) current: i32,
    pub(crate) trip: i32,
    pub(crate) bounds: Bounds,
    pub(crate) reversed: bool,
    pub(crate) twice_zero: i32,
    pub(crate) shaper: Shaper,
    /// Greatest level that may be applied.
    pub(crate) top: i32,
    pub(crate) wake_periods: u16,
}

impl Drive {
    pub(crate) fn new(fixed: Fixed) -> Self {
        let mut drive = Self {
            mode: Mode::Off,
            is_wild: false,
            corrects: false,
            tested: false,
            goes_on: false,
            twice_zero: 0,
            sign: if fixed.reversed { -1 } else { 0 },
            least: 0,
            range: 0,
            measured: 0,
            busy: 0,
            patience: PATIENCE,
            shaper: fixed.shaper,
            top: fixed.top,
            line: FixedPointLine::default(),
            regulator: Regulator::default(),
            sums: watch::BlockSums::default(),
            gains: Gains::default(),
            correction: Correction::NONE,
            next: RawLine { to: 0, periods: 0 },
            ahead: Ahead::default(),
            is_prepared: false,
            wake_periods: fixed.wake_periods,
            waking: 0,
            watch: Watch::default(),
            bounds: fixed.bounds,
            current: fixed.current,
            trip: fixed.trip,
            nominal_twice_zero: fixed.twice_zero,
            fault: Fault::Unattended,
            tripped: 0,
            test: SelfTest::new(TestPlan::default()),
            report: Sum::default(),
            outcome: None,
        };
        drive.set_zero(fixed.twice_zero);
        drive
    }

    /// The drive's report to the supervisor.
    #[must_use]
    pub fn report(&self) -> Report {
        Report {
            state: self.state(),
            holds: self.holds(),
            on_periods: self.watch.on(),
            setpoint: self.line.now(),
            power: self.report.power,
            levels: self.report.levels,
            units: self.report.units,
            blocks: self.report.blocks,
            outcome: self.outcome,
            tripped: self.tripped,
        }
    }

    /// State of the drive.
    #[must_use]
    pub fn state(&self) -> DriveState {
        match self.mode {
            Mode::Off => DriveState::Off {
                tested: self.tested,
            },
            Mode::Testing => DriveState::Testing,
            Mode::Waking | Mode::Driving => DriveState::Driving,
            Mode::Latched => DriveState::Latched(self.fault),
        }
    }

    /// The corrected current of the last period, in units of the driver, for
    /// [`Trace::push`](crate::Trace::push).
    #[inline]
    #[must_use]
    pub const fn measured(&self) -> i32 {
        self.measured
    }

    /// Applies an order. The drive enforces its limits on every order.
    pub fn apply(&mut self, order: &Order) {
        self.patience = PATIENCE;
        match &order.0 {
            Orders::Attended => {}
            Orders::Stop => self.stop(),
            Orders::Clear => {
                if self.mode == Mode::Latched {
                    self.mode = Mode::Off;
                    self.tested &= !self.fault.requires_self_test();
                }
            }
            Orders::Latch(fault) => self.latch(*fault),
            Orders::Cause(fault) => {
                if self.mode == Mode::Latched {
                    self.fault = *fault;
                }
            }
            Orders::Test(plan) => {
                if self.mode == Mode::Off {
                    self.tested = false;
                    self.set_zero(self.nominal_twice_zero);
                    self.outcome = None;
                    self.test = SelfTest::new(*plan);
                    self.mode = Mode::Testing;
                }
            }
            Orders::Fit {
                twice_zero,
                gains,
                coast_q8,
            } => {
                self.outcome = None;
                self.set_zero(*twice_zero);
                self.tested = true;
                self.gains = *gains;
                self.shaper.coast_q8 = *coast_q8;
            }
            Orders::Adapt { gains, coast_q8 } => {
                if self.tested {
                    self.regulator
                        .adapt(&self.gains, gains, self.line.setpoint());
                    self.gains = *gains;
                    self.shaper.coast_q8 = *coast_q8;
                }
            }
            Orders::Run { line, next } => self.run(*line, *next),
            Orders::Hold(units) => self.hold(*units),
            Orders::Correct(correction) => {
                self.corrects = *correction != Correction::NONE;
                self.correction = *correction;
            }
        }
    }

    fn set_zero(&mut self, twice_zero: i32) {
        self.twice_zero = twice_zero;
        // A sample trips if twice the sample differs from twice the reading without current by more
        // than the trip level.
        self.least = (twice_zero - self.trip + 1) >> 1;
        self.range = (((twice_zero + self.trip) >> 1) - self.least) as u32;
    }

    fn run(&mut self, line: RawLine, next: Option<RawLine>) {
        if !self.tested {
            return;
        }
        match self.mode {
            Mode::Waking | Mode::Driving => {}
            Mode::Off => {
                self.line = FixedPointLine::default();
                self.regulator = Regulator::default();
                self.sums = watch::BlockSums::default();
                self.watch = Watch::default();
                self.is_wild = false;
                self.waking = self.wake_periods;
                self.mode = if self.waking > 0 {
                    Mode::Waking
                } else {
                    Mode::Driving
                };
            }
            Mode::Testing | Mode::Latched => return,
        }
        self.line.go(self.limited(line.to), line.periods);
        self.busy = BUSY_PERIODS;
        self.is_prepared = false;
        self.goes_on = next.is_some();
        if let Some(next) = next {
            self.next = RawLine {
                to: self.limited(next.to),
                ..next
            };
        }
    }

    /// Limits a setpoint to the allowed range of currents.
    fn limited(&self, units: i32) -> i32 {
        units.min(self.current).max(-self.current)
    }

    fn hold(&mut self, units: i32) {
        if self.mode == Mode::Driving && self.holds() {
            self.line.go(self.limited(units), 0);
            self.busy = BUSY_PERIODS;
        }
    }

    /// Whether the line has ended and no other line follows.
    fn holds(&self) -> bool {
        self.line.is_over() && !self.goes_on && self.mode != Mode::Waking
    }

    fn stop(&mut self) {
        if self.mode != Mode::Latched {
            self.mode = Mode::Off;
        }
        self.goes_on = false;
        self.line = FixedPointLine::default();
    }

    /// Switches off until the fault is cleared. A fault that is latched already is kept.
    #[inline(never)]
    fn latch(&mut self, fault: Fault) {
        self.stop();
        if self.mode != Mode::Latched {
            self.mode = Mode::Latched;
            self.fault = fault;
        }
    }

    /// Runs one period. `samples` returns the period's two current samples, taken where the ripple
    /// passes through its mean, or `None` if the converter or its DMA lost some, which latches a
    /// fault in any state. It may wait for the second sample: it is called after the work that needs
    /// no sample. `bridge_faults` says whether the bridge reports a fault. Returns the bridge's
    /// inputs: its sleep input takes effect at once, the levels from the next period on.
    ///
    /// Call it once a period; the levels have to be written before the period ends. Call
    /// [`account`](Self::account) afterwards.
    #[inline(always)]
    pub fn tick(
        &mut self,
        bridge_faults: bool,
        samples: impl FnOnce() -> Option<[u16; 2]>,
    ) -> Output {
        let drives = self.mode == Mode::Driving;
        if drives {
            self.go_on();
        }
        let Some([first, second]) = samples() else {
            self.measured = 0;
            self.latch(Fault::SamplesLost);
            return Output::OFF;
        };
        let (first, second) = (i32::from(first), i32::from(second));
        self.measure(first + second);
        if !drives || self.trips(first) || self.trips(second) || bridge_faults {
            // Assigned field by field, so that the compiler keeps the fields in registers;
            // otherwise it puts the whole `Output` into memory, even on the fast path.
            let Output {
                awake,
                levels,
                limit_low,
            } = self.otherwise([first, second], bridge_faults);
            return Output {
                awake,
                levels,
                limit_low,
            };
        }
        self.is_wild = false;
        Output {
            awake: true,
            levels: self.regulate(),
            limit_low: false,
        }
    }

    /// Sets the measured current from the sum of a period's two samples.
    #[inline]
    fn measure(&mut self, sum: i32) {
        let units = ((sum - self.twice_zero) ^ self.sign) - self.sign;
        self.measured = if self.corrects {
            self.correction.apply(units)
        } else {
            units
        };
    }

    /// Does the rest of the period's work after the levels have been written: adds to the sums, and
    /// checks the sums at the end of a block. Returns whether the bridge has to switch off at once.
    #[inline]
    pub fn account<const N: usize>(&mut self, averages: &Averages<N>) -> bool {
        averages.push(self.measured);
        if self.mode != Mode::Driving {
            return self.wait();
        }
        self.patience -= 1;
        let is_whole = self.sums.push(self.regulator.level, self.measured);
        (is_whole || self.patience == 0) && self.close(is_whole)
    }

    #[inline]
    fn trips(&self, sample: i32) -> bool {
        (sample - self.least) as u32 > self.range
    }

    /// Returns the levels that bring the current to the setpoint, to which `go_on` has advanced.
    #[inline]
    fn regulate(&mut self) -> Levels {
        let measured = self.measured;
        let off = self.line.now() - measured;
        if !(-NEAR..=NEAR).contains(&off) {
            self.busy = BUSY_PERIODS;
        }
        let setpoint = if self.busy > 0 {
            self.busy -= 1;
            self.regulator.step(&self.gains, &self.line, measured)
        } else {
            self.regulator.rest(&self.gains, &self.line, off)
        };
        let level = self.regulator.dither(setpoint, self.top);
        let (level, levels) = self.shaper.shape(level, measured, &self.line);
        self.regulator.level = level;
        levels
    }

    /// Advances to the setpoint of the next period.
    #[inline]
    fn go_on(&mut self) {
        if self.line.is_over() {
            if self.goes_on {
                self.turn();
            } else if self.line.ends() {
                // The level has to be recomputed: during a slope it includes the inductance's
                // voltage, during a hold it does not.
                self.busy = BUSY_PERIODS;
            }
        }
        self.line.advance();
    }

    /// Starts the next line where the present one ends.
    #[inline(never)]
    fn turn(&mut self) {
        if self.is_prepared {
            self.line.follow(&self.ahead);
        } else {
            self.line.go(self.next.to, self.next.periods);
        }
        self.goes_on = false;
        self.busy = BUSY_PERIODS;
    }

    /// Handles the end of a block of periods, or an overdue order of the supervisor. Returns
    /// whether the drive has latched a fault.
    #[inline(never)]
    fn close(&mut self, is_whole: bool) -> bool {
        if self.patience == 0 {
            self.latch(Fault::Unattended);
            return true;
        }
        if !is_whole {
            return false;
        }
        let block = self.sums.take();
        let setpoint = self.line.setpoint();
        let fault = self
            .watch
            .close(&block, &self.gains, &self.bounds, setpoint, self.measured);
        self.report.power = self.report.power.wrapping_add(block.power.into());
        self.report.levels = self.report.levels.wrapping_add(block.levels);
        self.report.units = self.report.units.wrapping_add(block.units);
        self.report.blocks = self.report.blocks.wrapping_add(1);
        if let Some(fault) = fault {
            self.latch(fault);
            return true;
        }
        if self.goes_on && !self.is_prepared {
            self.ahead = self.line.ahead(self.next.to, self.next.periods);
            self.is_prepared = true;
        }
        false
    }

    /// Handles the end of a period without regulation. Returns whether the bridge is awake and an
    /// order from the supervisor is overdue.
    #[inline(never)]
    fn wait(&mut self) -> bool {
        if !matches!(self.mode, Mode::Testing | Mode::Waking) {
            return false;
        }
        self.patience -= 1;
        if self.patience == 0 {
            self.latch(Fault::Unattended);
        }
        self.patience == 0
    }

    /// Handles a period in which the current is not regulated, a sample is beyond the trip level,
    /// or the bridge reports a fault.
    #[inline(never)]
    fn otherwise(&mut self, samples: [i32; 2], bridge_faults: bool) -> Output {
        if matches!(self.mode, Mode::Off | Mode::Latched) {
            return Output::OFF;
        }
        let Some([first, second]) = self.without_wild(samples) else {
            self.tripped = self.measured;
            self.latch(Fault::OverCurrent);
            return Output::OFF;
        };
        self.measure(first + second);
        match self.mode {
            Mode::Testing => self.test(first + second, bridge_faults),
            Mode::Waking => self.wake(),
            _ if bridge_faults => {
                self.latch(Fault::Bridge);
                Output::OFF
            }
            _ => Output {
                awake: true,
                levels: self.regulate(),
                limit_low: false,
            },
        }
    }

    /// Returns the two samples; if one of them is beyond the trip level, it is replaced by the
    /// other, since a single outlier is a converter error. `None` if the current itself is beyond
    /// the trip level: both samples are, or one in each of two successive periods.
    fn without_wild(&mut self, [first, second]: [i32; 2]) -> Option<[i32; 2]> {
        let wild = [first, second].map(|sample| self.can_trip() && self.trips(sample));
        let before = core::mem::replace(&mut self.is_wild, wild != [false; 2]);
        match wild {
            [false, false] => Some([first, second]),
            [true, false] if !before => Some([second; 2]),
            [false, true] if !before => Some([first; 2]),
            _ => None,
        }
    }

    /// Whether the reading without current is known: the trip level is relative to it.
    fn can_trip(&self) -> bool {
        self.mode != Mode::Testing || self.test.twice_zero().is_some()
    }

    /// Handles a period in which the bridge wakes: no voltage is applied yet, and the bridge's
    /// fault output is ignored.
    fn wake(&mut self) -> Output {
        self.go_on();
        self.waking = self.waking.saturating_sub(1);
        if self.waking == 0 {
            self.mode = Mode::Driving;
        }
        Output::WAKING
    }

    #[inline(never)]
    fn test(&mut self, sum: i32, bridge_faults: bool) -> Output {
        let sum = self.reverse(sum);
        let step = self.test.step(sum);
        if let Some(twice_zero) = self.test.twice_zero() {
            self.set_zero(self.reverse(twice_zero));
        }
        match step {
            TestStep::Asleep => Output::OFF,
            TestStep::Waking => Output::WAKING,
            // While the reduced limit is tested, the bridge may report that it limits the current.
            TestStep::On { limit_low, .. } if bridge_faults && !limit_low => {
                self.latch(Fault::Bridge);
                Output::OFF
            }
            TestStep::On {
                levels,
                limit_low,
                power,
            } => {
                self.report.power = self.report.power.wrapping_add(power.into());
                Output {
                    awake: true,
                    levels,
                    limit_low,
                }
            }
            TestStep::Over(Ok(sums)) => {
                self.outcome = Some(sums);
                self.mode = Mode::Off;
                Output::OFF
            }
            TestStep::Over(Err(fault)) => {
                self.latch(fault);
                Output::OFF
            }
        }
    }

    /// Mirrors the sum of two samples about the nominal reading without current if the measurement
    /// is reversed. Applied twice, it returns the original sum.
    fn reverse(&self, sum: i32) -> i32 {
        if self.sign < 0 {
            2 * self.nominal_twice_zero - sum
        } else {
            sum
        }
    }
}
