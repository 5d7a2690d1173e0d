//! The lines of a run, as the evaluation needs them.

use super::bench::{BenchSample, Pressed, Run};
use palpate_wire::command::Settings;

use super::Unusable;
use crate::train::Fall;

/// A run.
#[derive(Clone, Debug)]
pub(super) struct SampleRun {
    pub(super) pressed: Pressed,
    /// Frequency of the untouched sensor, Hz.
    pub(super) rest_hz: f64,
    /// While the press moved in: relative change of inductance, force in N.
    pub(super) press: Vec<(f64, f64)>,
    /// The falls of the train.
    pub(super) falls: Vec<Fallen>,
    /// From touch to train, s.
    pub(super) since_touch_s: f64,
}

/// A sample during a fall of the current.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fallen {
    /// Since the train began, s.
    pub(super) time_s: f64,
    /// L/L0 - 1.
    pub(super) change: f64,
    pub(super) current_a: f64,
    /// Load cell, N, at the same time.
    pub(super) force_n: f64,
}

/// The untouched sensor is measured for this long, from the start: the bench moves later.
const REST_S: f64 = 0.75;
/// The first conversions after a start, in s: the oscillator settles.
const START_S: f64 = 0.05;

impl SampleRun {
    pub(super) fn new(notes: &Run, settings: &Settings) -> Result<Self, Unusable> {
        let rest: Vec<f64> = notes
            .lines
            .iter()
            .filter(|line| line.time_s > START_S && line.time_s < REST_S)
            .map(|line| line.frequency_hz)
            .collect();
        if rest.is_empty() {
            return Err(Unusable::Missing("reading of the untouched sensor"));
        }
        let rest_hz = rest.iter().sum::<f64>() / rest.len() as f64;
        let change = |line: &BenchSample| (rest_hz / line.frequency_hz).powi(2) - 1.0;
        let press: Vec<(f64, f64)> = notes
            .lines
            .windows(2)
            .filter_map(|pair| match pair {
                [before, line]
                    if before.force_n > CLEAR_OF_TOUCH_N
                        && line.time_s < notes.pressed_s - CLEAR_OF_STOP_S =>
                {
                    Some((change(line), force_at(before, line)))
                }
                _ => None,
            })
            .collect();
        let touched_s = touch_s(notes);
        Ok(Self {
            pressed: notes.pressed,
            rest_hz,
            press,
            falls: falls(notes, settings, change),
            since_touch_s: notes.ramps_s - touched_s,
        })
    }
}

/// Force at the middle of a conversion, between the gauges' readings before and after it.
fn force_at(before: &BenchSample, line: &BenchSample) -> f64 {
    let way = (line.time_s - before.gauges_time_s) / (line.gauges_time_s - before.gauges_time_s);
    before.force_n + way * (line.force_n - before.force_n)
}

/// A conversion in which the press touched, or stopped, is a mean over a kink, which the gauges'
/// straight line between two readings is not: such conversions are left out.
const CLEAR_OF_TOUCH_N: f64 = 50e-3;
const CLEAR_OF_STOP_S: f64 = 3e-3;
/// A force that is no noise of the load cell (1 mN), N.
const TOUCHING_N: f64 = 10e-3;

fn touch_s(notes: &Run) -> f64 {
    let touching = notes.lines.iter().find(|line| line.force_n > TOUCHING_N);
    touching.map_or(0.0, |line| line.gauges_time_s)
}

/// The samples whose neighbours show that the current fell all along.
fn falls(notes: &Run, settings: &Settings, change: impl Fn(&BenchSample) -> f64) -> Vec<Fallen> {
    let fall = Fall::of(settings);
    let steep = |from: &BenchSample, to: &BenchSample| {
        fall.between((from.time_s, from.current_a), (to.time_s, to.current_a))
    };
    notes
        .lines
        .windows(3)
        .filter_map(|lines| match lines {
            [before, line, after]
                if line.time_s > notes.ramps_s && steep(before, line) && steep(line, after) =>
            {
                Some(Fallen {
                    time_s: line.time_s - notes.ramps_s,
                    change: change(line),
                    current_a: line.current_a,
                    force_n: force_at(before, line),
                })
            }
            _ => None,
        })
        .collect()
}
