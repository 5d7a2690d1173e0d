//! Data recorded on the bench.

use serde::{Deserialize, Serialize};

/// One sample of the instrument, with readings of the gauges taken soon after it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchSample {
    /// Middle of the conversion, s.
    pub time_s: f64,
    /// Resonance frequency, Hz.
    pub frequency_hz: f64,
    /// Effective current over the conversion, A: root mean square of mean and ripple.
    pub current_a: f64,
    /// When the gauges were read, s.
    pub gauges_time_s: f64,
    /// Load cell, N; `None` without one.
    pub force_n: Option<f64>,
    /// Scale of the stage, m; `None` while a hand moves it.
    pub stage_m: Option<f64>,
}

/// Specimen on the stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Pressed {
    /// No contact.
    Nothing,
    /// A rigid block.
    Block,
    /// A spring with its nominal stiffness.
    Spring {
        /// Nominal stiffness, N/m.
        n_per_m: f64,
    },
    /// The block beside the centre.
    BlockBeside {
        /// Distance from the centre, m.
        distance_m: f64,
        /// Direction, rad.
        direction_rad: f64,
    },
    /// The block tilted.
    BlockTilted {
        /// Angle between its face and the sensor's, rad.
        angle_rad: f64,
        /// Direction of the edge that touches first, rad.
        direction_rad: f64,
    },
}

impl Pressed {
    /// Compliance of the specimen, m/N; zero for the block, `None` without a specimen.
    #[must_use]
    pub fn compliance_m_per_n(self) -> Option<f64> {
        match self {
            Self::Nothing => None,
            Self::Spring { n_per_m } => Some(1.0 / n_per_m),
            Self::Block | Self::BlockBeside { .. } | Self::BlockTilted { .. } => Some(0.0),
        }
    }
}

/// One press with its train of ramps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Specimen of the press.
    pub pressed: Pressed,
    /// Target depth of the sensing layer, m.
    pub depth_m: f64,
    /// The samples, from before the touch to after the last ramp.
    pub lines: Vec<BenchSample>,
    /// The samples of a press that is held after its train, up to 3 s after its request; none of others.
    #[serde(default)]
    pub held: Vec<BenchSample>,
    /// Time of the request of the train, s.
    pub began_s: f64,
    /// Start of the ramps, after the coil's test, s.
    pub ramps_s: f64,
    /// End of the stage's movement, s; 0 without a press.
    pub pressed_s: f64,
    /// Zero of the run's times, s of the board's clock.
    pub zero_s: f64,
}

impl Run {
    /// Creates an empty run.
    pub const fn new(pressed: Pressed, depth_m: f64) -> Self {
        Self {
            pressed,
            depth_m,
            lines: Vec::new(),
            held: Vec::new(),
            began_s: 0.0,
            ramps_s: 0.0,
            pressed_s: 0.0,
            zero_s: 0.0,
        }
    }

    /// Shifts all times so that they count from `moment_s`, the start of the run. In a run without
    /// a press the end of the movement becomes zero.
    pub fn since(mut self, moment_s: f64) -> Self {
        for line in self.lines.iter_mut().chain(&mut self.held) {
            line.time_s -= moment_s;
            line.gauges_time_s -= moment_s;
        }
        self.began_s -= moment_s;
        self.ramps_s -= moment_s;
        self.pressed_s = (self.pressed_s - moment_s).max(0.0);
        self.zero_s += moment_s;
        self
    }

    /// Frequency of the sensor before the press, Hz; `None` without samples.
    pub fn rest_hz(&self) -> Option<f64> {
        let rest = self.lines.iter();
        let rest = rest.filter(|line| line.time_s > START_S && line.time_s < REST_S);
        let (sum, count) = rest.fold((0.0, 0.0), |(sum, count), line| {
            (sum + line.frequency_hz, count + 1.0)
        });
        (count > 0.0).then(|| sum / count)
    }

    /// Start and end of the time without contact, s.
    pub const UNTOUCHED_S: (f64, f64) = (START_S, REST_S);

    /// Lowest frequency until a time, Hz.
    pub fn lowest_hz(&self, until_s: f64) -> f64 {
        let lines = self.lines.iter();
        let lines = lines.filter(|line| line.time_s > START_S && line.time_s < until_s);
        lines
            .map(|line| line.frequency_hz)
            .fold(f64::INFINITY, f64::min)
    }
}

/// All data of a bench.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// The runs.
    pub runs: Vec<Run>,
    /// Presses of the block beside the centre and tilted, with a train each.
    #[serde(default)]
    pub contact: Vec<Run>,
    /// A press onto the block without a train, to a lower frequency than that of any run, in the
    /// same time as the deepest press of the runs.
    pub deepest_press: Run,
    /// Force in N and scale in m, block on block, without the sensor.
    pub bare: Vec<(f64, f64)>,
    /// Temperature of the coil during the calibration, by its thermometer, degrees Celsius.
    pub temperature_c: f64,
}

impl Session {
    /// The run without contact.
    pub fn untouched(&self) -> Option<&Run> {
        self.runs.iter().find(|run| run.pressed == Pressed::Nothing)
    }

    /// Removes all data of the load cell.
    pub fn without_load_cell(mut self) -> Self {
        let runs = self.runs.iter_mut().chain(&mut self.contact);
        let runs = runs.chain([&mut self.deepest_press]);
        for line in runs.flat_map(|run| run.lines.iter_mut().chain(&mut run.held)) {
            line.force_n = None;
        }
        self.bare.clear();
        self
    }
}

/// End of the measurement of the untouched sensor, s; the bench moves later.
const REST_S: f64 = 0.75;
/// Settling time of the oscillator after a start, s.
pub const START_S: f64 = 0.05;
