//! Samples of a run, prepared for the evaluation.

use palpate_wire::command::Settings;

use super::{Known, Unusable};
use crate::fall::Fall;
use crate::session::{BenchSample, Pressed, Run, Session};

/// The evaluated samples of a run.
#[derive(Clone, Debug)]
pub(crate) struct SampleRun {
    pub(crate) pressed: Pressed,
    /// Frequency of the untouched sensor, Hz.
    pub(crate) rest_hz: f64,
    /// Samples while the press moves in.
    pub(crate) press: Vec<PressSample>,
    /// The falls of the train.
    pub(crate) falls: Vec<Fallen>,
    /// Time from touch to train, s.
    pub(crate) since_touch_s: f64,
}

/// A sample while the press moves in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PressSample {
    /// L/L0 - 1.
    pub(crate) change: f64,
    /// Load cell, N, at the same time; `None` without one.
    pub(crate) force_n: Option<f64>,
    /// Scale of the stage, m, at the same time; `None` where it is unknown.
    pub(crate) stage_m: Option<f64>,
}

/// A sample during a fall of the current.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fallen {
    /// Time since the start of the train, s.
    pub(crate) time_s: f64,
    /// L/L0 - 1.
    pub(crate) change: f64,
    pub(crate) current_a: f64,
    /// Load cell, N, at the same time; `None` without one.
    pub(crate) force_n: Option<f64>,
}

impl SampleRun {
    pub(crate) fn new(notes: &Run, settings: &Settings) -> Result<Self, Unusable> {
        let rest_hz = notes.rest_hz();
        let rest_hz = rest_hz.ok_or(Unusable::Missing("reading of the untouched sensor"))?;
        let change = |line: &BenchSample| (rest_hz / line.frequency_hz).powi(2) - 1.0;
        let press = notes
            .lines
            .windows(2)
            .filter_map(|pair| match pair {
                [before, line]
                    if is_clear_of_touch(before, change(before))
                        && line.time_s < notes.pressed_s - CLEAR_OF_STOP_S =>
                {
                    Some(PressSample {
                        change: change(line),
                        force_n: between(before, line, |line| line.force_n),
                        stage_m: between(before, line, |line| line.stage_m),
                    })
                }
                _ => None,
            })
            .collect();
        let touched_s = touch_s(notes, change);
        Ok(Self {
            pressed: notes.pressed,
            rest_hz,
            press,
            falls: falls(notes, settings, change),
            since_touch_s: notes.ramps_s - touched_s,
        })
    }
}

/// Prepares all runs with a train of a session, and its deepest press.
pub(crate) fn of_session(
    session: &Session,
    known: &Known,
) -> Result<(Vec<SampleRun>, SampleRun), Unusable> {
    let deepest = SampleRun::new(&session.deepest_press, &known.settings)?;
    Ok((of_runs(&session.runs, known)?, deepest))
}

/// Prepares runs with a train.
pub(crate) fn of_runs(runs: &[Run], known: &Known) -> Result<Vec<SampleRun>, Unusable> {
    let of = |run: &Run| SampleRun::new(run, &known.settings);
    runs.iter().map(of).collect()
}

/// Reading of a gauge at the middle of a conversion, interpolated between the readings before and
/// after.
fn between(
    before: &BenchSample,
    line: &BenchSample,
    of: impl Fn(&BenchSample) -> Option<f64>,
) -> Option<f64> {
    let way = (line.time_s - before.gauges_time_s) / (line.gauges_time_s - before.gauges_time_s);
    let (from, to) = (of(before)?, of(line)?);
    Some(from + way * (to - from))
}

/// Force below which a conversion is left out, N: a conversion during the touch averages over a
/// kink, while the gauges are interpolated linearly between two readings.
const CLEAR_OF_TOUCH_N: f64 = 50e-3;
/// Time before the stop in which a conversion is left out, s, for the reason of `CLEAR_OF_TOUCH_N`.
const CLEAR_OF_STOP_S: f64 = 3e-3;
/// Force above which the specimen touches, N: clearly above the noise of the load cell (1 mN).
const TOUCHING_N: f64 = 10e-3;
/// Relative changes of inductance that replace `CLEAR_OF_TOUCH_N` and `TOUCHING_N` without a load
/// cell. They stand for 10 and 2 µm of deformation on a coil whose inductance rises by 0.25 parts in a thousand per
/// micrometre (reference coil, slabs on both sides). The noise of the inductance is 2 parts in a
/// million.
const CLEAR_OF_TOUCH: f64 = 2.5e-3;
const TOUCHING: f64 = 0.5e-3;

fn is_clear_of_touch(line: &BenchSample, change: f64) -> bool {
    line.force_n
        .map_or(change > CLEAR_OF_TOUCH, |n| n > CLEAR_OF_TOUCH_N)
}

/// Time of the touch, s; 0 without a touch.
pub(crate) fn touch_s(notes: &Run, change: impl Fn(&BenchSample) -> f64) -> f64 {
    let is_touching = |line: &&BenchSample| {
        line.force_n
            .map_or(change(line) > TOUCHING, |force_n| force_n > TOUCHING_N)
    };
    let touching = notes.lines.iter().find(is_touching);
    touching.map_or(0.0, |line| line.gauges_time_s)
}

/// Samples whose neighbours show that the current fell throughout.
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
                    force_n: between(before, line, |line| line.force_n),
                })
            }
            _ => None,
        })
        .collect()
}
