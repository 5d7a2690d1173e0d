//! The procedure on a recorded stream, from the point at which the board started to learn.

use ldc161x::{Channel, Reading, Word};
use palpate_node::acquisition::{Scheme, Setpoint};
use palpate_node::board::LIMITS;
use palpate_procedure::event::Conditions;
use palpate_procedure::units::{Ampere, Celsius};
use palpate_procedure::{
    Action, Actions, BoardInfo, Conversion, Duration, Event, Instant, Link, Procedure, Scan,
};
use palpate_wire::code::{Chip, Mode, Outcome, RefusalReason, ResetCause, State};
use palpate_wire::record::{CoilTest, Hello, Sample, StateChange};
use palpate_wire::{Command, Frame, Header, Message, Record};

use super::ActiveConfiguration;

/// Channels of an LDC1614.
const CHANNELS: u8 = 0b1111;
/// Link of the replayed commands. The procedure treats all links alike.
const LINK: Link = Link::Usb;
/// Test result of a coil that was tested before the replay started. It affects only the energy of
/// the coil's drive, which is not replayed.
const TESTED: CoilTest = CoilTest {
    resistance_ohm: 0.0,
    inductance_h: 0.0,
    lost: 0.0,
    zero_v: 0.0,
    supply_v: 0.0,
    limited_to_a: None,
};

/// A procedure, with the records it has made.
#[derive(Debug)]
pub(super) struct Run {
    procedure: Procedure,
    actions: Actions,
    /// Time of the last step.
    now: Instant,
    /// Duration of a conversion.
    window: Duration,
    /// Time from the middle of a scan's first conversion to the end of that conversion. Any step
    /// with the scan runs later.
    before_edge: Duration,
    /// Converter and channel of each deformation curve.
    curves: Vec<(u8, u8)>,
    /// Whether the replay has learnt the untouched sensor of an array from the same scans as the board.
    knows_rest: bool,
    /// Computed records that have not been compared yet.
    made: Vec<Record>,
}

impl Run {
    /// Starts at a time of the board's clock; `None` if the procedure refuses the settings or the
    /// calibration.
    pub(super) fn begin(
        boot_id: u32,
        active_configuration: &ActiveConfiguration,
        at: Instant,
        is_armed: bool,
    ) -> Option<Self> {
        let settings = &active_configuration.settings;
        let setpoint = Setpoint {
            channels: settings.channels,
            rate_hz: settings.rate_hz,
            shares_bus: false,
        };
        // Times within a scan do not depend on how its frame is read.
        let scheme = Scheme::new(setpoint, false).ok()?;
        let mut run = Self {
            procedure: Procedure::new(board(boot_id, &active_configuration.hello)),
            actions: Actions::new(),
            now: at,
            window: Duration::from_ticks(scheme.window_us.into()),
            before_edge: Duration::from_ticks(scheme.before_edge_us.into()),
            curves: curves(&active_configuration.calibration),
            knows_rest: false,
            made: Vec::new(),
        };
        run.event(at, &Event::Tick);
        let settings = Command::SetSettings(settings.clone());
        for command in active_configuration.calibration.iter().chain([&settings]) {
            // The identity of the calibration changes no result.
            if !matches!(command, Command::SetCalibrationIdentity(_)) {
                run.accepted(command, at)?;
            }
        }
        if is_armed {
            run.accepted(&Command::Arm, at)?;
            run.event(at, &Event::CoilTested(TESTED));
        }
        run.made.clear();
        Some(run)
    }

    /// Whether the procedure is in the board's state. A new procedure in `SelfTest` matches a board
    /// in `Baseline`: it learns from the first conversion on, but reports `Baseline` after ten.
    pub(super) fn is_in(&self, state: State) -> bool {
        let is = self.procedure.state();
        is == state || (is, state) == (State::SelfTest, State::Baseline)
    }

    /// Takes a sample, and the board's records up to the next sample.
    pub(super) fn step(&mut self, group: &[Frame<Record>]) {
        // Drops computed samples that the board did not send: no later record can match them.
        self.made
            .retain(|record| is_computed(record) && !is_of_a_scan(record));
        for (place, frame) in group.iter().enumerate() {
            let at = Instant::from_ticks(frame.header.time_us);
            match &frame.message {
                Record::Sample(sample) => {
                    let followers = group.get(place + 1..).unwrap_or_default();
                    self.scan(at, sample, followers);
                }
                Record::State(change) => self.follow(at, change),
                Record::CoilTest(found) => self.event(at, &Event::CoilTested(found.clone())),
                Record::Status(status) => self.measured(at, status.temperature_c),
                message if is_computed(message) && self.place(message).is_none() => {
                    self.event(at, &Event::Tick);
                }
                _ => {}
            }
        }
    }

    /// Whether touches, and refusals by their place, can be compared; `false` for good once the board may have left out a scan.
    pub(super) const fn set_knows_rest(&mut self, knows_rest: bool) {
        self.knows_rest = knows_rest;
    }

    pub(super) fn knows(&self, record: &Record) -> bool {
        let is_by_touch = match record {
            Record::Touch(_) => true,
            Record::Refusal(refusal) => refusal.reason == RefusalReason::OffCentre,
            _ => false,
        };
        self.knows_rest || !is_by_touch
    }

    /// Takes the computed record that corresponds to a record of the board.
    pub(super) fn take(&mut self, sent: &Record) -> Option<Record> {
        let place = self.place(sent)?;
        Some(self.made.remove(place))
    }

    fn place(&self, sent: &Record) -> Option<usize> {
        let number = |record: &Record| match record {
            Record::LoadPoint(point) => point.index,
            Record::Sample(sample) => sample.sensor,
            _ => 0,
        };
        let is_same = |made: &Record| made.kind() == sent.kind() && number(made) == number(sent);
        self.made.iter().position(is_same)
    }

    fn scan(&mut self, middle: Instant, sample: &Sample, followers: &[Frame<Record>]) {
        let edge = Instant::from_ticks(middle.as_ticks() + self.before_edge.as_ticks());
        // The status in this step has the temperature at the start of a touch or of a measurement.
        let temperature_c = followers.iter().find_map(|frame| match &frame.message {
            Record::Status(status) => status.temperature_c,
            _ => None,
        });
        if temperature_c.is_some() {
            self.measured(edge, temperature_c);
        }
        let scan = self.scan_of(middle, sample);
        let stepped = followers
            .iter()
            .filter(|frame| shows_its_step(&frame.message));
        let stepped = stepped.map(|frame| frame.header.time_us).min();
        let now = stepped.map_or(edge, |time_us| Instant::from_ticks(time_us).max(edge));
        self.event(now, &Event::Scan(&scan));
    }

    fn scan_of(&self, middle: Instant, sample: &Sample) -> Scan {
        let mut scan = Scan {
            sensor: sample.sensor,
            middle,
            window: self.window,
            conversions: Default::default(),
            lost: sample.missed,
            gap: sample.gap,
            current: sample.current_a.map(Ampere),
            ripple: sample.ripple_a.map(Ampere),
            account: None,
        };
        let conversions = sample.channels.iter().map(|of| {
            let has_curve = self.curves.contains(&(sample.sensor, of.channel));
            let channel = Channel::ALL.get(usize::from(of.channel));
            let reading = Reading {
                channel: channel.copied().unwrap_or_default(),
                word: Word::from_registers((of.word >> 16) as u16, of.word as u16),
                frequency_hz: of.frequency_hz,
                sigma_hz: of.sigma_hz,
                // A deformation is missing if the driver distrusts the conversion because it
                // follows a gap; the word itself does not show the gap.
                after_gap: has_curve && of.deformation_m.is_none(),
                ..Reading::default()
            };
            Conversion {
                reading,
                offset: Duration::from_ticks(of.offset_us.into()),
            }
        });
        scan.conversions.extend(conversions);
        scan
    }

    /// Repeats the command that the board's change of state shows.
    fn follow(&mut self, at: Instant, change: &StateChange) {
        if change.armed != self.procedure.is_armed() {
            self.command(at, &arming(change));
        }
        if self.is_in(change.state) {
            return;
        }
        if change.state == State::Settling {
            self.command(at, &Command::Measure);
        } else {
            self.event(at, &Event::Tick);
        }
    }

    fn measured(&mut self, at: Instant, temperature_c: Option<f32>) {
        let conditions = Conditions {
            temperature: temperature_c.map(Celsius),
            ..Conditions::default()
        };
        self.event(at, &Event::Conditions(conditions));
    }

    fn accepted(&mut self, command: &Command, at: Instant) -> Option<()> {
        self.made.clear();
        self.command(at, command);
        let is_accepted = |record: &Record| match record {
            Record::Acknowledgement(answer) => answer.outcome == Outcome::Accepted,
            _ => false,
        };
        self.made.iter().any(is_accepted).then_some(())
    }

    fn command(&mut self, at: Instant, command: &Command) {
        let header = Header {
            boot_id: self.procedure.boot_id(),
            sequence: 0,
            time_us: 0,
            dropped: 0,
        };
        let frame = Frame {
            header,
            message: command.clone(),
        };
        self.event(at, &Event::Command(LINK, &frame));
    }

    /// Runs a step. Time never goes back: a step that is earlier than the last one runs at the last
    /// one's time.
    fn event(&mut self, at: Instant, event: &Event<'_>) {
        self.now = self.now.max(at);
        self.procedure.step_into(self.now, event, &mut self.actions);
        let records = self.actions.iter().filter_map(|action| match action {
            Action::Record { record, .. } => Some(record.clone()),
            _ => None,
        });
        self.made.extend(records);
    }
}

/// Whether the time of a record is that of its step.
const fn shows_its_step(record: &Record) -> bool {
    matches!(
        record,
        Record::State(_) | Record::Estimate(_) | Record::Refusal(_)
    )
}

/// Command that armed or disarmed the board.
fn arming(change: &StateChange) -> Command {
    match (change.armed, change.mode) {
        (true, _) => Command::Arm,
        (false, Mode::SensingOnly) => Command::SensingOnly,
        (false, _) => Command::Disarm,
    }
}

/// Data of the board for the procedure, as after a start without any fault.
fn board(boot_id: u32, hello: &Hello) -> BoardInfo {
    let channels = |chip: Chip| if chip == Chip::Ldc161x { CHANNELS } else { 0 };
    BoardInfo {
        boot_id,
        hello: Hello {
            reset_cause: ResetCause::PowerOn,
            ..hello.clone()
        },
        crash: None,
        crashes: 0,
        channels: [CHANNELS, channels(hello.second_chip)],
        coil: true,
        storage: false,
        limits: LIMITS,
    }
}

/// Converter and channel of each deformation curve.
fn curves(calibration: &[Command]) -> Vec<(u8, u8)> {
    let of = |command: &Command| match command {
        Command::SetDeformationCurve(curve) => Some((curve.sensor, curve.channel)),
        _ => None,
    };
    calibration.iter().filter_map(of).collect()
}

/// Whether a record is computed from conversions.
pub(super) const fn is_computed(record: &Record) -> bool {
    matches!(
        record,
        Record::Sample(_)
            | Record::Estimate(_)
            | Record::UncertaintyBudget(_)
            | Record::Relaxation(_)
            | Record::LoadPoint(_)
            | Record::Refusal(_)
            | Record::Touch(_)
    )
}

/// Whether a scan makes the record at once.
const fn is_of_a_scan(record: &Record) -> bool {
    matches!(record, Record::Sample(_) | Record::Touch(_))
}
