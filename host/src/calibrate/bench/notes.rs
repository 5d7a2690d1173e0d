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
    /// Load cell, N.
    pub(crate) force_n: f64,
    /// Scale of the stage, m.
    pub(crate) stage_m: f64,
}

impl BenchSample {
    /// A sample of the instrument at a time, s, with what the gauges said at theirs; nothing for a
    /// sample without a channel.
    pub(super) fn new(
        time_s: f64,
        sample: &Sample,
        gauges_time_s: f64,
        gauges: RigReading,
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
    /// The samples, from before the touch to after the last ramp.
    pub(crate) lines: Vec<BenchSample>,
    /// When the train was requested, s.
    pub(crate) began_s: f64,
    /// When its ramps began, after the coil's test, s.
    pub(crate) ramps_s: f64,
    /// When the press came to rest, s; the start for nothing.
    pub(crate) pressed_s: f64,
}

impl Run {
    /// Nothing yet.
    pub(super) const fn new(pressed: Pressed) -> Self {
        Self {
            pressed,
            lines: Vec::new(),
            began_s: 0.0,
            ramps_s: 0.0,
            pressed_s: 0.0,
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
        self
    }

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

/// The first conversions after a start, s: the oscillator settles.
const START_S: f64 = 0.05;
