//! Fit of the actuated layer to all trains together.
//!
//! On every fall of run j, with kappa_j = c_S/c_j known and g(I) = c_S/c_D(I) = g0 + h(I), the deformation is
//!
//! x = (X_j (1 + d_j phi + e_j t) - k I^2 g/c_S)/(1 + kappa_j + g).
//!
//! The unknowns are h's coefficients, the attraction k, g0, and for each run X and the drifts d and
//! e. The Gauss-Newton method minimises the sum of (measured x - x)^2. The noise is then on the
//! left side alone. Multiplied by 1/x the equation is linear, but the noise is among its
//! coefficients, which makes h, and with it every load, too small by the ratio of noise to signal.
//! Loads of different stiffness separate h from g0; presses of different depth separate the
//! attraction.

use super::actuated_layer::Actuated;
use super::crosstalk::Crosstalk;
use super::curve::{PressCurve, chebyshev};
use super::least_squares::System;
use super::line::{FallSample, MOST_STEPS, SETTLED};
use super::samples::{Fallen, SampleRun};
use super::{Known, Signal, Unusable};

/// Degree of the polynomial h(I): high enough for the deviations from a quadratic law that memory
/// and lag of the elastomer cause.
const DEGREE: usize = 8;

/// The fitted layer, with the trains that it was fitted to.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub(crate) actuated: Actuated,
    pub(crate) problem: Problem,
    /// Fitted growth of the cross-talk with the deformation, in addition to the growth already
    /// removed from the samples, 1/m.
    growth_per_m: f64,
}

/// The bench's trains, prepared for the fit.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    pub(crate) trains: Vec<Train>,
    pub(crate) sensing_n_per_m: f64,
    pub(crate) start_ratio: f64,
    pub(crate) peak_a: f64,
    /// Mean deformation of all trains, m.
    pub(crate) depth_m: f64,
    /// Cross-talk without contact, m/A^2; `Some` where this fit determines the growth of the
    /// cross-talk with the press, `None` where the load cell determines it.
    pub(crate) growing_m_per_a2: Option<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct Train {
    /// c_S/c_L by the spring's nominal stiffness, including the frame.
    pub(crate) kappa: f64,
    pub(crate) spring: bool,
    /// Time constant of the logarithmic drift, s.
    pub(crate) tau_s: f64,
    pub(crate) samples: Vec<FallSample>,
}

/// Indices of the unknowns that follow h's coefficients; each train's own ones start at `SHARED`.
const ATTRACTION: usize = DEGREE;
const RATIO: usize = DEGREE + 1;
const SHARED: usize = DEGREE + 2;

/// Fits the trains, with the cross-talk determined by the load cell.
pub(crate) fn fit(
    runs: &[SampleRun],
    force: &PressCurve,
    crosstalk: Crosstalk,
    frame_m_per_n: f64,
    known: &Known,
) -> Result<Fit, Unusable> {
    let problem = Problem::new(runs, force, crosstalk, frame_m_per_n, known)?;
    problem.fit()
}

/// Fits the trains, with the growth of the cross-talk with the press as one more unknown. The
/// growth differs from h: X I^2 lowers 1/x in proportion to W_j, while h is common to all trains.
pub(crate) fn fit_with_growth(
    runs: &[SampleRun],
    force: &PressCurve,
    mut crosstalk: Crosstalk,
    known: &Known,
) -> Result<(Fit, Crosstalk), Unusable> {
    let problem = |crosstalk: Crosstalk| {
        let problem = Problem::new(runs, force, crosstalk, 0.0, known)?;
        Ok(Problem {
            growing_m_per_a2: Some(crosstalk.untouched_m_per_a2),
            ..problem
        })
    };
    crosstalk.growth_per_m += problem(crosstalk)?.fit()?.growth_per_m;
    // Fits again, with the growth found by the first fit removed from the samples.
    Ok((problem(crosstalk)?.fit()?, crosstalk))
}

impl Problem {
    fn new(
        runs: &[SampleRun],
        force: &PressCurve,
        crosstalk: Crosstalk,
        frame_m_per_n: f64,
        known: &Known,
    ) -> Result<Self, Unusable> {
        let scales = (known.sensing_n_per_m, frame_m_per_n);
        let trains = runs.iter();
        let trains = trains.filter_map(|run| Train::of(run, force, &crosstalk, scales));
        let trains: Vec<Train> = trains.collect();
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
            sensing_n_per_m: known.sensing_n_per_m,
            start_ratio: known.sensing_n_per_m / known.actuated_n_per_m,
            peak_a: f64::from(known.settings.peak_current_a),
            depth_m: sum_m / count,
            growing_m_per_a2: None,
        };
        Ok(problem)
    }

    /// Smallest deformation in all trains, m; a train has its smallest at the end of a fall. The
    /// calibration does not cover shallower presses.
    pub(crate) fn shallowest_m(&self) -> f64 {
        let samples = self.trains.iter().flat_map(|train| &train.samples);
        let deformations = samples.map(|sample| sample.deformation_m);
        deformations.fold(f64::INFINITY, f64::min)
    }

    /// Solves for the layer, with the nominal stiffness of the springs.
    pub(crate) fn fit(&self) -> Result<Fit, Unusable> {
        let mut unknowns = self.start()?;
        let mut settled = false;
        for _ in 0..MOST_STEPS {
            let step = self.linearised(&unknowns).solve(LAYER)?;
            add(&mut unknowns, &step.unknowns);
            let of = |values: &[f64]| values.get(RATIO).copied().unwrap_or(0.0);
            if of(&step.unknowns).abs() <= SETTLED * of(&unknowns).abs() {
                settled = true;
                break;
            }
        }
        let actuated = self.actuated(&unknowns);
        let rises = actuated.rise(self.peak_a) > 0.0;
        if !(settled && actuated.ratio > 0.0 && rises) {
            return Err(self.cause(actuated.ratio));
        }
        Ok(Fit {
            growth_per_m: unknowns.get(self.growth()).copied().unwrap_or(0.0),
            actuated,
            problem: self.clone(),
        })
    }

    /// Solution of the equation multiplied by 1/x, which is linear: the starting point of the
    /// iteration.
    fn start(&self) -> Result<Vec<f64>, Unusable> {
        let mut system = System::new(self.unknowns());
        for (place, train) in self.placed() {
            for sample in &train.samples {
                let state = State {
                    deformation_m: sample.deformation_m,
                    pull_m: 0.0,
                    ratio: self.start_ratio,
                };
                let whole = 1.0 + place.kappa + self.start_ratio;
                let right_m = sample.deformation_m * (1.0 + place.kappa) / whole;
                let row = self.row(&state, place, sample, train);
                system.add(row, right_m, 1.0 / self.depth_m);
            }
        }
        Ok(system.solve(LAYER)?.unknowns)
    }

    /// Each train with its kappa and the index of its own unknowns.
    fn placed(&self) -> impl Iterator<Item = (Place, &Train)> {
        self.trains.iter().enumerate().map(|(index, train)| {
            let place = Place {
                kappa: train.kappa,
                own: SHARED + 3 * index,
            };
            (place, train)
        })
    }

    /// Builds the actuated layer from the unknowns.
    fn actuated(&self, unknowns: &[f64]) -> Actuated {
        let unknown = |index: usize| unknowns.get(index).copied().unwrap_or(0.0);
        Actuated {
            ratio: unknown(RATIO),
            regressor: unknowns.iter().take(DEGREE).copied().collect(),
            bend: 0.0,
            peak_a: self.peak_a,
            attraction_n_per_a2: unknown(ATTRACTION),
        }
    }

    /// Reason for a failed fit, or for a fit whose c_S/c_D0, `ratio`, is implausible.
    fn cause(&self, ratio: f64) -> Unusable {
        match self.signal() {
            Ok(signal) if signal.is_clear() => Unusable::Contradiction { signal, ratio },
            Ok(signal) => Unusable::StiffensTooLittle(signal),
            Err(cause) => cause,
        }
    }

    /// Signal of the stiffening in a train on the hardest load.
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
            let row = [1.0, part * part, phi, sample.time_s];
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

    /// Index of the cross-talk's growth, after all other unknowns.
    fn growth(&self) -> usize {
        SHARED + 3 * self.trains.len()
    }

    /// Number of the fit's unknowns.
    fn unknowns(&self) -> usize {
        self.growth() + usize::from(self.growing_m_per_a2.is_some())
    }

    /// System linearised about `unknowns`: derivatives and residuals of the deformations.
    fn linearised(&self, unknowns: &[f64]) -> System {
        let actuated = self.actuated(unknowns);
        // The samples are already corrected for the prepared growth; this growth is additional.
        let growth_per_m = unknowns.get(self.growth()).copied().unwrap_or(0.0);
        let mut system = System::new(self.unknowns());
        for (place, train) in self.placed() {
            for sample in &train.samples {
                let state = self.state(&actuated, unknowns, place, sample, train);
                let added = self.untouched_m(sample) * growth_per_m;
                let read_m = state.deformation_m * (1.0 + added);
                let row = self.row(&state, place, sample, train);
                system.add(row, sample.deformation_m - read_m, 1.0 / self.depth_m);
            }
        }
        system
    }

    /// State of the sensing layer for these unknowns.
    fn state(
        &self,
        actuated: &Actuated,
        unknowns: &[f64],
        place: Place,
        sample: &FallSample,
        train: &Train,
    ) -> State {
        let pull_n = actuated.attraction_n_per_a2 * sample.current_a * sample.current_a;
        let pull_m = pull_n / self.sensing_n_per_m;
        let ratio = actuated.ratio + actuated.regressor(sample.current_a);
        let ways = unknowns.iter().skip(place.own).zip(train.drifts(sample));
        let total_m = self.depth_m * ways.map(|(way, drift)| way * drift).sum::<f64>();
        State {
            deformation_m: (total_m - pull_m * ratio) / (1.0 + place.kappa + ratio),
            pull_m,
            ratio,
        }
    }

    /// Derivative of the deformation with respect to each unknown.
    fn row(&self, state: &State, place: Place, sample: &FallSample, train: &Train) -> Vec<f64> {
        let whole = 1.0 + place.kappa + state.ratio;
        let by_ratio = -(state.deformation_m + state.pull_m) / whole;
        let square_a2 = sample.current_a * sample.current_a;
        let mut row = vec![0.0; self.unknowns()];
        let mut set = |index: usize, value: f64| {
            if let Some(entry) = row.get_mut(index) {
                *entry = value;
            }
        };
        let terms = chebyshev(sample.current_a / self.peak_a).take(DEGREE);
        for (index, (term, _)) in terms.enumerate() {
            set(index, by_ratio * term);
        }
        set(
            ATTRACTION,
            -square_a2 * state.ratio / self.sensing_n_per_m / whole,
        );
        set(RATIO, by_ratio);
        for (index, drift) in train.drifts(sample).into_iter().enumerate() {
            set(place.own + index, self.depth_m * drift / whole);
        }
        set(
            self.growth(),
            self.untouched_m(sample) * state.deformation_m,
        );
        row
    }

    /// Cross-talk at the sample's current without contact, m; zero unless its growth is an unknown.
    fn untouched_m(&self, sample: &FallSample) -> f64 {
        self.growing_m_per_a2
            .map_or(0.0, |of| of * sample.current_a * sample.current_a)
    }
}

impl Train {
    /// Prepares the train of a run; `None` without contact. `scales` are the nominal c_S, N/m, and the
    /// compliance of the frame, m/N.
    pub(crate) fn of(
        run: &SampleRun,
        force: &PressCurve,
        crosstalk: &Crosstalk,
        (sensing_n_per_m, frame_m_per_n): (f64, f64),
    ) -> Option<Self> {
        let compliance = run.pressed.compliance_m_per_n()?;
        let prepare = |sample: &Fallen| {
            let read_m = force.at(sample.change) / sensing_n_per_m;
            FallSample {
                time_s: sample.time_s,
                deformation_m: crosstalk.without(read_m, sample.current_a),
                current_a: sample.current_a,
            }
        };
        Some(Self {
            kappa: sensing_n_per_m * (compliance + frame_m_per_n),
            spring: compliance > 0.0,
            tau_s: run.since_touch_s,
            samples: run.falls.iter().map(prepare).collect(),
        })
    }

    /// Factors of the train's own unknowns: constant, logarithmic, linear.
    fn drifts(&self, sample: &FallSample) -> [f64; 3] {
        [1.0, (sample.time_s / self.tau_s).ln_1p(), sample.time_s]
    }
}

/// State of the sensing layer at a sample.
#[derive(Clone, Copy, Debug)]
struct State {
    deformation_m: f64,
    /// Attraction of the actuated layer's halves over c_S, m.
    pull_m: f64,
    /// c_S/c_D at this current.
    ratio: f64,
}

/// Name of this fit's unknowns in error messages.
const LAYER: &str = "the actuated layer";

/// A train's kappa and the index of its own unknowns.
#[derive(Clone, Copy, Debug)]
struct Place {
    kappa: f64,
    own: usize,
}

fn add(unknowns: &mut [f64], changes: &[f64]) {
    for (unknown, change) in unknowns.iter_mut().zip(changes) {
        *unknown += change;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::{
        ATTRACTION_N_PER_A2, KAPPAS, PEAK_A, RATIO, RISE, Sensor, mean, noise, problem,
    };

    #[test]
    fn noise_of_the_readings_leaves_no_bias() {
        let fit = |seed| {
            let problem = problem(&Sensor::EXACT, KAPPAS, &mut noise(seed));
            problem.fit().unwrap().actuated
        };
        let fits: Vec<Actuated> = (0..8).map(fit).collect();
        let found = |of: fn(&Actuated) -> f64| fits.iter().map(of).collect::<Vec<f64>>();
        let figures = [
            ("c_S/c_D0", RATIO, found(|fit| fit.ratio)),
            ("rise", RISE, found(|fit| fit.rise(PEAK_A))),
            (
                "attraction",
                ATTRACTION_N_PER_A2,
                found(|fit| fit.attraction_n_per_a2),
            ),
        ];
        for (name, truth, found) in figures {
            let (mean, error) = mean(&found);
            println!("{name}: {mean} +- {error}, true {truth}");
            assert!(
                (mean - truth).abs() < 4.0 * error,
                "{name}: {mean} +- {error}"
            );
        }
    }
}
