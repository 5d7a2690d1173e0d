//! The half that runs with the PWM: integers only, no wait, the same few steps every period.

use crate::averages::Averages;
use crate::correction::Correction;
use crate::fault::Fault;
use crate::line::{Line, Wanted};
use crate::output::{Output, Shaper};
use crate::regulator::{Gains, Regulator};
use crate::self_test::{Plan, SelfTest, Step, Sums};
use crate::watch::{ATTENDED_WITHIN, Block, Bounds, Watch};
use crate::waveform::MOST_SEGMENTS;

/// A current that is as near as this to where it is wanted, in units, is on its course: 0.15 A of
/// the reference board, twice the noise of its converter's worst codes.
const NEAR: i32 = 48;
/// Periods for which the law is asked every time after the current was off its course.
const BUSY_PERIODS: u32 = 16;

/// A line in integers: where to, in units, and periods.
pub(crate) type Leg = (i32, u32);

/// A waveform in integers.
pub(crate) type Legs = heapless::Vec<Leg, MOST_SEGMENTS>;

/// What the supervisor wants. Made by [`Supervisor`](crate::Supervisor) outside of any lock.
#[derive(Clone, Debug)]
pub struct Order(pub(crate) Orders);

#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "an order lives for a moment, and there is no heap to put a waveform on"
)]
pub(crate) enum Orders {
    /// The supervisor has looked, and nothing changes.
    Attended,
    Stop,
    Clear,
    Latch(Fault),
    Test(Plan),
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
    Run(Legs),
    Correct(Correction),
}

/// Where a drive stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
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
    pub state: State,
    /// Whether the waveform is over and its last current is held.
    pub holds: bool,
    /// Periods with the bridge on in this run.
    pub on_periods: u32,
    pub(crate) wanted: i32,
    /// Sums of level times units, of levels, of units, over all whole blocks; they wrap.
    pub(crate) power: i64,
    pub(crate) levels: i32,
    pub(crate) units: i32,
    pub(crate) blocks: u32,
    pub(crate) outcome: Option<Sums>,
}

/// The drive: told of two samples every period, it says what the bridge is to do.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Current limit and trip, units.
    current: i32,
    trip: i32,
    bounds: Bounds,
    reversed: bool,
    nominal_twice_zero: i32,
    twice_zero: i32,
    gains: Option<Gains>,
    correction: Option<Correction>,
    shaper: Shaper,
    state: Mode,
    line: Line,
    legs: Legs,
    next: usize,
    regulator: Regulator,
    watch: Watch,
    /// The current of the period, and the level and the current that are wanted of the next.
    measured: i32,
    level: i32,
    wanted: Wanted,
    /// Periods in which the law is asked each time.
    busy: u32,
    unattended: u32,
    report: Sum,
    outcome: Option<Sums>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    power: i64,
    levels: i32,
    units: i32,
    blocks: u32,
}

#[derive(Clone, Copy, Debug)]
enum Mode {
    Off,
    Testing(SelfTest),
    Driving,
    Latched(Fault),
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
}

impl Drive {
    pub(crate) fn new(fixed: Fixed) -> Self {
        Self {
            current: fixed.current,
            trip: fixed.trip,
            bounds: fixed.bounds,
            reversed: fixed.reversed,
            nominal_twice_zero: fixed.twice_zero,
            twice_zero: fixed.twice_zero,
            gains: None,
            correction: None,
            shaper: fixed.shaper,
            state: Mode::Off,
            line: Line::default(),
            legs: Legs::new(),
            next: 0,
            regulator: Regulator::default(),
            watch: Watch::default(),
            measured: 0,
            level: 0,
            wanted: Wanted::default(),
            busy: 0,
            unattended: 0,
            report: Sum::default(),
            outcome: None,
        }
    }

    /// What the supervisor has to know.
    #[must_use]
    pub fn report(&self) -> Report {
        Report {
            state: self.state(),
            holds: self.line.is_over() && self.next >= self.legs.len(),
            on_periods: self.watch.on(),
            wanted: self.line.now(),
            power: self.report.power,
            levels: self.report.levels,
            units: self.report.units,
            blocks: self.report.blocks,
            outcome: self.outcome,
        }
    }

    /// Where it stands.
    #[must_use]
    pub fn state(&self) -> State {
        match self.state {
            Mode::Off => State::Off {
                tested: self.gains.is_some(),
            },
            Mode::Testing(_) => State::Testing,
            Mode::Driving => State::Driving,
            Mode::Latched(fault) => State::Latched(fault),
        }
    }

    /// The current of the last period, corrected, in units of the driver: what a
    /// [`Trace`](crate::Trace) takes.
    #[inline]
    #[must_use]
    pub const fn measured(&self) -> i32 {
        self.measured
    }

    /// Takes an order. What a limit forbids is held to it, whoever made the order.
    pub fn obey(&mut self, order: &Order) {
        self.unattended = 0;
        match &order.0 {
            Orders::Attended => {}
            Orders::Stop => self.stop(),
            Orders::Clear => {
                if let Mode::Latched(fault) = self.state {
                    self.state = Mode::Off;
                    if fault.asks_for_a_test() {
                        self.gains = None;
                    }
                }
            }
            Orders::Latch(fault) => self.latch(*fault),
            Orders::Test(plan) => {
                if matches!(self.state, Mode::Off) {
                    self.gains = None;
                    self.twice_zero = self.nominal_twice_zero;
                    self.outcome = None;
                    self.state = Mode::Testing(SelfTest::new(*plan));
                }
            }
            Orders::Fit {
                twice_zero,
                gains,
                coast_q8,
            } => {
                self.outcome = None;
                self.twice_zero = *twice_zero;
                self.gains = Some(*gains);
                self.shaper.coast_q8 = *coast_q8;
            }
            Orders::Adapt { gains, coast_q8 } => {
                if self.gains.is_some() {
                    self.gains = Some(*gains);
                    self.shaper.coast_q8 = *coast_q8;
                }
            }
            Orders::Run(legs) => self.run(legs),
            Orders::Correct(correction) => {
                self.correction = (*correction != Correction::NONE).then_some(*correction);
            }
        }
    }

    fn run(&mut self, legs: &Legs) {
        if self.gains.is_none() {
            return;
        }
        match self.state {
            Mode::Driving => {}
            Mode::Off => {
                self.line = Line::default();
                self.regulator = Regulator::default();
                self.watch = Watch::default();
                self.state = Mode::Driving;
            }
            Mode::Testing(_) | Mode::Latched(_) => return,
        }
        self.legs.clone_from(legs);
        self.next = 0;
        self.leg();
    }

    fn stop(&mut self) {
        if !matches!(self.state, Mode::Latched(_)) {
            self.state = Mode::Off;
        }
        self.legs.clear();
        self.next = 0;
        self.line = Line::default();
    }

    /// Off, and so it stays. The first fault stands.
    fn latch(&mut self, fault: Fault) {
        self.stop();
        if !matches!(self.state, Mode::Latched(_)) {
            self.state = Mode::Latched(fault);
        }
    }

    /// The next line of the waveform.
    fn leg(&mut self) {
        if let Some(&(to, periods)) = self.legs.get(self.next) {
            self.line
                .go(to.min(self.current).max(-self.current), periods);
            self.next += 1;
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
        let units = self.sign(first + second - self.twice_zero);
        self.measured = match &self.correction {
            Some(correction) => correction.apply(units),
            None => units,
        };
        match self.state {
            Mode::Driving => {
                if self.trips(first) || self.trips(second) {
                    self.latch(Fault::OverCurrent);
                    return Output::OFF;
                }
                if bridge_faults {
                    self.latch(Fault::Bridge);
                    return Output::OFF;
                }
                self.drive()
            }
            Mode::Off | Mode::Latched(_) => Output::OFF,
            Mode::Testing(_) => self.test([first, second], bridge_faults),
        }
    }

    /// The rest of the period's work, for which there is time after the levels have been written:
    /// sums, and what is watched over several periods. Returns whether the bridge has to go off at
    /// once.
    #[inline]
    pub fn account<const N: usize>(&mut self, averages: &Averages<N>) -> bool {
        averages.push(self.measured);
        if matches!(self.state, Mode::Off | Mode::Latched(_)) {
            return false;
        }
        self.unattended += 1;
        if self.unattended > ATTENDED_WITHIN {
            self.latch(Fault::Unattended);
            return true;
        }
        if matches!(self.state, Mode::Driving)
            && self.watch.push(self.level, self.measured)
            && let Some(fault) = self.close()
        {
            self.latch(fault);
            return true;
        }
        false
    }

    #[inline]
    fn trips(&self, sample: i32) -> bool {
        let twice = 2 * sample - self.twice_zero;
        twice > self.trip || twice < -self.trip
    }

    #[inline]
    fn sign(&self, units: i32) -> i32 {
        if self.reversed { -units } else { units }
    }

    #[inline]
    fn drive(&mut self) -> Output {
        let Some(gains) = &self.gains else {
            self.stop();
            return Output::OFF;
        };
        if self.line.is_over()
            && let Some(&(to, periods)) = self.legs.get(self.next)
        {
            self.line
                .go(to.min(self.current).max(-self.current), periods);
            self.next += 1;
            self.busy = BUSY_PERIODS;
        }
        let wanted = self.line.advance();
        let measured = self.measured;
        let off = (wanted.at_q4 >> 4) - measured;
        if !(-NEAR..=NEAR).contains(&off) {
            self.busy = BUSY_PERIODS;
        }
        let level = if self.busy > 0 {
            self.busy -= 1;
            self.regulator.step(gains, wanted, measured)
        } else {
            self.regulator.rest(gains, wanted, off)
        };
        let (level, levels) = self.shaper.shape(level, measured, wanted.at_q4);
        self.regulator.given(level);
        self.level = level;
        self.wanted = wanted;
        Output {
            awake: true,
            levels,
            limit_low: false,
        }
    }

    #[inline(never)]
    fn close(&mut self) -> Option<Fault> {
        let gains = self.gains.as_ref()?;
        let (block, fault) = self
            .watch
            .close(gains, &self.bounds, self.wanted, self.measured);
        let Block {
            levels,
            units,
            power,
        } = block;
        self.report.power = self.report.power.wrapping_add(power.into());
        self.report.levels = self.report.levels.wrapping_add(levels);
        self.report.units = self.report.units.wrapping_add(units);
        self.report.blocks = self.report.blocks.wrapping_add(1);
        fault
    }

    #[inline(never)]
    fn test(&mut self, [first, second]: [i32; 2], bridge_faults: bool) -> Output {
        let trips = self.trips(first) || self.trips(second);
        let Mode::Testing(test) = &mut self.state else {
            return Output::OFF;
        };
        if trips && test.twice_zero().is_some() {
            self.latch(Fault::OverCurrent);
            return Output::OFF;
        }
        let sum = first + second;
        let sum = if self.reversed {
            2 * self.nominal_twice_zero - sum
        } else {
            sum
        };
        let step = test.step(sum);
        if let Some(twice_zero) = test.twice_zero() {
            self.twice_zero = if self.reversed {
                2 * self.nominal_twice_zero - twice_zero
            } else {
                twice_zero
            };
        }
        match step {
            Step::Asleep => Output::OFF,
            // A bridge may report its limit, which is to act here.
            Step::On { limit_low, .. } if bridge_faults && !limit_low => {
                self.latch(Fault::Bridge);
                Output::OFF
            }
            Step::On {
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
            Step::Over(Ok(sums)) => {
                self.outcome = Some(sums);
                self.state = Mode::Off;
                Output::OFF
            }
            Step::Over(Err(fault)) => {
                self.latch(fault);
                Output::OFF
            }
        }
    }
}
