//! Figures of a run.

use crate::least_squares::System;
use crate::session::{BenchSample, Pressed, Run, START_S};
use crate::{Known, Unusable, train_scatter};

/// Figures of a run. Relative figures are relative to the values expected from the sensor design's
/// nominal data.
pub(super) struct Figures {
    /// Part of the samples that is missing.
    pub(super) missing: f64,
    /// Shortfall of the greatest current below the peak, relative to the peak.
    pub(super) current_missing: f64,
    /// Frequency of the untouched sensor, Hz.
    pub(super) rest_hz: f64,
    /// Mean of the load cell before the press, over the target force.
    pub(super) rest_force: Option<f64>,
    /// Standard deviation of the load cell before the press, over the target force.
    pub(super) force_noise: Option<f64>,
    /// Change of inductance at rest under the press; without a press, at the start of the train.
    pub(super) change: f64,
    /// Travel of the stage over the target travel.
    pub(super) travel: Option<f64>,
    /// Force at rest over the target force.
    pub(super) force: Option<f64>,
    /// Deviation of the load cell from a smooth curve of the inductance during the press, over the
    /// force.
    pub(super) follows: Option<f64>,
    /// Deviation of the stage's scale from a smooth curve of the inductance, after the touch, over
    /// the scale's travel.
    pub(super) stage_follows: Option<f64>,
    /// Part of the samples without a reading of the load cell.
    pub(super) force_missing: f64,
    /// Longest time for which the load cell's reading does not change under the press, s.
    pub(super) frozen_s: f64,
    /// Greatest change of inductance in the train over that before it, less one.
    pub(super) swing: f64,
    /// Change of inductance after the train over that before it, less one.
    pub(super) slip: f64,
    /// Force after the train over that before it, less one.
    pub(super) force_slip: Option<f64>,
    /// Standard deviation of the train's readings about a smooth curve, over their span.
    pub(super) scatter: Option<f64>,
}

/// Least depth for which the target force is computed, 0.05 mm. Forces are relative to that force.
const LEAST_DEPTH_M: f64 = 50e-6;
/// Change of inductance above which a sample counts as one with contact: 8 µm of deformation.
const TOUCHED: f64 = 2e-3;
/// Averaging time of the pressed sensor before the train and after its end, s.
const MEAN_S: f64 = 0.03;

impl Figures {
    /// Computes the figures; `None` if the run lacks the necessary samples.
    pub(super) fn of(run: &Run, known: &Known) -> Option<Self> {
        let rest_hz = run.rest_hz()?;
        let change = |line: &BenchSample| Some((rest_hz / line.frequency_hz).powi(2) - 1.0);
        let force = |line: &BenchSample| line.force_n;
        let stage = |line: &BenchSample| line.stage_m;
        let end_s = run.lines.last()?.time_s;
        let rest = Run::UNTOUCHED_S;
        let pressed = (run.began_s - MEAN_S, run.began_s);
        let after = (end_s - MEAN_S, end_s);
        let depth_m = run.depth_m.max(LEAST_DEPTH_M);
        let aimed_n = depth_m * known.sensing_n_per_m;
        let (change_before, _) = statistics(run, pressed, change)?;
        let (change_after, _) = statistics(run, after, change)?;
        let at_rest = statistics(run, rest, force);
        let force_before = statistics(run, pressed, force).map(|of| of.0);
        let force_after = statistics(run, after, force).map(|of| of.0);
        let stage_rest = statistics(run, rest, stage).map(|of| of.0);
        let stage_before = statistics(run, pressed, stage).map(|of| of.0);
        let had_train = run.ramps_s > run.began_s;
        let greatest_a = run.lines.iter().map(|line| line.current_a);
        let greatest_a = greatest_a.fold(0.0, f64::max);
        let peak_a = f64::from(known.settings.peak_current_a);
        let both = |one: Option<f64>, other: Option<f64>| Some((one?, other?));
        let slip = |(before, after): (f64, f64)| if had_train { after / before - 1.0 } else { 0.0 };
        Some(Self {
            missing: missing(run)?,
            current_missing: 1.0 - greatest_a / peak_a,
            rest_hz,
            rest_force: at_rest.map(|(mean_n, _)| mean_n / aimed_n),
            force_noise: at_rest.map(|(_, sigma_n)| sigma_n / aimed_n),
            change: change_before,
            travel: both(stage_rest, stage_before)
                .map(|(rest_m, pressed_m)| (pressed_m - rest_m) / aimed_travel_m(run, known)),
            force: force_before.map(|force_n| force_n / aimed_n),
            follows: follows(run, change, force).ok().flatten(),
            stage_follows: follows(run, change, |line| {
                line.stage_m.filter(|_| change(line) > Some(TOUCHED))
            })
            .ok()
            .flatten(),
            force_missing: without_force(run),
            frozen_s: frozen_s(run),
            swing: slip((change_before, greatest_change(run, change))),
            slip: slip((change_before, change_after)),
            force_slip: both(force_before, force_after).map(slip),
            scatter: train_scatter(run, &known.settings),
        })
    }
}

/// Change of the deformation that creep may leave after a train, over the change that the train
/// itself causes relative to the greatest deformation. On the design `closed`, whose train more
/// than doubles the deformation, it is up to 0.28 (swing 0.3 to 1.7, 0.07 to 0.12 left).
const LEFT_BY_TRAIN: f64 = 0.25;

impl Figures {
    /// Relative change of the deformation after the train, without the part that creep retains.
    pub(super) fn slipped(&self) -> f64 {
        let left = LEFT_BY_TRAIN * self.swing / (1.0 + self.swing);
        (self.slip.abs() - left).max(0.0)
    }
}

/// Expected travel of the stage for the target depth, by the design's nominal data, m, without the
/// way to the sensor.
pub(in super::super) fn aimed_travel_m(run: &Run, known: &Known) -> f64 {
    let compliance = run.pressed.compliance_m_per_n().unwrap_or_default();
    let load = known.sensing_n_per_m * compliance;
    run.depth_m * (1.0 + known.sensing_n_per_m / known.actuated_n_per_m + load)
}

/// Greatest change of inductance from the start of the train.
fn greatest_change(run: &Run, change: impl Fn(&BenchSample) -> Option<f64>) -> f64 {
    let train = run.lines.iter().filter(|line| line.time_s >= run.began_s);
    train.filter_map(change).fold(0.0, f64::max)
}

/// Mean and standard deviation within a span of time, s; `None` without values.
fn statistics(
    run: &Run,
    (from_s, to_s): (f64, f64),
    of: impl Fn(&BenchSample) -> Option<f64>,
) -> Option<(f64, f64)> {
    let within = run.lines.iter();
    let within = within.filter(|line| line.time_s >= from_s && line.time_s <= to_s);
    let values: Vec<f64> = within.filter_map(of).collect();
    let count = values.len() as f64;
    if values.is_empty() {
        return None;
    }
    let mean = values.iter().sum::<f64>() / count;
    let square = values
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>();
    Some((mean, (square / count).sqrt()))
}

/// Part of the samples that is missing, estimated from the usual time between neighbouring samples.
fn missing(run: &Run) -> Option<f64> {
    let pairs = run.lines.windows(2);
    let mut steps_s: Vec<f64> = pairs
        .filter_map(|pair| match pair {
            [before, after] => Some(after.time_s - before.time_s),
            _ => None,
        })
        .filter(|step_s| step_s.is_finite())
        .collect();
    let spanned_s: f64 = steps_s.iter().sum();
    steps_s.sort_by(f64::total_cmp);
    let step_s = steps_s.get(steps_s.len() / 2)?;
    Some(1.0 - step_s * steps_s.len() as f64 / spanned_s)
}

/// Part of the samples without a reading of the load cell.
fn without_force(run: &Run) -> f64 {
    let without = run.lines.iter().filter(|line| line.force_n.is_none());
    without.count() as f64 / run.lines.len().max(1) as f64
}

/// Longest time for which the load cell's reading does not change under the press, s.
fn frozen_s(run: &Run) -> f64 {
    let (mut since, mut longest_s) = (None, 0.0);
    let pressed = run.lines.iter().filter(|line| line.time_s > run.pressed_s);
    for line in pressed {
        match since {
            Some((force_n, from_s)) if line.force_n == Some(force_n) => {
                longest_s = f64::max(longest_s, line.time_s - from_s);
            }
            _ => since = line.force_n.map(|force_n| (force_n, line.time_s)),
        }
    }
    longest_s
}

/// Standard deviation of a gauge about a cubic of the inductance until the train, over the gauge's
/// span.
fn follows(
    run: &Run,
    change: impl Fn(&BenchSample) -> Option<f64>,
    gauge: impl Fn(&BenchSample) -> Option<f64>,
) -> Result<Option<f64>, Unusable> {
    if run.pressed == Pressed::Nothing {
        return Ok(None);
    }
    let lines = run.lines.iter();
    let points: Vec<(f64, f64)> = lines
        .filter(|line| line.time_s > START_S && line.time_s < run.began_s)
        .filter_map(|line| Some((change(line)?, gauge(line)?)))
        .collect();
    let span = |of: fn(&(f64, f64)) -> f64| {
        let values = points.iter().map(of);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (f64::min(low, value), f64::max(high, value))
        });
        high - low
    };
    let (change, way) = (span(|of| of.0), span(|of| of.1));
    if !(change > 0.0 && way > 0.0) {
        return Ok(None);
    }
    let mut system = System::new(4);
    for (at, value) in &points {
        let part = at / change;
        let row = [1.0, part, part.powi(2), part.powi(3)];
        system.add(row, value / way, 1.0);
    }
    Ok(Some(system.solve("a gauge in a press")?.sigma))
}
