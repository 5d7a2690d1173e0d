//! Instrument: passes samples, commands and time to the procedure, and carries out its actions.

use heapless::Vec;
use palpate_procedure::boot::Boot;
use palpate_procedure::event::{Conditions, Failure};
use palpate_procedure::storage::{StorageOrder, StorageReport};
use palpate_procedure::units::Ampere;
use palpate_procedure::{
    Action, Actions, BoardInfo, Conversion, Duration, Event, Instant, Link, Procedure, Scan,
};
use palpate_wire::code::{Chip, FaultCode, Location, RebootTarget};
use palpate_wire::command::{Command, Settings};
use palpate_wire::record::{Acknowledgement, Hello};
use palpate_wire::schema::{Described, field_number};
use palpate_wire::{
    Frame, FrameError, Invalid, MINOR_VERSION, Message, Problem, Record, SCHEMA_HASH,
};

use crate::acquisition::{Sampled, Scheme, Setpoint, rates_hz};
use crate::coil::{CoilHardware, CoilManager};
use crate::converter::{CONVERTERS, ConverterState};

/// Period at which the procedure receives temperature, supply and load, us.
const CONDITIONS_US: u64 = 100_000;
/// Mask of the channels of an LDC1614: bit n for channel n.
const CHANNELS: u8 = 0b1111;
/// Number of failure sources: each converter and the coil.
const SOURCES: usize = CONVERTERS + 1;
const COIL: usize = CONVERTERS;
/// Maximum number of faults that are reported at a time.
const MOST_REPORTED: usize = 12;
/// Time from the restart command to the restart, us: long enough for the answer to reach a PC that polls
/// only ten times a second, the slowest sensible rate.
const RESTART_AFTER_US: u64 = 200_000;

/// Number of the field `rate_hz` in the settings.
const RATE_FIELD: u8 = field_number(&<Settings as Described>::TYPE, "rate_hz");

/// A received command frame, or the error of an undecodable one.
pub type Received = Result<Frame<Command>, FrameError>;

/// Facts of the board that are known when the instrument starts.
#[derive(Clone, Debug)]
pub struct Identity {
    /// Random boot id of this run, never 0.
    pub boot_id: u32,
    /// Board, build and reset cause. The instrument fills in the converter chips, the protocol version
    /// and the schema hash.
    pub hello: Hello,
    /// Boot cause and crash record.
    pub boot: Boot,
    /// All clocks run as configured.
    pub clocks_run: bool,
    /// There is a storage for settings and calibration.
    pub storage: bool,
    /// Hard limits of every setting, command and calibration.
    pub limits: palpate_procedure::Limits,
}

/// Resource usage of the processor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// Time that the processor slept since start-up, us; wraps. `None` without a processor.
    pub asleep_us: Option<u32>,
    /// Greatest stack depth, bytes; 0 if it is not measured.
    pub stack_bytes: u32,
    /// Number of log messages dropped since start-up.
    pub logs_dropped: u32,
}

/// Board functions that the instrument needs.
pub trait Hardware {
    /// Coil hardware.
    type Coil: CoilHardware;

    /// Returns the time of the board's timer, us.
    fn now_us(&self) -> u64;

    /// Gives `work` access to the coil manager. Returns `None` on a board whose drive could not start:
    /// its coil is never driven.
    fn with_coil<T>(&mut self, work: impl FnOnce(&mut CoilManager<Self::Coil>) -> T) -> Option<T>;

    /// Gives `work` access to the state that the instrument shares with the converter tasks.
    fn with_converters<T>(
        &mut self,
        work: impl FnOnce(&mut [ConverterState; CONVERTERS]) -> T,
    ) -> T;

    /// Sends a record and its time over one link, or over all of them. Never waits: each link drops a
    /// record for which it has no space, and counts it.
    fn send(&mut self, to: Option<Link>, at_us: u64, record: &Record);

    /// Gives an order to the storage, whose last order must be complete; pass its reports to
    /// [`Instrument::stored`].
    fn order(&mut self, order: StorageOrder);

    /// Restarts the device. The bridge is off.
    fn restart(&mut self, target: RebootTarget);

    /// Lets the LED flicker for `for_us` microseconds.
    fn locate(&mut self, for_us: u64);

    /// Returns the resource usage of the processor so far.
    fn usage(&mut self) -> Usage;
}

/// Procedure and its connections.
#[derive(Debug)]
pub struct Instrument {
    /// The procedure, once the converters are known.
    procedure: Option<Procedure>,
    /// Actions of the last step.
    actions: Actions,
    /// Failures reported to the procedure that have not ended.
    standing: [Option<FaultCode>; SOURCES],
    /// Faults reported by the procedure that have not ended, with their locations.
    reported: Vec<(FaultCode, Location), MOST_REPORTED>,
    /// All clocks run as configured, or a failed one has been reported.
    clocks_run: bool,
    /// Order that waits for the bridge to be proven off.
    order: Option<StorageOrder>,
    /// Target and time of a requested restart. The time leaves enough time to send the last answer.
    restart: Option<(RebootTarget, u64)>,
    conditions_due_us: u64,
    /// Time at which the procedure last received conditions, us, and the time that the processor had
    /// slept up to then, us.
    last_conditions: (u64, u32),
}

impl Default for Instrument {
    fn default() -> Self {
        Self::new()
    }
}

impl Instrument {
    /// Creates an instrument that has not started.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            procedure: None,
            actions: Actions::new(),
            standing: [None; SOURCES],
            reported: Vec::new(),
            clocks_run: true,
            order: None,
            restart: None,
            conditions_due_us: 0,
            last_conditions: (0, 0),
        }
    }

    /// Returns the procedure, read-only.
    #[must_use]
    pub const fn procedure(&self) -> Option<&Procedure> {
        self.procedure.as_ref()
    }

    /// Returns whether all converters have been asked for their identity, so that the instrument may
    /// start.
    pub fn is_ready<H: Hardware>(hardware: &mut H) -> bool {
        hardware.with_converters(|converters| {
            converters
                .iter()
                .all(|converter| converter.chip().is_some())
        })
    }

    /// Starts the instrument. A converter that has not answered yet counts as absent. Stored settings
    /// and calibration are applied first; then [`has_begun`](Self::has_begun) returns `true`.
    pub fn begin<H: Hardware>(&mut self, hardware: &mut H, identity: Identity) {
        self.clocks_run = identity.clocks_run;
        self.make(hardware, identity);
        self.step(hardware, &Event::Tick);
        self.report_clocks(hardware);
    }

    /// Returns whether the instrument has started: before that, samples and commands have to wait.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.procedure.as_ref().is_some_and(Procedure::has_begun)
    }

    /// Reports a clock that does not run, once, after the start.
    fn report_clocks<H: Hardware>(&mut self, hardware: &mut H) {
        if self.has_begun() && !core::mem::replace(&mut self.clocks_run, true) {
            self.fail(hardware, Failure::new(FaultCode::Clock, Location::Clock));
        }
    }

    /// Creates the procedure in its own stack frame, which is free again before the procedure runs.
    #[inline(never)]
    fn make<H: Hardware>(&mut self, hardware: &mut H, identity: Identity) {
        let chips = hardware.with_converters(|converters| {
            let chip = |of: &ConverterState| of.chip().unwrap_or(Chip::Absent);
            let [first, second] = converters;
            [chip(first), chip(second)]
        });
        Procedure::new_in(&mut self.procedure, board(identity, chips));
    }

    // ---- events ----

    /// Handles a scan of a converter; drops one of an earlier setpoint.
    pub fn sampled<H: Hardware>(&mut self, hardware: &mut H, converter: u8, sampled: &Sampled) {
        let is_current = hardware.with_converters(|converters| {
            let state = converters.get(usize::from(converter));
            state.is_some_and(|state| state.is_current(sampled))
        });
        if !is_current {
            return;
        }
        // The scan is filled in place: copies of it, and of absent coil results, took 700 cycles per
        // sample.
        let mut scan = scan(converter, sampled);
        hardware.with_coil(|coil| add_current(&mut scan, sampled, coil));
        // A sample ends every failure of this converter and of the bus.
        let other = other_converter(converter);
        let ended = self.reported.clone().into_iter();
        for (code, _) in ended.filter(|(_, location)| *location != other) {
            self.step(hardware, &Event::Recovered(code));
        }
        self.step(hardware, &Event::Scan(&scan));
    }

    /// Handles a received command or an undecodable frame.
    pub fn received<H: Hardware>(&mut self, hardware: &mut H, link: Link, received: &Received) {
        match received {
            Ok(frame) => match self.beyond_the_converter(hardware, frame) {
                Some(invalid) => {
                    let kind = frame.message.kind();
                    let refusal = Acknowledgement::invalid(&frame.header, kind, &invalid);
                    let now_us = hardware.now_us();
                    hardware.send(Some(link), now_us, &Record::Acknowledgement(refusal));
                }
                None => self.step(hardware, &Event::Command(link, frame)),
            },
            Err(error) => self.step(hardware, &Event::NotUnderstood(link, *error)),
        }
    }

    /// Handles a restart request that is not a command. Returns whether the restart is accepted; it is
    /// refused while the storage is busy.
    pub fn asked_to_restart<H: Hardware>(
        &mut self,
        hardware: &mut H,
        target: RebootTarget,
    ) -> bool {
        self.step(hardware, &Event::Restart(target));
        self.restart.is_some()
    }

    /// Handles a report of the storage.
    pub fn stored<H: Hardware>(&mut self, hardware: &mut H, report: &StorageReport) {
        self.step(hardware, &Event::Storage(report));
        self.report_clocks(hardware);
    }

    /// Called every millisecond, and after samples and commands: passes failures, findings and
    /// conditions on. `stepped`: the procedure has already received the time with samples or commands.
    pub fn poll<H: Hardware>(&mut self, hardware: &mut H, stepped: bool) {
        if !self.has_begun() {
            self.step(hardware, &Event::Tick);
            self.report_clocks(hardware);
            return;
        }
        self.follow_coil(hardware);
        self.follow_failures(hardware);
        self.order_storage(hardware);
        let now_us = hardware.now_us();
        if let Some((target, at_us)) = self.restart
            && now_us >= at_us
        {
            hardware.with_coil(CoilManager::stop);
            hardware.restart(target);
        }
        if now_us >= self.conditions_due_us {
            self.conditions_due_us = now_us + CONDITIONS_US;
            let conditions = self.conditions(hardware, now_us);
            self.step(hardware, &Event::Conditions(conditions));
            let expects = |of: &Procedure| of.expects_thermometer();
            let expects = self.procedure.as_ref().is_some_and(expects);
            hardware.with_coil(|coil| coil.expect_thermometer(expects));
        } else if !stepped {
            self.step(hardware, &Event::Tick);
        }
    }

    /// Passes the pending order to the storage once the bridge rests (at once on a board without a
    /// bridge): no current flows then, and none can be commanded until the storage has finished.
    fn order_storage<H: Hardware>(&mut self, hardware: &mut H) {
        if self.order.is_none() || hardware.with_coil(|coil| coil.rests()) == Some(false) {
            return;
        }
        if let Some(order) = self.order.take() {
            hardware.order(order);
        }
    }

    /// Passes on a test result or a part of a trace.
    fn follow_coil<H: Hardware>(&mut self, hardware: &mut H) {
        // Checks first whether there is either, since test result and trace are large and rarely
        // available.
        if hardware.with_coil(|coil| coil.has_found()) != Some(true) {
            return;
        }
        let found = hardware.with_coil(CoilManager::take_found).flatten();
        if let Some(found) = found {
            self.step(hardware, &Event::CoilTested(found));
        }
        let trace = hardware.with_coil(CoilManager::take_trace).flatten();
        if let Some((at_us, trace)) = trace {
            let at = Instant::from_ticks(at_us);
            self.step(hardware, &Event::CurrentTraced { at, trace });
        }
    }

    /// Reports failures of converters and coil when they start. The end of a converter's failures shows
    /// in its next sample.
    fn follow_failures<H: Hardware>(&mut self, hardware: &mut H) {
        let [first, second] = hardware.with_converters(|converters| {
            let [first, second] = converters;
            [first.failure(), second.failure()]
        });
        let of_coil = hardware.with_coil(|coil| coil.failure()).flatten();
        for (source, failure) in [first, second, of_coil].into_iter().enumerate() {
            let Some(standing) = self.standing.get_mut(source) else {
                continue;
            };
            let code = failure.as_ref().map(|failure| failure.code);
            let before = core::mem::replace(standing, code);
            if let Some(failure) = failure
                && before != code
            {
                self.fail(hardware, failure);
            }
        }
    }

    fn conditions<H: Hardware>(&mut self, hardware: &mut H, now_us: u64) -> Conditions {
        let usage = hardware.usage();
        let asleep_us = usage.asleep_us.unwrap_or(0);
        let (then_us, slept_us) =
            core::mem::replace(&mut self.last_conditions, (now_us, asleep_us));
        let passed_us = now_us.saturating_sub(then_us) as f32;
        let idle = asleep_us.wrapping_sub(slept_us) as f32 / passed_us;
        let is_known = usage.asleep_us.is_some() && passed_us > 0.0;
        let [errors, recoveries] = hardware.with_converters(|converters| {
            let [first, second] = converters.map(|converter| converter.counts());
            [0, 1].map(|of: usize| {
                let count = |counts: [u32; 2]| counts.get(of).copied().unwrap_or(0);
                count(first).wrapping_add(count(second))
            })
        });
        Conditions {
            temperature: hardware.with_coil(|coil| coil.temperature()).flatten(),
            supply_v: hardware.with_coil(|coil| coil.supply_v()),
            processor_load: is_known.then(|| (1.0 - idle).clamp(0.0, 1.0)),
            stack_bytes: usage.stack_bytes,
            logs_dropped: usage.logs_dropped,
            bus_errors: errors,
            recoveries,
        }
    }

    fn fail<H: Hardware>(&mut self, hardware: &mut H, failure: Failure) {
        self.step(hardware, &Event::Fault(failure));
    }

    /// Returns the error of a command that requests a rate beyond the converter or the bus with its
    /// channels. The procedure knows only the limits of each field.
    fn beyond_the_converter<H: Hardware>(
        &self,
        hardware: &mut H,
        frame: &Frame<Command>,
    ) -> Option<Invalid> {
        let Command::SetSettings(settings) = &frame.message else {
            return None;
        };
        let boot_id = self.procedure.as_ref().map(Procedure::boot_id)?;
        if !frame.message.is_for(boot_id, frame.header.boot_id) || frame.message.validate().is_err()
        {
            return None;
        }
        let setpoint = Setpoint {
            channels: settings.channels,
            rate_hz: settings.rate_hz,
            shares_bus: hardware.with_converters(|converters| has_second(converters)),
        };
        let with_status = hardware.with_converters(|converters| reads_status(converters));
        if Scheme::new(setpoint, with_status).is_ok_and(|scheme| scheme.is_kept()) {
            return None;
        }
        let [low, high] = rates_hz(setpoint, with_status).map(|rate_hz| rate_hz as f32);
        let value = settings.rate_hz;
        Some(Invalid {
            field: RATE_FIELD,
            item: None,
            problem: Problem::OutOfRange { value, low, high },
        })
    }

    // ---- actions of the procedure ----

    /// Passes an event to the procedure, and carries out the resulting actions.
    fn step<H: Hardware>(&mut self, hardware: &mut H, event: &Event<'_>) {
        let Some(procedure) = &mut self.procedure else {
            return;
        };
        let now = Instant::from_ticks(hardware.now_us());
        procedure.step_into(now, event, &mut self.actions);
        for action in &self.actions {
            match action {
                Action::Record { at, to, record } => {
                    if let Record::Fault(fault) = record {
                        if !fault.active {
                            hardware.with_coil(|coil| coil.clear(fault.code));
                            // A coil failure whose cause persists is reported as a new one.
                            if let Some(of_coil) = self.standing.get_mut(COIL) {
                                of_coil.take_if(|code| *code == fault.code);
                            }
                        }
                        let of = (fault.code, fault.location);
                        self.reported.retain(|reported| *reported != of);
                        if fault.active {
                            // There is space for more faults than the procedure keeps.
                            let _ = self.reported.push(of);
                        }
                    }
                    hardware.send(*to, at.as_ticks(), record);
                }
                Action::ConfigureSensors { channels, rate } => {
                    let (channels, rate_hz) = (*channels, rate.0);
                    hardware.with_converters(|converters| set(converters, channels, rate_hz));
                }
                Action::SeekDrive { sensor } => hardware.with_converters(|converters| {
                    if let Some(converter) = converters.get_mut(usize::from(*sensor)) {
                        converter.seek_drive();
                    }
                }),
                Action::Storage(order) if changes_flash(order) => self.order = Some(order.clone()),
                Action::Storage(order) => hardware.order(order.clone()),
                Action::Restart(target) => {
                    self.restart = Some((*target, now.as_ticks() + RESTART_AFTER_US));
                }
                Action::Locate(time) => hardware.locate(time.as_ticks()),
                of_coil => drop(hardware.with_coil(|coil| drive(coil, of_coil))),
            }
        }
    }
}

/// Returns whether one of the present converters is read with STATUS.
fn reads_status([first, second]: &[ConverterState; CONVERTERS]) -> bool {
    let has_second = second.chip() == Some(Chip::Ldc161x);
    first.reads_status() || has_second && second.reads_status()
}

/// Returns the location of the other converter's failures.
const fn other_converter(converter: u8) -> Location {
    if converter == 0 {
        Location::SecondSensor
    } else {
        Location::Sensor
    }
}

/// Carries out an action of the coil.
fn drive<C: CoilHardware>(coil: &mut CoilManager<C>, action: &Action) {
    match action {
        Action::SafeState => coil.stop(),
        Action::Current(line) => coil.follow(line),
        Action::TestCoil => coil.test(),
        Action::TraceCurrent { interval } => coil.trace(interval.0),
        Action::CorrectCurrent(correction) => coil.correct(correction),
        Action::Record { .. }
        | Action::ConfigureSensors { .. }
        | Action::SeekDrive { .. }
        | Action::Storage(_)
        | Action::Restart(_)
        | Action::Locate(_) => {}
    }
}

/// Returns whether an order starts a save or erases the stored set. The bridge must be off before
/// either, and stays off during the orders that complete a save.
const fn changes_flash(order: &StorageOrder) -> bool {
    matches!(order, StorageOrder::Begin | StorageOrder::Erase)
}

/// Sets the requested operation of the present converters.
fn set(converters: &mut [ConverterState; CONVERTERS], channels: u8, rate_hz: f32) {
    let setpoint = Setpoint {
        channels,
        rate_hz,
        shares_bus: has_second(converters),
    };
    let [first, second] = converters;
    first.set(setpoint);
    if setpoint.shares_bus {
        second.set(setpoint);
    }
}

/// Returns whether there is a second converter.
fn has_second([_, second]: &[ConverterState; CONVERTERS]) -> bool {
    second.chip() == Some(Chip::Ldc161x)
}

/// Returns the board's description for the procedure.
fn board(identity: Identity, chips: [Chip; CONVERTERS]) -> BoardInfo {
    let [first, second] = chips;
    let second_channels = if second == Chip::Ldc161x { CHANNELS } else { 0 };
    BoardInfo {
        boot_id: identity.boot_id,
        hello: Hello {
            minor_version: MINOR_VERSION,
            schema_hash: SCHEMA_HASH,
            reset_cause: identity.boot.cause,
            chip: first,
            second_chip: second,
            configuration_crc: 0,
            ..identity.hello
        },
        crashes: identity.boot.streak,
        crash: identity.boot.crash,
        channels: [CHANNELS, second_channels],
        coil: true,
        storage: identity.storage,
        limits: identity.limits,
    }
}

/// Adds the coil's current during the conversions.
fn add_current<C: CoilHardware>(scan: &mut Scan, sampled: &Sampled, coil: &CoilManager<C>) {
    let half_us = u64::from(sampled.window_us / 2);
    let begin_us = sampled.time_us.saturating_sub(half_us);
    let end_us = begin_us + u64::from(sampled.window_us);
    let current_a = coil.mean_current_a(begin_us, end_us);
    scan.current = current_a.map(Ampere);
    scan.ripple = current_a
        .and_then(|mean_a| coil.ripple_a(mean_a))
        .map(Ampere);
    scan.account = Some(coil.account());
}

/// Converts a sample to a scan of the procedure, without the coil's current.
fn scan(converter: u8, sampled: &Sampled) -> Scan {
    let readings = sampled.frame.readings().iter();
    let conversions = readings
        .zip(sampled.offsets_us)
        .map(|(reading, offset_us)| Conversion {
            reading: *reading,
            offset: Duration::from_ticks(offset_us.into()),
        });
    let mut scan = Scan {
        sensor: converter,
        middle: Instant::from_ticks(sampled.time_us),
        window: Duration::from_ticks(sampled.window_us.into()),
        conversions: Vec::new(),
        lost: sampled.missed,
        gap: sampled.gap,
        current: None,
        ripple: None,
        account: None,
    };
    scan.conversions.extend(conversions);
    scan
}
