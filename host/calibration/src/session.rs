//! What is written down on the bench.

use serde::{Deserialize, Serialize};

/// One sample of the instrument, with what the gauges said soon after.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchSample {
    /// Middle of the conversion, s.
    pub time_s: f64,
    /// Resonance frequency, Hz.
    pub frequency_hz: f64,
    /// Current that acts over the conversion, A: mean and ripple, root mean square.
    pub current_a: f64,
    /// When the gauges were read, s.
    pub gauges_time_s: f64,
    /// Load cell, N; nothing without one.
    pub force_n: Option<f64>,
    /// Scale of the stage, m; nothing while a hand moves it.
    pub stage_m: Option<f64>,
}

/// What was on the stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Pressed {
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// What was pressed.
    pub pressed: Pressed,
    /// Depth of the sensing layer that was aimed at, m.
    pub depth_m: f64,
    /// The samples, from before the touch to after the last ramp.
    pub lines: Vec<BenchSample>,
    /// When the train was requested, s.
    pub began_s: f64,
    /// When its ramps began, after the coil's test, s.
    pub ramps_s: f64,
    /// When the press came to rest, s; the start for nothing.
    pub pressed_s: f64,
    /// What these times are since, s of the board's clock.
    pub zero_s: f64,
}

impl Run {
    /// Nothing yet.
    pub const fn new(pressed: Pressed, depth_m: f64) -> Self {
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
    pub fn since(mut self, moment_s: f64) -> Self {
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
    pub fn rest_hz(&self) -> Option<f64> {
        let rest = self.lines.iter();
        let rest = rest.filter(|line| line.time_s > START_S && line.time_s < REST_S);
        let (sum, count) = rest.fold((0.0, 0.0), |(sum, count), line| {
            (sum + line.frequency_hz, count + 1.0)
        });
        (count > 0.0).then(|| sum / count)
    }

    /// When the sensor was untouched, s.
    pub const UNTOUCHED_S: (f64, f64) = (START_S, REST_S);

    /// The lowest frequency until a moment, Hz.
    pub fn lowest_hz(&self, until_s: f64) -> f64 {
        let lines = self.lines.iter();
        let lines = lines.filter(|line| line.time_s > START_S && line.time_s < until_s);
        lines
            .map(|line| line.frequency_hz)
            .fold(f64::INFINITY, f64::min)
    }
}

/// Everything that was written down.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// The runs.
    pub runs: Vec<Run>,
    /// A press upon the block without a train, to a lower frequency than any run's, in the time that
    /// the deepest of their presses took.
    pub deepest_press: Run,
    /// Block on block, without the sensor: force in N and scale in m.
    pub bare: Vec<(f64, f64)>,
    /// The coil's temperature during the calibration, by its thermometer, degrees Celsius.
    pub temperature_c: f64,
}

impl Session {
    /// The run in which nothing touched.
    pub fn untouched(&self) -> Option<&Run> {
        self.runs.iter().find(|run| run.pressed == Pressed::Nothing)
    }

    /// What there would be without a load cell.
    pub fn without_load_cell(mut self) -> Self {
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
pub const START_S: f64 = 0.05;
