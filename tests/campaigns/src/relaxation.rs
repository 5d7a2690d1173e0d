//! `cargo campaign relaxation`: objects that relax, held on calibrated sensors; and springs in worlds
//! whose ramps bend as well.

use std::io::{self, Write};
use std::path::Path;

use clap::Args;
use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::failure::Failure;
use palpate_cli::in_order::in_order;
use palpate_cli::progress::Progress;
use palpate_sim::Time;
use palpate_sim::device::Device;
use palpate_sim::mechanics::contact::Contact;
use palpate_sim::mechanics::layer::CreepMode;
use palpate_sim::mechanics::load::{LOAD_MODES, Load};
use palpate_sim::mechanics::press::Profile;
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World as SimulatedWorld};
use palpate_simulate::campaign::counted::quantile;
use palpate_simulate::campaign::world::World;
use palpate_simulate::engine::{self, Native};
use palpate_simulate::instrument::{CalibratedInstrument, SPEED_M_PER_S, default_settings};
use palpate_simulate::press::{self, CLEARANCE_M, automatic, train_hz};
use palpate_simulate::verdict::Verdict;
use palpate_wire::code::RefusalReason;
use palpate_wire::record::Relaxation;
use palpate_wire::{Command, Frame, Record};
use serde::Serialize;

use crate::drawn::DrawnSensors;

/// Hold objects that relax on calibrated sensors, and judge stiffness and relaxation
#[derive(Args)]
#[command(after_help = "\
Prints Markdown. Exit code 1 when fewer than 95 % of the presses are covered or refused.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    drawn: DrawnSensors,
}

/// How an object relaxes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Law {
    name: &'static str,
    /// Time constants of its modes, s, which share the amplitude.
    taus_s: &'static [f64],
}

const fn one(name: &'static str, taus_s: &'static [f64]) -> Law {
    Law { name, taus_s }
}

/// Standard linear solids, and two spectra: over many decades, and over those of a train.
const LAWS: [Law; 11] = [
    one("0.02 s", &[0.02]),
    one("0.05 s", &[0.05]),
    one("0.1 s", &[0.1]),
    one("0.2 s", &[0.2]),
    one("0.5 s", &[0.5]),
    one("1 s", &[1.0]),
    one("2 s", &[2.0]),
    one("5 s", &[5.0]),
    one("20 s", &[20.0]),
    one("0.02 to 200 s", &[0.02, 0.2, 2.0, 20.0, 200.0]),
    one("0.01 to 1 s", &[0.01, 0.03, 0.1, 0.3, 1.0]),
];

/// Amplitudes, in units of the instant compliance.
const AMPLITUDES: [f64; 2] = [0.2, 0.5];

/// Worlds in which a spring's ramps bend.
const BENDING: [World; 7] = [
    World::Lag,
    World::Memory,
    World::Saturating,
    World::CrosstalkStronger,
    World::CrosstalkWeaker,
    World::VibrationInStep,
    World::VibrationTwice,
];

/// Interval between two readings of the truth.
const SLICE: Time = Time::from_ms(10);
/// Time that the instrument gets for self-test and baseline before the press.
const BASELINE: Time = Time::from_ms(800);
/// Longest time of a press: settling, train, and three seconds of holding.
const LONGEST: Time = Time::from_ms(9_000);
/// Time of holding that the last record of a press covers, s.
const HELD_S: f64 = 3.0;
/// Block of time over which the instrument averages, s.
const BLOCK_S: f64 = 0.1;

/// A press of an object that relaxes.
#[derive(Clone, Debug)]
struct RelaxedPress {
    /// Stiffness of the instant spring, in units of c_S.
    ratio: f64,
    law: usize,
    amplitude: f64,
    verdict: Verdict,
    true_n_per_m: f64,
    /// The last record of the relaxation, after three seconds, and the true relaxation.
    relaxation: Option<(Relaxation, f64)>,
}

/// A press of a spring in a world whose ramps bend.
#[derive(Clone, Debug)]
struct Bent {
    world: World,
    verdict: Verdict,
}

type OfSensor = (Vec<RelaxedPress>, Vec<Bent>);

pub(crate) fn run(Arguments { drawn }: &Arguments) -> Result<(), Failure> {
    let stack = &Stack::named(&drawn.stack, Path::new(""))?;
    let disturbances = &Disturbances::builtin().map_err(LoadError::from)?;
    let progress = Progress::new(drawn.plants as usize);
    let seed_of = |index: usize| drawn.seed.saturating_add(index as u64);
    let sensor = |index| {
        let of = of_sensor(drawn, stack, disturbances, seed_of(index));
        of.map_err(|failure| failure.to_string())
    };
    let (mut held, mut bent) = (Vec::new(), Vec::new());
    in_order(drawn.plants as usize, sensor, |index, of_sensor| {
        progress.step();
        match of_sensor {
            Ok((of_held, of_bent)) => {
                held.extend(of_held);
                bent.extend(of_bent);
            }
            Err(reason) => {
                palpate_cli::notice::say(format_args!("seed {}: {reason}", seed_of(index)));
            }
        }
        Ok(())
    })?;
    progress.finish();
    print(drawn, &stack.name, &held, &bent)
}

fn of_sensor(
    drawn: &DrawnSensors,
    stack: &Stack,
    disturbances: &Disturbances,
    seed: u64,
) -> Result<OfSensor, Failure> {
    let all = Switches::all();
    let instrument =
        CalibratedInstrument::calibrated(stack, disturbances, seed, all, &default_settings())?;
    let (mut held, mut bent) = (Vec::new(), Vec::new());
    for ratio in &drawn.loads {
        let n_per_m = ratio * instrument.plant.sensing.spring_n_per_m;
        for law in 0..LAWS.len() {
            for amplitude in AMPLITUDES {
                held.push(hold(&instrument, *ratio, (law, amplitude))?);
            }
        }
        for world in BENDING {
            bent.push(bend(&instrument, n_per_m, world)?);
        }
    }
    Ok((held, bent))
}

fn viscoelastic(n_per_m: f64, law: usize, amplitude: f64) -> Load {
    let taus_s = LAWS.get(law).map_or(&[][..], |law| law.taus_s);
    let mut creep = [CreepMode::default(); LOAD_MODES];
    for (mode, &tau_s) in creep.iter_mut().zip(taus_s) {
        *mode = CreepMode {
            amplitude: amplitude / taus_s.len() as f64,
            tau_s,
        };
    }
    Load::Viscoelastic { n_per_m, creep }
}

/// Presses an object and holds it until the last record of its relaxation.
fn hold(
    instrument: &CalibratedInstrument,
    ratio: f64,
    (law, amplitude): (usize, f64),
) -> Result<RelaxedPress, Failure> {
    let n_per_m = ratio * instrument.plant.sensing.spring_n_per_m;
    let setup = Setup {
        load: viscoelastic(n_per_m, law, amplitude),
        profile: Profile::at(-CLEARANCE_M),
        ..Setup::default()
    };
    let wiring = Wiring::new(SimulatedWorld::new(
        &instrument.plant,
        instrument.switches,
        setup,
    )?);
    let mut board = NativeBoard::new(&wiring);
    for command in &instrument.calibration.commands {
        board.send(automatic(command))?;
    }
    board.send(Command::Arm)?;
    board.run_until(BASELINE)?;
    board.with_world(|world| {
        let travel_m = world.press_for_depth_m(instrument.depth_m);
        world.move_press(travel_m, SPEED_M_PER_S);
    });
    let hertz = train_hz(&instrument.settings);
    let mut truth = Truth::default();
    let mut frames: Vec<Frame<Record>> = Vec::new();
    let end = board.now() + LONGEST;
    while board.now() < end && !is_over(&frames) {
        let next = board.now() + SLICE;
        board.run_until(next)?;
        board.with_world(|world| {
            let of = world.truth();
            let compliance = (of.load_m + of.frame_m) / of.force_n;
            truth.compliances.push((of.time.as_secs_f64(), compliance));
            truth.n_per_m = world.load_stiffness_n_per_m(hertz);
        });
        frames.extend(board.take_frames());
    }
    let reported = frames.iter().rev().find_map(|frame| match &frame.message {
        Record::Relaxation(of) if f64::from(of.held_s) >= HELD_S => {
            let at_s = frame.header.time_us as f64 * 1e-6;
            Some((of.clone(), truth.relaxation(at_s, of.held_s.into())))
        }
        _ => None,
    });
    Ok(RelaxedPress {
        ratio,
        law,
        amplitude,
        verdict: Verdict::of_records(frames.iter().map(|frame| &frame.message)),
        true_n_per_m: truth.n_per_m,
        relaxation: reported,
    })
}

/// Whether no further result of a press follows.
fn is_over(frames: &[Frame<Record>]) -> bool {
    frames.iter().any(|frame| match &frame.message {
        Record::Relaxation(of) => f64::from(of.held_s) >= HELD_S,
        Record::Refusal(_) | Record::Fault(_) => true,
        _ => false,
    })
}

/// Truth of a press.
#[derive(Clone, Debug, Default)]
struct Truth {
    /// Times, s, each with the compression of load and stand over the force, m/N.
    compliances: Vec<(f64, f64)>,
    /// Stiffness at the train's rate.
    n_per_m: f64,
}

impl Truth {
    /// Mean compliance in the block that ends at a time.
    fn mean(&self, end_s: f64) -> f64 {
        let within = |(at_s, _): &&(f64, f64)| (end_s - BLOCK_S..end_s).contains(at_s);
        let block: Vec<f64> = self
            .compliances
            .iter()
            .filter(within)
            .map(|of| of.1)
            .collect();
        block.iter().sum::<f64>() / block.len() as f64
    }

    /// Growth of the compliance in units of that at the train's rate.
    fn relaxation(&self, at_s: f64, held_s: f64) -> f64 {
        (self.mean(at_s) - self.mean(at_s - held_s)) * self.n_per_m
    }
}

/// Presses a spring in a world.
fn bend(instrument: &CalibratedInstrument, n_per_m: f64, world: World) -> Result<Bent, Failure> {
    let instrument = CalibratedInstrument {
        plant: world.plant(&instrument.plant),
        ..instrument.clone()
    };
    let how = press::Press {
        name: world.name(),
        load: Load::Spring { n_per_m },
        holder: world.holder(),
        contact: Contact::default(),
        clearance_m: world.clearance_m(),
        depth_m: instrument.depth_m,
        speed_m_per_s: SPEED_M_PER_S,
    };
    let pressed = engine::press(&instrument, &how, &Native)?;
    let verdict = Verdict::of(&pressed);
    Ok(Bent { world, verdict })
}

fn is_refused_as(verdict: &Verdict, reason: RefusalReason) -> bool {
    matches!(verdict, Verdict::Refusal(refusal) if refusal.reason == reason)
}

/// Counts of presses.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
struct Row {
    pressed: usize,
    covered: usize,
    relaxes: usize,
    misfit: usize,
    otherwise: usize,
    missed: usize,
    /// Mean of ln(estimate/truth).
    bias_ln: f64,
    /// Median of the true relaxations after three seconds.
    relaxation: Option<f64>,
    /// Number of reported relaxations.
    reported: usize,
    /// Number of reported relaxations above two standard errors.
    significant: usize,
    /// Number of significant relaxations within 20 % of the true one.
    within: usize,
    /// Median ratio of the significant relaxations to the true ones.
    ratio: Option<f64>,
    /// Root of the mean square of the errors over their own standard errors.
    standardised: f64,
}

impl Row {
    fn of<'h>(held: impl Iterator<Item = &'h RelaxedPress>) -> Self {
        let mut row = Self::default();
        let (mut errors, mut truths, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
        let mut squares = 0.0;
        for press in held {
            row.count(&press.verdict, press.true_n_per_m);
            let estimate = press.verdict.estimate().and_then(|of| of.stiffness_n_per_m);
            errors.extend(estimate.map(|of| (f64::from(of) / press.true_n_per_m).ln()));
            let Some((reported, truth)) = &press.relaxation else {
                continue;
            };
            let value = f64::from(reported.relaxation);
            let standard_error = f64::from(reported.standard_error);
            truths.push(*truth);
            row.reported += 1;
            squares += ((value - truth) / standard_error).powi(2);
            if value > 2.0 * standard_error {
                row.significant += 1;
                row.within += usize::from((value / truth - 1.0).abs() <= 0.2);
                ratios.push(value / truth);
            }
        }
        row.bias_ln = errors.iter().sum::<f64>() / errors.len() as f64;
        row.relaxation = quantile(&truths, 0.5);
        row.ratio = quantile(&ratios, 0.5);
        row.standardised = (squares / row.reported as f64).sqrt();
        row
    }

    fn count(&mut self, verdict: &Verdict, true_n_per_m: f64) {
        self.pressed += 1;
        let counter = match verdict.holds(true_n_per_m) {
            Some(true) => &mut self.covered,
            Some(false) => &mut self.missed,
            None if is_refused_as(verdict, RefusalReason::Relaxes) => &mut self.relaxes,
            None if is_refused_as(verdict, RefusalReason::Misfit) => &mut self.misfit,
            None => &mut self.otherwise,
        };
        *counter += 1;
    }

    fn cells(&self) -> [String; 10] {
        let percent =
            |of: Option<f64>| of.map_or(String::new(), |of| format!("{:.1} %", of * 100.0));
        [
            self.covered.to_string(),
            self.relaxes.to_string(),
            (self.misfit + self.otherwise).to_string(),
            self.missed.to_string(),
            format!("{:+.1} %", self.bias_ln * 100.0),
            percent(self.relaxation),
            format!("{} of {}", self.significant, self.reported),
            self.ratio
                .map_or(String::new(), |ratio| format!("{ratio:.2}")),
            self.within.to_string(),
            format!("{:.2}", self.standardised),
        ]
    }
}

/// Rows of a law and an amplitude.
fn rows(held: &[RelaxedPress]) -> impl Iterator<Item = (&'static str, f64, Row)> {
    LAWS.iter().enumerate().flat_map(move |(index, law)| {
        AMPLITUDES.map(|amplitude| {
            let of = |press: &&RelaxedPress| press.law == index && press.amplitude == amplitude;
            (law.name, amplitude, Row::of(held.iter().filter(of)))
        })
    })
}

fn print(
    drawn: &DrawnSensors,
    stack: &str,
    held: &[RelaxedPress],
    bent: &[Bent],
) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let whole = Row::of(held.iter());
    if drawn.json {
        for (law, amplitude, row) in rows(held) {
            let line = serde_json::json!({ "law": law, "amplitude": amplitude, "of": row });
            writeln!(out, "{line}")?;
        }
        return required(&whole);
    }
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header([
        "time constant",
        "amplitude",
        "covered",
        "refused as `relaxes`",
        "refused otherwise",
        "missed",
        "mean error",
        "true relaxation",
        "significant",
        "over true",
        "within 20 %",
        "error/standard error",
    ]);
    for (law, amplitude, row) in rows(held) {
        let names = [law.to_owned(), amplitude.to_string()];
        table.add_row(names.into_iter().chain(row.cells()));
    }
    let mut others = Table::new();
    others.load_style(ASCII_MARKDOWN);
    others.set_header([
        "a spring, and",
        "pressed",
        "`misfit`",
        "`relaxes`",
        "estimated",
    ]);
    for world in BENDING {
        let of: Vec<&Bent> = bent.iter().filter(|bent| bent.world == world).collect();
        let as_reason = |reason| {
            of.iter()
                .filter(|of| is_refused_as(&of.verdict, reason))
                .count()
        };
        let estimated = of.iter().filter(|of| of.verdict.estimate().is_some());
        others.add_row([
            world.name(),
            of.len().to_string(),
            as_reason(RefusalReason::Misfit).to_string(),
            as_reason(RefusalReason::Relaxes).to_string(),
            estimated.count().to_string(),
        ]);
    }
    for table in [&mut table, &mut others] {
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    writeln!(
        out,
        "{BEGIN}\nOf {} presses {} intervals contain the stiffness at the train's rate, {} do not; {} presses are refused as \
         `relaxes`, {} as `misfit`, {} otherwise. Of {} relaxations after three seconds {} are significant, {} of them within \
         20 % of the true one; the root mean square of error over standard error is {:.2}. The median standard error is {}.\n\n\
         {} sensors of the stack {stack} from seed {}, loads of {} c_S. Amplitude in units of the instant compliance; \
         two spectra of five modes each. Significant: above two standard errors; `over true` is the median of their ratio to \
         the true relaxation.\n\n{table}\n\nThe same sensors and loads without relaxation, in worlds whose ramps bend:\n\n{others}\n{END}",
        whole.pressed,
        whole.covered,
        whole.missed,
        whole.relaxes,
        whole.misfit,
        whole.otherwise,
        whole.reported,
        whole.significant,
        whole.within,
        whole.standardised,
        standard_errors(drawn, held),
        drawn.plants,
        drawn.seed,
        drawn
            .loads
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(", "),
    )?;
    required(&whole)
}

/// Median standard errors of the reported relaxations, by load.
fn standard_errors(drawn: &DrawnSensors, held: &[RelaxedPress]) -> String {
    let of_load = |ratio: &f64| {
        let held = held.iter().filter(|held| held.ratio == *ratio);
        let errors = held.filter_map(|held| held.relaxation.as_ref());
        let errors: Vec<f64> = errors.map(|(of, _)| of.standard_error.into()).collect();
        let median = quantile(&errors, 0.5)?;
        Some(format!("{:.1} % at {ratio} c_S", median * 100.0))
    };
    drawn
        .loads
        .iter()
        .filter_map(of_load)
        .collect::<Vec<_>>()
        .join(", ")
}

fn required(whole: &Row) -> Result<(), Failure> {
    let good = whole.pressed - whole.missed;
    if whole.pressed == 0 || good * 100 < whole.pressed * 95 {
        return Err(Failure::Refused(format!(
            "{good} of {} presses are covered or refused, fewer than 95 %",
            whole.pressed
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use palpate_sim::parameters::draw;

    use super::*;

    fn instrument() -> CalibratedInstrument {
        let stack = Stack::builtin("ultrasoft").unwrap();
        let disturbances = Disturbances::builtin().unwrap();
        let all = Switches::all();
        CalibratedInstrument::calibrated(&stack, &disturbances, 1, all, &default_settings())
            .unwrap()
    }

    /// What a train measures of a load, without any disturbance: 1/x over g on the last six falls, after
    /// the load has relaxed from the press. x (1 + c_S/c_L + g) is constant over a fall.
    fn seen_by_a_train(name: &str, amplitude: f64, ratio: f64) -> (f64, f64) {
        let stack = Stack::builtin("ultrasoft").unwrap();
        let plant = draw(&stack, &Disturbances::builtin().unwrap(), 1);
        let setup = Setup {
            load: viscoelastic(ratio * plant.sensing.spring_n_per_m, named(name), amplitude),
            profile: Profile::at(1e-3),
            ..Setup::default()
        };
        let mut world = SimulatedWorld::new(&plant, Switches::none(), setup).unwrap();
        world.advance(Time::from_ms(20_000));
        let ramp = [(10, 10.0), (40, 10.0), (100, 0.0)];
        let ramps = (0..12).flat_map(|number| ramp.map(|(ms, to_a)| (ms + 100 * number, to_a)));
        let points: Vec<_> = ramps.map(|(ms, to_a)| (Time::from_ms(ms), to_a)).collect();
        world.follow_current(&points);
        let mut samples = Vec::new();
        for ms in 0..1_200 {
            world.advance(Time::from_ms(1));
            if ms >= 600 && ms % 100 >= 40 {
                let truth = world.truth();
                let g = truth.sensing_spring_n_per_m / truth.actuated_spring_n_per_m;
                samples.push((g, 1.0 / truth.sensing_m));
            }
        }
        let count = samples.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| samples.iter().map(of).sum::<f64>() / count;
        let (g, y) = (mean(|of| of.0), mean(|of| of.1));
        let slope = (mean(|of| of.0 * of.1) - g * y) / (mean(|of| of.0 * of.0) - g * g);
        let kappa = y / slope - g - 1.0;
        let truth = world.load_stiffness_n_per_m(train_hz(&default_settings()));
        (plant.sensing.spring_n_per_m / kappa, truth)
    }

    /// The definition of the true stiffness: within 4 % for modes of up to half of the instant
    /// compliance and 20 ms or more.
    #[test]
    fn a_train_sees_the_storage_compliance_at_half_its_rate() {
        for law in &LAWS[..9] {
            for amplitude in AMPLITUDES {
                for ratio in [0.2, 1.0, 5.0] {
                    let (seen, truth) = seen_by_a_train(law.name, amplitude, ratio);
                    let off = seen / truth - 1.0;
                    assert!(
                        off.abs() < 0.04,
                        "{} {amplitude} {ratio} c_S: {off}",
                        law.name
                    );
                }
            }
        }
        // A train of this rate does not see the instant spring at 20 ms, which is 28 % stiffer.
        let (seen, _) = seen_by_a_train("0.02 s", 0.5, 1.0);
        let (instant, _) = seen_by_a_train("0.02 s", 0.0, 1.0);
        assert!(instant / seen > 1.2, "{seen} {instant}");
    }

    fn named(name: &str) -> usize {
        LAWS.iter().position(|law| law.name == name).unwrap()
    }

    /// A small version of the campaign: a fast object is refused as such, a slow one measured with its
    /// relaxation, and a lag of the stiffening is a misfit.
    #[test]
    fn a_fast_object_is_refused_and_a_slow_one_measured() {
        let instrument = instrument();
        let n_per_m = 0.5 * instrument.plant.sensing.spring_n_per_m;
        let held = |law, amplitude| hold(&instrument, 0.5, (named(law), amplitude)).unwrap();
        let fast = held("0.05 s", 0.5);
        assert!(
            is_refused_as(&fast.verdict, RefusalReason::Relaxes),
            "{fast:?}"
        );
        let slow = held("2 s", 0.5);
        assert_eq!(
            slow.verdict.holds(slow.true_n_per_m),
            Some(true),
            "{slow:?}"
        );
        let (reported, truth) = slow.relaxation.unwrap();
        let off = (f64::from(reported.relaxation) - truth) / f64::from(reported.standard_error);
        assert!(off.abs() < 3.0, "{reported:?} {truth}");
        assert!(
            reported.relaxation > 3.0 * reported.standard_error,
            "{reported:?}"
        );
        // A spring does not relax: the bench's creep is subtracted, with less uncertainty than any.
        let mut typical = instrument.clone();
        let commands = &mut typical.calibration.commands;
        commands.retain(|command| !matches!(command, Command::SetCreep(_)));
        let [own, any] = [&instrument, &typical].map(|of| {
            let spring = hold(of, 5.0, (named("2 s"), 0.0)).unwrap();
            let (reported, _) = spring.relaxation.unwrap();
            let standardised = reported.relaxation / reported.standard_error;
            assert!(standardised.abs() < 3.0, "{reported:?}");
            reported.standard_error
        });
        assert!(own < 0.4 * any, "{own} {any}");
        let lag = bend(&instrument, n_per_m, World::Lag).unwrap();
        assert!(
            is_refused_as(&lag.verdict, RefusalReason::Misfit),
            "{lag:?}"
        );
    }
}
