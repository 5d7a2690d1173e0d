//! Trains of a known sensor, from the three springs in closed form.

use palpate_sim::random::Stream;

use crate::actuated::{Problem, Train};
use crate::line::FallSample;

/// Nominal c_S of all trains, N/m.
pub(crate) const SENSING_N_PER_M: f64 = 6e3;
/// Peak current of the trains, A.
pub(crate) const PEAK_A: f64 = 10.0;
/// c_S/c_D0 without a current, rise at the peak current, and attraction, N/A^2.
pub(crate) const RATIO: f64 = 1.1;
pub(crate) const RISE: f64 = 0.04;
pub(crate) const ATTRACTION_N_PER_A2: f64 = 3e-4;
/// Loads, c_S/c_L: a block and six springs.
pub(crate) const KAPPAS: [f64; 7] = [0.0, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0];
/// Depths of the presses onto each load, m.
pub(crate) const DEPTHS_M: [f64; 3] = [0.18e-3, 0.3e-3, 0.42e-3];
/// Samples of one fall.
const SAMPLES: u16 = 100;

/// Cross-talk of a sensor: apparent deformation per square of the current, m/A^2, and its growth,
/// 1/m.
pub(crate) struct Sensor {
    pub(crate) untouched_m_per_a2: f64,
    pub(crate) growth_per_m: f64,
}

impl Sensor {
    /// A sensor without cross-talk.
    pub(crate) const EXACT: Self = Self {
        untouched_m_per_a2: 0.0,
        growth_per_m: 0.0,
    };
}

/// A train of three falls on a load (c_S/c_L), pressed to a depth, m; `added_m` is the error of
/// each reading.
pub(crate) fn train(
    sensor: &Sensor,
    kappa: f64,
    depth_m: f64,
    added_m: &mut dyn FnMut() -> f64,
) -> Train {
    train_of(3, sensor, (kappa, depth_m), added_m)
}

/// A train of `count` falls.
pub(crate) fn train_of(
    falls: u16,
    sensor: &Sensor,
    (kappa, depth_m): (f64, f64),
    added_m: &mut dyn FnMut() -> f64,
) -> Train {
    let samples = (0..falls * SAMPLES).map(|index| {
        let time_s = f64::from(index) * 2e-3;
        let part = f64::from(index % SAMPLES) / f64::from(SAMPLES - 1);
        let current_a = PEAK_A * (1.0 - part);
        let square_a2 = current_a * current_a;
        let rise = RISE * square_a2 / (PEAK_A * PEAK_A);
        let actuated_n_per_m = SENSING_N_PER_M / RATIO * (1.0 + rise);
        let pull_n = ATTRACTION_N_PER_A2 * square_a2;
        let total_m = depth_m * (1.0 + kappa + RATIO) * (1.0 + 0.01 * (time_s / 0.3).ln_1p());
        let compliance = 1.0 + kappa + SENSING_N_PER_M / actuated_n_per_m;
        let true_m = (total_m - pull_n / actuated_n_per_m) / compliance;
        let untouched_m = sensor.untouched_m_per_a2 * square_a2;
        let read_m = true_m + untouched_m * (1.0 + sensor.growth_per_m * true_m);
        FallSample {
            time_s,
            deformation_m: read_m + added_m(),
            current_a,
        }
    });
    Train {
        kappa,
        spring: kappa > 0.0,
        tau_s: 0.3,
        samples: samples.collect(),
    }
}

/// Trains on loads of these c_S/c_L, each at every depth.
pub(crate) fn problem(
    sensor: &Sensor,
    loads: [f64; KAPPAS.len()],
    added_m: &mut dyn FnMut() -> f64,
) -> Problem {
    let presses = loads.into_iter();
    let presses = presses.flat_map(|kappa| DEPTHS_M.map(|depth_m| (kappa, depth_m)));
    Problem {
        trains: presses
            .map(|(kappa, depth_m)| train(sensor, kappa, depth_m, added_m))
            .collect(),
        sensing_n_per_m: SENSING_N_PER_M,
        start_ratio: 0.9,
        peak_a: PEAK_A,
        depth_m: 0.3e-3,
        growing_m_per_a2: None,
    }
}

/// Noise of a deformation reading, m: four times that of the simulated sensors, so that a fit with
/// noise among its coefficients shows a large error.
const NOISE_M: f64 = 0.3e-6;

/// Normal noise of [`NOISE_M`].
pub(crate) fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut stream = Stream::named(seed, "noise");
    move || NOISE_M * stream.normal()
}

/// Mean and standard error of the mean.
pub(crate) fn mean(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0) / count).sqrt())
}
