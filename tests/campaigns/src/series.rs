//! `cargo campaign series`: presses in a row in a continuing world, where each press may affect the
//! next.

use std::io::{self, Write};
use std::path::Path;

use clap::Args;
use comfy_table::Table;
use comfy_table::presets::ASCII_MARKDOWN;
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::failure::Failure;
use palpate_cli::in_order::in_order;
use palpate_cli::progress::Progress;
use palpate_sim::Time;
use palpate_sim::device::Device;
use palpate_sim::mechanics::load::Load;
use palpate_sim::mechanics::press::Profile;
use palpate_sim::native::{BoardError, NativeBoard, Wiring};
use palpate_sim::random::Stream;
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Holder, Setup, World as SimulatedWorld};
use palpate_simulate::campaign::counted::Counted;
use palpate_simulate::campaign::coverage::Coverage;
use palpate_simulate::campaign::press::{Claim, Press};
use palpate_simulate::campaign::world::World;
use palpate_simulate::campaign::{counts_of_reasons, percent, without_estimate};
use palpate_simulate::instrument::{CalibratedInstrument, SPEED_M_PER_S, default_settings};
use palpate_simulate::press::{CLEARANCE_M, automatic};
use palpate_wire::code::{Contact, RefusalReason, State};
use palpate_wire::{Command, Frame, Record};
use serde::Serialize;

use crate::drawn::DrawnSensors;

/// Time after lift-off from which on any contact is a ghost, s.
const GONE_S: f64 = 1.0;
/// Time after lift-off in which a refusal may still concern the press, s.
const SOON_S: f64 = 0.2;
/// Interval between two changes of the ambient temperature.
const SLICE: Time = Time::from_ms(1_000);
/// Greatest rate, K/s, and greatest change, K, of the room's temperature.
const WARMING_K_PER_S: f64 = 2.0 / 60.0;
const MOST_WARMING_K: f64 = 10.0;

/// Ranges from which the presses of a series are drawn.
#[derive(Clone, Copy, Debug)]
struct SeriesPlan {
    /// Time between two presses, s.
    gap_s: (f64, f64),
    /// Time for which the object is pressed, s.
    held_s: (f64, f64),
    /// Depth, in units of the working depth.
    depth: (f64, f64),
}

const PLAN: SeriesPlan = SeriesPlan {
    gap_s: (0.2, 20.0),
    held_s: (0.2, 300.0),
    depth: (0.1, 1.4),
};

/// Results of one sensor's series.
#[derive(Clone, Debug, Default)]
struct Series {
    presses: Vec<Press>,
    /// Repeated measurements after a long hold, just before lift-off.
    held: Vec<Press>,
    found: Defects,
}

/// Counts of forbidden results.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
struct Defects {
    /// Contacts without an object, a second after lift-off or later.
    ghosts: usize,
    /// Presses and taps that were not detected.
    missed: usize,
    /// Refusals for another reason than the lost contact, later than `SOON_S` after lift-off.
    refusals: usize,
    /// Objects on the sensor at power on that were not detected within two seconds.
    lying: usize,
}

impl Defects {
    fn add(&mut self, other: Self) {
        self.ghosts += other.ghosts;
        self.missed += other.missed;
        self.refusals += other.refusals;
        self.lying += other.lying;
    }

    const fn is_none(self) -> bool {
        self.ghosts + self.missed + self.refusals + self.lying == 0
    }
}

/// A board whose sensor is pressed repeatedly.
struct Row<'a> {
    board: NativeBoard<'a>,
    chance: Stream,
    warming_k_per_s: f64,
    ambient_k: f64,
    /// Whether a fault was latched at the last state change.
    faulted: bool,
    found: Defects,
}

impl Row<'_> {
    fn run(&mut self, seconds: f64) -> Result<(), BoardError> {
        let end = self.board.now() + Time::from_secs_f64(seconds);
        while self.board.now() < end {
            let next = (self.board.now() + SLICE).min(end);
            self.board.run_until(next)?;
            let warmed_k = self.warming_k_per_s * next.as_secs_f64();
            let ambient_k = self.ambient_k + warmed_k.clamp(-MOST_WARMING_K, MOST_WARMING_K);
            self.board.with_world(|world| world.set_ambient(ambient_k));
        }
        Ok(())
    }

    /// Moves the object and waits until it has arrived.
    fn move_to(&mut self, position_m: f64) -> Result<(), BoardError> {
        let from_m = self.board.with_world(|world| world.planned_press_m());
        self.board
            .with_world(|world| world.move_press(position_m, SPEED_M_PER_S));
        self.run((position_m - from_m).abs() / SPEED_M_PER_S)
    }

    /// Presses to a depth for a time; returns the records until lift-off.
    fn press(&mut self, depth_m: f64, held_s: f64) -> Result<Vec<Frame<Record>>, BoardError> {
        self.board.take_frames();
        let travel_m = self
            .board
            .with_world(|world| world.press_for_depth_m(depth_m));
        self.move_to(travel_m)?;
        self.run(held_s)?;
        Ok(self.board.take_frames())
    }

    /// Lifts, and waits for a time: any contact after that is a ghost.
    fn lift(&mut self, gap_s: f64) -> Result<(), BoardError> {
        self.move_to(-CLEARANCE_M)?;
        let lifted_s = self.board.now().as_secs_f64();
        self.run(gap_s)?;
        let frames = self.board.take_frames();
        let after = |frame: &Frame<Record>, by_s: f64| {
            frame.header.time_us as f64 * 1e-6 >= lifted_s + by_s
        };
        self.found.ghosts += usize::from(frames.iter().any(|frame| {
            let held = matches!(&frame.message, Record::Sample(sample)
                if matches!(sample.contact, Contact::Held | Contact::Began));
            held && after(frame, GONE_S)
        }));
        self.found.refusals += frames
            .iter()
            .filter(|frame| match &frame.message {
                Record::Refusal(refusal) => {
                    refusal.reason != RefusalReason::ContactLost && after(frame, SOON_S)
                }
                _ => false,
            })
            .count();
        Ok(())
    }

    /// Counts an undetected contact, unless a fault is latched: the board reports the fault, and
    /// the press's outcome names it.
    fn expect_touch(&mut self, frames: &[Frame<Record>]) {
        let stands = |frame: &Frame<Record>| match &frame.message {
            Record::State(change) => Some(change.state == State::Fault),
            _ => None,
        };
        self.faulted = frames.iter().rev().find_map(stands).unwrap_or(self.faulted);
        self.found.missed += usize::from(!self.faulted && !Self::touches(frames));
    }

    fn touches(frames: &[Frame<Record>]) -> bool {
        frames.iter().any(|frame| match &frame.message {
            Record::State(change) => change.state == State::Contact,
            _ => false,
        })
    }

    fn chance(&mut self, part: f64) -> bool {
        self.chance.uniform() < part
    }
}

/// Outcome of a press: the last result before lift-off.
fn outcome(frames: &[Frame<Record>], nothing: &str) -> Result<Claim, String> {
    let result = frames.iter().rev().find_map(|frame| match &frame.message {
        Record::Estimate(estimate) => Some(Ok(Claim::from(estimate))),
        Record::Refusal(refusal) => Some(Err(palpate_cli::describe::refusal(refusal))),
        Record::Fault(fault) if fault.active => Some(Err(format!("fault: {:?}", fault.code))),
        _ => None,
    });
    result.unwrap_or_else(|| Err(nothing.to_owned()))
}

impl Series {
    fn of(
        instrument: &CalibratedInstrument,
        ratio: f64,
        presses: u32,
        plan: &SeriesPlan,
    ) -> Result<Self, Failure> {
        let load = Load::Spring {
            n_per_m: ratio * instrument.plant.sensing.spring_n_per_m,
        };
        let setup = Setup {
            load,
            holder: Holder::Stand,
            profile: Profile::at(-CLEARANCE_M),
            ..Setup::default()
        };
        let world = SimulatedWorld::new(&instrument.plant, instrument.switches, setup)?;
        let ambient_k = world.parameters().thermal.ambient_change_k;
        let wiring = Wiring::new(world);
        let mut chance = Stream::named(instrument.plant.seed, "campaign.series");
        let mut row = Row {
            board: NativeBoard::new(&wiring),
            warming_k_per_s: chance.between(-WARMING_K_PER_S, WARMING_K_PER_S),
            chance,
            ambient_k,
            faulted: false,
            found: Defects::default(),
        };
        let mut series = Self::default();
        row.begin(instrument)?;
        for _ in 0..presses {
            if row.chance(0.25) {
                row.tap(instrument)?;
            }
            row.one(&mut series, instrument, ratio, plan)?;
        }
        row.run(GONE_S + 5.0)?;
        row.lift(GONE_S)?;
        series.found = row.found;
        Ok(series)
    }
}

impl Row<'_> {
    /// Switches the board on. In one of four series an object lies on the sensor, and in half of
    /// those the board is armed while it lies there.
    fn begin(&mut self, instrument: &CalibratedInstrument) -> Result<(), Failure> {
        let lies = self.chance(0.25);
        let lifted_first = self.chance(0.5);
        if lies {
            let depth_m = self.chance.log_between(15e-6, 0.3e-3);
            let travel_m = self
                .board
                .with_world(|world| world.press_for_depth_m(depth_m));
            self.board
                .with_world(|world| world.move_press(travel_m, 0.0));
        }
        for command in &instrument.calibration.commands {
            self.board.send(automatic(command))?;
        }
        if lies {
            self.run(2.0)?;
            let frames = self.board.take_frames();
            self.found.lying += usize::from(!Self::touches(&frames));
            let waits_s = self.chance.log_between(0.5, 10.0);
            self.run(waits_s)?;
        }
        if lies && lifted_first {
            self.lift(1.0)?;
        }
        self.board.send(Command::Arm)?;
        if lies && !lifted_first {
            self.run(1.0)?;
            self.lift(1.0)?;
        }
        Ok(self.run(1.0)?)
    }

    /// A short tap before the press.
    fn tap(&mut self, instrument: &CalibratedInstrument) -> Result<(), Failure> {
        let depth_m = self.chance.between(0.3, 1.0) * instrument.depth_m;
        let held_s = self.chance.between(0.1, 0.3);
        let gap_s = self.chance.log_between(0.15, 0.6);
        let frames = self.press(depth_m, held_s)?;
        self.expect_touch(&frames);
        Ok(self.lift(gap_s)?)
    }

    /// A press of the series, with the gap after it.
    fn one(
        &mut self,
        series: &mut Series,
        instrument: &CalibratedInstrument,
        ratio: f64,
        plan: &SeriesPlan,
    ) -> Result<(), Failure> {
        let (low, high) = plan.depth;
        let depth_m = self.chance.between(low, high) * instrument.depth_m;
        // A fault disarms; a user would notice it and arm again.
        self.board.send(Command::Arm)?;
        let held_s = self.chance.log_between(plan.held_s.0, plan.held_s.1);
        let gap_s = self.chance.log_between(plan.gap_s.0, plan.gap_s.1);
        let frames = self.press(depth_m, held_s)?;
        self.expect_touch(&frames);
        let true_n_per_m = self
            .board
            .with_world(|world| world.truth().load_spring_n_per_m);
        let press = |outcome| Press {
            world: World::Calibrated,
            ratio,
            true_ratio: true_n_per_m / instrument.plant.sensing.spring_n_per_m,
            true_n_per_m,
            outcome,
        };
        series
            .presses
            .push(press(outcome(&frames, "lifted before there was a result")));
        let again = self.chance(0.5);
        let sets = self.chance(0.2);
        if held_s > 5.0 && again {
            self.board.send(Command::Measure)?;
            self.run(6.0)?;
            let frames = self.board.take_frames();
            series.held.push(press(outcome(&frames, "no result")));
        }
        if sets {
            self.set_again(instrument)?;
        }
        Ok(self.lift(gap_s)?)
    }

    /// Sends the settings again while the object presses.
    fn set_again(&mut self, instrument: &CalibratedInstrument) -> Result<(), Failure> {
        self.board.send(Command::Disarm)?;
        let settings = instrument.calibration.commands.iter();
        for command in settings.filter(|command| matches!(command, Command::SetSettings(_))) {
            self.board.send(automatic(command))?;
        }
        self.board.send(Command::Arm)?;
        Ok(self.run(0.5)?)
    }
}

#[derive(Serialize)]
struct SeriesResult {
    stack: String,
    plants: u64,
    seed: u64,
    presses: u32,
    not_calibrated: usize,
    found: Defects,
    first: Counted,
    later: Counted,
    after_a_long_hold: Counted,
}

/// Press each sensor many times in a row, in a continuing world: taps, short gaps, long holds,
/// objects on the sensor at power on, a room that warms
#[derive(Args)]
#[command(after_help = "\
Prints Markdown. Exit code 1 for any contact with nothing there, any press that is missed, any refusal after lift-off that \
does not speak of it, and when intervals contain the truth too seldom.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    drawn: DrawnSensors,
    /// Number of presses of each sensor
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1_000))]
    presses: u32,
}

pub(crate) fn run(Arguments { drawn, presses }: &Arguments) -> Result<(), Failure> {
    let stack = Stack::named(&drawn.stack, Path::new(""))?;
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let progress = Progress::new(drawn.plants as usize);
    let (mut all, mut not_calibrated) = (Vec::new(), 0);
    let of = |index: usize| {
        let seed = drawn.seed.saturating_add(index as u64);
        let ratio = drawn.loads[index % drawn.loads.len()];
        of_sensor(&stack, &disturbances, seed, ratio, *presses)
    };
    in_order(drawn.plants as usize, of, |index, series| {
        progress.step();
        let seed = drawn.seed.saturating_add(index as u64);
        let line = match &series {
            Ok(series) => {
                let counted = Counted::of(series.presses.iter().chain(&series.held));
                format!(
                    "{} of {} intervals contain the truth; {:?}",
                    counted.covered(),
                    counted.accepted,
                    series.found
                )
            }
            Err(failure) => failure.to_string(),
        };
        match series {
            Ok(series) => all.push(series),
            Err(_) => not_calibrated += 1,
        }
        if drawn.json {
            return Ok(());
        }
        let mut out = io::stdout().lock();
        writeln!(out, "seed {seed}: {line}")?;
        Ok(out.flush()?)
    })?;
    progress.finish();
    let result = SeriesResult::of(drawn, &stack.name, *presses, not_calibrated, &all);
    result.print(drawn.json, &all)?;
    result.judge(&all)
}

fn of_sensor(
    stack: &Stack,
    disturbances: &Disturbances,
    seed: u64,
    ratio: f64,
    presses: u32,
) -> Result<Series, Failure> {
    let settings = default_settings();
    let instrument =
        CalibratedInstrument::calibrated(stack, disturbances, seed, Switches::all(), &settings)?;
    Series::of(&instrument, ratio, presses, &PLAN)
}

impl SeriesResult {
    fn of(
        drawn: &DrawnSensors,
        stack: &str,
        presses: u32,
        not_calibrated: usize,
        all: &[Series],
    ) -> Self {
        let mut found = Defects::default();
        all.iter().for_each(|series| found.add(series.found));
        let later = all.iter().flat_map(|series| series.presses.iter().skip(1));
        Self {
            stack: stack.to_owned(),
            plants: drawn.plants,
            seed: drawn.seed,
            presses,
            not_calibrated,
            found,
            first: Counted::of(all.iter().filter_map(|series| series.presses.first())),
            later: Counted::of(later),
            after_a_long_hold: Counted::of(all.iter().flat_map(|series| &series.held)),
        }
    }

    fn print(&self, json: bool, all: &[Series]) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        if json {
            return Ok(writeln!(out, "{}", serde_json::to_string(self)?)?);
        }
        let Defects {
            ghosts,
            missed,
            refusals,
            lying,
        } = self.found;
        writeln!(
            out,
            "{BEGIN}\n{ghosts} contacts with nothing there, {missed} presses or taps not found, {refusals} refusals after lift-off, \
             {lying} objects at power on not found. {} of {} intervals of first presses contain the truth, {} of {} of later ones.\n",
            self.first.covered(),
            self.first.accepted,
            self.later.covered(),
            self.later.accepted,
        )?;
        writeln!(
            out,
            "{} sensors of the stack {} from seed {}. Each is pressed {} times onto the same spring without a restart: for {} to {} s, with \
             gaps of {} to {} s, to {} to {} times the working depth. A quarter of the presses follow a short tap; during a fifth the \
             settings are sent again; a quarter of the sensors have an object on them at power on; the room warms or cools by up to \
             2 K/min. {} sensors could not be calibrated.\n\n{}\n",
            self.plants,
            self.stack,
            self.seed,
            self.presses,
            PLAN.held_s.0,
            PLAN.held_s.1,
            PLAN.gap_s.0,
            PLAN.gap_s.1,
            PLAN.depth.0,
            PLAN.depth.1,
            self.not_calibrated,
            self.table()
        )?;
        let presses = all
            .iter()
            .flat_map(|series| series.presses.iter().chain(&series.held));
        let reasons = counts_of_reasons(presses.filter_map(|of| of.outcome.as_ref().err()));
        Ok(writeln!(out, "{}\n{END}", without_estimate(&reasons))?)
    }

    fn table(&self) -> Table {
        let mut table = Table::new();
        table.load_style(ASCII_MARKDOWN);
        table.set_header([
            "presses",
            "estimated",
            "refused",
            "hold",
            "RMS error, ln",
            "median half width",
            "narrow and wrong",
        ]);
        for (name, counted) in [
            ("first", &self.first),
            ("later", &self.later),
            (
                "again, after a hold of more than 5 s",
                &self.after_a_long_hold,
            ),
        ] {
            table.add_row([
                name.to_owned(),
                counted.accepted.to_string(),
                counted.refused.to_string(),
                percent(counted.coverage95),
                percent(counted.rms_ln),
                percent(counted.half_width_ln),
                percent(counted.narrow_and_wrong_part),
            ]);
        }
        table
    }

    /// Fails for any forbidden result, and where the coverage of the intervals is below 95 %.
    fn judge(&self, all: &[Series]) -> Result<(), Failure> {
        if !self.found.is_none() {
            return Err(Failure::Refused(format!("{:?}", self.found)));
        }
        let later = coverage(all, |series| series.presses.get(1..).unwrap_or_default());
        later.required("later presses")?;
        coverage(all, |series| &series.held).required("long held presses")
    }
}

/// Coverage of presses, with the sensors as sampling units.
fn coverage(all: &[Series], presses: fn(&Series) -> &[Press]) -> Coverage {
    Coverage::of(all.iter().map(|series| {
        let counted = Counted::of(presses(series).iter());
        (counted.covered(), counted.accepted)
    }))
}

#[cfg(test)]
mod tests {
    use palpate_simulate::campaign::press::load_name;

    use super::*;

    /// A small version of the campaign: three sensors, short holds.
    #[test]
    fn presses_in_a_row_leave_no_contact_behind() {
        let plan = SeriesPlan {
            held_s: (1.5, 4.0),
            gap_s: (0.5, 3.0),
            depth: (0.75, 1.2),
        };
        let (stack, disturbances) = (
            Stack::builtin("ultrasoft").unwrap(),
            Disturbances::builtin().unwrap(),
        );
        let mut estimates = 0;
        for (seed, ratio) in [(1, 1.0), (3, 0.5), (7, 2.0)] {
            let settings = default_settings();
            let calibrated = CalibratedInstrument::calibrated(
                &stack,
                &disturbances,
                seed,
                Switches::all(),
                &settings,
            );
            let series = Series::of(&calibrated.unwrap(), ratio, 4, &plan).unwrap();
            assert_eq!(
                series.found,
                Defects::default(),
                "seed {seed}, {}",
                load_name(ratio)
            );
            estimates += series
                .presses
                .iter()
                .filter(|press| press.outcome.is_ok())
                .count();
        }
        assert!(estimates >= 6, "{estimates} of 12");
    }
}
