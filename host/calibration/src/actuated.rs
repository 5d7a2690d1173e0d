//! The actuated layer, from all trains together.
//!
//! On every fall of run j, with W_j = 1 + kappa_j + g0 and kappa_j = c_S/c_j known:
//!
//! x0_j/x (1 + d_j phi) - h(I) - (k I^2/c_D)/x - g0 = 1 + kappa_j,
//!
//! which is linear in h's coefficients, the attraction k, g0 and every run's own x0 and drift, but
//! for c_D in the attraction: that comes from the solution before, three times. What separates the
//! unknowns: h and g0 by loads of different stiffness, the attraction by depths.

use crate::session::Pressed;

use super::crosstalk::Crosstalk;
use super::curve::{PressCurve, chebyshev};
use super::least_squares::{Solution, System};
use super::samples::{Fallen, SampleRun};
use super::{Known, Signal, Unusable};

/// Degree of h in the current: enough for the bends that memory and lag put on a quadratic law.
const DEGREE: usize = 8;
/// Times that the small terms are renewed: the third changes nothing above 1e-6.
const ROUNDS: usize = 4;
/// The actuated layer as calibrated.
#[derive(Clone, Debug)]
pub struct Actuated {
    /// g0 = c_S/c_D0.
    pub ratio: f64,
    /// Coefficients of h(I) in the terms of [`chebyshev`] in I/I_peak.
    pub regressor: Vec<f64>,
    /// Peak current of the train, A.
    pub peak_a: f64,
    /// Attraction of the layer's halves, N/A^2.
    pub attraction_n_per_a2: f64,
}

impl Actuated {
    /// h(I) = g(I) - g(0).
    pub fn regressor(&self, current_a: f64) -> f64 {
        let terms = chebyshev(current_a / self.peak_a).zip(&self.regressor);
        terms.map(|((term, _), c)| term * c).sum()
    }

    /// rho(I) = c_D/c_D0 - 1.
    pub fn rise(&self, current_a: f64) -> f64 {
        let regressor = self.regressor(current_a);
        -regressor / (self.ratio + regressor)
    }
}

impl Actuated {
    /// What stands beside 1 + kappa: g(I), and the attraction as a compliance.
    pub fn compliance(&self, sample: &FallSample, sensing_n_per_m: f64) -> f64 {
        let ratio_now = self.ratio + self.regressor(sample.current_a);
        let pull_n = self.attraction_n_per_a2 * sample.current_a.powi(2);
        ratio_now + pull_n * ratio_now / sensing_n_per_m / sample.deformation_m
    }

    /// A sample of a train beside its line.
    fn point(&self, sample: &FallSample, sensing_n_per_m: f64) -> LinePoint {
        LinePoint {
            time_s: sample.time_s,
            deformation_m: sample.deformation_m,
            compliance: self.compliance(sample, sensing_n_per_m),
        }
    }

    /// By how much the line of a train bends: the change of its slope from the middle to an end of its
    /// span of h, over the slope, without what noise makes of it.
    fn bend(
        &self,
        samples: &[FallSample],
        sensing_n_per_m: f64,
        tau_s: f64,
    ) -> Result<f64, Unusable> {
        let h = |sample: &FallSample| self.compliance(sample, sensing_n_per_m) - self.ratio;
        let (low, high) = samples
            .iter()
            .map(h)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| {
                (low.min(h), high.max(h))
            });
        let depth_m = mean_m(samples.iter().map(|sample| sample.deformation_m));
        let mut system = System::new(5);
        for sample in samples {
            let (row, right, weight) = self.point(sample, sensing_n_per_m).row(depth_m, tau_s);
            let bent = row.into_iter().chain([-h(sample).powi(2)]).collect();
            system.add(bent, right, weight);
        }
        let solved = system.solve("the bend of a train by itself")?;
        let gamma = solved.unknowns.last().copied().unwrap_or(0.0);
        let variance = solved.covariance[(4, 4)];
        Ok((gamma * gamma - variance).max(0.0).sqrt() * (high - low))
    }

    /// The line of one train by itself, for a press that was `tau_s` old when it began.
    ///
    /// # Errors
    /// If the samples do not determine it.
    pub fn line(
        &self,
        samples: &[FallSample],
        sensing_n_per_m: f64,
        tau_s: f64,
    ) -> Result<TrainFit, Unusable> {
        let points = samples.iter();
        let points: Vec<_> = points
            .map(|sample| self.point(sample, sensing_n_per_m))
            .collect();
        TrainFit::of(&points, tau_s)
    }
}

/// Mean of deformations, m.
fn mean_m(deformations_m: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = deformations_m.len().max(1) as f64;
    deformations_m.sum::<f64>() / count
}

/// A sample of a train with what stands beside 1 + kappa.
#[derive(Clone, Copy, Debug)]
pub struct LinePoint {
    /// Since the train began, s.
    pub time_s: f64,
    /// Deformation with the cross-talk taken out, m.
    pub deformation_m: f64,
    /// c_S/c_D(I), and the attraction as a compliance.
    pub compliance: f64,
}

impl LinePoint {
    /// Its equation: total way over `depth_m` and its drifts, kappa; right side and weight.
    fn row(&self, depth_m: f64, tau_s: f64) -> (Vec<f64>, f64, f64) {
        let phi = (self.time_s / tau_s).ln_1p();
        let level = depth_m / self.deformation_m;
        let right = 1.0 + self.compliance;
        // Noise of x enters as x_0/x^2.
        let weight = (level * level).recip();
        let row = vec![level, level * phi, -1.0, level * self.time_s];
        (row, right, weight)
    }
}

/// x (1 + kappa + g) = x_0 (1 + d phi(t)), fitted to a train.
#[derive(Clone, Copy, Debug)]
pub struct TrainFit {
    /// x_0, m.
    pub total_m: f64,
    /// d.
    pub drift: f64,
    /// Straight drift, 1/s.
    pub linear: f64,
    /// c_S/c_L.
    pub kappa: f64,
    /// Time constant of phi, s.
    pub tau_s: f64,
}

impl TrainFit {
    /// The line of one train by itself, for a press that was `tau_s` old when it began.
    ///
    /// # Errors
    /// If the points do not determine it.
    pub fn of(points: &[LinePoint], tau_s: f64) -> Result<Self, Unusable> {
        let depth_m = mean_m(points.iter().map(|point| point.deformation_m));
        let mut system = System::new(4);
        for point in points {
            let (row, right, weight) = point.row(depth_m, tau_s);
            system.add(row, right, weight);
        }
        match system.solve("a train by itself")?.unknowns.as_slice() {
            &[total, drift, kappa, linear] => Ok(Self {
                total_m: total * depth_m,
                drift: drift / total,
                linear: linear / total,
                kappa,
                tau_s,
            }),
            _ => Err(Unusable::Undetermined("a train by itself")),
        }
    }

    /// 1 + d phi(t).
    pub fn drifted(&self, time_s: f64) -> f64 {
        1.0 + self.drift * (time_s / self.tau_s).ln_1p() + self.linear * time_s
    }

    /// 1/x without drift, 1/m, at a compliance.
    pub fn inverse_per_m(&self, compliance: f64) -> f64 {
        (1.0 + self.kappa + compliance) / self.total_m
    }
}

/// The solution, with what is needed to see how it depends on the springs.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub(crate) actuated: Actuated,
    pub(crate) solution: Solution,
    pub(crate) problem: Problem,
    /// What the cross-talk grows by beyond what the samples were prepared with, 1/m.
    growth_per_m: f64,
}

/// The trains, prepared.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    trains: Vec<Train>,
    pub(crate) sensing_n_per_m: f64,
    start_ratio: f64,
    pub peak_a: f64,
    /// Mean deformation, m.
    pub(crate) depth_m: f64,
    /// The cross-talk without contact, m/A^2, where its growth is found here and not with a load cell.
    growing_m_per_a2: Option<f64>,
}

#[derive(Clone, Debug)]
struct Train {
    kappa: f64,
    spring: bool,
    /// Time constant of the logarithmic drift, s.
    tau_s: f64,
    samples: Vec<FallSample>,
}

/// A sample of a fall.
#[derive(Clone, Copy, Debug)]
pub struct FallSample {
    /// Since the train began, s.
    pub time_s: f64,
    /// Deformation with the cross-talk taken out, m.
    pub deformation_m: f64,
    /// Current that acts over the conversion, A.
    pub current_a: f64,
}

/// Places of the unknowns.
const ATTRACTION: usize = DEGREE;
const RATIO: usize = DEGREE + 1;
const SHARED: usize = DEGREE + 2;

/// Fits the trains, with the cross-talk as the load cell has it.
pub(crate) fn fit(
    runs: &[SampleRun],
    force: &PressCurve,
    crosstalk: Crosstalk,
    frame_m_per_n: f64,
    known: &Known,
) -> Result<Fit, Unusable> {
    let problem = Problem::new(runs, force, crosstalk, frame_m_per_n, known)?;
    problem.fit(&vec![0.0; problem.springs()])
}

/// Fits the trains and the growth of the cross-talk with the press, which is one more unknown:
/// X I^2 takes from 1/x in proportion to W_j, other than h, which all trains share.
pub(crate) fn fit_with_growth(
    runs: &[SampleRun],
    force: &PressCurve,
    mut crosstalk: Crosstalk,
    known: &Known,
) -> Result<(Fit, Crosstalk), Unusable> {
    let growing_m_per_a2 = Some(crosstalk.untouched_m_per_a2);
    for _ in 1..ROUNDS {
        let mut problem = Problem::new(runs, force, crosstalk, 0.0, known)?;
        problem.growing_m_per_a2 = growing_m_per_a2;
        let fit = problem.fit(&vec![0.0; problem.springs()])?;
        crosstalk.growth_per_m += fit.growth_per_m;
    }
    let mut problem = Problem::new(runs, force, crosstalk, 0.0, known)?;
    problem.growing_m_per_a2 = growing_m_per_a2;
    let fit = problem.fit(&vec![0.0; problem.springs()])?;
    Ok((fit, crosstalk))
}

impl Problem {
    fn new(
        runs: &[SampleRun],
        force: &PressCurve,
        crosstalk: Crosstalk,
        frame_m_per_n: f64,
        known: &Known,
    ) -> Result<Self, Unusable> {
        let sensing = known.sensing_n_per_m;
        let prepare = |sample: &Fallen| FallSample {
            time_s: sample.time_s,
            deformation_m: crosstalk.without(force.at(sample.change) / sensing, sample.current_a),
            current_a: sample.current_a,
        };
        let trains: Vec<Train> = runs
            .iter()
            .filter_map(|run| {
                let (compliance, spring) = match run.pressed {
                    Pressed::Nothing => return None,
                    Pressed::Block => (0.0, false),
                    Pressed::Spring { n_per_m } => (1.0 / n_per_m, true),
                };
                Some(Train {
                    kappa: sensing * (compliance + frame_m_per_n),
                    spring,
                    tau_s: run.since_touch_s,
                    samples: run.falls.iter().map(prepare).collect(),
                })
            })
            .collect();
        let changes = runs.iter().flat_map(|run| &run.falls);
        let greatest = changes.map(|fallen| fallen.change).fold(0.0, f64::max);
        if greatest > force.greatest_change {
            return Err(Unusable::BeyondPresses {
                train: greatest,
                press: force.greatest_change,
            });
        }
        if trains.iter().any(|train| train.samples.is_empty()) {
            return Err(Unusable::Missing(
                "fall of the current in one of its trains",
            ));
        }
        let deformations = trains.iter().flat_map(|train| &train.samples);
        let (sum_m, count) = deformations.fold((0.0, 0.0), |(sum, count), sample| {
            (sum + sample.deformation_m, count + 1.0)
        });
        let problem = Problem {
            trains,
            sensing_n_per_m: sensing,
            start_ratio: sensing / known.actuated_n_per_m,
            peak_a: f64::from(known.settings.peak_current_a),
            depth_m: sum_m / count,
            growing_m_per_a2: None,
        };
        Ok(problem)
    }

    /// The least deformation of all trains, m, which is one at the end of a fall: nothing is known of
    /// shallower presses.
    pub(crate) fn shallowest_m(&self) -> f64 {
        let samples = self.trains.iter().flat_map(|train| &train.samples);
        let deformations = samples.map(|sample| sample.deformation_m);
        deformations.fold(f64::INFINITY, f64::min)
    }

    /// Number of springs.
    pub(crate) fn springs(&self) -> usize {
        self.trains.iter().filter(|train| train.spring).count()
    }

    /// Solves for springs that are stiffer than written on them by these parts.
    pub(crate) fn fit(&self, stiffer: &[f64]) -> Result<Fit, Unusable> {
        let mut actuated = Actuated {
            ratio: self.start_ratio,
            regressor: vec![0.0; DEGREE],
            peak_a: self.peak_a,
            attraction_n_per_a2: 0.0,
        };
        let mut solution = None;
        let mut growth_per_m = 0.0;
        for _ in 0..ROUNDS {
            let solved = self
                .system(&actuated, stiffer)
                .solve("the actuated layer")?;
            let unknown = |index: usize| solved.unknowns.get(index).copied().unwrap_or(0.0);
            actuated = Actuated {
                ratio: unknown(RATIO),
                regressor: solved.unknowns.iter().take(DEGREE).copied().collect(),
                peak_a: self.peak_a,
                attraction_n_per_a2: unknown(ATTRACTION),
            };
            growth_per_m = unknown(self.growth());
            solution = Some(solved);
        }
        let rises = actuated.rise(self.peak_a) > 0.0;
        match solution {
            Some(solution) if actuated.ratio > 0.0 && rises => Ok(Fit {
                actuated,
                solution,
                problem: self.clone(),
                growth_per_m,
            }),
            _ => Err(self.cause(actuated.ratio)),
        }
    }

    /// Why there is no solution but one with this c_S/c_D0.
    fn cause(&self, ratio: f64) -> Unusable {
        match self.signal() {
            Ok(signal) if signal.is_clear() => Unusable::Contradiction { signal, ratio },
            Ok(signal) => Unusable::StiffensTooLittle(signal),
            Err(cause) => cause,
        }
    }

    /// What shows of the stiffening in a train of the hardest load.
    fn signal(&self) -> Result<Signal, Unusable> {
        let hardest = self
            .trains
            .iter()
            .min_by(|a, b| a.kappa.total_cmp(&b.kappa));
        let hardest = hardest.ok_or(Unusable::Missing("train under a load"))?;
        let mut system = System::new(4);
        for sample in &hardest.samples {
            let part = sample.current_a / self.peak_a;
            let phi = (sample.time_s / hardest.tau_s).ln_1p();
            let row = vec![1.0, part * part, phi, sample.time_s];
            system.add(row, sample.deformation_m, 1.0);
        }
        let solution = system.solve("the deformation on the block")?;
        match solution.unknowns.as_slice() {
            [rest_m, change_m, ..] => Ok(Signal {
                change: change_m / rest_m,
                scatter: solution.sigma / rest_m,
            }),
            _ => Err(Unusable::Undetermined("the deformation on the block")),
        }
    }

    /// By how much each train by itself, evaluated with the solution, misses what was pressed:
    /// kappa and the error of kappa.
    pub(crate) fn misses(&self, actuated: &Actuated) -> Result<Vec<(f64, f64)>, Unusable> {
        let miss = |train: &Train| {
            let line = actuated.line(&train.samples, self.sensing_n_per_m, train.tau_s)?;
            Ok((train.kappa, line.kappa - train.kappa))
        };
        self.trains.iter().map(miss).collect()
    }

    /// By how much the line of each train by itself bends over its own span of h.
    pub(crate) fn bends(&self, actuated: &Actuated) -> Result<Vec<f64>, Unusable> {
        let bend = |train: &Train| actuated.bend(&train.samples, self.sensing_n_per_m, train.tau_s);
        self.trains.iter().map(bend).collect()
    }

    /// Place of the growth of the cross-talk, after all else.
    fn growth(&self) -> usize {
        SHARED + 3 * self.trains.len()
    }

    fn system(&self, guess: &Actuated, stiffer: &[f64]) -> System {
        let unknowns = self.growth() + usize::from(self.growing_m_per_a2.is_some());
        let mut system = System::new(unknowns);
        let mut stiffer = stiffer.iter();
        for (index, train) in self.trains.iter().enumerate() {
            let part = if train.spring {
                stiffer.next().copied().unwrap_or(0.0)
            } else {
                0.0
            };
            let kappa = train.kappa / (1.0 + part);
            for sample in &train.samples {
                let mut row = vec![0.0; unknowns];
                let (x_m, current_a) = (sample.deformation_m, sample.current_a);
                let square_a2 = current_a * current_a;
                let ratio_now = guess.ratio + guess.regressor(current_a);
                let whole = 1.0 + kappa + ratio_now;
                let terms = chebyshev(current_a / self.peak_a).take(DEGREE);
                for (entry, (term, _)) in row.iter_mut().zip(terms) {
                    *entry = -term;
                }
                // 1/c_D = g/c_S.
                let set = |row: &mut Vec<f64>, index: usize, value: f64| {
                    if let Some(entry) = row.get_mut(index) {
                        *entry = value;
                    }
                };
                let pull = square_a2 * ratio_now / self.sensing_n_per_m / x_m;
                set(&mut row, ATTRACTION, -pull);
                set(&mut row, RATIO, -1.0);
                let phi = (sample.time_s / train.tau_s).ln_1p();
                set(&mut row, SHARED + 3 * index, self.depth_m / x_m);
                set(&mut row, SHARED + 3 * index + 1, self.depth_m / x_m * phi);
                set(
                    &mut row,
                    SHARED + 3 * index + 2,
                    self.depth_m / x_m * sample.time_s,
                );
                let untouched_m = self.growing_m_per_a2.map(|of| of * square_a2);
                set(&mut row, self.growth(), whole * untouched_m.unwrap_or(0.0));
                system.add(row, 1.0 + kappa, x_m / (self.depth_m * whole));
            }
        }
        system
    }
}

/// Places of the unknowns that all trains share.
pub(crate) const fn shared() -> usize {
    SHARED
}

/// The actuated layer of other unknowns.
pub(crate) fn with_unknowns(like: &Actuated, unknowns: &[f64]) -> Actuated {
    let unknown = |index: usize| unknowns.get(index).copied().unwrap_or(0.0);
    Actuated {
        ratio: unknown(RATIO),
        regressor: unknowns.iter().take(DEGREE).copied().collect(),
        attraction_n_per_a2: unknown(ATTRACTION),
        ..like.clone()
    }
}
