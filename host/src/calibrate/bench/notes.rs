//! What is written down on the bench.

use palpate_sim::current::acting_a;
use palpate_sim::rig::RigReading;
use palpate_wire::record::Sample;

/// One sample of the instrument, with what the gauges said soon after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BenchSample {
    /// Middle of the conversion, s.
    pub(crate) time_s: f64,
    /// Resonance frequency, Hz.
    pub(crate) frequency_hz: f64,
    /// Current that acts over the conversion, A: mean and ripple, root mean square.
    pub(crate) current_a: f64,
    /// When the gauges were read, s.
    pub(crate) gauges_time_s: f64,
    /// Load cell, N; nothing without one.
    pub(crate) force_n: Option<f64>,
    /// Scale of the stage, m; nothing while a hand moves it.
    pub(crate) stage_m: Option<f64>,
}

/// What the gauges of the bench said at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct GaugeReading {
    /// Load cell, N.
    pub(crate) force_n: Option<f64>,
    /// Scale of the stage, m.
    pub(crate) stage_m: Option<f64>,
}

impl From<RigReading> for GaugeReading {
    fn from(reading: RigReading) -> Self {
        Self {
            force_n: Some(reading.force_n),
            stage_m: Some(reading.stage_m),
        }
    }
}

impl BenchSample {
    /// A sample of the instrument at a time, s, with what the gauges said at theirs; nothing for a
    /// sample without a channel.
    pub(super) fn new(
        time_s: f64,
        sample: &Sample,
        gauges_time_s: f64,
        gauges: GaugeReading,
    ) -> Option<Self> {
        let conversion = sample.channels.first()?;
        Some(Self {
            time_s,
            frequency_hz: conversion.frequency_hz,
            current_a: acting_a(
                sample.current_a.unwrap_or(0.0).into(),
                sample.ripple_a.unwrap_or(0.0).into(),
            ),
            gauges_time_s,
            force_n: gauges.force_n,
            stage_m: gauges.stage_m,
        })
    }
}

/// What was on the stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pressed {
    /// Nothing touched.
    Nothing,
    /// A rigid block.
    Block,
    /// A spring, by what is written on it, N/m.
    Spring {
        /// N/m.
        n_per_m: f64,
    },
}

/// One press with its train of ramps.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Run {
    /// What was pressed.
    pub(crate) pressed: Pressed,
    /// Depth of the sensing layer that was aimed at, m.
    pub(crate) depth_m: f64,
    /// The samples, from before the touch to after the last ramp.
    pub(crate) lines: Vec<BenchSample>,
    /// When the train was requested, s.
    pub(crate) began_s: f64,
    /// When its ramps began, after the coil's test, s.
    pub(crate) ramps_s: f64,
    /// When the press came to rest, s; the start for nothing.
    pub(crate) pressed_s: f64,
    /// What these times are since, s of the board's clock.
    pub(crate) zero_s: f64,
}

impl Run {
    /// Nothing yet.
    pub(super) const fn new(pressed: Pressed, depth_m: f64) -> Self {
        Self {
            pressed,
            depth_m,
            lines: Vec::new(),
            began_s: 0.0,
            ramps_s: 0.0,
            pressed_s: 0.0,
            zero_s: 0.0,
        }
    }

    /// With all times since a moment, which was when it began; a press that never was is at that.
    pub(super) fn since(mut self, moment_s: f64) -> Self {
        for line in &mut self.lines {
            line.time_s -= moment_s;
            line.gauges_time_s -= moment_s;
        }
        self.began_s -= moment_s;
        self.ramps_s -= moment_s;
        self.pressed_s = (self.pressed_s - moment_s).max(0.0);
        self.zero_s += moment_s;
        self
    }

    /// Frequency of the sensor before the press, Hz; nothing without samples then.
    pub(crate) fn rest_hz(&self) -> Option<f64> {
        let rest = self.lines.iter();
        let rest = rest.filter(|line| line.time_s > START_S && line.time_s < REST_S);
        let (sum, count) = rest.fold((0.0, 0.0), |(sum, count), line| {
            (sum + line.frequency_hz, count + 1.0)
        });
        (count > 0.0).then(|| sum / count)
    }

    /// When the sensor was untouched, s.
    pub(crate) const UNTOUCHED_S: (f64, f64) = (START_S, REST_S);

    /// The lowest frequency until a moment, Hz.
    pub(super) fn lowest_hz(&self, until_s: f64) -> f64 {
        let lines = self.lines.iter();
        let lines = lines.filter(|line| line.time_s > START_S && line.time_s < until_s);
        lines
            .map(|line| line.frequency_hz)
            .fold(f64::INFINITY, f64::min)
    }
}

/// Everything that was written down.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Session {
    /// The runs.
    pub(crate) runs: Vec<Run>,
    /// A press upon the block without a train, to a lower frequency than any run's, in the time that
    /// the deepest of their presses took.
    pub(crate) deepest_press: Run,
    /// Block on block, without the sensor: force in N and scale in m.
    pub(crate) bare: Vec<(f64, f64)>,
    /// The coil's temperature during the calibration, by its thermometer, degrees Celsius.
    pub(crate) temperature_c: f64,
}

impl Session {
    /// What there would be without a load cell.
    pub(crate) fn without_load_cell(mut self) -> Self {
        let runs = self.runs.iter_mut().chain([&mut self.deepest_press]);
        for line in runs.flat_map(|run| &mut run.lines) {
            line.force_n = None;
        }
        self.bare.clear();
        self
    }
}

/// The untouched sensor is measured for this long, from the start: the bench moves later.
const REST_S: f64 = 0.75;
/// The first conversions after a start, in s: the oscillator settles.
pub(crate) const START_S: f64 = 0.05;
