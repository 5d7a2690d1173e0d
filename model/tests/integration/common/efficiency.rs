//! Compares the estimator with the Cramer-Rao bound, for the case of section 2 of the physics.

use palpate_model::ramp::{Basis, DriftModel, Fit, Noise, Ramp, RampRefusal};
use palpate_model::units::{NewtonPerMetre, Second};

use super::fisher::cramer_rao;
use super::plant::{Ramps, Recording, Stack, record};
use super::rng::Rng;
use super::statistics::EstimateErrors;

/// Time constant of the creep regressor over the whole duration.
pub const CREEP: f64 = 0.05;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disturbance {
    None,
    Linear,
    Creep,
}

impl Disturbance {
    pub fn phi(self, t: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Linear => t,
            Self::Creep => (1.0 + t / CREEP).ln(),
        }
    }

    /// True size of the drift: 1 % of x over the ramp, a considerable part of the signal.
    pub fn size(self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Linear => -0.01,
            Self::Creep => 0.0033,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct EfficiencyCase {
    pub name: &'static str,
    pub ramps: Ramps,
    pub disturbance: Disturbance,
    /// Published Cramer-Rao bound of c_L's standard error, relative to c_L.
    pub published: f64,
}

pub const CASES: [EfficiencyCase; 4] = [
    EfficiencyCase {
        name: "(a) no drift term",
        ramps: Ramps::ONE,
        disturbance: Disturbance::None,
        published: 0.0051,
    },
    EfficiencyCase {
        name: "(b) linear drift",
        ramps: Ramps::ONE,
        disturbance: Disturbance::Linear,
        published: 0.021,
    },
    EfficiencyCase {
        name: "(c) creep, saw-tooth of 8",
        ramps: Ramps::EIGHT,
        disturbance: Disturbance::Creep,
        published: 0.0051,
    },
    EfficiencyCase {
        name: "(-) creep, one ramp",
        ramps: Ramps::ONE,
        disturbance: Disturbance::Creep,
        published: 0.032,
    },
];

/// Noise of a reading relative to x, and (`EPS`) relative stiffening.
pub const NOISE: f64 = 1e-4;
pub const EPS: f64 = 0.03;

impl EfficiencyCase {
    pub fn stack(&self) -> Stack {
        Stack::equal(1.0, EPS)
    }

    /// Cramer-Rao bound of c_L's standard error, relative to c_L, from the forward model alone.
    pub fn bound(&self) -> f64 {
        let (stack, ramps, disturbance) = (self.stack(), self.ramps, self.disturbance);
        let model = |i: usize, p: &[f64]| {
            let drift: f64 = p.get(2).map_or(0.0, |d| d * disturbance.phi(ramps.time(i)));
            let stack_of =
                1.0 / p[0] + 1.0 / stack.sensing + 1.0 / stack.actuated_at(ramps.current(i));
            p[1] / stack.sensing / stack_of * (1.0 + drift)
        };
        let mut parameters = vec![stack.sensing, stack.total];
        let mut steps = vec![1.0, 1e-7];
        if disturbance != Disturbance::None {
            parameters.push(disturbance.size());
            steps.push(1e-4);
        }
        let truth = parameters.clone();
        let sigma = |i: usize| NOISE * model(i, &truth);
        cramer_rao(ramps.samples, &parameters, &steps, model, sigma)[0] / stack.sensing
    }

    pub fn recording(&self, seed: u64) -> Recording {
        let drift = |t| self.disturbance.size() * self.disturbance.phi(t);
        record(
            &self.stack(),
            &self.ramps,
            NOISE,
            drift,
            &mut Rng::new(seed),
        )
    }

    /// Errors of c_L divided by the bound, over ramps with these seeds.
    pub fn run(&self, seeds: std::ops::RangeInclusive<u64>, noise: Noise) -> EstimateErrors {
        let bound = self.bound();
        let mut errors = EstimateErrors::default();
        for seed in seeds {
            let recording = self.recording(seed);
            let truth = self.stack().sensing;
            match self.load(&recording, noise) {
                Ok((value, covered)) => errors.add((value / truth - 1.0) / bound, covered),
                Err(_) => errors.refused += 1,
            }
        }
        errors
    }

    fn load(&self, recording: &Recording, noise: Noise) -> Result<(f64, bool), RampRefusal> {
        let tau = Second(CREEP as f32);
        match self.disturbance {
            Disturbance::None => self.judge(fit(recording, Basis::LINEAR, noise)?),
            Disturbance::Linear => self.judge(fit(
                recording,
                Basis::with_drift(DriftModel::Linear).unwrap(),
                noise,
            )?),
            Disturbance::Creep => {
                let creep = DriftModel::Logarithmic { tau };
                self.judge(fit(recording, Basis::with_drift(creep).unwrap(), noise)?)
            }
        }
    }

    fn judge(&self, fit: Fit) -> Result<(f64, bool), RampRefusal> {
        let c = NewtonPerMetre(self.stack().sensing as f32);
        let load = fit.load_stiffness(c)?;
        let value = load
            .value()
            .map_or(f64::INFINITY, |value| f64::from(value.0));
        Ok((value, load.contains(c)))
    }
}

/// Fits a recording with the estimator.
pub fn fit(recording: &Recording, basis: Basis, noise: Noise) -> Result<Fit, RampRefusal> {
    let mut ramp = Ramp::new(recording.reference, basis);
    for sample in &recording.samples {
        ramp.push(sample).unwrap();
    }
    ramp.fit(noise)
}
