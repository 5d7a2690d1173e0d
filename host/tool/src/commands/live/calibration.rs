//! Calibration from the page: the bench's procedure, with its progress.

use std::cell::Cell;
use std::time::Duration;

use palpate_calibration::bench::{self, Bench, Instrument, Work};
use palpate_calibration::session::{BenchSample, Pressed, Run};
use palpate_calibration::{Calibration, evaluate};
use palpate_cli::failure::Failure;
use palpate_sim::switches::Switches;
use palpate_simulate::instrument::{BenchTask, default_settings};
use palpate_wire::code::Outcome;
use palpate_wire::command::CalibrationIdentity;
use palpate_wire::{Command, Record};

use super::arguments::Arguments;
use super::feed::Request;
use super::state::Progress;
use super::view::View;
use crate::board::bench::LinkedBench;
use crate::board::link::Link;
use crate::board::storage;
use crate::commands::calibrate::sensor::{CalibrationFigures, describe, identity, put_in_force};
use crate::interrupt::Interrupt;

/// A calibration that is not in force yet.
pub(super) struct UnsavedCalibration {
    calibration: Calibration,
    identity: CalibrationIdentity,
    figures: Box<CalibrationFigures>,
}

impl UnsavedCalibration {
    /// Puts the calibration in force and stores it.
    ///
    /// # Errors
    /// If the board refuses a part, or does not store it.
    pub(super) fn keep(self, link: &mut Link) -> Result<Progress, Failure> {
        put_in_force(link, &self.calibration.commands, self.identity)?;
        let mut figures = self.figures;
        figures.configuration_crc = storage::store(link)?.stored_crc;
        figures.stored = true;
        Ok(Progress::Kept { figures })
    }
}

/// Plan of the bench and prior data.
fn task(arguments: &Arguments) -> Result<BenchTask, Failure> {
    let (stack, plant) = arguments.watched.link.emulated.stack_and_plant()?;
    let settings = default_settings();
    Ok(BenchTask::of(&plant, &stack, Switches::all(), &settings))
}

/// Returns the state before a calibration: the number of runs, or why there is no bench.
pub(super) fn ready(arguments: &Arguments) -> Progress {
    if !arguments.watched.link.is_emulated() {
        return Progress::Unavailable {
            reason: "Only the emulated board has a bench of its own. `palpate calibrate sensor` says how a \
                     board is calibrated.",
        };
    }
    match task(arguments) {
        Ok(task) => Progress::Ready {
            runs: task.plan.runs(),
        },
        Err(failure) => failed(&failure),
    }
}

/// Progress of a calibration without a result.
pub(super) fn failed(failure: &Failure) -> Progress {
    Progress::Failed {
        reason: failure.to_string(),
    }
}

/// Carries out a calibration. Shows progress and result in the view.
pub(super) fn hold(
    link: &mut Link,
    view: &mut View,
    arguments: &Arguments,
    interrupt: &Interrupt,
) -> Option<UnsavedCalibration> {
    match found(link, view, arguments, interrupt) {
        Ok(held) => {
            view.calibration = Progress::Found {
                figures: held.figures.clone(),
            };
            Some(held)
        }
        Err(failure) => {
            view.calibration = failed(&failure);
            None
        }
    }
}

fn found(
    link: &mut Link,
    view: &mut View,
    arguments: &Arguments,
    interrupt: &Interrupt,
) -> Result<UnsavedCalibration, Failure> {
    let (_, plant) = arguments.watched.link.emulated.stack_and_plant()?;
    let task = task(arguments)?;
    link.send_accepted(&Command::Disarm)?;
    let depth_m = Cell::new(0.0);
    let mut bench = Watched {
        bench: LinkedBench::new(link, &plant, 0.0, interrupt.clone()),
        view,
        interrupt,
        depth_m: &depth_m,
        run: 0,
        runs: task.plan.runs(),
    };
    let session = bench::hold(&mut bench, &task.plan, &task.known, &mut |_, of| {
        depth_m.set(of);
    })?;
    let calibration = evaluate(&session, &task.known)
        .map_err(|error| Failure::Refused(format!("calibration: {error}")))?;
    let identity = identity(None, session.temperature_c);
    let figures = CalibrationFigures::of(&session, &task, &calibration, &identity, true);
    Ok(UnsavedCalibration {
        calibration,
        identity,
        figures: Box::new(figures),
    })
}

/// A bench that shows its progress on the pages, which can abort it.
struct Watched<'a, B> {
    bench: B,
    view: &'a mut View,
    interrupt: &'a Interrupt,
    /// Depth of the next press, m.
    depth_m: &'a Cell<f64>,
    run: usize,
    runs: usize,
}

impl<B: Bench<Error = Failure>> Bench for Watched<'_, B> {
    type Error = Failure;

    fn with_specimen(
        &mut self,
        pressed: Pressed,
        work: &mut Work<'_, Failure>,
    ) -> Result<Run, Failure> {
        self.run += 1;
        self.view.calibration = Progress::Running {
            run: self.run,
            runs: self.runs.max(self.run),
            pressed: describe(pressed, self.depth_m.get()),
        };
        self.view.show()?;
        let Self {
            bench,
            view,
            interrupt,
            ..
        } = self;
        bench.with_specimen(pressed, &mut |instrument| {
            view.begin_on_bench(instrument.now().as_secs_f64());
            work(&mut WatchedInstrument {
                instrument,
                view,
                interrupt,
            })
        })
    }

    fn press_bare(&mut self, force_n: f64) -> Result<Option<(f64, f64)>, Failure> {
        self.bench.press_bare(force_n)
    }

    fn temperature_c(&self) -> f64 {
        self.bench.temperature_c()
    }
}

/// The instrument of a watched bench.
struct WatchedInstrument<'a> {
    instrument: &'a mut dyn Instrument<Error = Failure>,
    view: &'a mut View,
    interrupt: &'a Interrupt,
}

impl WatchedInstrument<'_> {
    /// Fails if an abort was requested. Drops all other requests.
    fn goes_on(&self) -> Result<(), Failure> {
        let mut is_ended = self.interrupt.is_asked();
        while let Some(request) = self.view.feed().request() {
            is_ended |= matches!(request, Request::AbortCalibration | Request::Abort);
        }
        if is_ended {
            return Err(Failure::Refused("it was aborted".to_owned()));
        }
        Ok(())
    }
}

impl Instrument for WatchedInstrument<'_> {
    type Error = Failure;

    fn now(&self) -> Duration {
        self.instrument.now()
    }

    fn ask(&mut self, command: Command) -> Result<Outcome, Failure> {
        self.instrument.ask(command)
    }

    fn post(&mut self, command: Command) -> Result<(), Failure> {
        self.instrument.post(command)
    }

    fn advance(
        &mut self,
        end: Duration,
        lines: &mut Vec<BenchSample>,
    ) -> Result<Vec<Record>, Failure> {
        self.goes_on()?;
        let before = lines.len();
        let records = self.instrument.advance(end, lines)?;
        self.view
            .take_from_bench(lines.get(before..).unwrap_or_default());
        self.view.show_due()?;
        Ok(records)
    }

    fn press(&mut self, depth_m: f64, speed_m_per_s: f64) -> Result<Duration, Failure> {
        self.instrument.press(depth_m, speed_m_per_s)
    }
}
