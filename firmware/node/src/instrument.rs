//! The instrument: samples, commands and time go to the procedure, and what it asks for is carried
//! out.

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

/// How often the procedure receives temperature, supply and load, us.
const CONDITIONS_US: u64 = 100_000;
/// Channels of an LDC1614.
const CHANNELS: u8 = 0b1111;
/// Failures that may stand at once: of each converter, and of the coil.
const SOURCES: usize = CONVERTERS + 1;
const COIL: usize = CONVERTERS;
/// Faults that may be reported at once.
const MOST_REPORTED: usize = 12;
/// From the command to start anew to doing so, us: a PC that polls ten times a second, the slowest
/// that makes sense, has the answer.
const RESTART_AFTER_US: u64 = 200_000;

/// The rate among the settings' fields.
const RATE_FIELD: u8 = field_number(&<Settings as Described>::TYPE, "rate_hz");

/// A command frame, or why a frame is none.
pub type Received = Result<Frame<Command>, FrameError>;

/// What is known of the board when the instrument begins.
#[derive(Clone, Debug)]
pub struct Identity {
    /// A random number of this run, never 0.
    pub boot_id: u32,
    /// The board, its build and why it was reset; who answers as converter, protocol and layout are
    /// filled in.
    pub hello: Hello,
    /// How the last run ended.
    pub boot: Boot,
    /// The clocks run as planned.
    pub clocks_run: bool,
    /// Whether there is a storage for settings and calibration.
    pub storage: bool,
    /// What no setting, command or calibration exceeds.
    pub limits: palpate_procedure::Limits,
}

/// What the processor has used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// Microseconds in which it slept since the start; wraps. Nothing without a processor.
    pub asleep_us: Option<u32>,
    /// Greatest depth of the stack, bytes; 0 if it is not measured.
    pub stack_bytes: u32,
    /// Log messages dropped since the start.
    pub logs_dropped: u32,
}

/// What the instrument needs of its board.
pub trait Hardware {
    /// The coil's side.
    type Coil: CoilHardware;

    /// The board's timer, us.
    fn now_us(&self) -> u64;

    /// Lets `work` see what stands above the coil's drive. Nothing on a board whose drive could not
    /// start: its coil is never driven.
    fn with_coil<T>(&mut self, work: impl FnOnce(&mut CoilManager<Self::Coil>) -> T) -> Option<T>;

    /// Lets `work` see what the instrument shares with the converters' tasks.
    fn with_converters<T>(
        &mut self,
        work: impl FnOnce(&mut [ConverterState; CONVERTERS]) -> T,
    ) -> T;

    /// Sends a record of a time over a link, or over all of them. Never waits: what finds no room is
    /// dropped, and counted, by each link for itself.
    fn send(&mut self, to: Option<Link>, at_us: u64, record: &Record);

    /// Gives the storage an order; [`Instrument::stored`] takes what it reports. Its last order has
    /// been carried out.
    fn order(&mut self, order: StorageOrder);

    /// Starts the device anew. The bridge is off.
    fn restart(&mut self, target: RebootTarget);

    /// Lets the LED flicker for so long, us.
    fn locate(&mut self, for_us: u64);

    /// What the processor has used so far.
    fn usage(&mut self) -> Usage;
}

/// The procedure with its surroundings.
#[derive(Debug)]
pub struct Instrument {
    /// What the instrument does, once it is known which converters there are.
    procedure: Option<Procedure>,
    /// What it asked for last.
    actions: Actions,
    /// The failures that were reported to the procedure and that last.
    standing: [Option<FaultCode>; SOURCES],
    /// The faults that the procedure has reported and that have not ended, and where they are.
    reported: Vec<(FaultCode, Location), MOST_REPORTED>,
    /// The clocks run, as far as is still to be said.
    clocks_run: bool,
    /// The order that the storage gets once the bridge is proven off.
    order: Option<StorageOrder>,
    /// How the device is to start anew, and when: its last answer has been sent by then.
    restart: Option<(RebootTarget, u64)>,
    conditions_due_us: u64,
    /// Time of the last conditions, and the sleep up to then.
    last_conditions: (u64, u32),
}

impl Default for Instrument {
    fn default() -> Self {
        Self::new()
    }
}

impl Instrument {
    /// An instrument that has not begun.
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

    /// The procedure, to read.
    #[must_use]
    pub const fn procedure(&self) -> Option<&Procedure> {
        self.procedure.as_ref()
    }

    /// Whether all converters have been asked for their identity: the instrument may begin.
    pub fn is_ready<H: Hardware>(hardware: &mut H) -> bool {
        hardware.with_converters(|converters| {
            converters
                .iter()
                .all(|converter| converter.chip().is_some())
        })
    }

    /// Begins. A converter that has not answered yet counts as absent. What is stored comes into
    /// force first; [`has_begun`](Self::has_begun) says when.
    pub fn begin<H: Hardware>(&mut self, hardware: &mut H, identity: Identity) {
        self.clocks_run = identity.clocks_run;
        self.make(hardware, identity);
        self.step(hardware, &Event::Tick);
        self.report_clocks(hardware);
    }

    /// Whether it has begun: before that, samples and commands have to wait.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.procedure.as_ref().is_some_and(Procedure::has_begun)
    }

    /// Once it has begun it says, once, that a clock does not run.
    fn report_clocks<H: Hardware>(&mut self, hardware: &mut H) {
        if self.has_begun() && !core::mem::replace(&mut self.clocks_run, true) {
            self.fail(hardware, Failure::new(FaultCode::Clock, Location::Clock));
        }
    }

    /// Makes the procedure, in a frame of its own: what that takes of the stack is free again before
    /// the procedure runs.
    #[inline(never)]
    fn make<H: Hardware>(&mut self, hardware: &mut H, identity: Identity) {
        let chips = hardware.with_converters(|converters| {
            let chip = |of: &ConverterState| of.chip().unwrap_or(Chip::Absent);
            let [first, second] = converters;
            [chip(first), chip(second)]
        });
        self.procedure = Some(Procedure::new(board(identity, chips)));
    }

    // ---- what happens ----

    /// A converter has made a scan. One of an earlier setpoint is dropped.
    pub fn sampled<H: Hardware>(&mut self, hardware: &mut H, converter: u8, sampled: &Sampled) {
        let is_current = hardware.with_converters(|converters| {
            let state = converters.get(usize::from(converter));
            state.is_some_and(|state| state.is_current(sampled))
        });
        if !is_current {
            return;
        }
        // In place: copies of it, and of results of the coil that are not there, took 700 cycles a sample.
        let mut scan = scan(converter, sampled);
        hardware.with_coil(|coil| add_current(&mut scan, sampled, coil));
        // Whatever stood against this converter or the bus has ended with it.
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

    /// Something that is no command asks for a new start. Whether it is under way: not while something
    /// is being stored.
    pub fn asked_to_restart<H: Hardware>(
        &mut self,
        hardware: &mut H,
        target: RebootTarget,
    ) -> bool {
        self.step(hardware, &Event::Restart(target));
        self.restart.is_some()
    }

    /// The storage has reported.
    pub fn stored<H: Hardware>(&mut self, hardware: &mut H, report: &StorageReport) {
        self.step(hardware, &Event::Storage(report));
        self.report_clocks(hardware);
    }

    /// A millisecond has passed, or samples and commands have been taken: passes failures, findings
    /// and conditions on. `stepped`: the procedure has received the time with them already.
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

    /// Tells the storage what waits for the bridge. Where it rests, no current flows, and none can be
    /// commanded as long as the storage is at work.
    fn order_storage<H: Hardware>(&mut self, hardware: &mut H) {
        if self.order.is_none() || hardware.with_coil(|coil| coil.rests()) == Some(false) {
            return;
        }
        if let Some(order) = self.order.take() {
            hardware.order(order);
        }
    }

    /// Passes on what a test or a record of the current has found.
    fn follow_coil<H: Hardware>(&mut self, hardware: &mut H) {
        // Asked first: both are large, and nearly always there is neither.
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

    /// Reports failures when they begin. A converter's next sample shows that its own have ended.
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

    /// What is wrong with a command that asks for a rate that the converter or the bus cannot follow with
    /// its channels. The procedure knows the limits of each by itself only.
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

    // ---- what the procedure asks for ----

    /// Passes an event to the procedure, and carries out what it asks for.
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
                            // Where its cause lasts, it is a new one.
                            if let Some(of_coil) = self.standing.get_mut(COIL) {
                                of_coil.take_if(|code| *code == fault.code);
                            }
                        }
                        let of = (fault.code, fault.location);
                        self.reported.retain(|reported| *reported != of);
                        if fault.active {
                            // There is room for more than the procedure keeps.
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

/// Whether one of the converters that are there is read with STATUS.
fn reads_status([first, second]: &[ConverterState; CONVERTERS]) -> bool {
    let has_second = second.chip() == Some(Chip::Ldc161x);
    first.reads_status() || has_second && second.reads_status()
}

/// Where the failures of the other converter are.
const fn other_converter(converter: u8) -> Location {
    if converter == 0 {
        Location::SecondSensor
    } else {
        Location::Sensor
    }
}

/// Carries out what concerns the coil.
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

/// Whether an order begins what writes or erases. The orders that follow find the bridge as it was.
const fn changes_flash(order: &StorageOrder) -> bool {
    matches!(order, StorageOrder::Begin | StorageOrder::Erase)
}

/// Sets how the converters that are there are to be run.
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

/// Whether there is a second converter.
fn has_second([_, second]: &[ConverterState; CONVERTERS]) -> bool {
    second.chip() == Some(Chip::Ldc161x)
}

/// The board as the procedure takes it.
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

/// Adds what the coil took meanwhile.
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

/// A sample as the procedure takes it, without the coil's current.
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
