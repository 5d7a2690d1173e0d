//! Coil manager: gives requests to the drive and reports its results.
//!
//! The board's control interrupt runs the drive every period. The manager is above it: it starts and
//! stops that interrupt, gives orders to the drive, polls it a thousand times a second, reads supply and
//! thermistor, and maps failures to faults of the protocol.

#[cfg(test)]
mod bench;
mod faults;
mod hardware;
mod kept;
mod tracing;

use coil_hbridge::{
    Account, Correction, CurrentLine, DriveState, Findings, Moment, Refusal, Supervisor,
};
use palpate_procedure::Instant;
use palpate_procedure::event::Failure;
use palpate_procedure::thermometer::Thermometer;
use palpate_procedure::units::Celsius;
use palpate_wire::code::FaultCode;
use palpate_wire::command::{CurrentCorrection, MAX_POINTS};
use palpate_wire::record::{CoilTest, CurrentTrace};

pub use hardware::{
    AVERAGED_BLOCKS, CoilCircuit, CoilHardware, LastPeriod, SlowReadings, TRACE_LENGTH,
};
pub use kept::EnergyWords;
use tracing::Tracing;

/// Period of polling the drive, us.
pub const POLL_US: u64 = 1_000;
/// Number of polls from switching the bridge off to disabling the control interrupt: by then the mean
/// currents of the last conversions have been read.
const RESTS_AFTER: u16 = 200;
/// Number of polls after the bridge went off by which the current of any coil has decayed: a current
/// after that is a fault.
const DEAD_AFTER: u16 = 20;
/// Lowest current that counts as unwanted and not as an offset, A.
const UNWANTED_A: f32 = 0.5;
/// Number of bridge periods over which the current is averaged to detect an unwanted one.
const UNWANTED_PERIODS: u32 = 32;
/// While the control interrupt is disabled: number of polls between two readings of thermistor and
/// supply. The range of the poll counter is a multiple of this number.
const SELDOM: u8 = 8;
/// While the control interrupt is disabled: number of polls between two reports of the drive. The range
/// of the poll counter is a multiple of this number.
const RARELY: u8 = 64;
/// Weight of a new reading in the exponential smoothing of the supply voltage; 1 while readings are
/// rare.
const SMOOTHING: f32 = 0.25;
/// Number of units of [`Moment`] in a bridge period.
const SIXTEENTHS: i64 = 16;

/// Manager of the coil's drive.
#[derive(Debug)]
pub struct CoilManager<H> {
    hardware: H,
    supervisor: Supervisor,
    supply_v: f32,
    /// Last reading of the coil's supply, V, unfiltered.
    read_v: f32,
    thermometer: Thermometer,
    /// A coil that needs a thermometer is attached: the thermometer's faults count also while the coil
    /// is not driven.
    expects_thermometer: bool,
    /// Start time of the control interrupt; `None` while it is disabled.
    runs_since_us: Option<u64>,
    polled_us: u64,
    /// Number of polls; wraps.
    polls: u8,
    /// Number of polls since the bridge went off.
    off: u16,
    was: DriveState,
    failure: Option<Failure>,
    found: Option<CoilTest>,
    tracing: Option<Tracing>,
}

impl<H: CoilHardware> CoilManager<H> {
    const PERIOD_US: i64 = H::CIRCUIT.period_us() as i64;

    /// Creates a manager of a drive that the control interrupt already owns. The energy account of the
    /// previous run continues.
    pub fn new(hardware: H, mut supervisor: Supervisor) -> Self {
        if let Some(energy_j) = kept::energy_j(hardware.kept_energy()) {
            supervisor.charge(energy_j);
        }
        Self {
            hardware,
            supervisor,
            supply_v: 0.0,
            read_v: 0.0,
            thermometer: Thermometer::default(),
            expects_thermometer: false,
            runs_since_us: None,
            polled_us: 0,
            polls: 0,
            off: RESTS_AFTER,
            was: DriveState::Off { tested: false },
            failure: None,
            found: None,
            tracing: None,
        }
    }

    // ---- requests ----

    /// Lets the current follow a line. Ignores the line while a failure is latched: the procedure may have
    /// made its request before it received the failure.
    #[inline(never)]
    pub fn follow(&mut self, line: &CurrentLine) {
        if self.failure.is_some() {
            return;
        }
        self.wake();
        let Some(report) = self.hardware.with_drive(|drive| drive.report()) else {
            return;
        };
        // The time is read here, since a step of the procedure may take up to a millisecond before it
        // makes this request.
        let clock = || self.hardware.now_us();
        match self.supervisor.follow(&report, line, clock) {
            Ok(order) => self.hardware.apply(&order),
            Err(refusal) => self.refused(&refusal),
        }
    }

    /// Tests bridge, coil and current measurement, unless a failure is latched.
    #[inline(never)]
    pub fn test(&mut self) {
        if self.failure.is_some() {
            return;
        }
        self.wake();
        let Some(report) = self.hardware.with_drive(|drive| drive.report()) else {
            return;
        };
        match self.supervisor.test(&report, self.supply_v) {
            Ok(order) => self.hardware.apply(&order),
            Err(refusal) => self.refused(&refusal),
        }
    }

    /// Starts a trace of the current with a value every `interval_s`.
    pub fn trace(&mut self, interval_s: f32) {
        self.wake();
        let now_us = self.hardware.now_us();
        let tracing = Tracing::new(now_us, interval_s, &H::CIRCUIT.hardware);
        let trace = self.hardware.trace();
        trace.start(tracing.every());
        self.tracing = Some(tracing);
    }

    /// Corrects the measured current from now on.
    #[inline(never)]
    pub fn correct(&mut self, correction: &CurrentCorrection) {
        let mut pairs = heapless::Vec::<[f32; 2], MAX_POINTS>::new();
        for (measured_a, change_a) in correction.points() {
            // There is space for all pairs of a correction.
            let _ = pairs.push([measured_a, measured_a + change_a]);
        }
        match Correction::new(&pairs, &H::CIRCUIT.hardware) {
            Ok(correction) => self.hardware.apply(&Supervisor::correct(correction)),
            // The protocol's limits are narrower than the driver's: a table refused here means that the
            // two do not agree.
            Err(_) => self.fail(FaultCode::CurrentSense, None),
        }
    }

    /// Switches the bridge off before this returns; the bridge stays off.
    pub fn stop(&mut self) {
        self.switch_off();
        // A stopped test reports no result.
        self.found = None;
    }

    /// Clears the latched failure if it has this code.
    pub fn clear(&mut self, code: FaultCode) {
        if self.failure.is_some_and(|failure| failure.code == code) {
            self.failure = None;
            let clear = Supervisor::clear();
            self.hardware.with_drive(|drive| drive.apply(&clear));
        }
    }

    /// Sets whether an open or shorted thermometer is a fault while the coil is not driven. During a
    /// test or a drive it always is.
    pub const fn expect_thermometer(&mut self, expects: bool) {
        self.expects_thermometer = expects;
    }

    // ---- reports ----

    /// Returns whether the bridge is proven off: long enough for the control interrupt to be disabled,
    /// with no current measured since.
    pub const fn rests(&self) -> bool {
        self.runs_since_us.is_none()
    }

    /// Returns the latched failure.
    pub const fn failure(&self) -> Option<Failure> {
        self.failure
    }

    /// Returns whether a test result or a part of a trace is available.
    pub fn has_found(&self) -> bool {
        self.found.is_some() || self.has_trace()
    }

    /// Returns whether a trace is complete: with its last value, or because the interrupt was disabled.
    fn has_trace(&self) -> bool {
        let is_over =
            || self.runs_since_us.is_none() || self.hardware.trace().taken() >= TRACE_LENGTH;
        self.tracing.is_some() && is_over()
    }

    /// Takes the result of a test; `None` on later calls.
    pub const fn take_found(&mut self) -> Option<CoilTest> {
        self.found.take()
    }

    /// Takes a part of a complete trace, with the time of its first value.
    pub fn take_trace(&mut self) -> Option<(u64, CurrentTrace)> {
        if !self.has_trace() {
            return None;
        }
        let tracing = self.tracing.as_mut()?;
        let trace = self.hardware.trace();
        let taken = trace.taken();
        let part = tracing.part(trace, taken, &H::CIRCUIT.hardware);
        if tracing.is_over(taken) {
            self.tracing = None;
        }
        part
    }

    /// Returns the supply of the coil, V.
    pub const fn supply_v(&self) -> f32 {
        self.supply_v
    }

    /// Returns the temperature of the coil; `None` without a thermometer.
    pub fn temperature(&self) -> Option<Celsius> {
        self.thermometer.temperature()
    }

    /// Returns the energy that the coil has taken and not yet given off, as its drive counts it.
    pub const fn account(&self) -> Account {
        *self.supervisor.account()
    }

    /// Returns the mean of the measured current over a past window, A; `None` if the window is too old.
    pub fn mean_current_a(&self, from_us: u64, to_us: u64) -> Option<f32> {
        // Before the interrupt was enabled there was no current.
        let driven_from_us = from_us.max(self.runs_since_us.unwrap_or(u64::MAX));
        if driven_from_us >= to_us {
            return Some(0.0);
        }
        let last = self.hardware.last_period();
        let moment = |time_us: u64| {
            let after_us = (time_us as i64).saturating_sub(last.ended_us as i64);
            let sixteenths = after_us * SIXTEENTHS / Self::PERIOD_US;
            Moment::after(last.number, i32::try_from(sixteenths).unwrap_or(i32::MIN))
        };
        let (begin, end) = (moment(driven_from_us), moment(to_us));
        if begin == end {
            return Some(0.0);
        }
        let averages = self.hardware.averages();
        let mean_a = averages.mean_a(begin, end, &H::CIRCUIT.hardware)?;
        let window_us = to_us.saturating_sub(from_us).max(1);
        let driven_part = (to_us - driven_from_us) as f32 / window_us as f32;
        Some(mean_a * driven_part)
    }

    /// Returns the RMS ripple about a mean current, A; `None` before a coil is known.
    pub fn ripple_a(&self, mean_a: f32) -> Option<f32> {
        let ripple_a2 = self.supervisor.ripple()?.square_a2(mean_a);
        (ripple_a2 > 0.0).then(|| libm::sqrtf(ripple_a2))
    }

    // ---- every millisecond ----

    /// Polls the drive and the slow readings; call it every [`POLL_US`].
    pub fn poll(&mut self) {
        self.polls = self.polls.wrapping_add(1);
        self.off = self.off.saturating_add(1);
        let rests = self.runs_since_us.is_none();
        let skips = |every: u8| rests && !self.polls.is_multiple_of(every);
        let (skips_all, skips_the_drive) = (skips(SELDOM), skips(RARELY));
        if skips_all && self.supply_v != 0.0 {
            return;
        }
        self.read(rests);
        if skips_the_drive {
            return;
        }
        let Some(report) = self.hardware.with_drive(|drive| drive.report()) else {
            return;
        };
        let now_us = self.hardware.now_us();
        let elapsed_us = now_us.saturating_sub(self.polled_us);
        self.polled_us = now_us;
        let elapsed_us = u32::try_from(elapsed_us).unwrap_or(u32::MAX);
        let order = self.supervisor.attend(&report, self.supply_v, elapsed_us);
        let energy_j = self.supervisor.account().energy_j();
        self.hardware.keep_energy(kept::words(energy_j));
        let state = self.hardware.with_drive(|drive| {
            drive.apply(&order);
            drive.state()
        });
        if let Some(state) = state {
            self.changed(state);
        }
    }

    /// Takes the readings of thermistor and supply; smooths the supply while readings are frequent.
    fn read(&mut self, rests: bool) {
        let SlowReadings { thermistor, supply } = self.hardware.slow_readings();
        let supply_v = H::CIRCUIT.supply_v(supply);
        if let Some(reading) = self.hardware.take_supply_at_off() {
            self.supervisor.read_supply(H::CIRCUIT.supply_v(reading));
        }
        self.supervisor.read_supply(supply_v);
        let read_v = core::mem::replace(&mut self.read_v, supply_v);
        let is_first = self.supply_v == 0.0;
        let part = if rests || is_first { 1.0 } else { SMOOTHING };
        let off_v = |of_v: f32| of_v - self.supply_v;
        // A single outlier is an error of the ADC, so of the last two readings the one nearer to the
        // smoothed supply is used.
        self.supply_v += part
            * if is_first || off_v(supply_v).abs() <= off_v(read_v).abs() {
                off_v(supply_v)
            } else {
                off_v(read_v)
            };
        let now = Instant::from_ticks(self.hardware.now_us());
        let ratio = (f32::from(thermistor) + 0.5) / H::CIRCUIT.counts;
        let failure = self.thermometer.push(now, ratio);
        if let Some(failure) = failure
            && (self.expects_thermometer || !rests)
            && self.failure.is_none()
        {
            // The drive does not detect a failed thermometer by itself, so the bridge is switched off
            // first.
            self.switch_off();
            self.failure = Some(failure);
        }
    }

    fn changed(&mut self, state: DriveState) {
        let before = core::mem::replace(&mut self.was, state);
        match state {
            DriveState::Testing | DriveState::Driving => self.off = 0,
            DriveState::Latched(fault) => {
                if self.supervisor.is_cause_known() {
                    let found = self.supervisor.value_and_limit(fault);
                    let limits = &H::CIRCUIT.limits;
                    self.failed(faults::latched(fault, found, limits));
                }
            }
            DriveState::Off { tested } => {
                // Only the end of a test has a new result; the end of a drive has none.
                if tested
                    && matches!(
                        before,
                        DriveState::Testing | DriveState::Off { tested: false }
                    )
                {
                    self.tested();
                }
                self.watch_the_rest(tested);
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
            lost: coil.dead_time_share,
            zero_v: H::CIRCUIT.volts(zero_count),
            supply_v: self.supply_v,
            limited_to_a,
        });
    }

    /// Checks that no current flows while the bridge is off, and after a while disables the interrupt.
    fn watch_the_rest(&mut self, tested: bool) {
        if self.runs_since_us.is_none() {
            return;
        }
        if tested && self.off > DEAD_AFTER {
            let averages = self.hardware.averages();
            let now = averages.now();
            let since = now.wrapping_sub(UNWANTED_PERIODS);
            let flows_a = averages.mean_a(since.into(), now.into(), &H::CIRCUIT.hardware);
            if flows_a.is_some_and(|flows_a| flows_a.abs() > UNWANTED_A) {
                self.fail(FaultCode::CurrentUnwanted, flows_a);
            }
        }
        if self.off >= RESTS_AFTER {
            self.hardware.run(false);
            self.runs_since_us = None;
            self.polled_us = self.hardware.now_us();
        }
    }

    // ---- internal steps ----

    fn wake(&mut self) {
        if self.runs_since_us.is_none() {
            let now_us = self.hardware.now_us();
            self.runs_since_us = Some(now_us);
            self.polled_us = now_us;
            self.hardware.run(true);
        }
        self.off = 0;
    }

    fn switch_off(&mut self) {
        self.hardware.bridge_off();
        let stop = Supervisor::stop();
        self.hardware.with_drive(|drive| drive.apply(&stop));
    }

    fn refused(&mut self, refusal: &Refusal) {
        if let Some(failure) = faults::refused(refusal, &H::CIRCUIT.limits) {
            self.failed(failure);
        }
    }

    fn fail(&mut self, code: FaultCode, value: Option<f32>) {
        self.failed(faults::failure(code, value, &H::CIRCUIT.limits));
    }

    /// Latches the first failure until it is cleared.
    const fn failed(&mut self, failure: Failure) {
        if self.failure.is_none() {
            self.failure = Some(failure);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::bench::{SUPPLY_12_V, run};

    /// At rest the supply is read every eight polls.
    #[test]
    fn one_wild_reading_of_the_supply_is_none_and_two_are_the_supply() {
        let mut manager = run([0; 2]);
        let mut read = |supply: u16| {
            manager.hardware.supply = supply;
            (0..8).for_each(|_| manager.poll());
            manager.supply_v()
        };
        let twelve_v = read(SUPPLY_12_V);
        assert!((twelve_v - 12.0).abs() < 0.01, "{twelve_v}");
        for wild in [0, 4_095] {
            assert_eq!(read(wild), twelve_v);
            assert_eq!(read(SUPPLY_12_V), twelve_v);
        }
        let lower = SUPPLY_12_V / 2;
        assert_eq!(read(lower), twelve_v);
        assert!((read(lower) - 6.0).abs() < 0.01);
    }
}
