//! Three springs in series and a resonator, in `f64`: written from the equations, sharing no code with
//! the model or the plant.

use ldc161x::{Channel, Reading, Word};

/// Frequency of the resonator at rest.
const REST_HZ: f64 = 3e6;
/// Reference frequency of the converter, ten times that of the resonator.
const REFERENCE_HZ: f64 = 30e6;
/// Relative change of inductance per metre of deformation: 6 % at 0.3 mm.
pub(crate) const CHANGE_PER_M: f64 = 200.0;
/// Current at which the rise is specified.
pub(crate) const PEAK_A: f64 = 10.0;

/// The sensor and its load.
#[derive(Clone, Debug)]
pub(crate) struct Sensor {
    /// Stiffness c_S of the sensing layer.
    pub(crate) sensing_n_per_m: f64,
    /// Stiffness c_D0 of the actuated layer without current.
    pub(crate) actuated_n_per_m: f64,
    /// Relative rise of c_D at 10 A, proportional to the square of the current.
    pub(crate) rise: f64,
    /// Current at which the rise is half saturated; the rise at 10 A is unchanged.
    pub(crate) half_way_a: f64,
    /// Stiffness c_L of the load.
    pub(crate) load_n_per_m: f64,
    /// Total displacement of all three springs; zero lifts.
    pub(crate) depth_m: f64,
    /// Attraction between the halves of the actuated layer.
    pub(crate) attraction_n_per_a2: f64,
    /// Apparent deformation per square of the current; `crosstalk_growth_per_m` is its relative growth
    /// with the deformation.
    pub(crate) crosstalk_m_per_a2: f64,
    pub(crate) crosstalk_growth_per_m: f64,
    /// Change of the deformation with time, added to the reading.
    pub(crate) creep: Creep,
    /// Relaxation of the load: changes 1/c_L to (1 + d phi)/c_L.
    pub(crate) relaxation: Creep,
    pub(crate) offset_m: f64,
    /// Half the width of the uniform noise of a reading.
    pub(crate) noise_m: f64,
    /// Relative standard uncertainty that the reading states.
    pub(crate) stated: f64,
    /// Flags to be raised: bit 28 is the amplitude's.
    pub(crate) flags: u16,
    pub(crate) random: u64,
}

/// phi as a function of time in seconds.
pub(crate) type Shape = fn(f64) -> f64;

/// Changes x to x (1 + d phi), with size d, and phi as a function of the time since its start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Creep {
    pub(crate) size: f64,
    /// Start time of phi, in seconds since start-up.
    pub(crate) since_s: f64,
    pub(crate) shape: Shape,
}

impl Creep {
    const NONE: Self = Self {
        size: 0.0,
        since_s: 0.0,
        shape: |_| 0.0,
    };

    /// Returns 1 + d phi at a time since start-up.
    pub(crate) fn at(&self, time_s: f64) -> f64 {
        1.0 + self.size * (self.shape)((time_s - self.since_s).max(0.0))
    }
}

impl Default for Sensor {
    fn default() -> Self {
        Self {
            sensing_n_per_m: 6e3,
            actuated_n_per_m: 4e3,
            rise: 0.1,
            half_way_a: f64::INFINITY,
            load_n_per_m: 6e3,
            depth_m: 0.0,
            attraction_n_per_a2: 0.0,
            crosstalk_m_per_a2: 0.0,
            crosstalk_growth_per_m: 0.0,
            creep: Creep::NONE,
            relaxation: Creep::NONE,
            offset_m: 0.0,
            noise_m: 0.0,
            stated: 2e-8,
            flags: 0,
            random: 1,
        }
    }
}

impl Sensor {
    /// Returns c_D at a current.
    pub(crate) fn actuated(&self, current_a: f64) -> f64 {
        let part = (current_a / PEAK_A).powi(2);
        let saturates = (PEAK_A / self.half_way_a).powi(2);
        let stiffening = part * (1.0 + saturates) / (1.0 + saturates * part);
        self.actuated_n_per_m * (1.0 + self.rise * stiffening)
    }

    /// Presses until the sensing layer is deformed by `deformation_m` without current and relaxation.
    pub(crate) fn press(&mut self, deformation_m: f64) {
        self.depth_m = deformation_m * self.compliance(0.0, self.relaxation.since_s);
    }

    /// Returns the total compliance relative to that of the sensing layer.
    fn compliance(&self, current_a: f64, time_s: f64) -> f64 {
        let s = self.sensing_n_per_m;
        let load = s / self.load_n_per_m * self.relaxation.at(time_s);
        1.0 + load + s / self.actuated(current_a)
    }

    /// Returns the true deformation x_S of the sensing layer, which the procedure can only measure.
    pub(crate) fn deformation_m(&self, current_a: f64, time_s: f64) -> f64 {
        let pull_m = self.attraction_n_per_a2 * current_a.powi(2) / self.actuated(current_a);
        let pressed = if self.depth_m > 0.0 {
            (self.depth_m - pull_m) / self.compliance(current_a, time_s)
        } else {
            0.0
        };
        pressed * self.creep.at(time_s)
    }

    /// Returns the converter's reading.
    pub(crate) fn reading(&mut self, current_a: f64, time_s: f64) -> Reading {
        let x = self.deformation_m(current_a, time_s);
        let growth = 1.0 + self.crosstalk_growth_per_m * x;
        let seen = x + self.crosstalk_m_per_a2 * current_a.powi(2) * growth;
        let noise = self.noise_m * self.uniform();
        let change = CHANGE_PER_M * (seen + self.offset_m + noise);
        let frequency_hz = REST_HZ / (1.0 + change).sqrt();
        let code = (frequency_hz / REFERENCE_HZ * f64::from(1 << 28)).round() as u32;
        let msb = (code >> 16) as u16 | self.flags;
        Reading {
            channel: Channel::Zero,
            word: Word::from_registers(msb, code as u16),
            frequency_hz,
            sigma_hz: (frequency_hz * self.stated) as f32,
            ..Reading::default()
        }
    }

    /// Returns a random number from -1 to 1 (xorshift, Marsaglia 2003).
    fn uniform(&mut self) -> f64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        self.random as f64 / u64::MAX as f64 * 2.0 - 1.0
    }
}
