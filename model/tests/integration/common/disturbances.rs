//! Eq. (2) and the estimator under one disturbance at a time: a small `f64` plant has a switch for
//! each disturbance of section 3 of the physics, with a size within its published range.

use palpate_model::magnetorheological::deviation;
use palpate_model::ramp::{
    Basis, DriftModel, Fit, Noise, Ramp, RampRefusal, RampSample, Reference,
};
use palpate_model::units::{Metre, NewtonPerMetre, Second};

use super::plant::LoadLaw;
use super::reference::equation_2;
use super::rng::Rng;

/// The table's setup: an ultra-soft stack, a load as stiff as the sensing layer, and 400 readings
/// in eight falling ramps.
pub const SENSING: f64 = 6e3;
pub const ACTUATED: f64 = 4e3;
pub const EPS: f64 = 0.10;
const PEAK_A: f64 = 10.0;
const TEETH: usize = 8;
const PER_TOOTH: usize = 50;
const INTERVAL_S: f64 = 2e-3;
/// Time from the touch to the first ramp, s.
const SETTLE_S: f64 = 0.5;

#[derive(Clone, Copy, Debug)]
pub struct Disturbance {
    pub name: &'static str,
    /// White noise of a reading, relative to x.
    pub noise: f64,
    /// Relative change of x per second.
    pub drift: f64,
    /// Amplitude of each of three modes of creep of x, with time constants of 0.3, 20 and 300 s
    /// after the touch.
    pub creep: f64,
    /// Error of the zero of x: too high by this, m.
    pub zero: f64,
    /// Apparent deformation at peak current, quadratic in it, m.
    pub crosstalk: f64,
    /// Magnetic force on the actuated layer, N/A^2.
    pub attraction: f64,
    /// Growth of the stack's height, m/s.
    pub growth: f64,
    /// Time constant by which the stiffening lags, s.
    pub lag: f64,
    /// Fraction of the stiffening that passes through a play (hysteresis) of 0.2 of its range.
    pub memory: f64,
    /// Relative error of the calibrated stiffening: too high by this.
    pub eps: f64,
    /// Relative error of the current's reading: too high by this.
    pub gain: f64,
    /// Amplitude (m) and frequency (Hz) of a vibration of x.
    pub vibration: (f64, f64),
    /// Attraction and lag that the evaluation's model includes.
    pub modelled: (f64, f64),
    pub load: LoadLaw,
}

const NONE: Disturbance = Disturbance {
    name: "none",
    noise: 0.0,
    drift: 0.0,
    creep: 0.0,
    zero: 0.0,
    crosstalk: 0.0,
    attraction: 0.0,
    growth: 0.0,
    lag: 0.0,
    memory: 0.0,
    eps: 0.0,
    gain: 0.0,
    vibration: (0.0, 1.0),
    modelled: (0.0, 0.0),
    load: LoadLaw::Linear { stiffness: SENSING },
};

pub const ALL: [Disturbance; 18] = [
    NONE,
    Disturbance {
        name: "noise 1e-4 of x",
        noise: 1e-4,
        ..NONE
    },
    Disturbance {
        name: "drift 1 %/s of x",
        drift: 0.01,
        ..NONE
    },
    Disturbance {
        name: "creep, three modes of 5 %",
        creep: 0.05,
        ..NONE
    },
    Disturbance {
        name: "growth 0.5 um/s",
        growth: 0.5e-6,
        ..NONE
    },
    Disturbance {
        name: "vibration 0.5 um, 47 Hz",
        vibration: (0.5e-6, 47.0),
        ..NONE
    },
    Disturbance {
        name: "tremor 5 um, 8.3 Hz",
        vibration: (5e-6, 8.3),
        ..NONE
    },
    // k3 x^2 = k at 0.3 mm. The true result is the tangent there, which is twice the secant.
    Disturbance {
        name: "load hardens with x^3",
        load: LoadLaw::Hardening {
            k: SENSING / 2.0,
            k3: SENSING / 2.0 / (0.3e-3 * 0.3e-3),
        },
        ..NONE
    },
    Disturbance {
        name: "zero of x 1 um off",
        zero: 1e-6,
        ..NONE
    },
    Disturbance {
        name: "cross-talk -5 um",
        crosstalk: -5e-6,
        ..NONE
    },
    Disturbance {
        name: "cross-talk of which 2 % are left",
        crosstalk: -0.1e-6,
        ..NONE
    },
    Disturbance {
        name: "attraction 0.3 mN/A^2",
        attraction: 0.3e-3,
        ..NONE
    },
    Disturbance {
        name: "the same, modelled 20 % too weak",
        attraction: 0.3e-3,
        modelled: (0.24e-3, 0.0),
        ..NONE
    },
    Disturbance {
        name: "lag 5 ms",
        lag: 5e-3,
        ..NONE
    },
    Disturbance {
        name: "the same, modelled as 4 ms",
        lag: 5e-3,
        modelled: (0.0, 4e-3),
        ..NONE
    },
    Disturbance {
        name: "memory 10 %",
        memory: 0.10,
        ..NONE
    },
    Disturbance {
        name: "eps 5 % too high",
        eps: 0.05,
        ..NONE
    },
    Disturbance {
        name: "current 2 % too high",
        gain: 0.02,
        ..NONE
    },
];

struct DisturbedReading {
    time: f64,
    x: f64,
    /// Current relative to its peak, as read with the gain error.
    current: f64,
}

impl Disturbance {
    fn readings(&self, rng: &mut Rng) -> Vec<DisturbedReading> {
        let mut readings = Vec::new();
        for tooth in 0..TEETH {
            // The current was held at the peak before it fell, so lag and play start from the
            // settled stiffening.
            let (mut lagging, mut play) = (1.0, 0.8);
            for i in 0..PER_TOOTH {
                let time = (tooth * PER_TOOTH + i) as f64 * INTERVAL_S;
                let current = 1.0 - i as f64 / (PER_TOOTH - 1) as f64;
                let s = current * current;
                play = f64::clamp(play, s - 0.2, s + 0.2);
                let target = (1.0 - self.memory) * s + self.memory * (play + 0.2);
                lagging = if self.lag > 0.0 {
                    target + (lagging - target) * (-INTERVAL_S / self.lag).exp()
                } else {
                    target
                };
                let x = self.deformation(EPS * lagging, current, time);
                readings.push(DisturbedReading {
                    time,
                    x: x * (1.0 + self.noise * rng.normal()),
                    current: current * (1.0 + self.gain),
                });
            }
        }
        readings
    }

    /// The load's displacement: found by bisection, so that the three lengths add up to the total.
    fn displacement(&self, rise: f64, current: f64, time: f64) -> f64 {
        let actuated = ACTUATED * (1.0 + rise);
        let amperes = current * PEAK_A;
        let total = 1.05e-3 + self.growth * time;
        let pulled = self.attraction * amperes * amperes / actuated;
        let (mut low, mut high) = (0.0, total);
        for _ in 0..80 {
            let load = (low + high) / 2.0;
            let force = self.load.force(load);
            let length = load + force / SENSING + force / actuated + pulled;
            if length < total {
                low = load
            } else {
                high = load
            }
        }
        low
    }

    /// True c_L, relative to c_S: the slope of the load's tangent at half the rise.
    fn truth(&self) -> f64 {
        self.load.tangent(self.displacement(EPS / 2.0, 0.0, 0.0)) / SENSING
    }

    /// Apparent deformation x_S, with the disturbances of the reading.
    fn deformation(&self, rise: f64, current: f64, time: f64) -> f64 {
        let after = SETTLE_S + time;
        let crept: f64 = [0.3, 20.0, 300.0]
            .iter()
            .map(|tau| self.creep * (1.0 - (-after / tau).exp()))
            .sum();
        let (amplitude, hertz) = self.vibration;
        let shaken = amplitude * (std::f64::consts::TAU * hertz * time).sin();
        let force = self.load.force(self.displacement(rise, current, time));
        let x = force / SENSING * (1.0 + crept + self.drift * time);
        x + self.zero + self.crosstalk * current * current + shaken
    }
}

/// Relative errors of c_L, and the estimator's 95 % interval, for one disturbance.
pub struct ErrorRow {
    pub name: &'static str,
    /// Relative error of eq. (2), from the first and the last reading of the first ramp.
    pub plain: f64,
    /// Results of the estimator without drift term, and with a logarithmic creep term.
    pub ours: [Result<DisturbanceVerdict, RampRefusal>; 2],
}

#[derive(Clone, Copy, Debug)]
pub struct DisturbanceVerdict {
    pub error: f64,
    pub low: f64,
    pub high: f64,
}

impl Disturbance {
    /// The regressor h of every reading, for an evaluation that models the effects in `modelled`.
    fn regressors(&self, readings: &[DisturbedReading]) -> Vec<f32> {
        let (attraction, lag) = self.modelled;
        let eps = EPS * (1.0 + self.eps);
        let mut lagging = 0.0;
        let regressor = |(i, reading): (usize, &DisturbedReading)| {
            let rise = eps * reading.current * reading.current;
            // The stiffening has settled at the peak, and from there follows with a first-order
            // lag.
            lagging = if lag > 0.0 && i % PER_TOOTH != 0 {
                rise + (lagging - rise) * (-INTERVAL_S / lag).exp()
            } else {
                rise
            };
            let rise = lagging as f32;
            let amperes = reading.current * PEAK_A;
            let actuated = ACTUATED * (1.0 + f64::from(rise));
            let pulled = attraction * amperes * amperes / actuated / reading.x;
            deviation((SENSING / ACTUATED) as f32, rise) + pulled as f32
        };
        readings.iter().enumerate().map(regressor).collect()
    }
}

pub fn row(disturbance: &Disturbance) -> ErrorRow {
    let readings = disturbance.readings(&mut Rng::new(1));
    let assumed =
        |current: f64| ACTUATED * (1.0 + EPS * (1.0 + disturbance.eps) * current * current);
    let (first, last) = (&readings[0], &readings[PER_TOOTH - 1]);
    let springs = [assumed(first.current), assumed(last.current)];
    let truth = disturbance.truth();
    let plain = equation_2(SENSING, springs, [first.x, last.x]) / SENSING / truth - 1.0;
    let creep = DriftModel::Logarithmic {
        tau: Second(SETTLE_S as f32),
    };
    let x_ref = last.x as f32;
    let regressors = disturbance.regressors(&readings);
    let samples: Vec<RampSample> = readings
        .iter()
        .zip(regressors)
        .map(|(r, regressor)| RampSample {
            time: Second(r.time as f32),
            deformation: Metre((r.x - f64::from(x_ref)) as f32),
            regressor,
            sigma: Metre(if disturbance.noise > 0.0 { 3e-8 } else { 3e-10 }),
        })
        .collect();
    let reference = Reference::new(Metre(x_ref), (SENSING / ACTUATED) as f32).unwrap();
    ErrorRow {
        name: disturbance.name,
        plain,
        ours: [
            judge(truth, reference, &samples, Basis::LINEAR),
            judge(
                truth,
                reference,
                &samples,
                Basis::with_drift(creep).unwrap(),
            ),
        ],
    }
}

fn judge(
    truth: f64,
    reference: Reference,
    samples: &[RampSample],
    basis: Basis,
) -> Result<DisturbanceVerdict, RampRefusal> {
    let mut ramp = Ramp::new(reference, basis);
    samples.iter().for_each(|sample| ramp.push(sample).unwrap());
    let fit: Fit = ramp.fit(Noise::Larger)?;
    let load = fit.load_stiffness(NewtonPerMetre(SENSING as f32))?;
    let relative = |c: Option<NewtonPerMetre>| {
        c.map_or(f64::INFINITY, |c| f64::from(c.0) / SENSING / truth - 1.0)
    };
    Ok(DisturbanceVerdict {
        error: relative(load.value()),
        low: relative(Some(load.low())),
        high: relative(load.high()),
    })
}

/// The table as Markdown, in percent of c_L.
pub fn table() -> String {
    let mut text = String::from(
        "| disturbance | plain eq. (2) | whole ramp | with creep term | its 95 % interval |\n\
         |---|---|---|---|---|\n",
    );
    for row in ALL.iter().map(row) {
        let [without, with] = row.ours;
        let cell = |verdict: &Result<DisturbanceVerdict, RampRefusal>| match verdict {
            Ok(verdict) => percent(verdict.error),
            Err(refusal) => format!("refused: {refusal}"),
        };
        let interval = with.as_ref().map_or("-".into(), |verdict| {
            format!("{} to {}", percent(verdict.low), percent(verdict.high))
        });
        text += &format!(
            "| {} | {} | {} | {} | {} |\n",
            row.name,
            percent(row.plain),
            cell(&without),
            cell(&with),
            interval,
        );
    }
    text
}

fn percent(fraction: f64) -> String {
    format!("{:+.2} %", fraction * 100.0)
}
