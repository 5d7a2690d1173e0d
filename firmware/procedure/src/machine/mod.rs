//! The state machine.

mod budget;
mod coil;
mod commands;
mod faults;
mod manual;
mod phases;
mod readings;
mod storage;

use palpate_model::units::{Celsius, Hertz, Second};
use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Location, Mode, Part, ResetCause, State};
use palpate_wire::record::{Hello, StateChange, Status};

use crate::action::{Action, Actions};
use crate::board::{BoardInfo, MOST_CRASHES};
use crate::boot;
use crate::configuration::{Configuration, ITEMS};
use crate::deformation::Follower;
use crate::event::{Conditions, Event, Failure, Scan};
use crate::heat::Heat;
use crate::link::Link;
use crate::list::gathered;
use crate::stream::{DeformationScan, Streamer};
use crate::time::{Duration, Instant, after, between, seconds, span};
use budget::Budget;
use coil::{Knowledge, Waiting};
use phases::{BRING_UP, Phase};
use readings::{FlaggedSince, is_of_readings};
use storage::Storage;

/// The longest time between two steps. Two tasks may tell their events in another order than they
/// read the clock, but no later than that.
const TICK: Duration = Duration::from_ticks(10_000);
/// From the check of one item of the configuration to that of the next: all of them once a second.
const CHECK: Duration = Duration::from_ticks(1_000_000 / ITEMS as u64);

/// Faults that may stand at once behind another: of two converters, bus, coil, thermometer, processor,
/// configuration and storage, with one to spare.
const MOST_BEHIND: usize = 8;

/// What the instrument does, from event to actions.
///
/// See the [crate](crate) for an example.
#[derive(Clone, Debug)]
pub struct Procedure {
    board: BoardInfo,
    configuration: Configuration,
    phase: Phase,
    mode: Mode,
    armed: bool,
    coil: Knowledge,
    /// The queue of commands that need the coil.
    waiting: Option<Waiting>,
    /// What the coil's drive has said of its energy.
    budget: Budget,
    /// Number of the last measurement that began.
    measurement: u32,
    followers: [[Option<Follower>; 4]; 2],
    /// The last conversion of each channel that its follower has received.
    evaluated: [[Option<Instant>; 4]; 2],
    streamers: [Streamer; 2],
    heat: Option<Heat>,
    conditions: Conditions,
    counters: Counters,
    /// Time of the first step, and of the last.
    started: Option<Instant>,
    now: Instant,
    next_status: Instant,
    /// A calibration that is being sent, chunk by chunk.
    readback: Option<Readback>,
    storage: Storage,
    /// The device is about to start anew.
    restarting: bool,
    greeted: bool,
    /// When the first converter was last seen, or when waiting for it began.
    last_seen: Option<Instant>,
    /// Until when the converters may be busy with being configured.
    configured: Instant,
    flagged_since: FlaggedSince,
    /// Faults that were reported and have not ended, besides the one that stands.
    behind: heapless::Vec<Failure, MOST_BEHIND>,
    /// The item of the configuration that is checked next, and when.
    next_check: (usize, Instant),
}

/// A part of the calibration whose next record is due.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Readback {
    to: Option<Link>,
    part: Part,
    sensor: u8,
    channel: u8,
    chunk: usize,
}

/// What `status` counts.
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
    /// An instrument that has just started, with the default settings and no calibration.
    pub fn new(board: BoardInfo) -> Self {
        let mut procedure = Self {
            configuration: Configuration::new(&board),
            board,
            phase: Phase::SelfTest { good: 0 },
            mode: Mode::SensingOnly,
            armed: false,
            coil: Knowledge::None,
            waiting: None,
            budget: Budget::new(),
            measurement: 0,
            followers: Default::default(),
            evaluated: Default::default(),
            streamers: Default::default(),
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
        };
        procedure.begin_baseline();
        procedure
    }

    /// Settings and calibration in force.
    pub const fn configuration(&self) -> &Configuration {
        &self.configuration
    }

    /// The number of this run, to which commands are addressed.
    pub const fn boot_id(&self) -> u32 {
        self.board.boot_id
    }

    /// Where it stands.
    pub const fn state(&self) -> State {
        self.phase.state()
    }

    /// Whether the coil may be driven.
    pub const fn is_armed(&self) -> bool {
        self.armed
    }

    /// Whether there is a coil that may be driven, and so a thermometer that has to work.
    pub const fn expects_thermometer(&self) -> bool {
        self.heat.is_some()
    }

    /// Takes an event and says what is to be done. `now` does not go backwards: by less than a
    /// tick it is taken as standing still, by more as a fault of the clock.
    pub fn step(&mut self, now: Instant, event: &Event<'_>) -> Actions {
        let mut actions = Actions::new();
        self.step_into(now, event, &mut actions);
        actions
    }

    /// The same into actions that are there already, whatever they held: two kilobytes that
    /// need not be copied.
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
            // Any conversion shows that the converter and its bus work, not that its sensor does.
            Event::Recovered(code) if is_of_readings(*code) => {}
            Event::Recovered(code) => self.recovered(*code, &mut out),
        }
        self.tick(&mut out);
        self.send_readback(&mut out);
    }

    /// Whether what was stored is in force, so that the instrument may begin. Until then there is
    /// nothing but the storage.
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

    /// Whether it has begun. Before that it takes no events but time and what the storage reports.
    pub const fn has_begun(&self) -> bool {
        self.greeted
    }

    /// The first words after a start, and the configuration for the sensors.
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

    /// Lets the converters be configured as the settings say, which takes its time.
    fn configure_sensors(&mut self, out: &mut Out<'_>) {
        self.last_seen = Some(out.now);
        self.flagged_since = FlaggedSince::default();
        self.configured = after(out.now, BRING_UP);
        out.push(Action::ConfigureSensors {
            channels: self.configuration.settings.channels,
            rate: Hertz(self.configuration.settings.rate_hz),
        });
    }

    /// Forgets what the untouched sensor reads, and whether something touches.
    fn begin_baseline(&mut self) {
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

    /// Learns anew what the untouched sensor reads, after an interruption or with other settings. What touches still does.
    fn resume_baseline(&mut self) {
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

    /// Learns anew what the sensor reads, which is taken as untouched until readings say otherwise.
    fn learn_baseline(&mut self) {
        let followers = self.followers.iter_mut().flatten().flatten();
        followers.for_each(Follower::learn_anew);
    }

    /// What is known of the sensor that touch and stiffness come from.
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
        self.take_account(scan, out.now);
        if sensor == 0 {
            self.last_seen = Some(out.now);
            let principal = deformations.first().copied().flatten();
            self.principal(scan, principal, interval, out);
        }
    }

    /// The deformation at every channel of a scan; `None` where its conversion gives none.
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
            // Flagged readings before this one are part of the time.
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

    /// Begins to follow the coil's heat when its calibration comes, or goes on with another. A run that a
    /// reset ended may have left the copper as hot as is allowed; without power it cools within a second.
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

    /// What is due by time alone.
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

    /// Goes to another phase and says so.
    fn go(&mut self, phase: Phase, out: &mut Out<'_>) {
        let previous = self.state();
        self.phase = phase;
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

/// The actions of a step, as they come together.
struct Out<'a> {
    now: Instant,
    /// The link of the command that is what has happened.
    asker: Option<Link>,
    /// A conversion is what has happened.
    converted: bool,
    actions: &'a mut Actions,
}

impl Out<'_> {
    /// Adds an action. What has no room is lost, which the limit on a step's actions excludes;
    /// safe state is put first instead, so that it never is.
    fn push(&mut self, action: Action) {
        let _ = self.actions.push(action);
    }

    /// Bridge off, before all else.
    fn safe(&mut self) {
        // In place: a copy of the actions would be two kilobytes of stack.
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
            // It is at most the length: there is a slice of the rest.
            rest = rest.get_mut(..kept).unwrap_or_default();
        }
    }

    /// For all links, at this time.
    fn record(&mut self, record: Record) {
        self.record_to(None, record);
    }

    /// For all links, of another time.
    fn record_of(&mut self, at: Instant, record: Record) {
        let to = None;
        self.push(Action::Record { at, to, record });
    }

    /// For the link that asked.
    fn answer(&mut self, record: Record) {
        self.record_to(self.asker, record);
    }

    fn record_to(&mut self, to: Option<Link>, record: Record) {
        let at = self.now;
        self.push(Action::Record { at, to, record });
    }
}
