//! Errors of a bench session: each is added to a good simulated session, which is then refused.

use std::f64::consts::TAU;
use std::sync::OnceLock;

use palpate_calibration::bench::ContactPlan;
use palpate_calibration::checks::{fault_of_run, fault_of_session};
use palpate_calibration::session::{BenchSample, Pressed, Run, Session};
use palpate_calibration::{Known, evaluate};
use palpate_sim::parameters::draw;
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_wire::Command;

use crate::instrument::{BenchTask, default_settings};

/// A session with all disturbances, computed once.
fn good() -> &'static (Session, Known) {
    static GOOD: OnceLock<(Session, Known)> = OnceLock::new();
    GOOD.get_or_init(|| {
        let stack = Stack::builtin("ultrasoft").unwrap();
        let plant = draw(&stack, &Disturbances::builtin().unwrap(), 3);
        let task = BenchTask::of(&plant, &stack, Switches::all(), &default_settings());
        let session = task.session(&plant, Switches::all(), 0.0).unwrap();
        (session, task.known)
    })
}

/// Name of the fault for which the checks or the evaluation refuse a session; `None` if accepted.
fn refused(session: &Session, known: &Known) -> Option<String> {
    let untouched = session.runs.first();
    let runs = session.runs.iter().chain([&session.deepest_press]);
    let of_run = runs.map(|run| fault_of_run(run, untouched, known));
    let fault = of_run.flatten().next();
    let fault = fault.or_else(|| fault_of_session(session, known));
    let name = fault.map(|fault| {
        assert!(!fault.cause.is_empty() && !fault.action.is_empty());
        fault.name.to_owned()
    });
    name.or_else(|| evaluate(session, known).err().map(|of| of.to_string()))
}

/// Indices of the middle depth on the block, on a soft spring and on one like the sensing layer. A
/// session has one run without contact, three on the block, and three on each of six springs.
const BLOCK: usize = 2;
const SOFT: usize = 8;
const LIKE: usize = 14;

fn every(session: &mut Session, spoil: impl Fn(&mut BenchSample)) {
    let runs = session.runs.iter_mut().chain([&mut session.deepest_press]);
    runs.flat_map(|run| &mut run.lines).for_each(spoil);
}

fn force(session: &mut Session, spoil: impl Fn(f64) -> f64) {
    every(session, |line| line.force_n = line.force_n.map(&spoil));
}

fn stage(session: &mut Session, spoil: impl Fn(f64) -> f64) {
    every(session, |line| line.stage_m = line.stage_m.map(&spoil));
}

/// Lines of a run later than a time.
fn later(run: &mut Run, from_s: f64) -> impl Iterator<Item = &mut BenchSample> {
    let lines = run.lines.iter_mut();
    lines.filter(move |line| line.time_s > from_s)
}

/// Multiplies the deformation, as the change of inductance, and the force by a factor.
fn deform(run: &mut Run, from_s: f64, times: f64) {
    let rest_hz = run.rest_hz().unwrap();
    for line in later(run, from_s) {
        let change = (rest_hz / line.frequency_hz).powi(2) - 1.0;
        line.frequency_hz = rest_hz / (1.0 + times * change).sqrt();
        line.force_n = line.force_n.map(|force_n| force_n * times);
    }
}

/// Adds a deformation, m, to the samples of a train. On the reference coil a micrometre changes the
/// inductance by 0.25 parts in a thousand.
fn add(run: &mut Run, deformation_m: impl Fn(f64) -> f64) {
    let (rest_hz, from_s) = (run.rest_hz().unwrap(), run.ramps_s);
    for line in later(run, from_s) {
        let change = (rest_hz / line.frequency_hz).powi(2) - 1.0;
        let change = change + 250.0 * deformation_m(line.time_s);
        line.frequency_hz = rest_hz / (1.0 + change).sqrt();
    }
}

/// Changes the stated stiffness of one of the springs.
fn rename(session: &mut Session, from: f64, to: f64) {
    for run in &mut session.runs {
        if run.pressed == (Pressed::Spring { n_per_m: from }) {
            run.pressed = Pressed::Spring { n_per_m: to };
        }
    }
}

/// Replaces the three runs of the specimen at `place` by those of the specimen at `of`.
fn instead(session: &mut Session, place: usize, of: usize) {
    for depth in 0..3 {
        let pressed = session.runs[place + depth].pressed;
        session.runs[place + depth] = Run {
            pressed,
            ..session.runs[of + depth].clone()
        };
    }
}

type Spoil = (&'static str, fn(&mut Session), &'static [&'static str]);

/// Errors that can occur with and without a load cell, each with the faults that may be reported
/// for it.
const WITHOUT_LOAD_CELL: [Spoil; 18] = [
    (
        "a spring typed in twice as stiff",
        |session| rename(session, 6e3, 11e3),
        &["spring_differs"],
    ),
    (
        "two springs swapped",
        |session| {
            rename(session, 3e3, 1.0);
            rename(session, 6e3, 3e3);
            rename(session, 1.0, 6e3);
        },
        &["spring_differs"],
    ),
    (
        "a spring that was not changed",
        |session| instead(session, 13, 10),
        &["spring_differs"],
    ),
    (
        "a block in place of a spring",
        |session| instead(session, 10, 1),
        &["spring_differs", "stage_unit"],
    ),
    (
        "a stage whose numbers fall",
        |session| stage(session, |m| -m),
        &["stage_sign"],
    ),
    (
        "a stage in millimetres",
        |session| stage(session, |m| 1e3 * m),
        &["stage_unit"],
    ),
    (
        "a stage that lost steps in a press",
        |session| {
            let run = &mut session.runs[LIKE];
            let middle_s = run.pressed_s - 0.1;
            later(run, middle_s).for_each(|line| line.stage_m = line.stage_m.map(|m| m + 150e-6));
        },
        &["stage_does_not_follow", "spring_differs"],
    ),
    (
        "a specimen that slipped in the train",
        |session| {
            let from_s = session.runs[LIKE].ramps_s + 0.5;
            deform(&mut session.runs[LIKE], from_s, 0.85);
        },
        &["slipped"],
    ),
    (
        "a layer that jumps by two micrometres and back",
        |session| {
            add(&mut session.runs[LIKE], |time_s| {
                if (time_s * 7.3).fract() < 0.5 {
                    2e-6
                } else {
                    0.0
                }
            });
        },
        &["unsteady"],
    ),
    (
        "a bench that shakes by two micrometres at 50 Hz",
        |session| {
            add(&mut session.runs[LIKE], |time_s| {
                2e-6 * (time_s * 50.0 * TAU).sin()
            });
        },
        &["unsteady"],
    ),
    (
        "a press that did not reach the sensor",
        |session| deform(&mut session.runs[LIKE], 0.75, 0.0),
        &["press_not_reached"],
    ),
    (
        "a press too shallow",
        |session| deform(&mut session.runs[LIKE], 0.75, 0.3),
        &["depth_differs", "force_unit"],
    ),
    (
        "a specimen that rests on the sensor before the press",
        |session| {
            let lines = session.runs[SOFT].lines.iter_mut();
            lines.for_each(|line| line.frequency_hz *= 0.998);
        },
        &["rest_frequency_moved"],
    ),
    (
        "a touch where nothing is to touch",
        |session| {
            let run = &mut session.runs[0];
            let from_s = run.began_s - 0.04;
            later(run, from_s).for_each(|line| line.frequency_hz *= 0.998);
        },
        &["touched"],
    ),
    (
        "a sensing coil that comes loose",
        |session| {
            let run = &mut session.runs[BLOCK];
            let from_s = run.ramps_s + 1.0;
            later(run, from_s).for_each(|line| line.frequency_hz *= 1.01);
        },
        &["slipped"],
    ),
    (
        "a drive coil without a current",
        |session| {
            let lines = session.runs[BLOCK].lines.iter_mut();
            lines.for_each(|line| line.current_a = 0.0);
        },
        &["current_missing"],
    ),
    (
        "a tenth of the samples lost",
        |session| {
            let lines = &mut session.runs[BLOCK].lines;
            let mut index = 0;
            lines.retain(|_| {
                index += 1;
                index % 50 >= 5
            });
        },
        &["samples_missing"],
    ),
    (
        "springs in newtons per millimetre",
        |session| {
            for run in &mut session.runs {
                if let Pressed::Spring { n_per_m } = &mut run.pressed {
                    *n_per_m *= 1e-3;
                }
            }
        },
        &["stage_unit"],
    ),
];

/// Errors that only a load cell makes possible or shows, each with the faults that may be reported
/// for it.
const WITH_LOAD_CELL: [Spoil; 13] = [
    (
        "a force in millinewtons",
        |session| force(session, |n| 1e3 * n),
        &["force_noisy", "force_not_zero", "force_unit"],
    ),
    (
        "a force in kilonewtons",
        |session| force(session, |n| 1e-3 * n),
        &["force_unit"],
    ),
    (
        "a force in kilograms",
        |session| force(session, |n| n / 9.81),
        &["force_unit"],
    ),
    (
        "a force in pounds where kilograms were set",
        |session| force(session, |n| 2.2 * n),
        &["spring_differs"],
    ),
    (
        "a load cell with the wrong sign",
        |session| force(session, |n| -n),
        &["force_sign"],
    ),
    (
        "a load cell that is not at zero",
        |session| force(session, |n| n + 0.2),
        &["force_not_zero"],
    ),
    (
        "a load cell that is not plugged in",
        |session| force(session, |n| 1e-3 * (n * 1e6).sin()),
        &["force_unit", "force_sign"],
    ),
    (
        "a load cell unplugged in a train, which shows its last value",
        |session| {
            let run = &mut session.runs[BLOCK];
            let from_s = run.ramps_s + 0.4;
            let last = later(run, from_s).next().unwrap().force_n;
            later(run, from_s).for_each(|line| line.force_n = last);
        },
        &["force_frozen"],
    ),
    (
        "a load cell unplugged in a train, which shows nothing",
        |session| {
            let run = &mut session.runs[BLOCK];
            let from_s = run.ramps_s + 0.4;
            later(run, from_s).for_each(|line| line.force_n = None);
        },
        &["force_missing"],
    ),
    (
        "a load cell beyond its range",
        |session| {
            let lines = session.deepest_press.lines.iter();
            let greatest_n = lines.filter_map(|line| line.force_n).fold(0.0, f64::max);
            every(session, |line| {
                line.force_n = line
                    .force_n
                    .map(|n| n.min(0.6 * greatest_n) + 1e-5 * line.time_s);
            });
        },
        &["force_does_not_follow"],
    ),
    (
        "a load cell that is a tenth of a second late",
        |session| {
            for run in &mut session.runs {
                let forces: Vec<_> = run.lines.iter().map(|line| line.force_n).collect();
                for (index, line) in run.lines.iter_mut().enumerate() {
                    line.force_n = forces[index.saturating_sub(100)];
                }
            }
        },
        &["force_does_not_follow"],
    ),
    (
        "a load cell that scatters",
        |session| {
            every(session, |line| {
                let noise_n = 0.1 * (line.time_s * 1e5).sin();
                line.force_n = line.force_n.map(|n| n + noise_n);
            });
        },
        &["force_noisy"],
    ),
    (
        "a block of rubber",
        |session| session.bare.iter_mut().for_each(|(n, m)| *m += 1e-4 * *n),
        &["block_gives_way"],
    ),
];

fn judge(session: &Session, known: &Known, spoils: &[Spoil]) {
    assert_eq!(refused(session, known), None, "the good session");
    let mut wrong = Vec::new();
    for (what, spoil, expected) in spoils {
        let mut spoiled = session.clone();
        spoil(&mut spoiled);
        let found = refused(&spoiled, known);
        if !found
            .as_deref()
            .is_some_and(|found| expected.contains(&found))
        {
            wrong.push((what, found));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn every_spoiled_session_with_a_load_cell_is_refused_for_its_reason() {
    let (session, known) = good();
    judge(
        session,
        known,
        &[&WITHOUT_LOAD_CELL[..], &WITH_LOAD_CELL].concat(),
    );
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn every_spoiled_session_of_springs_alone_is_refused_for_its_reason() {
    let (session, known) = good();
    let session = session.clone().without_load_cell();
    let known = Known {
        load_cell_gain: None,
        ..known.clone()
    };
    judge(&session, &known, &WITHOUT_LOAD_CELL);
}

/// Presses beside the centre and tilted show the effects with which the sensor was drawn.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn place_and_tilt_are_found_as_the_sensor_was_drawn() {
    let contact = ContactPlan {
        within_m: 2e-3,
        tilt_rad: 2e-3,
    };
    for (stack, seed) in [("ultrasoft", 3), ("soft-closed", 5)] {
        let stack = Stack::builtin(stack).unwrap();
        let plant = draw(&stack, &Disturbances::builtin().unwrap(), seed);
        let mut task = BenchTask::of(&plant, &stack, Switches::all(), &default_settings());
        task.plan.contact = contact;
        let session = task.session(&plant, Switches::all(), 0.0).unwrap();
        assert_eq!(session.contact.len(), 6);
        let calibration = evaluate(&session, &task.known).unwrap();
        let found = calibration.contact.unwrap();
        assert_eq!((found.within_m, found.tilt_rad), (2e-3, 2e-3));
        // At the rim, and at the greatest tilt.
        let drawn = &plant.contact;
        let lost = drawn.lost_per_m2 * 2e-3 * 2e-3 * calibration.stiffening_of_signal;
        let shift_m = (1.0 - drawn.tilted_share) * 2.0 * drawn.radius_m * 2e-3;
        let ratio = shift_m / calibration.depth_m();
        let both = (lost * lost + ratio * ratio + 1.5 * lost * ratio) / 3.0;
        let stated = found
            .signal_uncertainty
            .hypot(found.zero_uncertainty_m / calibration.depth_m());
        println!("{found:?} {lost} {shift_m}");
        let part = stated / both.sqrt();
        // The stated value also includes the scatter of the trains.
        assert!((0.85..1.5).contains(&part), "{part}");
        // The calibration itself is that of the centred block.
        let without = Session {
            contact: Vec::new(),
            ..session
        };
        let mut commands = calibration.commands;
        assert!(matches!(commands.pop(), Some(Command::SetContact(_))));
        let alone = evaluate(&without, &task.known).unwrap();
        assert_eq!(alone.commands, commands);
        assert_eq!(alone.contact, None);
    }
}

/// A bench whose faces are not parallel: a small tilt widens the interval, a large one is refused.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_tilted_bench_widens_or_is_refused() {
    let stack = Stack::builtin("ultrasoft").unwrap();
    let plant = draw(&stack, &Disturbances::builtin().unwrap(), 3);
    let task = BenchTask::of(&plant, &stack, Switches::all(), &default_settings());
    let shift_m = |tilt_rad: f64| {
        (1.0 - plant.contact.tilted_share) * 2.0 * plant.contact.radius_m * tilt_rad
    };
    for part in [0.004, 0.02] {
        let tilt_rad = part * task.plan.depth_m / shift_m(1.0);
        let mut tilted = plant.clone();
        tilted.rig.tilt_rad = tilt_rad;
        let session = task.session(&tilted, Switches::all(), 0.0);
        if part > 0.01 {
            let refused = session.unwrap_err().to_string();
            assert!(refused.contains("touches with its edge first"), "{refused}");
            continue;
        }
        let commands = evaluate(&session.unwrap(), &task.known).unwrap().commands;
        let zero_m = commands.iter().find_map(|command| match command {
            Command::SetSprings(springs) => Some(f64::from(springs.zero_uncertainty_m)),
            _ => None,
        });
        let ratio = zero_m.unwrap() / shift_m(tilt_rad);
        assert!((0.7..1.3).contains(&ratio), "{ratio}");
    }
}

/// Only a session whose presses are held shows the creep; earlier programs recorded others.
#[test]
fn creep_is_found_where_presses_are_held() {
    let (session, known) = good();
    let has_creep = |session: &Session| {
        let commands = evaluate(session, known).unwrap().commands;
        commands.iter().any(|of| matches!(of, Command::SetCreep(_)))
    };
    assert!(has_creep(session));
    let mut earlier = session.clone();
    for run in &mut earlier.runs {
        run.held.clear();
    }
    assert!(!has_creep(&earlier));
}
