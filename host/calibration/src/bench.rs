//! Procedure of a calibration on the bench: the user's steps and the recorded data.
//!
//! The user presses specimens onto the instrument - none, a rigid block, reference springs, to
//! several depths - and drives the train of ramps on each. The instrument's samples and the bench's
//! gauges go into a [`Session`]; other modules evaluate it. A [`Bench`] provides the instrument and
//! the gauges.
//!
//! A train deforms the sensing layer further, since the actuated layer stiffens and takes less of
//! the deformation. The block is therefore pressed once more, without a train, until the coil's
//! frequency is below that of all trains. The sensing layer's own curve then covers all trains.

use std::f64::consts::TAU;
use std::fmt;
use std::time::Duration;

use palpate_wire::code::{Outcome, State, Stream};
use palpate_wire::command::{Coil, Settings};
use palpate_wire::{Command, Message, Record};

use crate::Known;
use crate::checks::{self, DataFault};
use crate::creep::HELD_S;
use crate::session::{BenchSample, Pressed, Run, Session};

/// A bench with an instrument on it.
pub trait Bench {
    /// Error of the bench.
    type Error: From<BrokenOff>;

    /// Runs `work` with a specimen on the stage, clear of the sensor, while the instrument runs.
    ///
    /// # Errors
    /// If there is no such specimen or instrument, or `work` fails.
    fn with_specimen(
        &mut self,
        pressed: Pressed,
        work: &mut Work<'_, Self::Error>,
    ) -> Result<Run, Self::Error>;

    /// Presses block on block, without the sensor, to a force in N. Returns the measured force in N
    /// and the position of the stage in m, or `None` if the bench lacks one of the two gauges.
    ///
    /// # Errors
    /// If a gauge does not answer.
    fn press_bare(&mut self, force_n: f64) -> Result<Option<(f64, f64)>, Self::Error>;

    /// Temperature of the coil, degrees Celsius.
    fn temperature_c(&self) -> f64;

    /// Whether to repeat a run with this fault. A bench without a person answers no.
    ///
    /// # Errors
    /// If the person cannot be asked.
    fn repeats(&mut self, _: &DataFault) -> Result<bool, Self::Error> {
        Ok(false)
    }
}

/// The instrument on the bench, with a specimen above it.
pub trait Instrument {
    /// Error of the instrument.
    type Error;

    /// Present time, by the clock of the samples.
    fn now(&self) -> Duration;

    /// Sends a command and waits for its answer.
    ///
    /// # Errors
    /// If no answer arrives.
    fn ask(&mut self, command: Command) -> Result<Outcome, Self::Error>;

    /// Sends a command; its answer arrives among the records.
    ///
    /// # Errors
    /// If it cannot be sent.
    fn post(&mut self, command: Command) -> Result<(), Self::Error>;

    /// Runs a short time, to `end` at most, and appends new samples with the gauges' readings.
    /// Returns all other records.
    ///
    /// # Errors
    /// If the instrument stops or a gauge does not answer.
    fn advance(
        &mut self,
        end: Duration,
        lines: &mut Vec<BenchSample>,
    ) -> Result<Vec<Record>, Self::Error>;

    /// Starts a press to about this deformation of the sensing layer, m, at a speed in m/s. Returns
    /// the duration of the movement.
    ///
    /// # Errors
    /// If the stage cannot press.
    fn press(&mut self, depth_m: f64, speed_m_per_s: f64) -> Result<Duration, Self::Error>;
}

/// Steps of one run on the bench.
pub type Work<'w, E> = dyn FnMut(&mut dyn Instrument<Error = E>) -> Result<Run, E> + 'w;

/// Why a session broke off although bench and instrument work.
#[derive(Clone, Debug, PartialEq)]
pub enum BrokenOff {
    /// The data are implausible.
    Data(DataFault),
    /// The instrument did not accept a command.
    Answer {
        /// The command's name.
        name: &'static str,
        /// The instrument's answer to the command.
        outcome: Outcome,
    },
    /// The train of ramps ended early, for this reason.
    Train(&'static str),
}

impl fmt::Display for BrokenOff {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Data(fault) => fault.fmt(f),
            Self::Answer { name, outcome } => write!(
                f,
                "the instrument answered {name} with {outcome}: {}",
                outcome.meaning().trim()
            ),
            Self::Train(reason) => write!(f, "the train of ramps was aborted: {reason}"),
        }
    }
}

impl std::error::Error for BrokenOff {}

/// Settings that the user chooses.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchPlan {
    /// Settings of the instrument, including the train that it will measure with.
    pub settings: Settings,
    /// Data of the coil, which limit its heating.
    pub coil: Coil,
    /// Target deformation of the sensing layer, m.
    pub depth_m: f64,
    /// Depths of the presses onto block and springs, in units of `depth_m`.
    pub depths: Vec<f64>,
    /// Stiffness of the springs, N/m.
    pub springs_n_per_m: Vec<f64>,
    /// Speed of the stage, m/s.
    pub speed_m_per_s: f64,
    /// Rest between press and train, s.
    pub rest_s: f64,
    /// Tolerance of the contact whose effect is measured; zeros for the centred, flat one alone.
    pub contact: ContactPlan,
}

/// Tolerance of the contact, with presses at its limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactPlan {
    /// Greatest distance from the centre, m; 0 for no press beside it.
    pub within_m: f64,
    /// Greatest tilt, rad; 0 for no tilted press.
    pub tilt_rad: f64,
}

impl ContactPlan {
    /// Displaced presses of the block: four places at the rim, and the tilt to two opposite sides.
    fn presses(&self) -> Vec<Pressed> {
        let turns = |count: u8| (0..count).map(move |of| TAU * f64::from(of) / f64::from(count));
        let beside = turns(if self.within_m > 0.0 { 4 } else { 0 });
        let beside = beside.map(|direction_rad| Pressed::BlockBeside {
            distance_m: self.within_m,
            direction_rad,
        });
        let tilted = turns(if self.tilt_rad > 0.0 { 2 } else { 0 });
        let tilted = tilted.map(|direction_rad| Pressed::BlockTilted {
            angle_rad: self.tilt_rad,
            direction_rad,
        });
        beside.chain(tilted).collect()
    }
}

/// Forces of block on block, N, up to the force of a stiff sensor.
const BARE_FORCES_N: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 20.0];
/// Time for self-test and baseline before anything moves.
const BASELINE: Duration = Duration::from_millis(800);
/// Longest wait for the end of a train, including the coil's test before it.
const TRAIN: Duration = Duration::from_millis(60_000);
/// Time that is still recorded after the end of a train.
const AFTERWARDS: Duration = Duration::from_millis(50);

/// Target force of the first press without a train over the greatest force of all runs: between a
/// press and a train, creep releases a few per cent of the force.
const BEYOND_TRAINS: f64 = 1.08;
/// Factor from each press without a train to the next one, until a press exceeds the trains'
/// readings: on a soft load the sensing layer creeps at constant force, by a tenth and more.
const FURTHER: f64 = 1.05;
/// Greatest number of further presses: the last is 1.6 times as deep as the first, more than any
/// creep needs.
const ATTEMPTS: u32 = 10;
/// Time at the end of a press that is not evaluated, s: a conversion in this time averages over the
/// stop of the stage.
const STOP_S: f64 = 5e-3;

/// Carries out a calibration. Calls `progress` before each run with its specimen and depth, m.
/// Checks every run before the next one, and the whole session at the end.
///
/// # Errors
/// Errors of the bench, a train that breaks off, and implausible data.
pub fn hold<E: From<BrokenOff>>(
    bench: &mut dyn Bench<Error = E>,
    plan: &BenchPlan,
    known: &Known,
    progress: &mut dyn FnMut(Pressed, f64),
) -> Result<Session, E> {
    let mut pressing = |bench: &mut dyn Bench<Error = E>,
                        task: RunTask,
                        untouched: Option<&Run>| loop {
        progress(task.pressed, task.depth_m);
        let mut work = |instrument: &mut dyn Instrument<Error = E>| run(instrument, plan, &task);
        let run = bench.with_specimen(task.pressed, &mut work)?;
        match checks::fault_of_run(&run, untouched, known) {
            None => return Ok::<Run, E>(run),
            Some(fault) if bench.repeats(&fault)? => {}
            Some(fault) => return Err(BrokenOff::Data(fault).into()),
        }
    };
    let mut runs: Vec<Run> = Vec::new();
    for task in plan.tasks() {
        let run = pressing(bench, task, runs.first())?;
        runs.push(run);
    }
    let mut contact: Vec<Run> = Vec::new();
    for task in plan.contact_tasks() {
        let run = pressing(bench, task, runs.first())?;
        contact.push(run);
    }
    let all = runs.iter().chain(&contact);
    let lowest = all.map(|run| run.lowest_hz(f64::INFINITY));
    let lowest_hz = lowest.fold(f64::INFINITY, f64::min);
    let mut times = BEYOND_TRAINS * growth(&runs);
    let mut deepest_press = pressing(bench, plan.deepest(times), runs.first())?;
    for _ in 0..ATTEMPTS {
        if deepest_press.lowest_hz(deepest_press.pressed_s - STOP_S) < lowest_hz {
            break;
        }
        times *= FURTHER;
        deepest_press = pressing(bench, plan.deepest(times), runs.first())?;
    }
    let mut bare = Vec::new();
    for force_n in BARE_FORCES_N {
        bare.extend(bench.press_bare(force_n)?);
    }
    let session = Session {
        runs,
        contact,
        deepest_press,
        bare,
        temperature_c: bench.temperature_c(),
    };
    match checks::fault_of_session(&session, known) {
        None => Ok(session),
        Some(fault) => Err(BrokenOff::Data(fault).into()),
    }
}

/// Ratio of the greatest force in all runs to the greatest force at rest, before a train on the
/// block. Without a load cell it is the ratio of the changes of inductance, which rise more steeply
/// than the force.
fn growth(runs: &[Run]) -> f64 {
    let by_force = growth_of(runs, |_, line| line.force_n);
    let softer = |rest_hz: f64, line: &BenchSample| (rest_hz / line.frequency_hz).powi(2) - 1.0;
    let by_inductance = || growth_of(runs, |rest_hz, line| Some(softer(rest_hz?, line)));
    by_force.or_else(by_inductance).unwrap_or(1.0)
}

/// Computes [`growth`] for the quantity `of`, from the frequency at rest, Hz, and a sample. Returns
/// `None` if the quantity is never positive.
fn growth_of(runs: &[Run], of: impl Fn(Option<f64>, &BenchSample) -> Option<f64>) -> Option<f64> {
    let greatest_of = |run: &Run, until_s: f64| {
        let rest_hz = run.rest_hz();
        let lines = run.lines.iter();
        let lines = lines.filter(|line| line.gauges_time_s < until_s);
        let values = lines.filter_map(|line| of(rest_hz, line));
        values.fold(0.0, f64::max)
    };
    let blocks = runs.iter().filter(|run| run.pressed == Pressed::Block);
    let at_rest = blocks
        .map(|run| greatest_of(run, run.began_s))
        .fold(0.0, f64::max);
    let all = runs.iter().map(|run| greatest_of(run, f64::INFINITY));
    let all = all.fold(0.0, f64::max);
    (at_rest > 0.0).then(|| all / at_rest)
}

/// One run.
#[derive(Clone, Copy)]
struct RunTask {
    pressed: Pressed,
    /// Target deformation of the sensing layer, m.
    depth_m: f64,
    /// Speed of the stage, m/s.
    speed_m_per_s: f64,
    /// Whether a train follows the press.
    train: bool,
    /// Whether the press is held after the train, which shows the creep of the layers.
    held: bool,
}

impl BenchPlan {
    fn with_train(&self, pressed: Pressed, depth_m: f64) -> RunTask {
        RunTask {
            pressed,
            depth_m,
            speed_m_per_s: self.speed_m_per_s,
            train: true,
            held: false,
        }
    }

    /// Presses of the block beside the centre and tilted, to the working depth.
    fn contact_tasks(&self) -> Vec<RunTask> {
        let presses = self.contact.presses().into_iter();
        let presses = presses.map(|pressed| self.with_train(pressed, self.depth_m));
        presses.collect()
    }

    /// Runs with a train, in their order.
    fn tasks(&self) -> Vec<RunTask> {
        let with_train = |pressed, depth_m| self.with_train(pressed, depth_m);
        let springs = self.springs_n_per_m.iter();
        let springs = springs.map(|&n_per_m| Pressed::Spring { n_per_m });
        let specimens = core::iter::once(Pressed::Block).chain(springs);
        let (depth_held, spring_held) = (middle(&self.depths), middle(&self.springs_n_per_m));
        let is_held = move |pressed| match pressed {
            Pressed::Spring { n_per_m } => Some(n_per_m) == spring_held,
            _ => true,
        };
        let presses = specimens.flat_map(|pressed| {
            let depths = self.depths.iter();
            depths.map(move |depth| RunTask {
                held: Some(*depth) == depth_held && is_held(pressed),
                ..with_train(pressed, depth * self.depth_m)
            })
        });
        core::iter::once(with_train(Pressed::Nothing, 0.0))
            .chain(presses)
            .collect()
    }

    /// The press onto the block without a train: `times` as deep and as fast as the deepest one.
    fn deepest(&self, times: f64) -> RunTask {
        let deepest = self.depths.iter().copied().fold(0.0, f64::max);
        RunTask {
            pressed: Pressed::Block,
            depth_m: times * (deepest * self.depth_m),
            speed_m_per_s: times * self.speed_m_per_s,
            train: false,
            held: false,
        }
    }

    /// Smallest number of runs: those with a train, and one press without a train.
    pub fn runs(&self) -> usize {
        self.tasks().len() + self.contact_tasks().len() + 1
    }
}

/// The lower median of these; `None` if there are none.
fn middle(of: &[f64]) -> Option<f64> {
    let mut sorted = of.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len().saturating_sub(1) / 2).copied()
}

fn run<E: From<BrokenOff>>(
    instrument: &mut dyn Instrument<Error = E>,
    plan: &BenchPlan,
    task: &RunTask,
) -> Result<Run, E> {
    let begin = instrument.now();
    let mut run = Run::new(task.pressed, task.depth_m);
    rest(instrument, (&plan.settings, &plan.coil), &mut run)?;
    if task.pressed != Pressed::Nothing {
        let moving = instrument.press(task.depth_m, task.speed_m_per_s)?;
        let at_rest = instrument.now() + moving;
        run_until(instrument, at_rest, &mut run.lines)?;
        run.pressed_s = at_rest.as_secs_f64();
        let rested = at_rest + Duration::from_secs_f64(plan.rest_s);
        run_until(instrument, rested, &mut run.lines)?;
    }
    run.began_s = instrument.now().as_secs_f64();
    run.ramps_s = if task.train {
        sweep(instrument, &mut run.lines)?
    } else {
        run.began_s
    };
    if task.held {
        let end = Duration::from_secs_f64(run.began_s + HELD_S);
        run_until(instrument, end, &mut run.held)?;
    }
    Ok(run.since(begin.as_secs_f64()))
}

/// Records a train on the untouched sensor, with these settings and data of the coil.
///
/// # Errors
/// Errors of the instrument, and a train that breaks off.
pub fn untouched<E: From<BrokenOff>>(
    instrument: &mut dyn Instrument<Error = E>,
    set: (&Settings, &Coil),
) -> Result<Run, E> {
    let begin = instrument.now();
    let mut run = Run::new(Pressed::Nothing, 0.0);
    rest(instrument, set, &mut run)?;
    run.began_s = instrument.now().as_secs_f64();
    run.ramps_s = sweep(instrument, &mut run.lines)?;
    Ok(run.since(begin.as_secs_f64()))
}

/// Sets the settings and the coil's data, then records the sensor at rest.
fn rest<E: From<BrokenOff>>(
    instrument: &mut dyn Instrument<Error = E>,
    (settings, coil): (&Settings, &Coil),
    run: &mut Run,
) -> Result<(), E> {
    let end = instrument.now() + BASELINE;
    let settings = Settings {
        stream: Stream::Samples,
        decimation: 1,
        ..settings.clone()
    };
    send_accepted(instrument, Command::SetSettings(settings))?;
    send_accepted(instrument, Command::SetCoil(coil.clone()))?;
    run_until(instrument, end, &mut run.lines)
}

/// Sends a command and requires its acceptance.
fn send_accepted<E: From<BrokenOff>>(
    instrument: &mut dyn Instrument<Error = E>,
    command: Command,
) -> Result<(), E> {
    let name = command.name();
    match instrument.ask(command)? {
        Outcome::Accepted => Ok(()),
        outcome => Err(BrokenOff::Answer { name, outcome }.into()),
    }
}

fn run_until<E>(
    instrument: &mut dyn Instrument<Error = E>,
    end: Duration,
    lines: &mut Vec<BenchSample>,
) -> Result<(), E> {
    while instrument.now() < end {
        instrument.advance(end, lines)?;
    }
    Ok(())
}

/// Drives the train. Returns the start of its ramps, s, which follows the coil's test.
fn sweep<E: From<BrokenOff>>(
    instrument: &mut dyn Instrument<Error = E>,
    lines: &mut Vec<BenchSample>,
) -> Result<f64, E> {
    send_accepted(instrument, Command::Arm)?;
    instrument.post(Command::Sweep)?;
    let limit = instrument.now() + TRAIN;
    let mut ramps_s = None;
    while instrument.now() < limit {
        for record in instrument.advance(limit, lines)? {
            match record {
                Record::State(change) if change.state == State::Ramps => {
                    ramps_s = Some(instrument.now().as_secs_f64());
                }
                Record::State(change) if change.previous == State::Ramps => {
                    let end = instrument.now() + AFTERWARDS;
                    run_until(instrument, end, lines)?;
                    return ramps_s.ok_or_else(|| broken_off("the train had no ramps"));
                }
                Record::Refusal(refusal) => {
                    return Err(broken_off(refusal.reason.meaning().trim()));
                }
                Record::Fault(fault) => return Err(broken_off(fault.code.meaning().trim())),
                _ => {}
            }
        }
    }
    Err(broken_off("it did not end in time"))
}

fn broken_off<E: From<BrokenOff>>(reason: &'static str) -> E {
    BrokenOff::Train(reason).into()
}
