//! The bound of a small bench, against estimates by other methods.

use palpate_sim::random::Stream;

use super::train::TrainTask;
use super::*;

/// Relative noise of a frequency, for conversions of a millisecond.
const SIGMA: f64 = 8.7e-6;

fn plant() -> (Stack, Disturbances, Parameters) {
    let stack = Stack::builtin("ultrasoft").unwrap();
    let disturbances = Disturbances::builtin().unwrap();
    let mut plant = draw(&stack, &disturbances, 810_001);
    plant.thermal.ambient_change_k = 4.0;
    (stack, disturbances, plant)
}

/// A bench with a block and one spring, pressed to one depth.
fn small(plant: &Parameters, stack: &Stack) -> BenchTask {
    let mut task = BenchTask::of(plant, stack, Switches::all(), &default_settings());
    task.plan.springs_n_per_m = vec![plant.sensing.spring_n_per_m];
    task.plan.depths = vec![1.0];
    task
}

#[test]
fn what_is_read_less_or_known_less_leaves_more_open() {
    let (stack, disturbances, plant) = plant();
    let task = small(&plant, &stack);
    let unknowns = unknowns(&stack, &disturbances);
    let load_n_per_m = 2.0 * plant.sensing.spring_n_per_m;
    let bounds = |task: &BenchTask| {
        let bench = BenchInformation::new(&plant, task, &unknowns, (SIGMA, 0.2e-6)).unwrap();
        bench
            .press(load_n_per_m, task.plan.depth_m)
            .unwrap()
            .unwrap()
    };
    let small = bounds(&task);
    println!("{:?}", small.map(f64::sqrt));
    assert!(small.windows(2).all(|pair| pair[0] < pair[1]), "{small:?}");
    let mut larger = task.clone();
    larger.plan.depths.push(1.4);
    let larger = bounds(&larger);
    // For an exactly known sensor the bound does not depend on the bench.
    assert!(
        (larger[0] / small[0] - 1.0).abs() < 1e-6,
        "{larger:?} {small:?}"
    );
    let pairs = larger.iter().zip(small).skip(1);
    assert!(
        pairs.clone().all(|(more, less)| *more < less),
        "{larger:?} {small:?}"
    );
}

/// Least-squares estimates of load and position from noisy readings must scatter by the bound.
/// Their derivatives are computed by another method.
#[test]
fn estimates_of_a_known_sensor_scatter_by_the_bound() {
    const TRIALS: u32 = 400;
    let (stack, _, plant) = plant();
    let task = small(&plant, &stack);
    let load_n_per_m = 2.0 * plant.sensing.spring_n_per_m;
    let bench = BenchInformation::new(&plant, &task, &[], (SIGMA, 0.0)).unwrap();
    let [bound, ..] = bench
        .press(load_n_per_m, task.plan.depth_m)
        .unwrap()
        .unwrap();
    let mut in_use = plant.clone();
    in_use.press.frame_m_per_n = 0.0;
    let read = |n_per_m: f64, travel_m: f64| {
        let train = TrainTask {
            settings: &task.plan.settings,
            load: Some(Load::Spring { n_per_m }),
            travel_m,
        };
        let readings = train.readings(&in_use).unwrap();
        readings
            .iter()
            .map(|reading| reading.deformation_m)
            .collect::<Vec<f64>>()
    };
    let force_n = plant.sensing.spring_n_per_m * task.plan.depth_m;
    let travel_m =
        task.plan.depth_m + force_n * (1.0 / load_n_per_m + 1.0 / plant.actuated.spring_n_per_m);
    let truth = read(load_n_per_m, travel_m);
    let slope = |other: Vec<f64>, step: f64| -> Vec<f64> {
        other
            .iter()
            .zip(&truth)
            .map(|(other, truth)| (other - truth) / step)
            .collect()
    };
    let by_load = slope(read(load_n_per_m * 1.001, travel_m), 1.001_f64.ln());
    let by_place = slope(read(load_n_per_m, travel_m + 1e-7), 1e-7);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (ll, lp, pp) = (
        dot(&by_load, &by_load),
        dot(&by_load, &by_place),
        dot(&by_place, &by_place),
    );
    let tank = palpate_sim::sensing_coil::tank::SensingTank::new(&plant.tank);
    let mut stream = Stream::named(4, "efficiency");
    let mut squares = 0.0;
    for _ in 0..TRIALS {
        let noise: Vec<f64> = truth
            .iter()
            .map(|x| {
                stream.normal()
                    * SIGMA
                    * palpate_design::plan::metres_per_relative_frequency(&tank, *x)
            })
            .collect();
        let (noisy_load, noisy_place) = (dot(&by_load, &noise), dot(&by_place, &noise));
        squares += ((noisy_load * pp - noisy_place * lp) / (ll * pp - lp * lp)).powi(2)
            / f64::from(TRIALS);
    }
    // 400 squares determine a variance within 7 %.
    assert!((squares / bound - 1.0).abs() < 0.25, "{squares} {bound}");
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn no_bound_is_above_what_presses_come_to() {
    let (stack, disturbances, _) = plant();
    let unknowns = unknowns(&stack, &disturbances);
    let mut presses = Vec::new();
    for seed in 820_001..820_009 {
        let sensor = Judged {
            stack: &stack,
            disturbances: &disturbances,
            unknowns: &unknowns,
            plant: draw(&stack, &disturbances, seed),
        };
        // A sensor whose supply cannot drive the peak current has no calibration and no presses.
        presses.extend(sensor.presses().unwrap_or_default());
    }
    for ratio in LOADS {
        let load = Efficiency::of(ratio, &presses).unwrap();
        println!("{load:?}");
        assert!(load.presses > 4);
        assert!(load.efficiency - STANDARD_ERRORS * load.efficiency_standard_error <= 1.0);
        // Even on so few sensors the chain uses at least a third of its information.
        assert!(load.efficiency_without_own_heat > 0.3);
        assert!((0.6..1.7).contains(&(load.planned_rms_ln / load.measured_rms_ln)));
    }
}
