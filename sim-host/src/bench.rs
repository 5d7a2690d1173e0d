//! A calibration on the bench: what its user does there, and what they write down.
//!
//! The instrument on the [`rig`](crate::rig) is the native board with its own firmware's
//! procedure. Its user presses specimens upon it - nothing, a rigid block, reference
//! springs, to several depths - and drives the train of ramps on each; the instrument's samples and the
//! bench's gauges go into a [`Session`]. What calibration follows from that is not decided here.
//!
//! A train presses the sensing layer deeper than it was: the actuated layer stiffens and takes less of
//! the deformation. So the block is pressed once more, without a train, until the coil's frequency is
//! below that of all trains: the sensing layer's own curve is then known wherever a train leads it.

use palpate_wire::code::{Outcome, State};
use palpate_wire::command::{Coil, Settings};
use palpate_wire::{Command, Record};

use crate::Time;
use crate::current::acting_a;
use crate::device::Device;
use crate::native::{BoardError, NativeBoard, Wiring};
use crate::parameters::{ParameterError, Parameters};
use crate::rig::{BareRig, CLEARANCE_M, Gauges, Rig, Specimen};
use crate::switches::Switches;
use crate::world::World;

/// One sample of the instrument, with what the gauges said soon after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BenchSample {
    /// Middle of the conversion, s.
    pub time_s: f64,
    /// Resonance frequency, Hz.
    pub frequency_hz: f64,
    /// Current that acts over the conversion, A: mean and ripple, root mean square.
    pub current_a: f64,
    /// When the gauges were read, s.
    pub gauges_time_s: f64,
    /// Load cell, N.
    pub force_n: f64,
    /// Scale of the stage, m.
    pub stage_m: f64,
}

/// What was on the stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pressed {
    /// Nothing touched.
    Nothing,
    /// A rigid block.
    Block,
    /// A spring, by what is written on it, N/m.
    Spring {
        /// N/m.
        n_per_m: f64,
    },
}

/// One press with its train of ramps.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// What was pressed.
    pub pressed: Pressed,
    /// The samples, from before the touch to after the last ramp.
    pub lines: Vec<BenchSample>,
    /// When the train was requested, s.
    pub began_s: f64,
    /// When its ramps began, after the coil's test, s.
    pub ramps_s: f64,
    /// When the press came to rest, s; the start for nothing.
    pub pressed_s: f64,
}

impl Run {
    /// The lowest frequency until a moment, Hz.
    fn lowest_hz(&self, until_s: f64) -> f64 {
        let lines = self.lines.iter();
        let lines = lines.filter(|line| line.time_s > START_S && line.time_s < until_s);
        lines
            .map(|line| line.frequency_hz)
            .fold(f64::INFINITY, f64::min)
    }
}

/// Everything that was written down.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// The runs.
    pub runs: Vec<Run>,
    /// A press upon the block without a train, to a lower frequency than any run's, in the time that
    /// the deepest of their presses took.
    pub deepest_press: Run,
    /// Block on block, without the sensor: force in N and scale in m.
    pub bare: Vec<(f64, f64)>,
    /// The coil's temperature during the calibration, by its thermometer, degrees Celsius.
    pub temperature_c: f64,
}

/// What the bench's user sets beforehand.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchPlan {
    /// Settings of the instrument: the train is the one that it will measure with.
    pub settings: Settings,
    /// The coil's data, without which nothing limits its heat.
    pub coil: Coil,
    /// Depth of the sensing layer to aim at, m.
    pub depth_m: f64,
    /// Depths to which block and springs are pressed, in units of that.
    pub depths: Vec<f64>,
    /// Springs, N/m.
    pub springs_n_per_m: Vec<f64>,
    /// How fast the stage moves, m/s.
    pub speed_m_per_s: f64,
    /// Rest between press and train, s.
    pub rest_s: f64,
}

/// Why a calibration came to nothing.
#[derive(Clone, Debug, PartialEq)]
pub enum BenchError {
    /// There is no such plant.
    Plant(ParameterError),
    /// The board cannot run.
    Board(BoardError),
    /// The instrument refused a command.
    Command {
        /// Its kind.
        kind: u8,
        /// The answer.
        outcome: Outcome,
    },
    /// The train did not come to its end.
    NoTrain {
        /// What the instrument said instead, if anything.
        said: Option<Box<Record>>,
    },
}

impl core::fmt::Display for BenchError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Plant(error) => error.fmt(f),
            Self::Board(error) => error.fmt(f),
            Self::Command { kind, outcome } => {
                write!(
                    f,
                    "the instrument answered command 0x{kind:02x} with {outcome}"
                )
            }
            Self::NoTrain { said: Some(said) } => {
                write!(f, "the train of ramps broke off: {said:?}")
            }
            Self::NoTrain { said: None } => f.write_str("the train of ramps did not end in time"),
        }
    }
}

impl core::error::Error for BenchError {}

impl From<ParameterError> for BenchError {
    fn from(error: ParameterError) -> Self {
        Self::Plant(error)
    }
}

impl From<BoardError> for BenchError {
    fn from(error: BoardError) -> Self {
        Self::Board(error)
    }
}

/// Forces of the bare bench, N: up to what a stiff sensor takes.
const BARE_FORCES_N: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 20.0];
/// Readings averaged at each.
const BARE_READINGS: u32 = 100;
/// Time for self-test and baseline before anything moves.
const BASELINE: Time = Time::from_ms(800);
/// Time after the train.
const AFTERWARDS: Time = Time::from_ms(50);

/// The press by itself begins with so many times the greatest force of all runs: creep releases a
/// few per cent of the force between a press and a train.
const BEYOND_TRAINS: f64 = 1.08;
/// It goes so many times further until it is beyond their readings: a load that gives way lets the
/// sensing layer creep at the same force, by a tenth and more.
const FURTHER: f64 = 1.05;
/// Then it is given up: nothing that creeps takes 1.6 times the deformation.
const ATTEMPTS: u32 = 10;
/// The end of a press, in which a conversion is a mean over the stop, s.
const STOP_S: f64 = 5e-3;
/// The first conversions after a start, s: the oscillator settles.
const START_S: f64 = 0.05;

/// Goes through a calibration of a plant.
///
/// # Errors
/// [`BenchError`].
pub fn calibrate(
    parameters: &Parameters,
    switches: Switches,
    plan: &BenchPlan,
) -> Result<Session, BenchError> {
    let pressing = |pressed, depth_m, speed_m_per_s, train| {
        let task = BenchTask {
            pressed,
            depth_m,
            speed_m_per_s,
            train,
        };
        run(parameters, switches, plan, &task)
    };
    let mut runs = vec![pressing(Pressed::Nothing, 0.0, plan.speed_m_per_s, true)?];
    let springs = plan.springs_n_per_m.iter();
    let springs = springs.map(|&n_per_m| Pressed::Spring { n_per_m });
    for pressed in core::iter::once(Pressed::Block).chain(springs) {
        for depth in &plan.depths {
            let depth_m = depth * plan.depth_m;
            runs.push(pressing(pressed, depth_m, plan.speed_m_per_s, true)?);
        }
    }
    let deepest = plan.depths.iter().copied().fold(0.0, f64::max);
    let press = |times: f64| {
        let (depth_m, speed_m_per_s) = (deepest * plan.depth_m, plan.speed_m_per_s);
        pressing(
            Pressed::Block,
            times * depth_m,
            times * speed_m_per_s,
            false,
        )
    };
    let lowest = runs.iter().map(|run| run.lowest_hz(f64::INFINITY));
    let lowest_hz = lowest.fold(f64::INFINITY, f64::min);
    let mut times = BEYOND_TRAINS * growth(&runs);
    let mut deepest_press = press(times)?;
    for _ in 0..ATTEMPTS {
        if deepest_press.lowest_hz(deepest_press.pressed_s - STOP_S) < lowest_hz {
            break;
        }
        times *= FURTHER;
        deepest_press = press(times)?;
    }
    let mut session = Session {
        runs,
        deepest_press,
        bare: Vec::new(),
        temperature_c: crate::thermal::CALIBRATION_C,
    };
    let mut bare = BareRig::new(parameters, switches);
    for force_n in BARE_FORCES_N {
        let readings = (0..BARE_READINGS).map(|_| bare.press(force_n));
        let (force_n, stage_m) = readings.fold((0.0, 0.0), |(force_n, stage_m), reading| {
            (force_n + reading.force_n, stage_m + reading.stage_m)
        });
        let count = f64::from(BARE_READINGS);
        session.bare.push((force_n / count, stage_m / count));
    }
    Ok(session)
}

/// The greatest force of all runs over the greatest at rest before a train upon the block.
fn growth(runs: &[Run]) -> f64 {
    let greatest_n = |lines: &mut dyn Iterator<Item = &BenchSample>| {
        lines.map(|line| line.force_n).fold(0.0, f64::max)
    };
    let blocks = runs.iter().filter(|run| run.pressed == Pressed::Block);
    let mut at_rest = blocks.flat_map(|run| {
        let lines = run.lines.iter();
        lines.filter(|line| line.gauges_time_s < run.began_s)
    });
    let at_rest_n = greatest_n(&mut at_rest);
    let all_n = greatest_n(&mut runs.iter().flat_map(|run| &run.lines));
    if at_rest_n > 0.0 {
        all_n / at_rest_n
    } else {
        1.0
    }
}

/// What is done in one run.
struct BenchTask {
    pressed: Pressed,
    /// Depth of the sensing layer to aim at, m.
    depth_m: f64,
    /// How fast the stage moves, m/s.
    speed_m_per_s: f64,
    /// Whether a train is driven after the press.
    train: bool,
}

fn run(
    parameters: &Parameters,
    switches: Switches,
    plan: &BenchPlan,
    task: &BenchTask,
) -> Result<Run, BenchError> {
    let BenchTask {
        pressed,
        depth_m,
        speed_m_per_s,
        train,
    } = *task;
    let specimen = match pressed {
        Pressed::Nothing | Pressed::Block => Specimen::Block,
        Pressed::Spring { n_per_m } => Specimen::Spring {
            nominal_n_per_m: n_per_m,
        },
    };
    let (world, gauges) = Rig::new(parameters, switches, specimen)?.into_parts();
    let travel_m = match pressed {
        Pressed::Nothing => None,
        _ => Some(world.press_for_depth_m(depth_m)),
    };
    let hardware = Wiring::new(world);
    let mut bench = Bench {
        board: NativeBoard::new(&hardware),
        hardware: &hardware,
        gauges,
        lines: Vec::new(),
    };
    bench.prepare(plan)?;
    bench.run_until(BASELINE)?;
    let mut pressed_s = 0.0;
    if let Some(travel_m) = travel_m {
        let mut world = hardware.world().borrow_mut();
        world.move_press(travel_m, speed_m_per_s);
        drop(world);
        let moving_s = (travel_m + CLEARANCE_M) / speed_m_per_s;
        let at_rest = bench.board.now() + Time::from_secs_f64(moving_s);
        bench.run_until(at_rest)?;
        pressed_s = at_rest.as_secs_f64();
        bench.run_until(at_rest + Time::from_secs_f64(plan.rest_s))?;
    }
    let began_s = bench.board.now().as_secs_f64();
    let ramps_s = if train { bench.sweep()? } else { began_s };
    Ok(Run {
        pressed,
        lines: bench.lines,
        began_s,
        ramps_s,
        pressed_s,
    })
}

/// The bench during a run.
struct Bench<'a> {
    board: NativeBoard<'a>,
    hardware: &'a Wiring,
    gauges: Gauges,
    lines: Vec<BenchSample>,
}

impl Bench<'_> {
    fn prepare(&mut self, plan: &BenchPlan) -> Result<(), BenchError> {
        let settings = Settings {
            stream: palpate_wire::code::Stream::Samples,
            decimation: 1,
            ..plan.settings.clone()
        };
        self.command(Command::SetSettings(settings))?;
        self.command(Command::SetCoil(plan.coil.clone()))
    }

    /// Sends a command, which has to be accepted.
    fn command(&mut self, command: Command) -> Result<(), BenchError> {
        self.board.send(command)?;
        let records = self.board.take_records();
        let mut answers = records.iter().filter_map(|(_, record)| match record {
            Record::Acknowledgement(answer) => Some((answer.kind, answer.outcome)),
            _ => None,
        });
        match answers.next_back() {
            Some((_, Outcome::Accepted)) => Ok(()),
            Some((kind, outcome)) => Err(BenchError::Command { kind, outcome }),
            None => Err(BenchError::NoTrain { said: None }),
        }
    }

    /// Runs, and writes the samples down with the gauges.
    fn run_until(&mut self, end: Time) -> Result<(), BenchError> {
        while self.board.now() < end {
            self.board.advance(end)?;
            let _ = self.write_down();
        }
        Ok(())
    }

    /// Writes new samples down; returns the records that are none.
    fn write_down(&mut self) -> Vec<Record> {
        let mut others = Vec::new();
        for (at, record) in self.board.take_records() {
            let Record::Sample(sample) = record else {
                others.push(record);
                continue;
            };
            let Some(conversion) = sample.channels.first() else {
                continue;
            };
            let world: core::cell::Ref<'_, World> = self.hardware.world().borrow();
            let reading = self.gauges.read(&world);
            self.lines.push(BenchSample {
                time_s: at.as_ticks() as f64 * 1e-6,
                frequency_hz: conversion.frequency_hz,
                current_a: acting_a(
                    sample.current_a.unwrap_or(0.0).into(),
                    sample.ripple_a.unwrap_or(0.0).into(),
                ),
                gauges_time_s: world.now().as_secs_f64(),
                force_n: reading.force_n,
                stage_m: reading.stage_m,
            });
        }
        others
    }

    /// Drives the train; the time at which its ramps began, s. The coil's test goes before it.
    fn sweep(&mut self) -> Result<f64, BenchError> {
        self.command(Command::Arm)?;
        self.board.post(Command::Sweep);
        let limit = self.board.now() + Time::from_ms(60_000);
        let (mut ramps_s, mut said) = (None, None);
        while self.board.now() < limit {
            self.board.advance(limit)?;
            for record in self.write_down() {
                match record {
                    Record::State(change) if change.state == State::Ramps => {
                        ramps_s = Some(self.board.now().as_secs_f64());
                    }
                    Record::State(change) if change.previous == State::Ramps && said.is_none() => {
                        let end = self.board.now() + AFTERWARDS;
                        self.run_until(end)?;
                        return ramps_s.ok_or(BenchError::NoTrain { said });
                    }
                    Record::Refusal(_) | Record::Fault(_) => said = Some(Box::new(record)),
                    _ => {}
                }
            }
            if said.is_some() {
                break;
            }
        }
        Err(BenchError::NoTrain { said })
    }
}
