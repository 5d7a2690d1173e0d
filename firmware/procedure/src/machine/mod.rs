//! The state machine.

mod budget;
mod coil;
mod commands;
mod faults;
mod manual;
mod phases;
mod readings;
mod state;
mod storage;

use palpate_model::contact::Touch;
use palpate_model::units::{Celsius, Hertz, Second};
use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Location, Mode, Part, ResetCause, State};
use palpate_wire::record::{Hello, StateChange, Status};

use crate::action::{Action, Actions};
use crate::board::{BoardInfo, MOST_CRASHES};
use crate::boot;
use crate::configuration::{Configuration, ITEMS};
use crate::deformation::{self, Deformation, Follower};
use crate::event::{Conditions, Event, Failure, Scan};
use crate::heat::Heat;
use crate::link::Link;
use crate::list::gathered;
use crate::relaxation::HeldPress;
use crate::stream::{DeformationScan, Streamer};
use crate::time::{Duration, Instant, after, between, seconds, span};
use crate::touch::Touching;
use state::{Budget, CoilTestState, FlaggedSince, Phase, Storage, Waiting, is_of_readings};

/// Longest time between two steps. A step's time may precede that of the previous step by less than
/// this: two tasks may deliver their events in another order than they read the clock.
const TICK: Duration = Duration::from_ticks(10_000);
/// Time between the checks of two items of the configuration: each item is checked once per second.
const CHECK: Duration = Duration::from_ticks(1_000_000 / ITEMS as u64);

/// Longest start-up of a converter, during which there are no conversions. With four channels, the
/// maximum, the drive of each is searched, and 280 registers are written, read back or compared, in one
/// transaction each. A transaction takes at most 0.47 ms, after which it fails with a fault of its own:
/// 132 ms in total. Reset and wake-up take 3.5 ms.
const BRING_UP: Duration = Duration::from_ticks(140_000);

/// Capacity of the queue of faults behind the standing one. There are eight sources: two converters,
/// bus, coil, thermometer, processor, configuration and storage. The fault of one of them stands, so one
/// place is spare.
const MOST_BEHIND: usize = 8;

/// State machine of the instrument: events in, actions out.
///
/// See the [crate](crate) for an example.
#[derive(Clone, Debug)]
pub struct Procedure {
    board: BoardInfo,
    configuration: Configuration,
    phase: Phase,
    mode: Mode,
    armed: bool,
    coil: CoilTestState,
    /// Waiting command that needs the coil.
    waiting: Option<Waiting>,
    /// Energy reports of the coil's drive, and the load measured by the coil test.
    budget: Budget,
    /// Number of the last measurement.
    measurement: u32,
    /// Press that is held after an estimate.
    held: Option<HeldPress>,
    followers: [[Option<Follower>; 4]; 2],
    /// Time of the last evaluated conversion of each channel.
    evaluated: [[Option<Instant>; 4]; 2],
    streamers: [Streamer; 2],
    touching: Touching,
    heat: Option<Heat>,
    conditions: Conditions,
    counters: Counters,
    /// Time of the first step; `now` is the time of the last one.
    started: Option<Instant>,
    now: Instant,
    next_status: Instant,
    /// Calibration readback in progress, sent in chunks.
    readback: Option<Readback>,
    storage: Storage,
    /// The device is about to restart.
    restarting: bool,
    greeted: bool,
    /// Time when the first converter was last seen, or when waiting for it began.
    last_seen: Option<Instant>,
    /// Time until which the converters may be busy with their configuration.
    configured: Instant,
    flagged_since: FlaggedSince,
    /// Reported faults that have not ended, besides the standing one.
    behind: heapless::Vec<Failure, MOST_BEHIND>,
    /// Next item of the configuration to check, and the time of the check.
    next_check: (usize, Instant),
}

/// Calibration part whose next record is due.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Readback {
    to: Option<Link>,
    part: Part,
    sensor: u8,
    channel: u8,
    chunk: usize,
}

/// Counters of `status`.
#[derive(Clone, Debug, Default)]
struct Counters {
    conversions: [u32; 2],
    lost: [u32; 2],
    flagged: [u32; 2],
    commands_damaged: u32,
    commands_refused: u32,
    refusals: u32,
}

impl Procedure {
    /// Creates an instrument at start-up, with default settings and no calibration.
    pub fn new(board: BoardInfo) -> Self {
        let mut procedure = Self::blank(board);
        procedure.prepare();
        procedure
    }

    /// As [`new`](Self::new), in its place: as a value of its own, it takes eleven kilobytes of stack.
    pub fn new_in(place: &mut Option<Self>, board: BoardInfo) {
        place.insert(Self::blank(board)).prepare();
    }

    // Inlined: the compiler then writes the fields to their place.
    #[inline(always)]
    fn blank(board: BoardInfo) -> Self {
        Self {
            configuration: Configuration::default(),
            board,
            phase: Phase::SelfTest { good: 0 },
            mode: Mode::SensingOnly,
            armed: false,
            coil: CoilTestState::None,
            waiting: None,
            budget: Budget::new(),
            measurement: 0,
            held: None,
            followers: Default::default(),
            evaluated: Default::default(),
            streamers: Default::default(),
            touching: Touching::default(),
            heat: None,
            conditions: Conditions::default(),
            counters: Counters::default(),
            started: None,
            now: Instant::from_ticks(0),
            next_status: Instant::from_ticks(0),
            readback: None,
            storage: Storage::new(),
            restarting: false,
            greeted: false,
            last_seen: None,
            configured: Instant::from_ticks(0),
            flagged_since: FlaggedSince::default(),
            behind: heapless::Vec::new(),
            next_check: (0, Instant::from_ticks(0)),
        }
    }

    fn prepare(&mut self) {
        self.configuration.limit_to(&self.board);
        self.begin_baseline();
    }

    /// Returns the active settings and calibration.
    pub const fn configuration(&self) -> &Configuration {
        &self.configuration
    }

    /// Returns the boot id, which commands must carry.
    pub const fn boot_id(&self) -> u32 {
        self.board.boot_id
    }

    /// Returns the present state.
    pub const fn state(&self) -> State {
        self.phase.state()
    }

    /// Returns whether the coil may be driven.
    pub const fn is_armed(&self) -> bool {
        self.armed
    }

    /// Returns whether there is a coil that may be driven, so that its thermometer must work.
    pub const fn expects_thermometer(&self) -> bool {
        self.heat.is_some()
    }

    /// Handles an event and returns the actions. `now` must not go backwards: a step back by less than a
    /// tick counts as standing still, a larger one as a fault of the clock.
    pub fn step(&mut self, now: Instant, event: &Event<'_>) -> Actions {
        let mut actions = Actions::new();
        self.step_into(now, event, &mut actions);
        actions
    }

    /// Like [`step`](Self::step), but replaces the content of an existing list of actions, which avoids
    /// copying two kilobytes.
    pub fn step_into(&mut self, now: Instant, event: &Event<'_>, actions: &mut Actions) {
        actions.clear();
        let set_back = between(now, self.now) > TICK;
        self.now = if set_back { now } else { now.max(self.now) };
        self.started.get_or_insert(self.now);
        let asker = match event {
            Event::Command(link, _) | Event::NotUnderstood(link, _) => Some(*link),
            _ => None,
        };
        let mut out = Out {
            now: self.now,
            asker,
            converted: matches!(event, Event::Scan(_)),
            actions,
        };
        if !self.greeted && !self.start(event, &mut out) {
            return;
        }
        if set_back {
            self.clock_set_back(&mut out);
        }
        self.follow_drive(out.now);
        match event {
            Event::Tick => {}
            Event::Scan(scan) => self.scan(scan, &mut out),
            Event::Command(link, frame) => self.command(*link, frame, &mut out),
            Event::NotUnderstood(_, error) => self.not_understood(error, &mut out),
            Event::Restart(target) => drop(self.restart(*target, &mut out)),
            Event::Storage(report) => self.storage_reported(report, &mut out),
            Event::CoilTested(found) => self.coil_tested(found, &mut out),
            Event::CurrentTraced { at, trace } => {
                let record = Record::CurrentTrace(trace.clone());
                out.record_of(*at, record);
            }
            Event::Conditions(conditions) => self.conditions(conditions),
            Event::Fault(failure) => self.fail(*failure, &mut out),
            // This event follows any conversion. A conversion proves that converter and bus work, but
            // only good readings prove the sensor, and end a fault of readings.
            Event::Recovered(code) if is_of_readings(*code) => {}
            Event::Recovered(code) => self.recovered(*code, &mut out),
        }
        self.tick(&mut out);
        self.send_readback(&mut out);
    }

    /// Returns whether the stored configuration is active, so that the instrument may start. Until then
    /// only the storage runs.
    fn start(&mut self, event: &Event<'_>, out: &mut Out<'_>) -> bool {
        if !self.board.storage {
            self.greet(out);
            return true;
        }
        match event {
            Event::Storage(report) => self.storage_reported(report, out),
            _ if self.storage.is_at_work() => self.watch_storage(out),
            _ => self.begin_storage(out),
        }
        false
    }

    /// Returns whether the instrument has started. Before that it accepts only time and reports of the
    /// storage.
    pub const fn has_begun(&self) -> bool {
        self.greeted
    }

    /// Sends the first records after start-up, and configures the sensors.
    fn greet(&mut self, out: &mut Out<'_>) {
        self.greeted = true;
        out.record(Record::Hello(self.hello()));
        if let Some(crash) = self.board.crash.take() {
            out.record(Record::Crash(crash));
        }
        self.configure_sensors(out);
        self.next_status = self.status_after(out.now);
        if self.board.crashes >= MOST_CRASHES {
            self.fail(
                Failure {
                    value: Some(self.board.crashes.into()),
                    limit: Some(MOST_CRASHES.into()),
                    ..Failure::new(FaultCode::CrashStreak, Location::Processor)
                },
                out,
            );
        }
        if let Some(code) = boot::fault(self.board.hello.reset_cause) {
            self.fail(Failure::new(code, Location::Processor), out);
        }
    }

    fn status_after(&self, now: Instant) -> Instant {
        after(now, span(self.configuration.settings.status_period_s))
    }

    fn hello(&self) -> Hello {
        Hello {
            configuration_crc: self.configuration.crc(),
            ..self.board.hello.clone()
        }
    }

    /// Requests the configuration of the converters by the settings. It takes up to [`BRING_UP`].
    fn configure_sensors(&mut self, out: &mut Out<'_>) {
        self.last_seen = Some(out.now);
        self.flagged_since = FlaggedSince::default();
        self.configured = after(out.now, BRING_UP);
        out.push(Action::ConfigureSensors {
            channels: self.configuration.settings.channels,
            rate: Hertz(self.configuration.settings.rate_hz),
        });
    }

    /// Discards the baseline and the touch state.
    fn begin_baseline(&mut self) {
        self.touching = Touching::default();
        self.evaluated = Default::default();
        let settings = &self.configuration.settings;
        for (sensor, of) in self.followers.iter_mut().enumerate() {
            let has = self.board.channels.get(sensor).copied().unwrap_or(0) & settings.channels;
            for (channel, follower) in of.iter_mut().enumerate() {
                *follower = (has >> channel & 1 == 1)
                    .then(|| Follower::new(settings).ok())
                    .flatten();
            }
        }
    }

    /// Learns the baseline again, after an interruption or with other settings; a touch remains.
    fn resume_baseline(&mut self) {
        self.touching = Touching::default();
        let settings = &self.configuration.settings;
        for (sensor, of) in self.followers.iter_mut().enumerate() {
            let has = self.board.channels.get(sensor).copied().unwrap_or(0) & settings.channels;
            for (channel, follower) in of.iter_mut().enumerate() {
                match follower {
                    _ if has >> channel & 1 == 0 => *follower = None,
                    Some(follower) => follower.resume(settings),
                    None => *follower = Follower::new(settings).ok(),
                }
            }
        }
    }

    /// Learns the baseline again, and assumes an untouched sensor until readings show a touch.
    fn learn_baseline(&mut self) {
        let followers = self.followers.iter_mut().flatten().flatten();
        followers.for_each(Follower::learn_anew);
    }

    /// Returns the follower of the channel that determines touch and stiffness.
    fn principal_follower(&self) -> Option<&Follower> {
        let [first, _] = &self.followers;
        let of = first.get(usize::from(self.configuration.principal()));
        of.and_then(Option::as_ref)
    }

    fn scan(&mut self, scan: &Scan, out: &mut Out<'_>) {
        let sensor = usize::from(scan.sensor & 1);
        let Some(last) = self.streamers.get(sensor).map(Streamer::last) else {
            return;
        };
        let usual = || Second(1.0 / self.configuration.settings.rate_hz);
        let interval = last.map_or_else(usual, |last| seconds(last, scan.middle));
        let square_a2 = scan.square_current_a2();
        if let (0, Some(heat), Some(square_a2)) = (sensor, &mut self.heat, square_a2) {
            heat.push(square_a2, interval);
        }
        let deformations = self.deformations(scan, interval, square_a2);
        self.count(scan, sensor);
        self.watch_readings(scan, out);
        let springs = self.configuration.springs();
        let settings = &self.configuration.settings;
        if let Some(streamer) = self.streamers.get_mut(sensor)
            && let Some((at, record)) = streamer.push(scan, &deformations, settings, springs)
        {
            out.record_of(at, record);
        }
        let memory = deformation::memory(settings) as u16;
        if self.configuration.array().is_some()
            && self.can_read_flash()
            && let Some(touch) = self.touching.push(&self.configuration, scan, memory)
        {
            out.record_of(scan.middle, Record::Touch(touch));
        }
        // The zero of a touch depends on the temperature, which this status contains: the records have
        // all inputs of a deformation, so that it can be recomputed from them.
        let begins = |of: &Deformation| matches!(of.touch, Touch::Began { .. });
        if deformations.iter().flatten().any(begins) {
            out.record(Record::Status(self.status()));
        }
        self.take_account(scan, out.now);
        if sensor == 0 {
            self.last_seen = Some(out.now);
            let principal = deformations.first().copied().flatten();
            self.principal(scan, principal, interval, out);
        }
    }

    /// Returns the deformation at every channel of a scan; `None` if flagged or without a curve.
    fn deformations(
        &mut self,
        scan: &Scan,
        interval: Second,
        square_a2: Option<f32>,
    ) -> DeformationScan {
        let away_k = self.configuration.away_k(self.conditions.temperature);
        let configuration = &self.configuration;
        let sensor = usize::from(scan.sensor & 1);
        let mut followers = self.followers.get_mut(sensor);
        let mut evaluated = self.evaluated.get_mut(sensor);
        gathered(scan.conversions.iter().map(|conversion| {
            let reading = &conversion.reading;
            let channel = usize::from(reading.channel.number());
            let calibration = configuration.channel(scan.sensor, channel as u8)?;
            let follower = followers.as_mut()?.get_mut(channel)?.as_mut()?;
            if !reading.is_good() {
                return None;
            }
            // The interval since the last good reading includes the flagged readings between.
            let last = evaluated.as_mut()?.get_mut(channel)?.replace(scan.middle);
            let interval = last.map_or(interval, |last| seconds(last, scan.middle));
            follower.push(reading, interval, square_a2, away_k, calibration)
        }))
    }

    fn count(&mut self, scan: &Scan, sensor: usize) {
        let flagged = scan
            .conversions
            .iter()
            .any(|conversion| !conversion.reading.is_good());
        let counters = &mut self.counters;
        let add = |to: &mut [u32; 2], by: u32| {
            if let Some(to) = to.get_mut(sensor) {
                *to = to.wrapping_add(by);
            }
        };
        add(&mut counters.conversions, 1);
        add(&mut counters.lost, scan.lost);
        add(&mut counters.flagged, flagged.into());
    }

    fn conditions(&mut self, conditions: &Conditions) {
        self.conditions = conditions.within_protocol();
        if let (Some(heat), Some(temperature)) = (&mut self.heat, self.conditions.temperature) {
            heat.measured(temperature);
        }
    }

    /// Starts the coil's heat computation with its calibration, or continues it with a new one. A run
    /// that ended in a reset may have left the copper at its highest allowed temperature; without power
    /// it cools within a second.
    fn follow_heat(&mut self) {
        let temperature = self.conditions.temperature;
        let started = self.started.unwrap_or(self.now);
        let cold = temperature.unwrap_or_default();
        let copper = match (&self.heat, self.board.hello.reset_cause) {
            (Some(heat), _) => (heat.copper(), Second(0.0)),
            (None, ResetCause::PowerOn) => (cold, Second(0.0)),
            (None, _) => (self.board.limits.temperature, seconds(started, self.now)),
        };
        self.heat = self
            .configuration
            .coil()
            .and_then(|coil| Heat::new(coil, temperature, copper).ok());
    }

    /// Handles everything that depends on time alone.
    fn tick(&mut self, out: &mut Out<'_>) {
        self.deadlines(out);
        self.watch_storage(out);
        self.check_next(out);
        if out.now >= self.next_status {
            self.next_status = self.status_after(out.now);
            out.record(Record::Status(self.status()));
        }
    }

    fn status(&self) -> Status {
        let Counters {
            conversions: [conversions, second_conversions],
            lost: [conversions_lost, second_conversions_lost],
            flagged: [conversions_flagged, second_conversions_flagged],
            commands_damaged,
            commands_refused,
            refusals,
        } = self.counters;
        Status {
            conversions,
            conversions_lost,
            conversions_flagged,
            second_conversions,
            second_conversions_lost,
            second_conversions_flagged,
            bus_errors: self.conditions.bus_errors,
            recoveries: self.conditions.recoveries,
            logs_dropped: self.conditions.logs_dropped,
            commands_damaged,
            commands_refused,
            measurements: self.measurement,
            refusals,
            temperature_c: self.temperature().map(|temperature| temperature.0),
            supply_v: self.conditions.supply_v,
            processor_load: self.conditions.processor_load,
            stack_bytes: self.conditions.stack_bytes,
        }
    }

    fn temperature(&self) -> Option<Celsius> {
        self.conditions.temperature
    }

    /// Sends the next chunk of a calibration.
    fn send_readback(&mut self, out: &mut Out<'_>) {
        if let Some(readback) = &mut self.readback {
            let Readback {
                to,
                part,
                sensor,
                channel,
                chunk,
            } = *readback;
            match self.configuration.record(part, sensor, channel, chunk) {
                Some(record) => {
                    readback.chunk += 1;
                    out.record_to(to, record);
                }
                None => self.readback = None,
            }
        }
    }

    /// Enters another phase and reports it.
    // Inlined: the compiler then writes the phase to its place. A phase takes up to two kilobytes of
    // stack as an argument.
    #[inline(always)]
    fn go(&mut self, phase: Phase, out: &mut Out<'_>) {
        let previous = self.state();
        self.phase = phase;
        self.entered(previous, out);
    }

    #[inline(never)]
    fn entered(&self, previous: State, out: &mut Out<'_>) {
        if self.state() != previous {
            self.announce(previous, out);
        }
    }

    fn announce(&self, previous: State, out: &mut Out<'_>) {
        out.record(Record::State(StateChange {
            state: self.state(),
            previous,
            mode: self.mode,
            armed: self.armed,
            measurement: self.measurement,
        }));
    }
}

/// Actions of a step, in order.
struct Out<'a> {
    now: Instant,
    /// Link of the command that this step handles.
    asker: Option<Link>,
    /// This step handles a conversion.
    converted: bool,
    actions: &'a mut Actions,
}

impl Out<'_> {
    /// Adds an action. A full list would drop it, but holds more than the largest step needs. A safe
    /// state is put first, so it is never lost.
    fn push(&mut self, action: Action) {
        let _ = self.actions.push(action);
    }

    /// Switches the bridge off before all other actions.
    fn safe(&mut self) {
        // The list is changed in place: a copy of the actions would take two kilobytes of stack.
        let keep = |action: &Action| !matches!(action, Action::SafeState | Action::Current(_));
        self.actions.retain(keep);
        if self.actions.is_full() {
            let _ = self.actions.pop();
        }
        let _ = self.actions.push(Action::SafeState);
        let mut rest: &mut [Action] = self.actions;
        while let [before @ .., one, last] = rest {
            core::mem::swap(one, last);
            let kept = before.len() + 1;
            // `kept` is at most the length, so the slice exists.
            rest = rest.get_mut(..kept).unwrap_or_default();
        }
    }

    /// Sends a record to all links, with the present time.
    fn record(&mut self, record: Record) {
        self.record_to(None, record);
    }

    /// Sends a record to all links, with another time.
    fn record_of(&mut self, at: Instant, record: Record) {
        let to = None;
        self.push(Action::Record { at, to, record });
    }

    /// Sends a record to the link that asked.
    fn answer(&mut self, record: Record) {
        self.record_to(self.asker, record);
    }

    fn record_to(&mut self, to: Option<Link>, record: Record) {
        let at = self.now;
        self.push(Action::Record { at, to, record });
    }
}
