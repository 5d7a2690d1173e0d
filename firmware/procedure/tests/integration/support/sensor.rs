//! Three springs in series and a resonator, in `f64`: written from the equations, with no line in
//! common with the model or the plant.

use ldc161x::{Channel, Reading, Word};

/// Of the resonator: f_ref such that f is a tenth of it.
const REST_HZ: f64 = 3e6;
const REFERENCE_HZ: f64 = 30e6;
/// Relative change of inductance for a metre of deformation: 6 % at 0.3 mm.
pub(crate) const CHANGE_PER_M: f64 = 200.0;
/// Current at which the rise is stated.
pub(crate) const PEAK_A: f64 = 10.0;

/// The sensor, and what presses on it.
#[derive(Clone, Debug)]
pub(crate) struct Sensor {
    /// c_S.
    pub(crate) sensing_n_per_m: f64,
    /// c_D0.
    pub(crate) actuated_n_per_m: f64,
    /// Relative rise of c_D at 10 A, proportional to the current's square.
    pub(crate) rise: f64,
    /// Current at which that saturates half-way; the rise at 10 A stays.
    pub(crate) half_way_a: f64,
    /// c_L.
    pub(crate) load_n_per_m: f64,
    /// Way that all three are pressed together; zero lifts.
    pub(crate) depth_m: f64,
    /// Attraction of the actuated layer's halves.
    pub(crate) attraction_n_per_a2: f64,
    /// Apparent deformation by the current, and its growth with the deformation.
    pub(crate) crosstalk_m_per_a2: f64,
    pub(crate) crosstalk_growth_per_m: f64,
    /// Added to what is read.
    pub(crate) creep: Creep,
    pub(crate) offset_m: f64,
    /// Half the width of a uniform noise.
    pub(crate) noise_m: f64,
    /// Standard uncertainty that the reading states, relative.
    pub(crate) stated: f64,
    /// Flag to be raised: bit 28 is the amplitude's.
    pub(crate) flags: u16,
    pub(crate) random: u64,
}

/// phi over the time in seconds.
pub(crate) type Shape = fn(f64) -> f64;

/// x goes to x (1 + d phi), d its size and phi over the time since the train began.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Creep {
    pub(crate) size: f64,
    /// When phi begins to count, in seconds since the start.
    pub(crate) since_s: f64,
    pub(crate) shape: Shape,
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
            creep: Creep {
                size: 0.0,
                since_s: 0.0,
                shape: |_| 0.0,
            },
            offset_m: 0.0,
            noise_m: 0.0,
            stated: 2e-8,
            flags: 0,
            random: 1,
        }
    }
}

impl Sensor {
    /// c_D at a current.
    pub(crate) fn actuated(&self, current_a: f64) -> f64 {
        let part = (current_a / PEAK_A).powi(2);
        let saturates = (PEAK_A / self.half_way_a).powi(2);
        let stiffening = part * (1.0 + saturates) / (1.0 + saturates * part);
        self.actuated_n_per_m * (1.0 + self.rise * stiffening)
    }

    /// Presses so far that the sensing layer is deformed by `deformation_m` without current.
    pub(crate) fn press(&mut self, deformation_m: f64) {
        self.depth_m = deformation_m * self.compliance(0.0);
    }

    /// Compliance of the whole in units of the sensing layer's.
    fn compliance(&self, current_a: f64) -> f64 {
        let s = self.sensing_n_per_m;
        1.0 + s / self.load_n_per_m + s / self.actuated(current_a)
    }

    /// x_S, which the procedure does not see.
    pub(crate) fn deformation_m(&self, current_a: f64, time_s: f64) -> f64 {
        let pull_m = self.attraction_n_per_a2 * current_a.powi(2) / self.actuated(current_a);
        let pressed = if self.depth_m > 0.0 {
            (self.depth_m - pull_m) / self.compliance(current_a)
        } else {
            0.0
        };
        let creep = &self.creep;
        pressed * (1.0 + creep.size * (creep.shape)((time_s - creep.since_s).max(0.0)))
    }

    /// What the converter reports of it.
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

    /// From -1 to 1 (xorshift, Marsaglia 2003).
    fn uniform(&mut self) -> f64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        self.random as f64 / u64::MAX as f64 * 2.0 - 1.0
    }
}
