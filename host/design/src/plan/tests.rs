//! Compares the formulas with trains of three springs in closed form, evaluated sample by sample,
//! and the trains that the search finds with the simulated board.

use palpate_sim::Time;
use palpate_sim::device::Device;
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_sim::random::Stream;
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};
use palpate_wire::code::{RefusalReason, State};
use palpate_wire::command::Settings;
use palpate_wire::{Command, Record};

use super::bench::slopes;
use super::causes::Cause;
use super::line::TrainLine;
use super::search::COMPARED;
use super::*;

const PRESS: PlannedPress = PlannedPress {
    depth: 1.0,
    away_k: 2.9,
};
/// Loads, c_S/c_L.
const KAPPAS: [f64; 3] = [0.2, 1.0, 5.0];

fn sensor(stack: &str) -> PlannedSensor {
    let stack = Stack::builtin(stack).unwrap();
    PlannedSensor::new(&stack, &Disturbances::builtin().unwrap())
}

fn conversions(sensor: &PlannedSensor) -> Conversions {
    Conversions::at(1_000, sensor.plant.ldc.white_noise_relative).unwrap()
}

fn line(sensor: &PlannedSensor) -> TrainLine {
    TrainLine::new(
        sensor,
        &sensor.settings,
        &conversions(sensor),
        sensor.depth_m,
    )
    .unwrap()
}

/// Errors of the quantities in an evaluation: relative for spring and stiffening; in units of the
/// working depth at the peak for attraction, cross-talk and its growth.
#[derive(Clone, Copy, Default)]
struct Wrong {
    actuated: f64,
    stiffening: f64,
    attraction: f64,
    crosstalk: f64,
    growth: f64,
}

/// Time, s, and current, A, at every conversion of the falls.
fn falls(settings: &Settings) -> Vec<(f64, f64)> {
    let fall = |ramp: u32| {
        (0..60).map(move |index| {
            let since_s = 1e-3 * (f64::from(index) + 0.5);
            (
                0.1 * f64::from(ramp) + 0.035 + since_s,
                10.0 * (1.0 - since_s / 0.06),
            )
        })
    };
    assert_eq!((settings.ramps, settings.peak_current_a), (12, 10.0));
    (0..12).flat_map(fall).collect()
}

/// Returns kappa from a line fitted to 1/x of a train, evaluated with the errors `wrong`. `added_m`
/// is the error of a reading, m, at a time, s.
fn reads(
    sensor: &PlannedSensor,
    kappa: f64,
    wrong: &Wrong,
    added_m: &mut dyn FnMut(f64) -> f64,
) -> f64 {
    let (depth_m, whole) = (sensor.depth_m, sensor.whole(kappa));
    let mut normal = Information::new(4);
    let mut right = [0.0; 4];
    for (time_s, current_a) in falls(&sensor.settings) {
        let square = current_a * current_a / 100.0;
        let h = sensor.stiffening(current_a);
        let pull_m = sensor.plant.attraction.n_per_a2 * current_a * current_a
            / sensor.plant.sensing.spring_n_per_m
            * (sensor.ratio + h);
        // The total travel is x (1 + kappa + g) plus the pull.
        let true_m = (depth_m * whole - pull_m) / (whole + h);
        let read_m =
            true_m + square * (wrong.crosstalk * depth_m + wrong.growth * true_m) + added_m(time_s);
        let pull_m = pull_m + wrong.attraction * depth_m * square * (sensor.ratio + h);
        let signal = h * (1.0 + wrong.stiffening) + pull_m / read_m;
        let row = [1.0, signal, time_s, (time_s / 0.7).ln_1p()];
        normal.read(&row, 1.0);
        for (sum, entry) in right.iter_mut().zip(row) {
            *sum += entry * depth_m / read_m;
        }
    }
    let solved = normal.solve(&right).unwrap();
    // 1/x extrapolated to zero signal, without the drift.
    let level = solved[0];
    level / solved[1] - 1.0 - sensor.ratio * (1.0 + wrong.actuated)
}

#[test]
fn an_error_of_each_quantity_moves_a_load_by_what_the_slopes_say() {
    const STEP: f64 = 1e-4;
    for name in ["ultrasoft", "soft-closed"] {
        let sensor = sensor(name);
        let line = line(&sensor);
        for kappa in KAPPAS {
            let exact = reads(&sensor, kappa, &Wrong::default(), &mut |_| 0.0);
            assert!((exact / kappa - 1.0).abs() < 1e-6, "{kappa}: {exact}");
            let wrongs = [
                Wrong {
                    actuated: STEP,
                    ..Wrong::default()
                },
                Wrong {
                    stiffening: STEP,
                    ..Wrong::default()
                },
                Wrong {
                    attraction: STEP,
                    ..Wrong::default()
                },
                Wrong {
                    crosstalk: STEP,
                    ..Wrong::default()
                },
                Wrong {
                    growth: STEP,
                    ..Wrong::default()
                },
            ];
            for (index, (slope, wrong)) in slopes(&sensor, &line, kappa)
                .into_iter()
                .zip(wrongs)
                .enumerate()
            {
                let moved = (reads(&sensor, kappa, &wrong, &mut |_| 0.0) - exact) / STEP;
                // The slopes are of first order, while the stiffening is a tenth of the line, and
                // more where the attraction cancels most of the stiffening: both may differ by
                // 12 %.
                assert!(
                    (moved / slope - 1.0).abs() < 0.12,
                    "{name} {kappa} {index}: {moved} {slope}"
                );
            }
        }
    }
}

#[test]
fn noise_and_vibration_scatter_a_load_by_what_the_line_says() {
    const TRIALS: u32 = 400;
    let sensor = sensor("ultrasoft");
    let (line, conversions) = (line(&sensor), conversions(&sensor));
    let (kappa, whole) = (1.0, sensor.whole(1.0));
    let noise_m = conversions.relative_sigma * sensor.metres_per_relative_frequency(sensor.depth_m);
    let mut stream = Stream::named(3, "plan");
    let (mut of_noise, mut of_vibration) = (0.0, 0.0);
    for _ in 0..TRIALS {
        let read = reads(&sensor, kappa, &Wrong::default(), &mut |_| {
            noise_m * stream.normal()
        });
        of_noise += (read - kappa).powi(2) / f64::from(TRIALS);
        let (low_hz, high_hz) = sensor.vibration_hz;
        let omega = core::f64::consts::TAU * stream.between(low_hz, high_hz);
        let phase = core::f64::consts::TAU * stream.uniform();
        let amplitude_m = sensor.vibration_m / whole;
        let read = reads(&sensor, kappa, &Wrong::default(), &mut |time_s| {
            amplitude_m * (omega * time_s + phase).sin()
        });
        of_vibration += (read - kappa).powi(2) / f64::from(TRIALS);
    }
    let noise = of_noise / (whole.powi(4) * line.conversions);
    let vibration = of_vibration / (whole.powi(2) * line.vibration);
    // 400 squares give the variance by noise within 7 %. Most of the vibration's effect is at a few
    // frequencies near the ramps' harmonics, so its limits are wider.
    assert!((noise - 1.0).abs() < 0.2, "{noise}");
    assert!((0.6..1.6).contains(&vibration), "{vibration}");
}

#[test]
fn the_causes_add_up_to_what_the_information_bounds() {
    let sensor = sensor("ultrasoft");
    let bench = PlannedBench::new(&sensor, &sensor.settings, conversions(&sensor)).unwrap();
    let line = line(&sensor);
    for kappa in KAPPAS {
        let row = bench.row(&line, kappa);
        let sum: f64 = bench.of_bench(&row).unwrap().iter().sum();
        let bound = bench.information.variance(&row).unwrap();
        assert!((sum / bound - 1.0).abs() < 1e-9, "{kappa}: {sum} {bound}");
    }
}

#[test]
fn errors_grow_with_the_temperature_and_with_nothing_else_of_it() {
    let sensor = sensor("ultrasoft");
    let bench = PlannedBench::new(&sensor, &sensor.settings, conversions(&sensor)).unwrap();
    let at = |away_k| {
        let press = PlannedPress { away_k, ..PRESS };
        bench.expected(&[5.0], &press).unwrap().remove(0)
    };
    let (cool, warm) = (at(0.0), at(5.0));
    assert_ne!(cool.limit(), Cause::Temperature);
    assert_eq!(warm.limit(), Cause::Temperature);
    for (index, cause) in Cause::ALL.into_iter().enumerate() {
        let same = cool.causes_ln[index] == warm.causes_ln[index];
        assert_eq!(same, cause != Cause::Temperature, "{cause:?}");
    }
}

#[test]
fn a_stack_whose_stiffening_does_not_show_has_no_plan() {
    let sensor = sensor("paper");
    let bench = PlannedBench::new(&sensor, &sensor.settings, conversions(&sensor));
    assert_eq!(bench.err(), Some(Unplannable::StiffensTooLittle));
}

/// Whether the simulated board drives a train.
fn drives(sensor: &PlannedSensor, settings: &Settings) -> Result<(), RefusalReason> {
    let world = World::new(&sensor.plant, Switches::all(), Setup::default()).unwrap();
    let wiring = Wiring::new(world);
    let mut board = NativeBoard::new(&wiring);
    board.run_until(Time::from_ms(1_500)).unwrap();
    board.send(Command::SetSettings(settings.clone())).unwrap();
    board
        .send(Command::SetCoil(palpate_simulate::instrument::coil(
            &sensor.plant,
        )))
        .unwrap();
    board.send(Command::Arm).unwrap();
    board.take_records();
    board.send(Command::Sweep).unwrap();
    let end = board.now() + Time::from_ms(6_000);
    board.run_until(end).unwrap();
    let mut ended = false;
    for (_, record) in board.take_records() {
        match record {
            Record::Refusal(refusal) => return Err(refusal.reason),
            Record::Fault(fault) => panic!("{fault:?}"),
            Record::State(change) => ended |= change.previous == State::Ramps,
            _ => {}
        }
    }
    assert!(ended, "the train ends");
    Ok(())
}

#[test]
fn the_best_train_is_driven_and_one_that_exceeds_its_energy_is_refused() {
    let sensor = sensor("ultrasoft");
    let search = TrainSearch {
        sensor: &sensor,
        press: PRESS,
        contact_s: 2.0,
    };
    let compared = search.compare().unwrap();
    let [default, .., best] = compared.as_slice() else {
        panic!("{compared:?}");
    };
    assert_eq!(compared[1].limit, Some(TrainLimit::Energy));
    for (index, load) in COMPARED.into_iter().enumerate() {
        assert!(
            best.train.errors_ln[index] <= default.train.errors_ln[index],
            "{load}"
        );
    }
    assert_eq!(
        drives(&sensor, &search.settings(&best.train.choice)),
        Ok(())
    );
    let more = Settings {
        ramps: 20,
        ..sensor.settings.clone()
    };
    assert_eq!(drives(&sensor, &more), Err(RefusalReason::TooMuchEnergy));
}
