//! `palpate chip`: the driver with the simulated chip; prints a stream of readings.

use std::{
    cell::RefCell,
    f64::consts::PI,
    io::{self, Write},
    path::PathBuf,
};

use clap::{Args, ValueEnum};
use ldc161x::{
    Address, Code28, Configuration, Error, Frame, InterruptRelease, Ldc161x, Plan, Quality, Reading,
};
use ldc161x_sim::{
    Bus, Chip, ChipFault, Conversions, Delay, ExternalClock, FaultEvent, IntbPin, Lost, PartNumber,
    Sensors, Settings, ShutdownPin, Switches, Time,
};
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_design::plan_ldc::{self, PlannedBoard, Release};
use serde::Serialize;

use crate::board::switches;

/// Run the driver against the simulated chip and stream its readings.
///
/// Simulated data: nothing here was measured. The sensors sweep slowly through the upper half of
/// their range, so that each reading can be compared with the true frequency beside it.
#[derive(Args)]
#[command(after_help = "\
Each line is one reading; with --json one JSON object a line. Exit code 1 when the driver cannot \
go on; errors and recoveries are reported on standard error.

Examples:
  palpate chip --channels 0-3 --rate 500 --frames 20
  palpate chip --rate 1000 --frames 2000 --fault brown-out --json > readings.jsonl")]
pub(crate) struct Arguments {
    #[command(flatten)]
    board: PlannedBoard,
    /// Frames to read
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    frames: u32,
    /// Seed of the simulation: same seed, same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Switches of the chip as `palpate bring-up` writes them
    #[arg(long, value_name = "FILE.toml", conflicts_with = "release")]
    switches: Option<PathBuf>,
    /// A fault, halfway through
    #[arg(long, value_enum)]
    fault: Option<FaultKind>,
    /// Print JSON lines
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum FaultKind {
    /// The supply dips and every register is lost
    BrownOut,
    /// The chip does not acknowledge for 5 ms
    Nack,
    /// SDA is stuck low for 5 ms
    SdaStuck,
    /// The reference clock stops for 5 ms
    ClockLoss,
    /// The chip is lost for good
    Absent,
}

impl Arguments {
    /// Reads the switches of the simulated chip.
    fn switches(&self) -> Result<Switches, Failure> {
        if let Some(file) = &self.switches {
            return switches::read(file);
        }
        Ok(Switches {
            interrupt_release: match self.board.release {
                Release::Status => ldc161x_sim::InterruptRelease::StatusOnly,
                Release::Data => ldc161x_sim::InterruptRelease::StatusOrData,
            },
            ..Switches::default()
        })
    }
}

impl FaultKind {
    fn event(self, at: Time) -> FaultEvent {
        let passing = Time::from_ms(5);
        match self {
            Self::BrownOut => FaultEvent::at(at, ChipFault::BrownOut(Lost::Everything), passing),
            Self::Nack => FaultEvent::at(at, ChipFault::Nack { after_bytes: 0 }, passing),
            Self::SdaStuck => FaultEvent::at(at, ChipFault::SdaStuck { clocks: None }, passing),
            Self::ClockLoss => FaultEvent::at(at, ChipFault::ClockLoss, passing),
            Self::Absent => FaultEvent::from(at, ChipFault::Absent),
        }
    }
}

/// Duty of the simulated comparator. The driver's configuration contains it, as on a calibrated
/// board.
const COMPARATOR_DUTY: f32 = 0.29;
/// Shortest time in which a sensor sweeps between the middle and the top of its range, s.
const SWEEP_S: f64 = 1.618_034;
/// Limit of the change of a sensor's frequency within a third of its period, relative to the stated
/// uncertainty of a reading. The mean over the counted edges and the mean over the conversion may
/// belong to times that differ by a third of a period.
const MOTION: f64 = 0.2;
/// The verb gives up after this many consecutive recoveries. 50 recoveries take 5 ms each or more,
/// together a quarter of a second.
const RECOVERIES: u32 = 50;
/// Time after which the bus master gives up on a line that stays low: several times the duration of
/// a transfer.
const BUS_DEADLINE: Time = Time::from_ms(1);
/// Number of frames after which one register is compared, if the bus has time. The two transfers
/// take 48 bit times, and the master needs 20 us for them.
const FRAMES_PER_CANARY: u32 = 8;
const CANARY_BITS: u64 = 48;
const CANARY_MASTER_NS: u64 = 20_000;

/// Coils whose frequency slowly sweeps along a sine. A linear sweep would have equal steps from
/// reading to reading, which round alike again and again.
#[derive(Clone)]
struct Coils {
    lowest_hz: f64,
    highest_hz: f64,
    sweep_s: f64,
    resistance_ohm: f64,
    quality_factor: f64,
}

impl Sensors for Coils {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        let turns = time_s / self.sweep_s + 0.25 * (1 + channel) as f64;
        let share = 0.75 + 0.25 * (PI * turns).cos();
        self.lowest_hz + share * (self.highest_hz - self.lowest_hz)
    }

    fn parallel_resistance_ohm(&self, _channel: usize, _time_s: f64) -> f64 {
        self.resistance_ohm
    }

    fn quality_factor(&self, _channel: usize, _time_s: f64) -> f64 {
        self.quality_factor
    }
}

/// A reading with the true frequency.
#[derive(Serialize)]
struct ReadingLine {
    simulated: bool,
    /// Middle of the conversion since the start of the simulation, s.
    time_s: f64,
    frame: u32,
    channel: u8,
    word: String,
    frequency_hz: f64,
    sigma_hz: f32,
    /// True mean frequency of the sensor over the conversion, Hz.
    true_hz: f64,
    m: u32,
    n: u32,
    residual_lsb: f32,
    /// `None` for a sensor too slow for a verdict.
    plausible: Option<bool>,
    quality: Quality,
    gap: bool,
    drive_step: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let switches = arguments.switches()?;
    let mut request = arguments.board.request(match switches.interrupt_release {
        ldc161x_sim::InterruptRelease::StatusOnly => Release::Status,
        ldc161x_sim::InterruptRelease::StatusOrData => Release::Data,
    });
    request.noise.comparator_duty = Some(COMPARATOR_DUTY);
    let plan = request.plan().map_err(plan_ldc::refused)?;
    let chip = RefCell::new(Chip::new(
        settings(arguments, switches),
        coils(&arguments.board, &plan),
    ));
    let mut session = ChipSession::new(&chip, arguments, &plan);
    if let Err(error) = session.start(&plan.configuration) {
        // A chip may lose its registers at the first start.
        session.recover(&error)?;
    }
    if let Some(fault) = arguments.fault {
        let half_ns = plan.frame_period_ns * u64::from(arguments.frames) / 2;
        let half_way = chip.borrow().now() + Time::from_us(half_ns / 1_000);
        let scheduled = chip.borrow_mut().schedule(fault.event(half_way));
        scheduled.map_err(|full| Failure::Refused(full.to_string()))?;
    }
    session.stream(arguments)
}

fn settings(arguments: &Arguments, switches: Switches) -> Settings {
    let ideal = Settings::ideal();
    let clock_hz = f64::from(arguments.board.external_clock_hz().unwrap_or(40_000_000));
    Settings {
        part: match arguments.board.model() {
            ldc161x::Model::Ldc1612 => PartNumber::Ldc1612,
            ldc161x::Model::Ldc1614 => PartNumber::Ldc1614,
        },
        seed: arguments.seed,
        external_clock: Some(ExternalClock::exact(clock_hz)),
        conversions: Conversions {
            noise_at_1ms: f64::from(arguments.board.noise),
            falling_edge: f64::from(COMPARATOR_DUTY),
            ..Conversions::default()
        },
        switches,
        // The drive does not shift the frequency: the true frequency is the sensor's own.
        ..ideal
    }
}

fn coils(board: &PlannedBoard, plan: &Plan) -> Coils {
    let [lowest_hz, highest_hz] = [board.sensor.0, board.sensor.1].map(f64::from);
    let first = plan.configuration.acquisition.channels().next();
    let scale = plan.configuration.scale(first.unwrap_or_default());
    let code = Code28::new((highest_hz / scale.hz_per_lsb()) as u32);
    let sigma = f64::from(scale.relative_sigma(code.unwrap_or(Code28::OVER_RANGE)));
    let share_per_s = MOTION * sigma * 3.0 * lowest_hz;
    let span = 0.5 * (highest_hz / lowest_hz - 1.0);
    Coils {
        lowest_hz,
        highest_hz,
        sweep_s: SWEEP_S.max(PI / 2.0 * span / share_per_s),
        resistance_ohm: f64::from(board.resistance.1),
        quality_factor: f64::from(board.quality),
    }
}

/// Whether the bus has time to read a register between two frames.
fn has_room(plan: &Plan, bus_hz: u32) -> bool {
    let register_ns = CANARY_BITS * 1_000_000_000 / u64::from(bus_hz) + CANARY_MASTER_NS;
    plan.frame_period_ns >= plan.frame_read_ns + register_ns
}

/// A driver with its connections.
struct ChipSession<'a> {
    chip: &'a RefCell<Chip<Coils>>,
    driver: Ldc161x<Bus<'a, Coils>>,
    interrupt: IntbPin<'a, Coils>,
    shutdown: ShutdownPin<'a, Coils>,
    delay: Delay<'a, Coils>,
    bus: Bus<'a, Coils>,
    /// Event that releases the interrupt of this chip, as the driver found.
    release: InterruptRelease,
    /// Whether the bus has time to read a register between two frames.
    has_room: bool,
}

type DriverResult<T> = Result<T, Error<ldc161x_sim::I2cError>>;

impl<'a> ChipSession<'a> {
    fn new(chip: &'a RefCell<Chip<Coils>>, arguments: &Arguments, plan: &Plan) -> Self {
        let bus = || Bus::new(chip, arguments.board.bus).with_deadline(BUS_DEADLINE);
        Self {
            chip,
            driver: Ldc161x::new(bus(), arguments.board.model(), Address::AddrLow),
            interrupt: IntbPin::new(chip),
            shutdown: ShutdownPin::new(chip),
            delay: Delay::new(chip),
            bus: bus(),
            release: InterruptRelease::default(),
            has_room: has_room(plan, arguments.board.bus),
        }
    }

    fn start(&mut self, configuration: &Configuration) -> DriverResult<()> {
        self.driver.start(configuration)?;
        self.probe()
    }

    fn probe(&mut self) -> DriverResult<()> {
        self.release = self
            .driver
            .probe_interrupt_release(&mut self.interrupt, &mut self.delay)?;
        Ok(())
    }

    fn next_frame(&mut self) -> DriverResult<Frame> {
        self.driver
            .wait_for_interrupt(&mut self.interrupt, &mut self.delay)?;
        let frame = self.driver.read_frame()?;
        if self.has_room && frame.number.is_multiple_of(FRAMES_PER_CANARY) {
            self.driver.check_canary()?;
        }
        Ok(frame)
    }

    fn stream(&mut self, arguments: &Arguments) -> Result<(), Failure> {
        let mut out = io::BufWriter::new(io::stdout().lock());
        if !arguments.json {
            writeln!(
                out,
                "simulated chip; interrupt released {}\n\n{:>10} {:>3} {:>14} {:>9} {:>9}  M/N  quality",
                match self.release {
                    InterruptRelease::ByStatusOnly => "by STATUS",
                    InterruptRelease::ByData => "by data",
                },
                "time/ms",
                "ch",
                "frequency/Hz",
                "sigma/Hz",
                "error/Hz",
            )?;
        }
        let mut frames = 0;
        while frames < arguments.frames {
            match self.next_frame() {
                Ok(frame) => {
                    self.print(&mut out, arguments.json, &frame)?;
                    frames += 1;
                }
                Err(error) => {
                    out.flush()?;
                    self.recover(&error)?;
                }
            }
        }
        Ok(out.flush()?)
    }

    /// Recovers with nine clocks to free the bus, the SD pin, and the configuration.
    fn recover(&mut self, error: &Error<ldc161x_sim::I2cError>) -> Result<(), Failure> {
        let at = self.now_ms();
        notice::say(format_args!("palpate: {at:.3} ms: {error}"));
        for attempt in 1..=RECOVERIES {
            // The next transfer shows whether the pulses helped.
            let _ = self.bus.clock_pulses(9);
            let recovered = self
                .driver
                .recover_by_shutdown(&mut self.shutdown, &mut self.delay)
                .and_then(|()| self.probe());
            if recovered.is_ok() {
                let ms = self.now_ms() - at;
                notice::say(format_args!(
                    "palpate: recovered after {ms:.3} ms, attempt {attempt}"
                ));
                return Ok(());
            }
        }
        Err(Failure::Refused(format!(
            "gave up after {RECOVERIES} recoveries; the first error was: {error}"
        )))
    }

    fn now_ms(&self) -> f64 {
        self.chip.borrow().now().as_secs_f64() * 1e3
    }

    fn print(&self, out: &mut impl Write, json: bool, frame: &Frame) -> Result<(), Failure> {
        for reading in frame.readings() {
            let Some(line) = self.line(frame, reading) else {
                continue;
            };
            if json {
                serde_json::to_writer(&mut *out, &line)?;
                writeln!(out)?;
            } else {
                writeln!(
                    out,
                    "{:>10.3} {:>3} {:>14.2} {:>9.2} {:>+9.2}  {}  {:?}{}",
                    line.time_s * 1e3,
                    line.channel,
                    line.frequency_hz,
                    line.sigma_hz,
                    line.frequency_hz - line.true_hz,
                    match line.plausible {
                        Some(true) => "yes",
                        Some(false) => "no ",
                        None => "-  ",
                    },
                    line.quality,
                    if line.gap { ", gap before it" } else { "" },
                )?;
            }
        }
        Ok(())
    }

    /// Returns the reading with the simulated chip's own record of the conversion.
    fn line(&self, frame: &Frame, reading: &Reading) -> Option<ReadingLine> {
        let chip = self.chip.borrow();
        let truth = chip.last_read(reading.channel.number())?;
        let scale = self.driver.configuration()?.scale(reading.channel);
        let ratio = scale.rational(reading.word.code());
        Some(ReadingLine {
            simulated: true,
            time_s: truth.end.as_secs_f64() - 0.5 * scale.conversion_s(),
            frame: frame.number,
            channel: reading.channel.number(),
            word: format!("{:#010x}", reading.word.bits()),
            frequency_hz: reading.frequency_hz,
            sigma_hz: reading.sigma_hz,
            true_hz: truth.sensor_hz,
            m: ratio.m,
            n: ratio.n,
            residual_lsb: ratio.residual_lsb,
            plausible: ratio.plausible,
            quality: reading.quality(),
            gap: frame.marks.gap,
            drive_step: frame.marks.drive_step,
        })
    }
}
