//! Delay of a gauge's readings.
//!
//! An amplifier averages, a serial line takes time, and a program does not always run at once, so a
//! reading arrives tens of milliseconds late. In a press, force and inductance belong together at
//! every moment, including touch and stop; a wrong delay turns their curve into a loop. The right
//! delay is therefore the one for which the force is closest to a smooth curve of the inductance.

use palpate_calibration::least_squares::System;
use palpate_calibration::session::{Run, START_S};

use super::track::Track;

/// Range of tried delays, s: a program may also stamp a little late.
const RANGE_S: (f64, f64) = (-0.05, 0.5);
/// Step of the first search, s. Half the length of the shortest press would be too coarse.
const STEP_S: f64 = 0.01;
/// Number of halvings of the step after the first search, down to 0.02 ms.
const HALVINGS: u32 = 9;
/// Maximum number of samples of a press that are compared.
const SAMPLES: usize = 400;

/// Returns the delay of a gauge in a run, s; `None` if its readings do not cover the press.
pub(super) fn of(run: &Run, track: &Track) -> Option<f64> {
    let lines = run.lines.iter();
    let lines = lines.filter(|line| line.time_s > START_S && line.time_s < run.began_s);
    let samples: Vec<(f64, f64)> = lines
        .map(|line| (line.time_s + run.zero_s, line.frequency_hz))
        .collect();
    let (first, last) = (samples.first()?, samples.last()?);
    let softness = |hz: f64| (first.1 / hz).powi(2) - 1.0;
    let greatest = softness(last.1);
    let step = samples.len().div_ceil(SAMPLES).max(1);
    let points = samples.iter().step_by(step);
    let points: Vec<(f64, f64)> = points
        .map(|(time_s, hz)| (*time_s, softness(*hz) / greatest))
        .collect();
    let (mut best_s, mut step_s) = (0.0, STEP_S);
    let mut least = f64::INFINITY;
    let mut consider = |delay_s: f64, best_s: &mut f64| {
        if let Some(loop_n) = loop_n(&points, track, delay_s)
            && loop_n < least
        {
            (least, *best_s) = (loop_n, delay_s);
        }
    };
    let steps = ((RANGE_S.1 - RANGE_S.0) / STEP_S).round() as u32;
    for index in 0..=steps {
        consider(RANGE_S.0 + STEP_S * f64::from(index), &mut best_s);
    }
    for _ in 0..HALVINGS {
        step_s *= 0.5;
        let around = best_s;
        consider(around - step_s, &mut best_s);
        consider(around + step_s, &mut best_s);
    }
    least.is_finite().then_some(best_s)
}

/// Deviation of the force from a cubic function of the inductance, N, for a delay.
fn loop_n(points: &[(f64, f64)], track: &Track, delay_s: f64) -> Option<f64> {
    let mut system = System::new(4);
    let mut count = 0;
    for (time_s, part) in points {
        if let Some(force_n) = track.at(time_s + delay_s) {
            let row = [1.0, *part, part.powi(2), part.powi(3)];
            system.add(row, force_n, 1.0);
            count += 1;
        }
    }
    // A delay that covers less than half of the press is not comparable.
    if 2 * count < points.len() {
        return None;
    }
    system.solve("the gauge's delay").ok().map(|of| of.sigma)
}

#[cfg(test)]
mod tests {
    use palpate_calibration::session::{BenchSample, Pressed};

    use super::*;

    /// A press that touches at 1 s and stops at 1.3 s, with a late load cell that prints 80 times a
    /// second.
    #[test]
    fn the_delay_of_a_slow_load_cell_is_found() {
        let depth = |time_s: f64| ((time_s - 1.0) / 0.3).clamp(0.0, 1.0);
        let mut run = Run::new(Pressed::Block, 0.3e-3);
        run.began_s = 1.8;
        run.zero_s = 5.0;
        for index in 0..1_800 {
            let time_s = f64::from(index) * 1e-3;
            let change = 0.08 * depth(time_s) + 0.02 * depth(time_s).powi(2);
            run.lines.push(BenchSample {
                time_s,
                frequency_hz: 3.7e6 / (1.0 + change).sqrt(),
                current_a: 0.0,
                gauges_time_s: time_s,
                force_n: None,
                stage_m: None,
            });
        }
        for delay_s in [0.0, 0.037, 0.21] {
            let mut track = Track::default();
            for index in 0..200 {
                let time_s = f64::from(index) * 0.0125;
                track.enter(5.0 + time_s, None, 1.8 * depth(time_s - delay_s));
            }
            let found_s = of(&run, &track).unwrap();
            assert!((found_s - delay_s).abs() < 3e-3, "{found_s} {delay_s}");
        }
        assert_eq!(of(&run, &Track::default()), None);
    }
}
