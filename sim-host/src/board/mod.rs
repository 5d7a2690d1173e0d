//! The virtual board: the instrument's own driver and procedure against the simulated converter
//! and plant, on the virtual clock.
//!
//! What runs here is what runs on the real board - the same driver, the same procedure, the same
//! records - with the tasks between them replaced by one loop: wait for INTB, read the frame, tell
//! the procedure, do what it asks. The coil's current is ideal: it follows the commanded profile,
//! within what the supply can push.
//!
//! ```
//! use palpate_sim::Time;
//! use palpate_sim::board::{Hardware, VirtualBoard};
//! use palpate_sim::device::Device;
//! use palpate_sim::parameters::draw;
//! use palpate_sim::stack::{Disturbances, Stack};
//! use palpate_sim::switches::Switches;
//! use palpate_sim::world::{Setup, World};
//!
//! let plant = draw(&Stack::builtin("ultrasoft")?, &Disturbances::builtin()?, 1);
//! let hardware = Hardware::new(World::new(&plant, Switches::all(), Setup::default())?);
//! let mut board = VirtualBoard::new(&hardware);
//! board.run_until(Time::from_ms(500))?;
//! let records = board.take_records();
//! assert!(records.len() > 400, "samples at 1 kHz after the start");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod identity;

use core::cell::RefCell;
use core::fmt;

use coil_hbridge::{Account, Correction, SELF_TEST_J};
use ldc161x::{
    Acquisition, Address, Channel, Error, Frame, Ldc161x, Model, Plan, Rate, ReferenceClock,
    Request, Sensor, Sequence,
};
use ldc161x_sim::{Bus, Chip, Delay, I2cError, IntbPin, Time};
use palpate_procedure::event::{Conditions, Failure};
use palpate_procedure::units::{Ampere, Celsius};
use palpate_procedure::{Action, Actions, Conversion, Duration, Event, Instant, Procedure, Scan};
use palpate_wire::code::{FaultCode, Place};
use palpate_wire::record::{CoilTest, CurrentTrace};
use palpate_wire::{Command, Header, Message, Record, Sequencer};

use crate::device::Device;
use crate::electrical::{reference_hardware, reference_limits};
use crate::world::{SharedWorld, World};

pub use identity::{BOOT_ID, board};

/// Settings with which the instrument starts.
#[must_use]
pub fn default_settings() -> palpate_wire::command::Settings {
    palpate_procedure::configuration::DEFAULT_SETTINGS
}

/// Delay of a drive's current behind the commanded line: an order waits for its period, the control
/// law for two, and for eight while the current follows its profile. In what the image reports of ramps
/// of 0.17 A/ms, on the sensors of seeds 1 to 8 without disturbances, a fall's knee is 86 to 147 us
/// late, 112 on average. An elastomer that lags behind the current makes half a per cent of a hard load
/// of it.
const RESPONSE: Time = Time::from_us(112);

/// CLKIN for one channel (shared pin plan: 120 MHz divided by 4).
const SINGLE_CLKIN_HZ: u32 = 30_000_000;
/// CLKIN for several: 120 MHz divided by 3.
const SCAN_CLKIN_HZ: u32 = 40_000_000;
/// I2C clock.
const SCL_HZ: u32 = 400_000;
/// Longest wait for an interrupt before the procedure receives the time.
const TICK: Time = Time::from_ms(10);
/// How often the board reports temperature and supply.
const CONDITIONS_PERIOD: Time = Time::from_ms(100);
/// Samples of the ADC averaged over a conversion: at 10 kHz.
const ADC_SAMPLES_PER_S: f64 = 10e3;
/// Currents of a record, each the mean over a period of the reference board's bridge, from two
/// samples.
const TRACE_LENGTH: usize = 128;
/// See [`TRACE_LENGTH`].
const TRACE_WINDOW: Time = Time::from_us(16);
/// See [`TRACE_LENGTH`].
const TRACE_SAMPLES: u32 = 2;
/// Reading of the current amplifier without current: the middle of the ADC's range.
const AMPLIFIER_ZERO_V: f32 = 1.65;
/// Rounds in which a drive's true current is found.
const ROUNDS: u32 = 6;
/// Straight pieces of a true current whose measured one is a straight line: 16 leave 0.2 mA of a bow
/// of 8 LSB.
const PIECES: u32 = 16;
/// Supply that the board reports where the world's has no limit: that of the reference board.
const NO_LIMIT_V: f64 = 12.0;
/// How long the coil's test takes: that of the reference board's coil, 40 uH and 0.5 ohm at 12 V.
const COIL_TEST: Time = Time::from_ms(60);
/// A current that is no error of the world's sums.
const UNWANTED_A: f64 = 0.01;
/// Longest wait for an answer: what waits for the coil's test is answered after it.
const ANSWER: Time = Time::from_ms(500);
/// A failed start is tried again after this time.
const RETRY: Time = Time::from_ms(20);

/// What the board is wired to: converter and world.
#[derive(Debug)]
pub struct Hardware {
    world: SharedWorld,
    chip: RefCell<Chip<SharedWorld>>,
}

impl Hardware {
    /// A converter in this world, at the world's own time.
    #[must_use]
    pub fn new(world: World) -> Self {
        Self::clocked(world, SINGLE_CLKIN_HZ)
    }

    /// The same with the clock that autoscan needs.
    #[must_use]
    pub fn for_several_channels(world: World) -> Self {
        Self::clocked(world, SCAN_CLKIN_HZ)
    }

    fn clocked(world: World, clkin_hz: u32) -> Self {
        let settings = world.chip_settings(f64::from(clkin_hz));
        let start = world.now();
        let world = SharedWorld::new(world);
        let mut chip = Chip::new(settings, world.clone());
        chip.advance_to(start);
        Self {
            world,
            chip: RefCell::new(chip),
        }
    }

    /// The world, to move its press and to look at what is truly there.
    #[must_use]
    pub fn world(&self) -> &SharedWorld {
        &self.world
    }

    /// The converter, to schedule faults and to look at its record.
    #[must_use]
    pub fn chip(&self) -> &RefCell<Chip<SharedWorld>> {
        &self.chip
    }

    fn clkin_hz(&self) -> u32 {
        let clock = self.chip.borrow().settings().external_clock;
        clock.map_or(SINGLE_CLKIN_HZ, |clock| clock.frequency_hz as u32)
    }
}

/// Why the board cannot run.
#[derive(Clone, Debug, PartialEq)]
pub enum BoardError {
    /// The converter cannot be configured as asked.
    Plan(ldc161x::Refusal),
    /// A command of this kind was not answered.
    NoAnswer {
        /// The command's kind.
        kind: u8,
    },
}

impl fmt::Display for BoardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plan(refusal) => write!(f, "converter: {refusal}"),
            Self::NoAnswer { kind } => {
                write!(f, "the command 0x{kind:02x} was not answered")
            }
        }
    }
}

impl core::error::Error for BoardError {}

/// A record with its time.
pub type TimedRecord = (Instant, Record);

type Driver<'a> = Ldc161x<Bus<'a, SharedWorld>>;

/// The board under way.
#[derive(Debug)]
pub struct VirtualBoard<'a> {
    hardware: &'a Hardware,
    driver: Driver<'a>,
    interrupt: IntbPin<'a, SharedWorld>,
    delay: Delay<'a, SharedWorld>,
    procedure: Procedure,
    sensing: Option<Sensing>,
    wanted: Option<Plan>,
    correction: Option<Correction>,
    tracing: Option<Tracing>,
    /// When the test of the coil ends.
    test_ends: Option<Time>,
    /// The energy that the coil has taken and not given off yet, and until when it is counted.
    account: Account,
    counted: Time,
    next_conditions: Time,
    commands_sent: u32,
    sequencer: Sequencer,
    frames: Vec<palpate_wire::Frame<Record>>,
}

/// The converter under way.
#[derive(Clone, Copy, Debug)]
struct Sensing {
    plan: Plan,
    conversion: Time,
    /// Time of the last edge.
    last: Option<Time>,
}

/// A record of the current under way.
#[derive(Clone, Debug)]
struct Tracing {
    began: Time,
    interval: Time,
    next: Time,
    currents_a: Vec<f32>,
}

impl Tracing {
    fn new(began: Time, interval_s: f64) -> Self {
        let interval = Time::from_secs_f64(interval_s).max(TRACE_WINDOW);
        Self {
            began,
            interval,
            next: began + interval,
            currents_a: Vec::new(),
        }
    }

    /// The parts in which it is sent, each with the time of its first current.
    fn parts(&self) -> impl Iterator<Item = (Instant, CurrentTrace)> + '_ {
        let interval_s = self.interval.as_secs_f64() as f32;
        (0..)
            .step_by(16)
            .zip(self.currents_a.chunks(16))
            .map(move |(first, chunk)| {
                let at = self.began + Time::from_ps(self.interval.as_ps() * (u64::from(first) + 1));
                let trace = CurrentTrace {
                    total: TRACE_LENGTH as u8,
                    first,
                    interval_s,
                    currents_a: chunk.iter().copied().collect(),
                };
                (Instant::from_ticks(micros(at)), trace)
            })
    }
}

impl<'a> VirtualBoard<'a> {
    /// A board that starts now, with default settings and no calibration.
    #[must_use]
    pub fn new(hardware: &'a Hardware) -> Self {
        let bus = Bus::new(&hardware.chip, SCL_HZ);
        Self {
            hardware,
            driver: Ldc161x::new(bus, Model::Ldc1614, Address::AddrLow),
            interrupt: IntbPin::new(&hardware.chip),
            delay: Delay::new(&hardware.chip),
            procedure: Procedure::new(board()),
            sensing: None,
            wanted: None,
            correction: None,
            tracing: None,
            test_ends: None,
            account: Account::new(&reference_hardware(), &reference_limits()),
            counted: hardware.world.borrow().now(),
            next_conditions: hardware.world.borrow().now(),
            commands_sent: 0,
            sequencer: Sequencer::new(BOOT_ID),
            frames: Vec::new(),
        }
    }

    /// Sends a command without waiting for its answer; returns its number.
    ///
    /// # Errors
    /// If the board cannot run on.
    pub fn post(&mut self, command: Command) -> Result<u32, BoardError> {
        let sequence = self.commands_sent;
        let header = Header {
            boot_id: BOOT_ID,
            sequence,
            time_us: 0,
            dropped: 0,
        };
        self.commands_sent += 1;
        let frame = palpate_wire::Frame {
            header,
            message: command,
        };
        self.step(&Event::Command(&frame))?;
        Ok(sequence)
    }

    /// The procedure, to look at.
    #[must_use]
    pub fn procedure(&self) -> &Procedure {
        &self.procedure
    }

    /// No edge: time goes on, and a converter that has not started is tried again.
    fn idle(&mut self) -> Result<(), BoardError> {
        if self.sensing.is_none() && self.wanted.is_some() {
            self.start_sensing();
        }
        self.step(&Event::Tick)
    }

    fn converted(&mut self, edge: Time, sensing: Sensing) -> Result<(), BoardError> {
        match self.driver.read_frame() {
            Ok(frame) => {
                let scan = self.scan(edge, &sensing, &frame);
                self.sensing = Some(Sensing {
                    last: Some(edge),
                    ..sensing
                });
                self.step(&Event::Scan(&scan))
            }
            Err(error) => {
                self.sensing = None;
                self.step(&Event::Fault(failure(&error)))
            }
        }
    }

    fn scan(&self, edge: Time, sensing: &Sensing, frame: &Frame) -> Scan {
        let channels = frame.readings().len() as u64;
        let slot = Time::from_ps(1_000 * sensing.plan.frame_period_ns / channels.max(1));
        let first = edge - Time::from_ps(slot.as_ps() * (channels.max(1) - 1));
        let begins = first - sensing.conversion;
        let middle = first - Time::from_ps(sensing.conversion.as_ps() / 2);
        let conversions = frame.readings().iter().enumerate().map(|(place, reading)| {
            let offset = Time::from_ps(slot.as_ps() * place as u64);
            Conversion {
                reading: *reading,
                offset: Duration::from_ticks(micros(offset)),
            }
        });
        let samples = (sensing.conversion.as_secs_f64() * ADC_SAMPLES_PER_S).max(1.0) as u32;
        let reported_a = self.reported_a(begins, first, samples);
        let ripple_a = self.hardware.world.borrow().ripple_a(reported_a);
        Scan {
            sensor: 0,
            middle: Instant::from_ticks(micros(middle)),
            window: Duration::from_ticks(micros(sensing.conversion)),
            conversions: conversions.take(4).collect(),
            lost: lost(edge, sensing),
            gap: frame.marks.gap,
            current: Some(Ampere(reported_a as f32)),
            // A drive that knows its coil knows the ripple.
            ripple: Some(Ampere(ripple_a as f32)),
            account: Some(self.account),
        }
    }

    /// The measured mean of the current, without its zero, corrected.
    fn reported_a(&self, from: Time, to: Time, samples: u32) -> f64 {
        let mut world = self.hardware.world.borrow_mut();
        // A drive finds its zero before it drives.
        let zero_a = world.measured_zero_a();
        let measured_a = world.reported_mean_current_a(from, to, samples) - zero_a;
        drop(world);
        self.corrected_a(measured_a)
    }

    /// A drive leads its measured current along the line, for it knows no other: the measurement's
    /// errors bend the true one.
    ///
    /// `until` says how long it takes to where the line begins, and where that is; without it the
    /// line begins now.
    fn follow_line(&self, until: Option<(Time, f64)>, to_a: f64, over: Time) {
        let (begin, from_a) = until.unwrap_or_else(|| {
            // From where it is, which a supply may have kept from where it was led.
            let now_a = self.hardware.world.borrow().truth().current_a;
            (Time::ZERO, self.measured_a(now_a))
        });
        let begin = begin + RESPONSE;
        let points: Vec<(Time, f64)> = (0..=PIECES)
            .map(|piece| {
                let part = f64::from(piece) / f64::from(PIECES);
                let time = Time::from_ps(over.as_ps() / u64::from(PIECES) * u64::from(piece));
                (
                    begin + time,
                    self.flowing_a(from_a + part * (to_a - from_a)),
                )
            })
            .collect();
        self.hardware.world.borrow_mut().follow_current(&points);
    }

    /// The measured value of a true current, without noise, A.
    fn measured_a(&self, true_a: f64) -> f64 {
        let world = self.hardware.world.borrow();
        let chain = &world.parameters().current;
        self.corrected_a(chain.noiseless_a(true_a) - chain.zero_a())
    }

    /// The true current whose measured value this is, A.
    fn flowing_a(&self, wanted_a: f64) -> f64 {
        // Gain and bow are off by parts of a hundred: each round leaves as little of the error.
        (0..ROUNDS).fold(wanted_a, |true_a, _| {
            true_a - (self.measured_a(true_a) - wanted_a)
        })
    }

    fn corrected_a(&self, measured_a: f64) -> f64 {
        match &self.correction {
            Some(of) => of
                .corrected_a(measured_a as f32, &reference_hardware())
                .into(),
            None => measured_a,
        }
    }

    /// Records what has passed of the current, and tells it when there is all of it.
    fn follow_trace(&mut self) -> Result<(), BoardError> {
        let now = self.now();
        let Some(mut tracing) = self.tracing.take() else {
            return Ok(());
        };
        while tracing.currents_a.len() < TRACE_LENGTH && tracing.next <= now {
            let from = tracing.next - TRACE_WINDOW;
            let reported_a = self.reported_a(from, tracing.next, TRACE_SAMPLES);
            tracing.currents_a.push(reported_a as f32);
            tracing.next += tracing.interval;
        }
        if tracing.currents_a.len() < TRACE_LENGTH {
            self.tracing = Some(tracing);
            return Ok(());
        }
        for (at, trace) in tracing.parts() {
            self.step(&Event::CurrentTraced { at, trace })?;
        }
        Ok(())
    }

    /// Reports what the test of the coil has found, when it is over.
    fn follow_test(&mut self) -> Result<(), BoardError> {
        if self.test_ends.is_some_and(|ends| ends <= self.now()) {
            self.test_ends = None;
            let found = self.coil_test();
            self.step(&Event::CoilTested(found))?;
        }
        Ok(())
    }

    /// The drive's guard of energy: counts what has flowed, and ends what is too much.
    fn count_energy(&mut self) -> Result<(), BoardError> {
        let (from, now) = (self.counted, self.now());
        if now <= from {
            return Ok(());
        }
        self.counted = now;
        let world = self.hardware.world.borrow();
        let mean_a = world.mean_current_a(from, now);
        let square_a2 = mean_a * mean_a + world.ripple_a(mean_a).powi(2);
        drop(world);
        let elapsed_s = (now - from).as_secs_f64();
        let taken_j = self.coil_test().resistance_ohm * (square_a2 * elapsed_s) as f32;
        self.account.pass(taken_j, elapsed_s as f32);
        if mean_a.abs() > UNWANTED_A && self.account.is_used_up() {
            let failure = Failure {
                value: Some(self.account.energy_j()),
                limit: Some(self.account.usable_j()),
                ..Failure::new(FaultCode::TooMuchEnergy, Place::Coil)
            };
            self.step(&Event::Fault(failure))?;
        }
        Ok(())
    }

    fn conditions(&self) -> Conditions {
        let world = self.hardware.world.borrow();
        let truth = world.truth();
        let supply_v = world.parameters().current.supply_v;
        Conditions {
            temperature: Some(Celsius(truth.pad_c as f32)),
            supply_v: supply_v.is_finite().then_some(supply_v as f32),
            ..Conditions::default()
        }
    }

    /// Tells the procedure, and does what it asks.
    fn step(&mut self, event: &Event<'_>) -> Result<(), BoardError> {
        let now = self.now();
        self.hardware.world.borrow_mut().advance_to(now);
        let actions = self.procedure.step(Instant::from_ticks(micros(now)), event);
        self.carry_out(actions)
    }

    fn carry_out(&mut self, actions: Actions) -> Result<(), BoardError> {
        for action in actions {
            match action {
                Action::SafeState => {
                    self.test_ends = None;
                    self.hardware.world.borrow_mut().set_current(0.0);
                }
                Action::Current { at, from, to, over } => {
                    let ahead = at.as_ticks().saturating_sub(micros(self.now()));
                    let until = (ahead > 0).then(|| (Time::from_us(ahead), from.0.into()));
                    let over = Time::from_us(over.as_ticks());
                    self.follow_line(until, to.0.into(), over);
                }
                // An ideal source of current has nothing to find; it takes the time all the same.
                Action::TestCoil => {
                    self.test_ends = Some(self.now() + COIL_TEST);
                    self.account.charge(SELF_TEST_J);
                }
                Action::TraceCurrent { interval } => {
                    self.tracing = Some(Tracing::new(self.now(), interval.0.into()));
                }
                Action::CorrectCurrent(correction) => {
                    let pairs: Vec<[f32; 2]> = correction
                        .places()
                        .map(|(measured_a, change_a)| [measured_a, measured_a + change_a])
                        .collect();
                    let made = Correction::new(&pairs, &reference_hardware());
                    self.correction = made.ok();
                }
                Action::ConfigureSensors { channels, rate } => {
                    let plan = self.plan(channels, rate.0).map_err(BoardError::Plan)?;
                    self.wanted = Some(plan);
                    self.start_sensing();
                }
                Action::Record { at, record } => self.frames.push(palpate_wire::Frame {
                    header: self.sequencer.stamp(at.as_ticks()),
                    message: record,
                }),
            }
        }
        Ok(())
    }

    /// What a test of the ideal source finds: the coil as it is.
    fn coil_test(&self) -> CoilTest {
        let world = self.hardware.world.borrow();
        let current = &world.parameters().current;
        let supply_v = if current.supply_v.is_finite() {
            current.supply_v
        } else {
            NO_LIMIT_V
        };
        CoilTest {
            resistance_ohm: (world.truth().coil_ohm + current.supply_ohm) as f32,
            inductance_h: current.inductance_h as f32,
            lost: 0.0,
            zero_v: AMPLIFIER_ZERO_V,
            supply_v: supply_v as f32,
            limited_to_a: None,
        }
    }

    /// Register values for channels and a rate, for a sensor as the coil's designer knows it: its
    /// frequency and losses at rest, and what a press may make of them.
    fn plan(&self, channels: u8, rate_hz: f32) -> Result<Plan, ldc161x::Refusal> {
        let world = self.hardware.world.borrow();
        let rest_hz = world.frequency_hz(world.now().as_secs_f64()).unwrap_or(3e6);
        let (quality, parallel_ohm) = world.losses(rest_hz);
        let sensor = Sensor {
            highest_quality_factor: quality.ceil() as u16,
            // At rest; a press raises L by a fifth at most (0.4 mm between slabs 1 mm off), and with
            // it the parallel resistance L/(R C).
            lowest_rp_ohm: parallel_ohm as u32,
            highest_rp_ohm: (1.2 * parallel_ohm) as u32,
            ..Sensor::new((0.8 * rest_hz) as u32, (1.05 * rest_hz) as u32)
        };
        let acquisition = match channels {
            0b0001 => Acquisition::Single(Channel::Zero),
            0b0010 => Acquisition::Single(Channel::One),
            0b0100 => Acquisition::Single(Channel::Two),
            0b1000 => Acquisition::Single(Channel::Three),
            0b0011 => Acquisition::Autoscan(Sequence::ZeroToOne),
            0b0111 => Acquisition::Autoscan(Sequence::ZeroToTwo),
            _ => Acquisition::Autoscan(Sequence::ZeroToThree),
        };
        let clock = ReferenceClock::External {
            hz: self.hardware.clkin_hz(),
        };
        Request::new(Model::Ldc1614, clock, acquisition, sensor)
            .rate(Rate::PerSecond(rate_hz.ceil() as u32))
            .plan()
    }

    fn start_sensing(&mut self) {
        let Some(plan) = self.wanted else {
            return;
        };
        let started = self.driver.start(&plan.configuration).and_then(|()| {
            self.driver
                .probe_interrupt_release(&mut self.interrupt, &mut self.delay)
                .map(drop)
        });
        let channel = plan.configuration.acquisition.channels().next();
        let scale = plan.configuration.scale(channel.unwrap_or_default());
        self.sensing = started.ok().map(|()| Sensing {
            plan,
            conversion: Time::from_secs_f64(scale.conversion_s()),
            last: None,
        });
        if self.sensing.is_none() {
            let later = self.now() + RETRY;
            self.hardware.chip.borrow_mut().advance_to(later);
        }
    }
}

impl Device for VirtualBoard<'_> {
    type Error = BoardError;

    fn now(&self) -> Time {
        self.hardware.chip.borrow().now()
    }

    fn send(&mut self, command: Command) -> Result<(), Self::Error> {
        let kind = command.kind();
        let seen = self.frames.len();
        let sequence = self.post(command)?;
        let is_answer = |record: &Record| match record {
            Record::Acknowledgement(answer) => answer.command == sequence,
            _ => false,
        };
        let frames = self.frames.get(seen..).unwrap_or_default();
        let is_answered = frames.iter().any(|frame| is_answer(&frame.message));
        let end = self.now() + ANSWER;
        if is_answered || self.run_to(end, is_answer)? {
            return Ok(());
        }
        Err(BoardError::NoAnswer { kind })
    }

    fn advance(&mut self, end: Time) -> Result<(), Self::Error> {
        let now = self.now();
        let limit = (now + TICK).min(end).max(now + Time::from_us(1));
        let edge = self.hardware.chip.borrow_mut().advance_to_interrupt(limit);
        self.hardware
            .world
            .borrow_mut()
            .advance_to(edge.unwrap_or(limit));
        self.follow_trace()?;
        self.follow_test()?;
        self.count_energy()?;
        match (edge, self.sensing) {
            (Some(edge), Some(sensing)) => self.converted(edge, sensing)?,
            _ => self.idle()?,
        }
        if self.now() >= self.next_conditions {
            self.next_conditions = self.now() + CONDITIONS_PERIOD;
            let conditions = self.conditions();
            self.step(&Event::Conditions(conditions))?;
        }
        Ok(())
    }

    fn frames(&mut self) -> &mut Vec<palpate_wire::Frame<Record>> {
        &mut self.frames
    }

    fn with_world<T>(&mut self, look: impl FnOnce(&mut World) -> T) -> T {
        look(&mut self.hardware.world.borrow_mut())
    }
}

/// Whole conversions that were missed before an edge.
fn lost(edge: Time, sensing: &Sensing) -> u32 {
    let Some(last) = sensing.last else {
        return 0;
    };
    let periods = (edge - last).as_secs_f64() / (sensing.plan.frame_period_ns as f64 * 1e-9);
    (periods.round() as u32).saturating_sub(1)
}

/// A moment in whole microseconds.
fn micros(time: Time) -> u64 {
    (time.as_ps() + 500_000) / 1_000_000
}

fn failure(error: &Error<I2cError>) -> Failure {
    match error {
        Error::WrongIdentity { .. } => Failure::new(FaultCode::SensorIdentity, Place::Sensor),
        Error::RegistersLost { .. } => Failure::new(FaultCode::SensorReset, Place::Sensor),
        _ => Failure::new(FaultCode::BusNotAcknowledged, Place::Bus),
    }
}
