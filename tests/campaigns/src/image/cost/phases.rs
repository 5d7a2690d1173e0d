//! Phases of the running image.

use std::ops::Range;
use std::time::Duration;

use palpate_cli::failure::Failure;
use palpate_emulator::{Image, Instrument, Options, Profile};
use palpate_sim::Time;
use palpate_sim::device::Device;
use palpate_sim::mechanics::load::Load;
use palpate_sim::mechanics::press;
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};
use palpate_simulate::instrument::{self, SPEED_M_PER_S, default_settings};
use palpate_simulate::press::automatic;
use palpate_wire::code::State;
use palpate_wire::{Command, Record};

/// Kind of the pressed sensor.
const STACK: &str = "ultrasoft";
/// Initial position of the object above the sensor, m.
const CLEARANCE_M: f64 = 0.2e-3;
/// Time from the start to samples, and from the commands to the end of the baseline.
const SETTLED: Time = Time::from_ms(1_000);
/// Observation time of each steady phase.
const WATCHED: Time = Time::from_ms(2_000);
/// Observation time within a train, much less than the train takes.
const OF_THE_TRAIN: Time = Time::from_ms(400);
/// Time in which the firmware computes the estimate and sends its curve.
const AFTERWARDS: Time = Time::from_ms(100);
/// Longest time from the press to an estimate.
const PATIENCE: Time = Time::from_ms(30_000);

/// Cost of a phase.
pub(super) struct Phase {
    pub(super) name: &'static str,
    pub(super) profile: Profile,
    /// Number of conversions with an interrupt.
    pub(super) samples: usize,
    pub(super) passed: Time,
    pub(super) asleep: Time,
    /// Delays from INTB's edge to the START of the transaction.
    pub(super) latencies: Vec<Time>,
}

impl Phase {
    /// Share of the time in which the processor did not sleep.
    pub(super) fn load(&self) -> f64 {
        1.0 - self.asleep.as_secs_f64() / self.passed.as_secs_f64()
    }
}

pub(super) struct Measured {
    /// Phases at a steady rate.
    pub(super) phases: Vec<Phase>,
    /// Phase after the last steady one, until the estimate, which is computed once.
    pub(super) rest: Phase,
    pub(super) stack_bytes: u32,
    pub(super) cpu_hz: f64,
    /// Ratio of simulated to real time, on one core.
    pub(super) speed: f64,
}

/// Measures all phases with the probe's link alone, then some with a PC at the USB port as well.
pub(super) fn measure(
    image: &Image,
    shared: &[Range<u32>],
    seed: u64,
) -> Result<Measured, Failure> {
    let mut measured = measure_by(image, shared, seed, false)?;
    let by_both = measure_by(image, shared, seed, true)?;
    measured.phases.extend(by_both.phases);
    measured.stack_bytes = measured.stack_bytes.max(by_both.stack_bytes);
    Ok(measured)
}

fn measure_by(
    image: &Image,
    shared: &[Range<u32>],
    seed: u64,
    has_usb: bool,
) -> Result<Measured, Failure> {
    let stack = Stack::builtin(STACK).map_err(LoadError::from)?;
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let known = instrument::CalibratedInstrument::calibrated(
        &stack,
        &disturbances,
        seed,
        Switches::all(),
        &default_settings(),
    )?;
    let setup = Setup {
        load: Load::Spring {
            n_per_m: known.plant.sensing.spring_n_per_m,
        },
        profile: press::Profile::at(-CLEARANCE_M),
        ..Setup::default()
    };
    let world = World::new(&known.plant, known.switches, setup)?;
    let options = Options {
        record: true,
        ..Options::default()
    };
    let mut watched = Watched {
        board: Instrument::new(image, world, options),
        shared,
    };
    let mut phases = Vec::new();
    if has_usb {
        let host = watched.board.board_mut().usb_mut();
        host.plug();
        host.enumerate();
    }
    watched.board.start().map_err(Failure::refused)?;
    watched.pass(SETTLED)?;
    if !has_usb {
        phases.push(watched.phase("sensing, not calibrated", WATCHED)?);
    }
    for command in &known.calibration.commands {
        watched.send(automatic(command))?;
    }
    if has_usb {
        watched.send(Command::Store)?;
        phases.push(watched.watch("storing, with USB", |watched| {
            let is_over = |record: &Record| matches!(record, Record::Storage(_));
            watched.until(is_over, "the save did not end")
        })?);
    }
    watched.send(Command::Arm)?;
    watched.pass(SETTLED)?;
    let name = if has_usb {
        "calibrated, with USB"
    } else {
        "calibrated"
    };
    phases.push(watched.phase(name, WATCHED)?);
    let speed = watched.speed()?;
    let depth_m = known.depth_m;
    watched.board.with_world(|world| {
        let travel_m = world.press_for_depth_m(depth_m);
        world.move_press(travel_m, SPEED_M_PER_S);
    });
    let is_driven =
        |record: &Record| matches!(record, Record::State(it) if it.state == State::Ramps);
    watched.until(is_driven, "the train of ramps did not begin")?;
    let name = if has_usb {
        "in the train, with USB"
    } else {
        "in the train"
    };
    phases.push(watched.phase(name, OF_THE_TRAIN)?);
    let rest = watched.until_the_estimate()?;
    Ok(Measured {
        phases,
        rest,
        stack_bytes: watched.stack_bytes()?,
        cpu_hz: watched.board.board().frequencies_hz().0,
        speed,
    })
}

/// An observed image.
struct Watched<'s> {
    board: Instrument,
    shared: &'s [Range<u32>],
}

impl Watched<'_> {
    fn send(&mut self, command: Command) -> Result<(), Failure> {
        self.board.send(command).map_err(Failure::refused)
    }

    fn pass(&mut self, time: Time) -> Result<(), Failure> {
        let end = self.board.now() + time;
        self.board.run_until(end).map_err(Failure::refused)
    }

    fn until(&mut self, found: impl Fn(&Record) -> bool, otherwise: &str) -> Result<(), Failure> {
        let end = self.board.now() + PATIENCE;
        match self.board.run_to(end, found).map_err(Failure::refused)? {
            true => Ok(()),
            false => Err(Failure::Refused(otherwise.to_owned())),
        }
    }

    fn phase(&mut self, name: &'static str, time: Time) -> Result<Phase, Failure> {
        self.watch(name, |watched| watched.pass(time))
    }

    fn until_the_estimate(&mut self) -> Result<Phase, Failure> {
        self.watch("to the estimate", |watched| {
            let is_end =
                |record: &Record| matches!(record, Record::Estimate(_) | Record::Refusal(_));
            watched.until(is_end, "no estimate came")?;
            let refused = watched
                .board
                .frames()
                .iter()
                .find_map(|of| match &of.message {
                    Record::Refusal(refusal) => Some(format!("{refusal:?}")),
                    _ => None,
                });
            refused.map_or(Ok(()), |reason| Err(Failure::Refused(reason)))?;
            // The run of the handler must end to be counted.
            watched.pass(AFTERWARDS)
        })
    }

    fn watch(
        &mut self,
        name: &'static str,
        run: impl FnOnce(&mut Self) -> Result<(), Failure>,
    ) -> Result<Phase, Failure> {
        let board = self.board.board_mut();
        let (begin, asleep) = (board.now(), board.time_asleep());
        let log = board.wire_log();
        let before = log.map_or((0, 0), |log| (log.edges.len(), log.edge_to_start.len()));
        board.profile(self.shared);
        run(self)?;
        let board = self.board.board_mut();
        let profile = board.take_profile();
        let log = board.wire_log();
        let edges = log.map_or(0, |log| log.edges.len());
        let latencies = log.and_then(|log| log.edge_to_start.get(before.1..));
        Ok(Phase {
            name,
            profile: profile.ok_or_else(|| Failure::Refused("nothing was counted".to_owned()))?,
            samples: edges - before.0,
            passed: board.now() - begin,
            asleep: board.time_asleep() - asleep,
            latencies: latencies.unwrap_or_default().to_vec(),
        })
    }

    /// Emulated seconds per second of one core's processor time, on a copy of the board that no
    /// phase counts. Other programs of this computer do not change it much.
    fn speed(&self) -> Result<f64, Failure> {
        let mut copy = self.board.clone();
        let end = copy.now() + WATCHED;
        let begin = processor_time()?;
        copy.run_until(end).map_err(Failure::refused)?;
        Ok(WATCHED.as_secs_f64() / (processor_time()? - begin).as_secs_f64())
    }

    fn stack_bytes(&mut self) -> Result<u32, Failure> {
        self.send(Command::Identify)?;
        let frames = self.board.frames().iter().rev();
        let mut sizes = frames.filter_map(|frame| match &frame.message {
            Record::Status(status) => Some(status.stack_bytes),
            _ => None,
        });
        sizes
            .next()
            .ok_or_else(|| Failure::Refused("the image did not report its status".to_owned()))
    }
}

/// Returns the time for which a processor has run this thread, as Linux counts it.
fn processor_time() -> Result<Duration, Failure> {
    const COUNTS: &str = "/proc/thread-self/schedstat";
    let counts = std::fs::read_to_string(COUNTS).map_err(Failure::refused)?;
    let nanoseconds = counts
        .split(' ')
        .next()
        .and_then(|count| count.parse().ok());
    let nanoseconds = nanoseconds
        .ok_or_else(|| Failure::Refused(format!("{COUNTS} begins with no number: `{counts}`")))?;
    Ok(Duration::from_nanos(nanoseconds))
}
