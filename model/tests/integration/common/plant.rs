//! A press on a spring, as in the crate's module `springs`: three springs in series with a constant
//! total length, of which the actuated one softens with the current.

use palpate_model::ramp::{Basis, Fit, Noise, Ramp, RampRefusal, RampSample, Reference};
use palpate_model::units::{Metre, Second};

use super::rng::Rng;

/// Falling ramps of the current: one ramp, or several in a saw-tooth.
#[derive(Clone, Copy, Debug)]
pub struct Ramps {
    pub samples: usize,
    pub teeth: usize,
    /// Duration of all samples together, s.
    pub duration: f64,
}

impl Ramps {
    pub const ONE: Self = Self {
        samples: 400,
        teeth: 1,
        duration: 1.0,
    };
    pub const EIGHT: Self = Self {
        samples: 400,
        teeth: 8,
        duration: 1.0,
    };

    pub fn time(&self, i: usize) -> f64 {
        self.duration * i as f64 / (self.samples - 1) as f64
    }

    /// Current relative to its peak: it falls from 1 to 0 in every tooth.
    pub fn current(&self, i: usize) -> f64 {
        let per_tooth = self.samples / self.teeth;
        1.0 - (i % per_tooth) as f64 / (per_tooth - 1) as f64
    }
}

/// Law of a load: displacement under a force, in metres and newtons.
#[derive(Clone, Copy, Debug)]
pub enum LoadLaw {
    Linear {
        stiffness: f64,
    },
    /// F = k x + k3 x^3.
    Hardening {
        k: f64,
        k3: f64,
    },
}

impl LoadLaw {
    pub fn force(&self, x: f64) -> f64 {
        match *self {
            Self::Linear { stiffness } => stiffness * x,
            Self::Hardening { k, k3 } => k * x + k3 * x * x * x,
        }
    }

    pub fn tangent(&self, x: f64) -> f64 {
        match *self {
            Self::Linear { stiffness } => stiffness,
            Self::Hardening { k, k3 } => k + 3.0 * k3 * x * x,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Stack {
    pub sensing: f64,
    pub actuated: f64,
    pub eps: f64,
    pub load: LoadLaw,
    /// Total displacement x_0, m.
    pub total: f64,
}

/// Deformations of the layers in one state.
#[derive(Clone, Copy, Debug)]
pub struct LayerState {
    pub sensing: f64,
    pub load: f64,
    pub force: f64,
}

impl Stack {
    /// Three springs near 6 N/mm with c_L/c_S = `ratio` and c_D0 = c_S; x_S is about 0.3 mm.
    pub fn equal(ratio: f64, eps: f64) -> Self {
        let c = 6e3;
        Self {
            sensing: c,
            actuated: c,
            eps,
            load: LoadLaw::Linear {
                stiffness: ratio * c,
            },
            total: 0.3e-3 * (2.0 + 1.0 / ratio),
        }
    }

    pub fn actuated_at(&self, current: f64) -> f64 {
        self.actuated * (1.0 + self.eps * current * current)
    }

    /// Solves F (1/c_S + 1/c_D) + x_L(F) = total for the force F, by Newton's method.
    pub fn at(&self, current: f64) -> LayerState {
        let compliance = 1.0 / self.sensing + 1.0 / self.actuated_at(current);
        let mut x = self.total / 3.0;
        for _ in 0..100 {
            let excess = self.load.force(x) * compliance + x - self.total;
            x -= excess / (self.load.tangent(x) * compliance + 1.0);
            if excess.abs() <= 1e-16 * self.total {
                break;
            }
        }
        let force = self.load.force(x);
        LayerState {
            sensing: force / self.sensing,
            load: x,
            force,
        }
    }

    /// Ratio g_0 = c_S/c_D0, rounded to the device's `f32`.
    pub fn reference_ratio(&self) -> f32 {
        (self.sensing / self.actuated) as f32
    }

    /// Regressor h = c_S/c_D(I) - c_S/c_D0.
    pub fn regressor(&self, current: f64) -> f64 {
        let rise = self.eps * current * current;
        -self.sensing / self.actuated * rise / (1.0 + rise)
    }
}

/// One measurement, with the `f32` inputs that the device would have.
pub struct Recording {
    pub reference: Reference,
    pub samples: Vec<RampSample>,
}

/// Records a press with a falling current. The noise is `relative` times x, and x is multiplied by
/// the drift 1 + drift(t).
pub fn record(
    stack: &Stack,
    ramps: &Ramps,
    relative: f64,
    drift: impl Fn(f64) -> f64,
    rng: &mut Rng,
) -> Recording {
    let x_ref = stack.at(0.0).sensing as f32;
    let samples = (0..ramps.samples)
        .map(|i| {
            let (t, current) = (ramps.time(i), ramps.current(i));
            let clean = stack.at(current).sensing * (1.0 + drift(t));
            let read = clean * (1.0 + relative * rng.normal());
            RampSample {
                time: Second(t as f32),
                deformation: Metre((read - f64::from(x_ref)) as f32),
                regressor: stack.regressor(current) as f32,
                sigma: Metre((clean * relative) as f32),
            }
        })
        .collect();
    let reference = Reference::new(Metre(x_ref), stack.reference_ratio()).unwrap();
    Recording { reference, samples }
}

/// Fits a recording with the estimator.
pub fn fit(recording: &Recording, basis: Basis, noise: Noise) -> Result<Fit, RampRefusal> {
    let mut ramp = Ramp::new(recording.reference, basis);
    for sample in &recording.samples {
        ramp.push(sample).unwrap();
    }
    ramp.fit(noise)
}
