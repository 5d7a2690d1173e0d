//! The coil: what the tasks request of its drive, and the reports that they receive.

pub mod limits;
pub mod period;
pub mod precedence;

use core::cell::RefCell;

use coil_hbridge::{
    Account, Correction, Fault, Findings, Moment, Refusal, State, Supervisor, Waveform,
};
use critical_section::Mutex;
use palpate_procedure::Instant;
use palpate_procedure::event::Failure;
use palpate_procedure::thermometer::Thermometer;
use palpate_procedure::units::Celsius;
use palpate_wire::code::{FaultCode, Place};
use palpate_wire::command::{CurrentCorrection, MAX_PLACES};
use palpate_wire::record::{CoilTest, CurrentTrace};
use rtic_monotonics::rp2040::prelude::*;

use crate::{Mono, safe};
use limits::{HARDWARE, LIMITS, PERIOD_US};
use period::{AVERAGES, TRACE, TRACE_LENGTH, apply, held};

/// From one look at the drive to the next.
pub const LOOK_US: u64 = 1_000;
/// Looks after which the interrupt rests when the bridge is off: until the means of the last
/// conversions have been asked for.
const RESTS_AFTER: u16 = 200;
/// Looks after which the current has died in any coil, and a current that flows is unwanted.
const DEAD_AFTER: u16 = 20;
/// A current that is no offset, A.
const UNWANTED_A: f32 = 0.5;
/// Looks from one at the slow readings to the next, and from one at the drive, while the interrupt
/// rests: both divide the looks that are counted.
const SELDOM: u8 = 8;
const RARELY: u8 = 64;
/// Part of the difference that a slow reading takes over at each look; all of it where there are
/// few.
const SMOOTHING: f32 = 0.25;
/// Counts of the ADC, and volts of one, of which the middle counts.
const COUNTS: f32 = 4096.0;
const VOLTS_PER_COUNT: f32 = 3.3 / COUNTS;
/// Divider of the coil's supply: 100 kiloohm over 10 kiloohm.
const SUPPLY_RATIO: f32 = 11.0;

/// What belongs to the tasks.
struct Coil {
    supervisor: Supervisor,
    supply_v: f32,
    thermometer: Thermometer,
    /// Whether there is a coil that needs one, driven or not.
    expects_thermometer: bool,
    /// Since when the interrupt runs.
    runs_since_us: Option<u64>,
    looked_us: u64,
    /// Looks; wraps.
    looks: u8,
    /// Looks since the bridge went off.
    off: u16,
    was: State,
    failure: Option<Failure>,
    found: Option<CoilTest>,
    tracing: Option<Tracing>,
}

/// A record of the current under way.
#[derive(Clone, Copy)]
struct Tracing {
    began_us: u64,
    /// Periods from one current to the next.
    every: u32,
    /// Number of currents that have been reported.
    reported: usize,
}

static COIL: Mutex<RefCell<Option<Coil>>> = Mutex::new(RefCell::new(None));

fn with<T>(work: impl FnOnce(&mut Coil) -> T) -> Option<T> {
    critical_section::with(|section| {
        let mut coil = COIL.borrow(section).try_borrow_mut().ok()?;
        coil.as_mut().map(work)
    })
}

/// Starts PWM, ADC and drive; the bridge is off.
pub fn start() {
    let Ok((supervisor, drive)) = Supervisor::new(HARDWARE, LIMITS) else {
        // Constants that do not fit each other: without a drive there is no current.
        return;
    };
    period::start(drive);
    let coil = Coil {
        supervisor,
        supply_v: 0.0,
        thermometer: Thermometer::default(),
        expects_thermometer: false,
        runs_since_us: None,
        looked_us: 0,
        looks: 0,
        off: RESTS_AFTER,
        was: State::Off { tested: false },
        failure: None,
        found: None,
        tracing: None,
    };
    critical_section::with(|section| {
        if let Ok(mut place) = COIL.borrow(section).try_borrow_mut() {
            *place = Some(coil);
        }
    });
}

/// A course of the current.
#[derive(Clone, Copy)]
pub struct Course {
    /// Until when it goes to `from_a`; once that has passed, it does not.
    pub at_us: u64,
    /// Where it is then, A.
    pub from_a: f32,
    /// Where it goes from there, A.
    pub to_a: f32,
    /// In which time, s.
    pub over_s: f32,
}

/// Lets the current take a course from where it is, unless a failure stands that is not known yet
/// where this is wanted.
pub fn go(now_us: u64, course: &Course) {
    with(|coil| {
        if coil.failure.is_none() {
            coil.go(now_us, course);
        }
    });
}

/// Tests bridge, coil and current measurement; under the same condition.
pub fn test(now_us: u64) {
    with(|coil| {
        if coil.failure.is_none() {
            coil.test(now_us);
        }
    });
}

/// Records the current from now on.
pub fn trace(now_us: u64, interval_s: f32) {
    with(|coil| coil.trace(now_us, interval_s));
}

/// A part of the record, with the time of its first current, when the record is over.
pub fn take_trace() -> Option<(u64, CurrentTrace)> {
    with(Coil::take_trace).flatten()
}

/// Corrects the measured current from now on.
pub fn correct(correction: &CurrentCorrection) {
    let mut pairs = heapless::Vec::<[f32; 2], MAX_PLACES>::new();
    for (measured_a, change_a) in correction.places() {
        // There is room for as many as a correction has.
        let _ = pairs.push([measured_a, measured_a + change_a]);
    }
    match Correction::new(&pairs, &HARDWARE) {
        Ok(correction) => apply(&Supervisor::correct(correction)),
        // The protocol's limits are narrower than the driver's: a table that this refuses means
        // that the two no longer agree.
        Err(_) => drop(with(|coil| coil.fails(FaultCode::CurrentSense, None))),
    }
}

/// The bridge is off when this returns, and stays so.
pub fn stop() {
    safe::bridge_off();
    held(|drive| drive.apply(&Supervisor::stop()));
    // Of a test that was stopped nothing is reported.
    with(|coil| coil.found = None);
}

/// Clears a fault, if it is this one that stands.
pub fn clear(code: FaultCode) {
    with(|coil| {
        if coil.failure.is_some_and(|failure| failure.code == code) {
            coil.failure = None;
            held(|drive| drive.apply(&Supervisor::clear()));
        }
    });
}

/// Looks after the drive; once a millisecond.
pub fn look(now_us: u64) {
    with(|coil| coil.look(now_us));
}

/// What has failed, while it stands.
pub fn failure() -> Option<Failure> {
    with(|coil| coil.failure).flatten()
}

/// What a test has found, once.
pub fn take_found() -> Option<CoilTest> {
    with(|coil| coil.found.take()).flatten()
}

/// Supply of the coil, V.
pub fn supply_v() -> Option<f32> {
    with(|coil| coil.supply_v)
}

/// The energy that the coil has taken and not given off yet, as its drive counts it.
pub fn account() -> Option<Account> {
    with(|coil| *coil.supervisor.account())
}

/// Temperature of the coil; nothing without a thermometer.
pub fn temperature() -> Option<Celsius> {
    // Outside of the critical section: the control interrupt does not wait for arithmetic.
    with(|coil| coil.thermometer)?.temperature()
}

/// Whether a thermometer that is open or shorted is a fault while the coil rests, too. While it is
/// tested or driven it always is.
pub fn expect_thermometer(expects: bool) {
    with(|coil| coil.expects_thermometer = expects);
}

/// Mean of the measured current over a past window, A; nothing if it is too old.
pub fn mean_current_a(from_us: u64, to_us: u64) -> Option<f32> {
    let since_us = with(|coil| coil.runs_since_us).flatten();
    // Before the interrupt ran there was none.
    let from = from_us.max(since_us.unwrap_or(u64::MAX));
    if from >= to_us {
        return Some(0.0);
    }
    // A sixteenth of a period is a microsecond.
    const { assert!(PERIOD_US == 16) };
    // Together: a task that came between would shift the window by as long as it runs.
    let (now_us, last, ended_us) = critical_section::with(|_| {
        let (last, ended_us) = period::last();
        (Mono::now().as_ticks(), last, ended_us)
    });
    let at = |time_us: u64| {
        let ago_us = now_us.saturating_sub(time_us) as i32 - ended_us;
        Moment::after(last, -ago_us)
    };
    let (begin, end) = (at(from), at(to_us));
    if begin == end {
        return Some(0.0);
    }
    let mean_a = AVERAGES.mean_a(begin, end, &HARDWARE)?;
    let part = (to_us - from) as f32 / to_us.saturating_sub(from_us).max(1) as f32;
    Some(mean_a * part)
}

/// Root mean square of the ripple about a mean current, A; nothing before a coil is known.
pub fn ripple_a(mean_a: f32) -> Option<f32> {
    let ripple = with(|coil| coil.supervisor.ripple()).flatten()?;
    // Outside of the critical section: the control interrupt does not wait for arithmetic.
    let ripple_a2 = ripple.square_a2(mean_a);
    (ripple_a2 > 0.0).then(|| libm::sqrtf(ripple_a2))
}

impl Coil {
    fn wake(&mut self, now_us: u64) {
        if self.runs_since_us.is_none() {
            self.runs_since_us = Some(now_us);
            self.looked_us = now_us;
            period::run(true);
        }
        self.off = 0;
    }

    fn test(&mut self, now_us: u64) {
        self.wake(now_us);
        let Some(report) = held(|drive| drive.report()) else {
            return;
        };
        match self.supervisor.test(&report, self.supply_v) {
            Ok(order) => apply(&order),
            Err(refusal) => self.refused(&refusal),
        }
    }

    fn trace(&mut self, now_us: u64, interval_s: f32) {
        self.wake(now_us);
        let every = (interval_s / HARDWARE.period_s + 0.5) as u32;
        self.tracing = Some(Tracing {
            began_us: now_us,
            every: every.max(1),
            reported: 0,
        });
        held(|_| TRACE.start(every));
    }

    fn take_trace(&mut self) -> Option<(u64, CurrentTrace)> {
        let tracing = self.tracing.as_mut()?;
        let taken = TRACE.taken();
        // It ends with the interrupt, at the latest.
        if taken < TRACE_LENGTH && self.runs_since_us.is_some() {
            return None;
        }
        let first = tracing.reported;
        let mut currents_a = heapless::Vec::new();
        for current_a in TRACE.currents_a(&HARDWARE).skip(first) {
            if currents_a.push(current_a).is_err() {
                break;
            }
        }
        tracing.reported += currents_a.len();
        let interval_us = tracing.every * PERIOD_US;
        let at_us = tracing.began_us + u64::from(interval_us) * (first as u64 + 1);
        if tracing.reported >= taken {
            self.tracing = None;
        }
        if currents_a.is_empty() {
            return None;
        }
        let trace = CurrentTrace {
            total: taken as u8,
            first: first as u8,
            interval_s: interval_us as f32 * 1e-6,
            currents_a,
        };
        Some((at_us, trace))
    }

    fn go(&mut self, now_us: u64, course: &Course) {
        self.wake(now_us);
        let Some(report) = held(|drive| drive.report()) else {
            return;
        };
        match waveform(course).and_then(|course| self.supervisor.run(&report, &course)) {
            Ok(order) => apply(&order),
            Err(refusal) => self.refused(&refusal),
        }
    }

    /// The drive's own limits forbid what the procedure's allow, or a fault stands.
    fn refused(&mut self, refusal: &Refusal) {
        let (code, value) = match *refusal {
            // It has been reported.
            Refusal::Latched(_) => return,
            Refusal::Energy(energy_j) => (FaultCode::TooMuchEnergy, energy_j),
            Refusal::Duration(duration_s) => (FaultCode::OnTime, duration_s),
            Refusal::Supply(supply_v) if supply_v > LIMITS.supply_v[1] => {
                (FaultCode::SupplyHigh, supply_v)
            }
            Refusal::Supply(supply_v) => (FaultCode::SupplyLow, supply_v),
            Refusal::Current(current_a) => (FaultCode::OverCurrent, current_a),
            _ => (FaultCode::CoilUnknown, 0.0),
        };
        self.fails(code, Some(value));
    }

    fn latched(&mut self, fault: Fault) {
        match (fault, self.supervisor.supply_low_v()) {
            (Fault::SupplyLow, Some([supply_v, needed_v])) => {
                self.fails(FaultCode::SupplyLow, Some(supply_v));
                if let Some(failure) = &mut self.failure {
                    failure.limit = Some(needed_v);
                }
            }
            _ => self.fails(code(fault), None),
        }
    }

    fn fails(&mut self, code: FaultCode, value: Option<f32>) {
        if self.failure.is_none() {
            let (place, limit) = about(code);
            self.failure = Some(Failure {
                code,
                place,
                value,
                limit,
            });
        }
    }

    fn look(&mut self, now_us: u64) {
        self.looks = self.looks.wrapping_add(1);
        self.off = self.off.saturating_add(1);
        let rests = self.runs_since_us.is_none();
        let skips = |every: u8| rests && !self.looks.is_multiple_of(every);
        let (skips_all, skips_the_drive) = (skips(SELDOM), skips(RARELY));
        if skips_all && self.supply_v != 0.0 {
            return;
        }
        self.read(now_us, rests);
        if skips_the_drive {
            return;
        }
        let Some(report) = held(|drive| drive.report()) else {
            return;
        };
        let elapsed_us = now_us.saturating_sub(self.looked_us);
        self.looked_us = now_us;
        let elapsed_us = u32::try_from(elapsed_us).unwrap_or(u32::MAX);
        let order = self.supervisor.attend(&report, self.supply_v, elapsed_us);
        let Some(state) = held(|drive| {
            drive.apply(&order);
            drive.state()
        }) else {
            return;
        };
        self.follow(now_us, state);
    }

    /// Takes the slow readings, of the supply's change a part where they are many.
    fn read(&mut self, now_us: u64, rests: bool) {
        let [thermistor, supply] = period::slow_results().map(|count| f32::from(count) + 0.5);
        let supply_v = SUPPLY_RATIO * VOLTS_PER_COUNT * supply;
        let part = if rests || self.supply_v == 0.0 {
            1.0
        } else {
            SMOOTHING
        };
        if let Some(reading) = period::take_supply_at_off() {
            let reading_v = SUPPLY_RATIO * VOLTS_PER_COUNT * (f32::from(reading) + 0.5);
            self.supervisor.read_supply(reading_v);
        }
        self.supervisor.read_supply(supply_v);
        self.supply_v += part * (supply_v - self.supply_v);
        let now = Instant::from_ticks(now_us);
        let failure = self.thermometer.push(now, thermistor / COUNTS);
        if let Some(failure) = failure
            && (self.expects_thermometer || !rests)
        {
            self.ends(failure);
        }
    }

    /// A failure that the drive does not know of: the bridge goes off before all else.
    fn ends(&mut self, failure: Failure) {
        if self.failure.is_some() {
            return;
        }
        safe::bridge_off();
        held(|drive| drive.apply(&Supervisor::stop()));
        self.failure = Some(failure);
    }

    fn follow(&mut self, now_us: u64, state: State) {
        let before = core::mem::replace(&mut self.was, state);
        match state {
            State::Testing | State::Driving => self.off = 0,
            State::Latched(fault) => {
                if self.supervisor.knows_the_cause() {
                    self.latched(fault);
                }
            }
            State::Off { tested } => {
                // A drive that ends finds nothing new.
                if tested && matches!(before, State::Testing | State::Off { tested: false }) {
                    self.tested();
                }
                self.watch_the_rest(now_us, tested);
            }
        }
    }

    fn tested(&mut self) {
        let Some(Findings {
            zero_count,
            coil,
            limited_to_a,
        }) = self.supervisor.findings().copied()
        else {
            return;
        };
        self.found = Some(CoilTest {
            resistance_ohm: coil.resistance_ohm,
            inductance_h: coil.inductance_h,
            lost: coil.lost,
            zero_v: (zero_count + 0.5) * VOLTS_PER_COUNT,
            supply_v: self.supply_v,
            limited_to_a,
        });
    }

    /// While the bridge is off no current may flow, and after a while the interrupt rests.
    fn watch_the_rest(&mut self, now_us: u64, tested: bool) {
        let Some(_) = self.runs_since_us else {
            return;
        };
        if tested && self.off > DEAD_AFTER {
            let now = AVERAGES.now();
            let since = now.wrapping_sub(32);
            let flows_a = AVERAGES.mean_a(since.into(), now.into(), &HARDWARE);
            if flows_a.is_some_and(|flows_a| flows_a.abs() > UNWANTED_A) {
                self.fails(FaultCode::CurrentUnwanted, flows_a);
            }
        }
        if self.off >= RESTS_AFTER {
            period::run(false);
            self.runs_since_us = None;
            self.looked_us = now_us;
        }
    }
}

/// A course from now on. It is asked for late in a step that may have taken a millisecond.
fn waveform(course: &Course) -> Result<Waveform, Refusal> {
    let ahead_us = course.at_us.saturating_sub(Mono::now().as_ticks());
    let waveform = Waveform::new();
    let waveform = if ahead_us > 0 {
        waveform.line(course.from_a, ahead_us as f32 * 1e-6)?
    } else {
        waveform
    };
    waveform.line(course.to_a, course.over_s)
}

/// The drive's fault as the protocol has it.
const fn code(fault: Fault) -> FaultCode {
    match fault {
        Fault::OverCurrent => FaultCode::OverCurrent,
        Fault::Bridge => FaultCode::Bridge,
        Fault::CurrentMissing => FaultCode::CurrentMissing,
        Fault::CurrentUnexplained | Fault::Short => FaultCode::CoilShort,
        Fault::NotFollowing => FaultCode::CurrentOffTarget,
        Fault::SupplyLow => FaultCode::SupplyLow,
        Fault::SupplyHigh => FaultCode::SupplyHigh,
        Fault::OnTime => FaultCode::OnTime,
        Fault::Energy => FaultCode::TooMuchEnergy,
        Fault::Unattended => FaultCode::Overrun,
        Fault::Offset | Fault::SenseReversed | Fault::SenseFrozen => FaultCode::CurrentSense,
        Fault::Open => FaultCode::CoilOpen,
        Fault::NotACoil => FaultCode::CoilUnknown,
        Fault::NoHardwareLimit => FaultCode::NoHardwareLimit,
    }
}

/// Where a fault is, and what the limit was.
const fn about(code: FaultCode) -> (Place, Option<f32>) {
    match code {
        FaultCode::Bridge | FaultCode::NoHardwareLimit => (Place::Bridge, None),
        FaultCode::SupplyLow => (Place::Supply, Some(LIMITS.supply_v[0])),
        FaultCode::SupplyHigh => (Place::Supply, Some(LIMITS.supply_v[1])),
        FaultCode::OverCurrent => (Place::Coil, Some(LIMITS.trip_a)),
        FaultCode::OnTime => (Place::Coil, Some(LIMITS.on_time_s)),
        FaultCode::TooMuchEnergy => (Place::Coil, Some(LIMITS.energy_j)),
        FaultCode::Overrun => (Place::Processor, None),
        _ => (Place::Coil, None),
    }
}
