//! The half that runs with the PWM: integers only, no wait, the same few steps every period.

use crate::averages::Averages;
use crate::correction::Correction;
use crate::fault::Fault;
use crate::line::{Ahead, FixedPointLine};
use crate::output::{Levels, Output, Shaper};
use crate::regulator::{Gains, Regulator};
use crate::self_test::{SelfTest, TestPlan, TestStep, TestSums};
use crate::watch::{self, ATTENDED_WITHIN, Bounds, Watch};

/// A current that is as near as this to its setpoint, in units, is on track: 0.15 A of
/// the reference board, twice the noise of its converter's worst codes.
const NEAR: i32 = 48;
/// Periods for which the law is asked every time after the current was off its setpoint.
const BUSY_PERIODS: u32 = 16;

/// The period in which it has not looked in time.
const PATIENCE: u32 = ATTENDED_WITHIN + 1;

/// A line in integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RawLine {
    /// Where it ends, units.
    pub(crate) to: i32,
    pub(crate) periods: u32,
}

/// What the supervisor wants. Made by [`Supervisor`](crate::Supervisor) outside of any lock.
#[derive(Clone, Debug)]
pub struct Order(pub(crate) Orders);

#[derive(Clone, Debug)]
pub(crate) enum Orders {
    /// The supervisor has looked, and nothing changes.
    Attended,
    Stop,
    Clear,
    Latch(Fault),
    /// What stands behind the fault that is latched.
    Cause(Fault),
    Test(TestPlan),
    /// What the self-test found: the zero and the law.
    Fit {
        twice_zero: i32,
        gains: Gains,
        coast_q8: i32,
    },
    /// The supply has changed.
    Adapt {
        gains: Gains,
        coast_q8: i32,
    },
    /// To follow a line, and the next one after it.
    Run {
        line: RawLine,
        next: Option<RawLine>,
    },
    /// To hold this current, units, where one is held already.
    Hold(i32),
    Correct(Correction),
}

/// Where a drive stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DriveState {
    /// Off. `tested`: whether it may be driven.
    Off {
        /// The self-test has found a coil.
        tested: bool,
    },
    /// The self-test runs.
    Testing,
    /// The current is regulated.
    Driving,
    /// A fault switched it off.
    Latched(Fault),
}

/// What the supervisor has to know; a copy takes a few cycles.
#[derive(Clone, Copy, Debug)]
pub struct Report {
    /// Where it stands.
    pub state: DriveState,
    /// Whether the line is over, and its last current stays.
    pub holds: bool,
    /// Periods with the bridge on in this run.
    pub on_periods: u32,
    pub(crate) setpoint: i32,
    /// Sums of level times units, of levels, of units, over all whole blocks; they wrap.
    pub(crate) power: i64,
    pub(crate) levels: i32,
    pub(crate) units: i32,
    pub(crate) blocks: u32,
    pub(crate) outcome: Option<TestSums>,
    pub(crate) tripped: i32,
}

/// The drive: from two samples every period it computes the bridge's inputs.
///
/// What every period needs comes first and in this order: the processor reaches 124 bytes from an
/// address in one instruction.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Drive {
    mode: Mode,
    /// Whether the period before had a sample beyond the trip.
    is_wild: bool,
    /// Whether there is a correction.
    corrects: bool,
    /// Whether there is a law.
    tested: bool,
    /// Whether a line follows the present one, which is `next`.
    goes_on: bool,
    /// Two readings without current.
    twice_zero: i32,
    /// -1 where the measurement is reversed, otherwise 0.
    sign: i32,
    /// The least sample that is no trip, and how many more are none.
    least: i32,
    range: u32,
    /// The current of the period.
    measured: i32,
    /// Periods in which the law is asked each time.
    busy: u32,
    /// Periods until the supervisor has to have looked.
    patience: u32,
    shaper: Shaper,
    /// Greatest level.
    top: i32,
    line: FixedPointLine,
    sums: watch::BlockSums,
    regulator: Regulator,
    gains: Gains,
    // From here on for a few periods only.
    /// Periods in which the bridge wakes, and how many are left.
    wake_periods: u16,
    waking: u16,
    correction: Correction,
    next: RawLine,
    /// The same with its division done, if it was prepared.
    ahead: Ahead,
    is_prepared: bool,
    watch: Watch,
    bounds: Bounds,
    /// Current limit and trip, units.
    current: i32,
    trip: i32,
    nominal_twice_zero: i32,
    fault: Fault,
    /// The current that tripped, units.
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
    /// By `test`.
    Testing,
    /// To be driven, once the bridge is awake.
    Waking,
    Driving,
    /// By `fault`.
    Latched,
}

/// What never changes, in integers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fixed {
    pub(crate) current: i32,
    pub(crate) trip: i32,
    pub(crate) bounds: Bounds,
    pub(crate) reversed: bool,
    pub(crate) twice_zero: i32,
    pub(crate) shaper: Shaper,
    /// Greatest level.
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

    /// What the supervisor has to know.
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

    /// Where it stands.
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

    /// The current of the last period, corrected, in units of the driver: what a
    /// [`Trace`](crate::Trace) takes.
    #[inline]
    #[must_use]
    pub const fn measured(&self) -> i32 {
        self.measured
    }

    /// Applies an order. The drive holds the current to its limits whatever the order says.
    pub fn apply(&mut self, order: &Order) {
        self.patience = PATIENCE;
        match &order.0 {
            Orders::Attended => {}
            Orders::Stop => self.stop(),
            Orders::Clear => {
                if self.mode == Mode::Latched {
                    self.mode = Mode::Off;
                    self.tested &= !self.fault.asks_for_a_test();
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
        // Twice a sample less twice the zero is within plus and minus the trip.
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

    /// A current within the limits.
    fn limited(&self, units: i32) -> i32 {
        units.min(self.current).max(-self.current)
    }

    fn hold(&mut self, units: i32) {
        if self.mode == Mode::Driving && self.holds() {
            self.line.go(self.limited(units), 0);
            self.busy = BUSY_PERIODS;
        }
    }

    /// Whether the line is over, and none follows.
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

    /// Off, and so it stays. The first fault stands.
    #[inline(never)]
    fn latch(&mut self, fault: Fault) {
        self.stop();
        if self.mode != Mode::Latched {
            self.mode = Mode::Latched;
            self.fault = fault;
        }
    }

    /// A period: its two samples, taken where the ripple passes through its mean, and whether the
    /// bridge reports a fault. Returns what the bridge is to do: at once where it is to sleep, from
    /// the next period on otherwise.
    ///
    /// To be called once a period, after the second sample; the levels have to be written before
    /// the period ends. [`account`](Self::account) follows.
    #[inline]
    pub fn tick(&mut self, samples: [u16; 2], bridge_faults: bool) -> Output {
        let [first, second] = samples;
        let (first, second) = (i32::from(first), i32::from(second));
        self.measure(first + second);
        if self.mode != Mode::Driving || self.trips(first) || self.trips(second) || bridge_faults {
            // By its parts: the compiler keeps these in registers, where it would put the whole
            // into memory in the other case as well.
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
            levels: self.drive(),
            limit_low: false,
        }
    }

    /// In the place of [`tick`](Self::tick), for a period whose samples are not known: the converter or what
    /// carries its results has lost some, and the others may stand for one another. Returns that the bridge
    /// has to go off, whatever the drive did.
    pub fn lose_samples(&mut self) -> Output {
        self.measured = 0;
        self.latch(Fault::SamplesLost);
        Output::OFF
    }

    /// The current, by the sum of a period's two samples.
    #[inline]
    fn measure(&mut self, sum: i32) {
        let units = ((sum - self.twice_zero) ^ self.sign) - self.sign;
        self.measured = if self.corrects {
            self.correction.apply(units)
        } else {
            units
        };
    }

    /// The rest of the period's work, for which there is time after the levels have been written:
    /// sums, and what is watched over several periods. Returns whether the bridge has to go off at
    /// once.
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

    #[inline]
    fn drive(&mut self) -> Levels {
        self.go_on();
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

    /// The setpoint of the next period.
    #[inline]
    fn go_on(&mut self) {
        if self.line.is_over() {
            if self.goes_on {
                self.turn();
            } else if self.line.ends() {
                // The level of a slope is not that of its end.
                self.busy = BUSY_PERIODS;
            }
        }
        self.line.advance();
    }

    /// At the end of a line: goes on with the next one.
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

    /// The end of a block, or of the supervisor's time. Returns whether that was the end of all.
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

    /// A period without regulation has passed; whether a bridge that is awake has had no order for too
    /// long.
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

    /// A period in which no current is regulated any more, or not yet, or in which something is wrong.
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
                levels: self.drive(),
                limit_low: false,
            },
        }
    }

    /// The two samples, with the other one in the place of one beyond the trip: a single wild sample is
    /// the converter's. Nothing where it is the current: both samples, or one in each of two periods.
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

    /// Whether the reading without current is known, which a trip counts from.
    fn can_trip(&self) -> bool {
        self.mode != Mode::Testing || self.test.twice_zero().is_some()
    }

    /// A period in which the bridge wakes: no voltage yet, and what it reports counts for nothing.
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
            // A bridge may report its limit, which is to act here.
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

    /// Two samples, or two readings without current, as they would be if a measurement that is
    /// reversed were not; and back.
    fn reverse(&self, sum: i32) -> i32 {
        if self.sign < 0 {
            2 * self.nominal_twice_zero - sum
        } else {
            sum
        }
    }
}
