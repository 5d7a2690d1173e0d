//! Test rig: the procedure on a synthetic sensor and an ideal coil, with the promises checked at every
//! step.

#![allow(dead_code, reason = "no test uses all of it")]

pub(crate) mod calibration;
pub(crate) mod drive;
pub(crate) mod moves;
pub(crate) mod promises;
pub(crate) mod sensor;

use palpate_procedure::event::{Conditions, Failure};
use palpate_procedure::units::{Ampere, Celsius, Hertz};
use palpate_procedure::{
    Action, Actions, BoardInfo, Conversion, Duration, Event, Instant, Limits, Link, Procedure, Scan,
};
use palpate_wire::code::{Chip, FaultCode, Location, Outcome, ResetCause, State};
use palpate_wire::command::{ClearFault, DriveCoil, Settings, StiffeningCurve};
use palpate_wire::record::{
    Acknowledgement, CoilTest, Estimate, Fault, Hello, LoadPoint, Raw, Refusal, Relaxation, Sample,
    StateChange, Status, Storage, Touch, UncertaintyBudget,
};
use palpate_wire::{Command, Frame, Header, MINOR_VERSION, Record, SCHEMA_HASH};

use drive::SimulatedDrive;
use sensor::Sensor;

pub(crate) const BOOT: u32 = 7;

/// Converts a time to whole microseconds.
pub(crate) fn micros(time_s: f32) -> u64 {
    (time_s * 1e6).round() as u64
}

/// Every state except the fault.
pub(crate) const STATES: [State; 10] = [
    State::SelfTest,
    State::Baseline,
    State::Watching,
    State::Contact,
    State::Settling,
    State::Peak,
    State::Ramps,
    State::Estimating,
    State::Release,
    State::Manual,
];

/// Returns a board with one converter of four channels, and a coil.
pub(crate) fn board() -> BoardInfo {
    BoardInfo {
        boot_id: BOOT,
        hello: Hello {
            minor_version: MINOR_VERSION,
            schema_hash: SCHEMA_HASH,
            firmware_major: 0,
            firmware_minor: 1,
            firmware_patch: 0,
            commit: 0,
            dirty: false,
            simulated: true,
            board: palpate_wire::code::Board::Native,
            unit: 0,
            reset_cause: ResetCause::PowerOn,
            chip: Chip::Ldc161x,
            second_chip: Chip::Absent,
            configuration_crc: 0,
        },
        crash: None,
        storage: false,
        crashes: 0,
        channels: [0b1111, 0],
        coil: true,
        limits: Limits {
            current: Ampere(12.0),
            energy_j: 60.0,
            on_time_s: 20.0,
            temperature: Celsius(100.0),
            rate: Hertz(5_000.0),
        },
    }
}

/// Path of the coil's current: a straight line from the reported current to the start of the next line,
/// then that line, then constant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct CurrentPath {
    pub(crate) reported_a: f64,
    pub(crate) reported_us: u64,
    pub(crate) from_a: f64,
    pub(crate) to_a: f64,
    pub(crate) since_us: u64,
    pub(crate) over_us: u64,
}

impl CurrentPath {
    pub(crate) fn at(&self, time_us: u64) -> f64 {
        let gone = time_us.saturating_sub(self.since_us) as f64;
        if time_us < self.since_us {
            let part = time_us.saturating_sub(self.reported_us) as f64
                / (self.since_us - self.reported_us) as f64;
            self.reported_a + (self.from_a - self.reported_a) * part
        } else if gone < self.over_us as f64 {
            self.from_a + (self.to_a - self.from_a) * gone / self.over_us as f64
        } else {
            self.to_a
        }
    }

    /// Returns whether the current is at zero and stays there.
    pub(crate) fn is_off(&self) -> bool {
        self.to_a == 0.0 && self.over_us == 0
    }
}

/// Procedure with its simulated surroundings.
#[derive(Clone)]
pub(crate) struct Rig {
    pub(crate) procedure: Procedure,
    pub(crate) limits: Limits,
    pub(crate) sensor: Sensor,
    /// Gain of the current measurement; `current_offset_a` is its offset.
    pub(crate) current_gain: f64,
    pub(crate) current_offset_a: f64,
    /// RMS ripple as a function of the mean current, A; `tells_ripple` says whether it is reported.
    pub(crate) ripple_a: fn(f64) -> f64,
    pub(crate) tells_ripple: bool,
    pub(crate) line: CurrentPath,
    pub(crate) now_us: u64,
    pub(crate) records: Vec<(Instant, Record)>,
    pub(crate) sequence: u32,
    /// Duration of a coil test; `test_ends_us` is the end of the one in progress.
    pub(crate) test_us: u64,
    pub(crate) test_ends_us: Option<u64>,
    /// Drive of the coil with its energy guard; without it the coil is ideal.
    pub(crate) drive: Option<SimulatedDrive>,
    /// Commands without an answer yet: sequence number and kind.
    pub(crate) open: Vec<(u32, u8)>,
    /// The last command was a stop: neither drive nor test may start.
    pub(crate) stopped: bool,
    /// Events and the resulting actions, for a test that repeats them.
    pub(crate) tape: Option<Vec<Observed>>,
}

/// An event with its time and the resulting actions.
#[derive(Clone)]
pub(crate) struct Observed {
    pub(crate) now_us: u64,
    pub(crate) event: OwnEvent,
    pub(crate) actions: Actions,
}

/// An event that owns its data.
#[derive(Clone)]
pub(crate) enum OwnEvent {
    Tick,
    Scan(Scan),
    Command(Frame<Command>),
    Conditions(Conditions),
    CoilTested(CoilTest),
    Other,
}

impl OwnEvent {
    fn of(event: &Event<'_>) -> Self {
        match event {
            Event::Tick => Self::Tick,
            Event::Scan(scan) => Self::Scan((*scan).clone()),
            Event::Command(_, frame) => Self::Command((*frame).clone()),
            Event::Conditions(conditions) => Self::Conditions(*conditions),
            Event::CoilTested(found) => Self::CoilTested(found.clone()),
            _ => Self::Other,
        }
    }
}

impl Rig {
    /// Creates a device that has just started.
    pub(crate) fn started_as(board: BoardInfo) -> Self {
        Self {
            tape: None,
            limits: board.limits,
            procedure: Procedure::new(board),
            sensor: Sensor::default(),
            current_gain: 1.0,
            current_offset_a: 0.0,
            ripple_a: |_| 0.0,
            tells_ripple: false,
            line: CurrentPath::default(),
            now_us: 1_000_000,
            records: Vec::new(),
            sequence: 0,
            test_us: 0,
            test_ends_us: None,
            drive: None,
            open: Vec::new(),
            stopped: false,
        }
    }

    pub(crate) fn started() -> Self {
        Self::started_as(board())
    }

    /// Creates a rig that is calibrated for its sensor, with these settings and a coil at 25 degrees;
    /// not armed.
    pub(crate) fn calibrated(sensor: Sensor, settings: Settings) -> Self {
        let mut rig = Self::started();
        rig.sensor = sensor;
        rig.temperature(25.0);
        rig.accepted(Command::SetSettings(settings));
        for command in calibration::calibration(&rig.sensor.clone()) {
            rig.accepted(command);
        }
        rig
    }

    /// As [`calibrated`](Self::calibrated), armed and watching.
    pub(crate) fn armed(sensor: Sensor, settings: Settings) -> Self {
        let mut rig = Self::calibrated(sensor, settings);
        rig.arm();
        rig
    }

    /// As [`armed`](Self::armed) with changed settings, and touched.
    pub(crate) fn touched(change: impl FnOnce(&mut Settings)) -> Self {
        let mut rig = Self::armed(Sensor::default(), calibration::settings(change));
        rig.touch(3e-4);
        rig
    }

    /// Arms, and waits until the baseline is known.
    pub(crate) fn arm(&mut self) {
        self.accepted(Command::Arm);
        self.until(State::Watching, 60_000);
    }

    /// As [`arm`](Self::arm), and touches.
    pub(crate) fn arm_and_touch(&mut self) {
        self.arm();
        self.touch(3e-4);
    }

    /// Creates a calibrated rig with changed settings in this state; armed except in a fault.
    pub(crate) fn standing_in(state: State, change: impl FnOnce(&mut Settings)) -> Self {
        let mut rig = Self::calibrated(Sensor::default(), calibration::settings(change));
        rig.accepted(Command::Arm);
        match state {
            State::SelfTest | State::Baseline | State::Watching => {}
            State::Fault => drop(rig.fail(FaultCode::Bridge, Location::Bridge)),
            _ => {
                rig.until(State::Watching, 3_000);
                rig.touch(3e-4);
                if state == State::Manual {
                    rig.accepted(drive_coil(1.0, 0.01));
                } else if state != State::Contact {
                    rig.accepted(Command::Measure);
                }
            }
        }
        rig.until(state, 5_000);
        rig
    }

    /// Passes an event to the procedure, carries out its actions and checks the promises. Then reports
    /// the result of a coil test that has ended.
    pub(crate) fn step(&mut self, event: &Event<'_>) -> Actions {
        let line = self.line;
        let now_us = self.now_us;
        let drive = self.drive.as_mut();
        let is_over = drive.is_some_and(|drive| drive.advance(now_us, &line));
        let actions = self.step_alone(event);
        let is_refused = self.line != line
            && self
                .drive
                .as_ref()
                .is_some_and(|drive| drive.refuses(&self.line));
        if is_over || is_refused {
            self.fail(FaultCode::TooMuchEnergy, Location::Coil);
        }
        if self
            .test_ends_us
            .is_some_and(|ends_us| ends_us <= self.now_us)
        {
            self.test_ends_us = None;
            let found = self.coil_test();
            self.step_alone(&Event::CoilTested(found));
        }
        actions
    }

    /// Returns the result of the coil test.
    fn coil_test(&self) -> CoilTest {
        let mut found = coil_test();
        if let Some(drive) = &self.drive {
            found.resistance_ohm = drive.resistance_ohm() as f32;
            found.lost = drive.lost_v as f32 / found.supply_v;
        }
        found
    }

    fn step_alone(&mut self, event: &Event<'_>) -> Actions {
        let now = Instant::from_ticks(self.now_us);
        let actions = self.procedure.step(now, event);
        if let Some(tape) = &mut self.tape {
            tape.push(Observed {
                now_us: self.now_us,
                event: OwnEvent::of(event),
                actions: actions.clone(),
            });
        }
        for action in &actions {
            match action {
                Action::SafeState => {
                    self.line = CurrentPath::default();
                    self.test_ends_us = None;
                }
                Action::TestCoil => {
                    self.test_ends_us = Some(self.now_us + self.test_us);
                    if let Some(drive) = &mut self.drive {
                        drive.account.charge(1.0);
                    }
                }
                Action::Current(line) => {
                    let (reported_us, reported_a) = (self.now_us, self.line.at(self.now_us));
                    let since_us = line.start_us.max(reported_us);
                    self.line = CurrentPath {
                        reported_a,
                        reported_us,
                        from_a: if since_us > reported_us {
                            line.from_a.into()
                        } else {
                            reported_a
                        },
                        to_a: line.to_a.into(),
                        since_us,
                        over_us: micros(line.over_s),
                    };
                }
                Action::ConfigureSensors { .. }
                | Action::SeekDrive { .. }
                | Action::TraceCurrent { .. }
                | Action::CorrectCurrent(_) => {}
                Action::Record { at, record, .. } => self.records.push((*at, record.clone())),
                Action::Storage(_) | Action::Restart(_) | Action::Locate(_) => {}
            }
        }
        promises::hold(self, event, &actions);
        actions
    }

    pub(crate) fn period_us(&self) -> u64 {
        let rate_hz = self.procedure.configuration().settings().rate_hz;
        (1e6 / f64::from(rate_hz)) as u64
    }

    /// Returns the scan whose last conversion ends at this time.
    pub(crate) fn scan(&mut self) -> Scan {
        let window_us = self.period_us();
        let middle_us = self.now_us.saturating_sub(window_us / 2);
        let current_a = self.line.at(middle_us);
        let ripple_a = (self.ripple_a)(current_a);
        let effective_current_a = current_a.hypot(ripple_a).copysign(current_a);
        let reading = self
            .sensor
            .reading(effective_current_a, middle_us as f64 * 1e-6);
        let offset = Duration::from_ticks(0);
        let reported_a = current_a * self.current_gain + self.current_offset_a;
        Scan {
            sensor: 0,
            middle: Instant::from_ticks(middle_us),
            window: Duration::from_ticks(window_us),
            conversions: [Conversion { reading, offset }].into_iter().collect(),
            lost: 0,
            gap: false,
            current: Some(Ampere(reported_a as f32)),
            ripple: self.tells_ripple.then_some(Ampere(ripple_a as f32)),
            account: self
                .drive
                .as_ref()
                .filter(|drive| !drive.is_silent)
                .map(|drive| drive.account),
        }
    }

    /// Advances by a conversion period and passes a scan.
    pub(crate) fn convert(&mut self) -> Actions {
        self.now_us = self.now_us.saturating_add(self.period_us());
        let scan = self.scan();
        self.step(&Event::Scan(&scan))
    }

    /// As [`convert`](Self::convert), with the scan changed.
    pub(crate) fn convert_with(&mut self, change: impl FnOnce(&mut Scan)) -> Actions {
        self.now_us = self.now_us.saturating_add(self.period_us());
        let mut scan = self.scan();
        change(&mut scan);
        self.step(&Event::Scan(&scan))
    }

    /// Advances the time by `time_us` without a conversion.
    pub(crate) fn wait(&mut self, time_us: u64) -> Actions {
        self.now_us = self.now_us.saturating_add(time_us);
        self.step(&Event::Tick)
    }

    /// Converts for `ms` milliseconds.
    pub(crate) fn run(&mut self, ms: u64) {
        let end_us = self.now_us + ms * 1_000;
        while self.now_us < end_us {
            self.convert();
        }
    }

    /// Converts until a state is reached.
    pub(crate) fn until(&mut self, state: State, at_most_ms: u64) {
        let end_us = self.now_us + at_most_ms * 1_000;
        while self.state() != state {
            assert!(
                self.now_us < end_us,
                "{state} not reached in {at_most_ms} ms, but {}; {:?}",
                self.state(),
                self.refusals()
            );
            self.convert();
        }
    }

    /// Presses, and waits until the touch is detected.
    pub(crate) fn touch(&mut self, deformation_m: f64) {
        self.sensor.press(deformation_m);
        self.until(State::Contact, 3_000);
    }

    /// Lifts, and waits until the baseline is known again.
    pub(crate) fn lift(&mut self) {
        self.sensor.depth_m = 0.0;
        self.until(State::Watching, 3_000);
    }

    /// Measures the touching object.
    pub(crate) fn measure(&mut self) -> Estimate {
        self.accepted(Command::Measure);
        self.until(State::Estimating, 10_000);
        self.last()
    }

    /// Returns whether the interval of an estimate contains the true stiffness.
    pub(crate) fn covers(&self, estimate: &Estimate) -> bool {
        let truth = self.sensor.load_n_per_m as f32;
        let upper = estimate.upper_n_per_m.unwrap_or(f32::INFINITY);
        (estimate.lower_n_per_m..=upper).contains(&truth)
    }

    /// Requests a measurement that is refused.
    pub(crate) fn refused(&mut self) -> Refusal {
        let before = self.refusals().len();
        self.accepted(Command::Measure);
        for _ in 0..100_000 {
            if self.refusals().len() > before {
                break;
            }
            self.convert();
        }
        assert_eq!(self.refusals().len(), before + 1, "{}", self.state());
        self.refusals()[before].clone()
    }

    /// Sends a command to a boot; returns the actions.
    pub(crate) fn command(&mut self, command: Command, boot: u32) -> Actions {
        self.sequence += 1;
        let frame = frame(command, boot, self.sequence);
        self.step(&Event::Command(Link::Probe, &frame))
    }

    /// Sends a command; returns the only answer in this step, its own.
    pub(crate) fn send(&mut self, command: Command) -> Acknowledgement {
        let actions = self.command(command, BOOT);
        answers(&actions).pop().expect("an answer")
    }

    pub(crate) fn outcome(&mut self, command: Command) -> Outcome {
        self.send(command).outcome
    }

    pub(crate) fn accepted(&mut self, command: Command) {
        let answer = self.send(command.clone());
        assert_eq!(answer.outcome, Outcome::Accepted, "{command:?}: {answer:?}");
    }

    pub(crate) fn temperature(&mut self, temperature_c: f32) {
        self.step(&Event::Conditions(Conditions {
            temperature: Some(Celsius(temperature_c)),
            ..Conditions::default()
        }));
    }

    pub(crate) fn fail(&mut self, code: FaultCode, location: Location) -> Actions {
        self.step(&Event::Fault(Failure::new(code, location)))
    }

    pub(crate) fn state(&self) -> State {
        self.procedure.state()
    }

    pub(crate) fn settings(&self) -> &Settings {
        self.procedure.configuration().settings()
    }

    /// Returns the content of all records of a kind.
    pub(crate) fn all<T: Content>(&self) -> Vec<T> {
        let records = self.records.iter();
        records
            .filter_map(|(_, record)| T::of(record).cloned())
            .collect()
    }

    pub(crate) fn last<T: Content>(&self) -> T {
        self.all().pop().expect("such a record")
    }

    pub(crate) fn refusals(&self) -> Vec<Refusal> {
        self.all()
    }

    pub(crate) fn faults(&self) -> Vec<Fault> {
        self.all()
    }

    pub(crate) fn changes(&self) -> Vec<StateChange> {
        self.all()
    }

    /// Requests the counters.
    pub(crate) fn status(&mut self) -> Status {
        self.accepted(Command::Identify);
        self.last()
    }

    /// Returns the states entered, in order.
    pub(crate) fn states(&self) -> Vec<State> {
        let changes = self.changes();
        let moved = changes.iter().filter(|of| of.state != of.previous);
        moved.map(|of| of.state).collect()
    }
}

/// Returns the result of a coil test.
pub(crate) fn coil_test() -> CoilTest {
    CoilTest {
        resistance_ohm: 0.48,
        inductance_h: 4e-5,
        lost: 0.006,
        zero_v: 1.65,
        supply_v: 12.0,
        limited_to_a: None,
    }
}

/// Returns the frame of a command.
pub(crate) fn frame(message: Command, boot_id: u32, sequence: u32) -> Frame<Command> {
    let header = Header {
        boot_id,
        sequence,
        time_us: 0,
        dropped: 0,
    };
    Frame { header, message }
}

/// Content of the records of one kind.
pub(crate) trait Content: Clone {
    fn of(record: &Record) -> Option<&Self>;
}

macro_rules! contents {
    ($($kind:ident: $content:ty,)+) => {$(
        impl Content for $content {
            fn of(record: &Record) -> Option<&Self> {
                match record {
                    Record::$kind(content) => Some(content),
                    _ => None,
                }
            }
        }
    )+};
}

contents! {
    Acknowledgement: Acknowledgement,
    CoilTest: CoilTest,
    Estimate: Estimate,
    Fault: Fault,
    Hello: Hello,
    LoadPoint: LoadPoint,
    Raw: Raw,
    Refusal: Refusal,
    Relaxation: Relaxation,
    Sample: Sample,
    State: StateChange,
    Status: Status,
    StiffeningCurve: StiffeningCurve,
    Storage: Storage,
    Touch: Touch,
    UncertaintyBudget: UncertaintyBudget,
}

/// Returns the answers among the actions.
pub(crate) fn answers(actions: &Actions) -> Vec<Acknowledgement> {
    let answers = actions.iter().filter_map(|action| match action {
        Action::Record { record, .. } => Acknowledgement::of(record).cloned(),
        _ => None,
    });
    answers.collect()
}

/// Returns the command that clears a fault.
pub(crate) fn clear(code: FaultCode) -> Command {
    Command::ClearFault(ClearFault { code })
}

/// Returns the command that drives a current without a trace.
pub(crate) fn drive_coil(to_a: f32, over_s: f32) -> Command {
    Command::DriveCoil(DriveCoil {
        to_a,
        over_s,
        trace_interval_s: 0.0,
    })
}
