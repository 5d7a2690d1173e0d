//! Adjustment of the layer to the load that each train gives by itself.
//!
//! The fit of all samples gives h's shape. It weights every sample alike, as if noise were the only
//! deviation of a train from its line. In fact creep, memory and the spring's error are common to
//! all samples of a train, and bias the five quantities below. Here every train counts once, with
//! kappa = c_S/c_L from its own line. With W = 1 + kappa + c_S/c_D0 and the deformation x, an error
//! of each quantity causes an error of kappa in proportion to:
//!
//! | quantity | error of kappa |
//! |---|---|
//! | c_S/c_D0, with the same h | constant |
//! | size of h | W |
//! | attraction | W/x |
//! | cross-talk | W^2/x |
//! | growth of the cross-talk with the press | W^2 |
//!
//! Loads of different stiffness and presses of different depth separate the quantities. Weighted
//! least squares finds them, with one more unknown for the error of each spring, limited by the
//! tolerance. The mean bend of the trains' lines is then removed from h's shape.

use super::Unusable;
use super::actuated::{Fit, Train};
use super::actuated_layer::Actuated;
use super::crosstalk::Crosstalk;
use super::least_squares::{Solution, System};
use super::line::{Bend, FallSample};

/// Number of adjusted quantities.
pub(crate) const QUANTITIES: usize = 5;

/// Changes of the five quantities: c_S/c_D0 and h relative to their values; attraction and
/// cross-talk as their effect on the mean deformation at the peak current, relative to that
/// deformation; the growth as its relative addition to a deformation at the peak current.
pub(crate) type Changes = [f64; QUANTITIES];

/// Step of each quantity for numerical derivatives: a thousandth of typical changes.
const STEPS: Changes = [1e-4, 1e-4, 1e-5, 1e-5, 1e-5];
/// Rounds of the iteration that alternates between the trains' scatter and the quantities. The
/// third round changes no quantity by more than a thousandth of its uncertainty.
const ROUNDS: usize = 4;
/// Lower limit of the scatter ([`scattered`]). Of 54 simulated sensors of the design
/// `ultrasoft` (seeds 900001 to 900060), the ten with the least scatter have this value; on half of
/// all sensors the trains' own errors explain the whole scatter.
pub(crate) const LEAST_SCATTER: f64 = 0.0008;
/// Standard deviation of a train's kappa about the adjusted layer, in addition to the train's own error,
/// for a `scatter` that is relative to W on a load of c_S. It grows with W^2, as an error of the
/// reading does: without vibration and noise, the trains on a block deviate by 0.09 % of W, those on a
/// spring of a tenth of c_S by 0.37 % (simulated sensors of the design `ultrasoft`, seeds 2100001 to
/// 2100031).
pub(crate) fn scattered(scatter: f64, kappa: f64, ratio: f64) -> f64 {
    scatter * (1.0 + kappa + ratio).powi(2) / (2.0 + ratio)
}

/// Upper limit of the trains' scatter; with more scatter the trains carry no
/// information.
const MOST_SCATTER: f64 = 1.0;
/// Relative tolerance of the search for the scatter.
const SCATTER_SETTLED: f64 = 1e-3;
/// Prior standard deviation of the changes of c_S/c_D0, h and attraction, far above typical
/// results. It keeps the values of the fit of all samples where a bench with a single depth cannot
/// separate them.
const PRIOR_DEVIATION: f64 = 1.0;
/// Prior standard deviations of the changes of the cross-talk and of its growth, relative to the
/// cross-talk: the train without contact determines the cross-talk, the load cell its growth. On 60
/// simulated sensors of the design `ultrasoft` the changes are at most a tenth and three tenths. On
/// the design `closed` the cross-talk is small compared with the trains' deviations from their
/// lines. Without these priors the fit would give three times the cross-talk of the untouched
/// sensor there.
const OF_CROSSTALK: [f64; 2] = [0.1, 0.3];
/// Cross-talk at the peak current, relative to the mean deformation, below which its growth is not
/// adjusted: the growth of so small a cross-talk could exceed the protocol's limit of 1e5/m.
const CARRIES_GROWTH: f64 = 1e-4;

/// The adjusted layer with its covariance.
#[derive(Clone, Debug)]
pub(crate) struct Adjusted {
    pub(crate) layer: Layer,
    /// Scatter of the trains' kappa about the adjusted layer ([`scattered`]).
    pub(crate) scatter: f64,
    /// Covariance of the five adjusted quantities.
    pub(crate) covariance: [Changes; QUANTITIES],
    /// Covariance of the quantities if the springs were exact.
    pub(crate) covariance_of_exact_springs: [Changes; QUANTITIES],
    /// For every train: its nominal kappa, and the deviation of the kappa that its own line gives.
    pub(crate) misses: Vec<(f64, f64)>,
    /// Bend of each train's own line.
    pub(crate) bends: Vec<Bend>,
}

/// The actuated layer and the cross-talk.
#[derive(Clone, Debug)]
pub(crate) struct Layer {
    pub(crate) actuated: Actuated,
    pub(crate) crosstalk: Crosstalk,
    /// Mean deformation of all trains, m.
    pub(crate) depth_m: f64,
    pub(crate) sensing_n_per_m: f64,
}

impl Layer {
    /// Returns the layer with the changes applied.
    pub(crate) fn changed(&self, changes: &Changes) -> Self {
        let &[ratio, regressor, attraction, untouched, growth] = changes;
        let square_a2 = self.actuated.peak_a * self.actuated.peak_a;
        let actuated = &self.actuated;
        let untouched_m_per_a2 =
            self.crosstalk.untouched_m_per_a2 + untouched * self.depth_m / square_a2;
        let grows_per_a2 =
            self.crosstalk.untouched_m_per_a2 * self.crosstalk.growth_per_m + growth / square_a2;
        Self {
            actuated: Actuated {
                ratio: actuated.ratio * (1.0 + ratio),
                regressor: actuated
                    .regressor
                    .iter()
                    .map(|term| term * (1.0 + regressor))
                    .collect(),
                attraction_n_per_a2: actuated.attraction_n_per_a2
                    + attraction * self.depth_m * self.sensing_n_per_m / square_a2,
                ..actuated.clone()
            },
            crosstalk: Crosstalk {
                untouched_m_per_a2,
                growth_per_m: if self.carries_growth() {
                    grows_per_a2 / untouched_m_per_a2
                } else {
                    self.crosstalk.growth_per_m
                },
            },
            ..self.clone()
        }
    }

    /// Cross-talk at the peak current, relative to the mean deformation.
    fn crosstalk_at_peak(&self) -> f64 {
        let square_a2 = self.actuated.peak_a * self.actuated.peak_a;
        self.crosstalk.untouched_m_per_a2.abs() * square_a2 / self.depth_m
    }

    fn carries_growth(&self) -> bool {
        self.crosstalk_at_peak() > CARRIES_GROWTH
    }

    /// Returns the samples of a train, corrected for the cross-talk of this layer instead of the
    /// cross-talk `prepared` with which they were prepared.
    fn samples(&self, train: &Train, prepared: &Crosstalk) -> Vec<FallSample> {
        let samples = train.samples.iter().map(|sample| {
            let read_m = prepared.with(sample.deformation_m, sample.current_a);
            FallSample {
                deformation_m: self.crosstalk.without(read_m, sample.current_a),
                ..*sample
            }
        });
        samples.collect()
    }

    /// kappa by a train's own line, from samples prepared with the cross-talk `prepared`.
    fn kappa(&self, train: &Train, prepared: &Crosstalk) -> Result<f64, Unusable> {
        let samples = self.samples(train, prepared);
        let line = self
            .actuated
            .line(&samples, self.sensing_n_per_m, train.tau_s)?;
        Ok(line.kappa)
    }

    /// Relative error of the signal per relative error of the stiffening, at the mean depth.
    pub(crate) fn stiffening_of_signal(&self) -> f64 {
        /// Number of currents at which the fall is evaluated.
        const CURRENTS: u8 = 32;
        /// Upper limit of the result: beyond it the attraction leaves a signal of less than a
        /// hundredth of the stiffening, and no measurement is possible.
        const MOST: f64 = 100.0;
        let actuated = &self.actuated;
        let at = |index: u8| {
            let current_a = actuated.peak_a * f64::from(index) / f64::from(CURRENTS);
            let h = actuated.regressor(current_a);
            let pull_n = actuated.attraction_n_per_a2 * current_a * current_a;
            let pulled_m = pull_n / self.sensing_n_per_m * (actuated.ratio + h);
            (h, h + pulled_m / self.depth_m)
        };
        of_signal((0..=CURRENTS).map(at)).abs().clamp(1.0, MOST)
    }

    /// kappa that an instrument with this calibration measures at the ends of a fall, on a sensor
    /// with the true layer `sensor`, pressed to a depth in m onto a load with the given kappa.
    pub(crate) fn reads(&self, sensor: &Self, kappa: f64, depth_m: f64) -> f64 {
        let peak_a = sensor.actuated.peak_a;
        let at_peak = |of: &Actuated| {
            let ratio = of.ratio + of.regressor(peak_a);
            let pull_m = of.attraction_n_per_a2 * peak_a * peak_a / self.sensing_n_per_m;
            (ratio, pull_m * ratio)
        };
        // At rest the deformation is the depth; at the peak x (W + h) + pull = depth W.
        let whole = 1.0 + kappa + sensor.actuated.ratio;
        let (ratio, pulled_m) = at_peak(&sensor.actuated);
        let true_m = (depth_m * whole - pulled_m) / (1.0 + kappa + ratio);
        let read_m = sensor.crosstalk.with(true_m, peak_a);
        let found_m = self.crosstalk.without(read_m, peak_a);
        // The equation of the deformation at the peak, solved for W, with the calibrated layer.
        let (ratio, pulled_m) = at_peak(&self.actuated);
        let h = ratio - self.actuated.ratio + pulled_m / found_m;
        h / (depth_m / found_m - 1.0) - 1.0 - self.actuated.ratio
    }
}

/// Relative error of the signal per relative error of h, from pairs of h and signal along a fall;
/// the signal is h with the attraction. The attraction reduces the signal, so the result exceeds
/// one. A train's line uses the whole fall, so the result is the slope of h against the signal.
pub(crate) fn of_signal(fall: impl Iterator<Item = (f64, f64)>) -> f64 {
    let points: Vec<(f64, f64)> = fall.collect();
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (mean_h, mean_signal) = (mean(|point| point.0), mean(|point| point.1));
    let sum = |of: &dyn Fn(f64, f64) -> f64| {
        let deviations = points.iter();
        let deviations = deviations.map(|(h, signal)| of(h - mean_h, signal - mean_signal));
        deviations.sum::<f64>()
    };
    sum(&|h, signal| h * signal) / sum(&|_, signal| signal * signal)
}

/// Adjusts the fit of all samples, with springs within a relative, uniform tolerance.
pub(crate) fn adjust(
    fit: &Fit,
    crosstalk: Crosstalk,
    tolerance: f64,
) -> Result<Adjusted, Unusable> {
    let fitted = Layer {
        actuated: fit.actuated.clone(),
        crosstalk,
        depth_m: fit.problem.depth_m,
        sensing_n_per_m: fit.problem.sensing_n_per_m,
    };
    let mut trains = Trains::new(fit, fitted, tolerance / 3_f64.sqrt())?;
    let mut changes = Changes::default();
    let mut scatter = LEAST_SCATTER;
    let mut slopes = Vec::new();
    for _ in 0..ROUNDS {
        slopes = trains.slopes(&changes)?;
        let solution;
        (scatter, solution) = trains.solve(&slopes, &changes)?;
        for (change, found) in changes.iter_mut().zip(&solution.unknowns) {
            *change = *found;
        }
        // With the changed quantities the trains' lines bend; their mean bend moves into h's shape.
        let layer = trains.fitted.changed(&changes);
        let of_signal = Bend::mean(&trains.bends(&layer)?);
        trains.fitted.actuated.bend += of_signal / layer.stiffening_of_signal();
    }
    let covariance = |tolerance: f64| {
        let system = trains.system(&slopes, &changes, scatter, tolerance);
        Ok(covariance(&system.solve(QUANTITIES_BY_LOADS)?))
    };
    let layer = trains.fitted.changed(&changes);
    Ok(Adjusted {
        scatter,
        covariance: covariance(trains.tolerance)?,
        covariance_of_exact_springs: covariance(EXACT)?,
        misses: trains.misses(&layer)?,
        bends: trains.bends(&layer)?,
        layer,
    })
}

/// Name of the adjustment's unknowns in error messages.
const QUANTITIES_BY_LOADS: &str = "the actuated layer by the loads";
/// Relative tolerance of springs that count as exact; not zero, since its inverse is a weight.
const EXACT: f64 = 1e-6;

/// Covariance of the quantities. Each weight must be one over the standard deviation itself, not
/// only proportional to it.
fn covariance(solution: &Solution) -> [Changes; QUANTITIES] {
    let variance = solution.sigma * solution.sigma;
    std::array::from_fn(|row| {
        std::array::from_fn(|column| solution.covariance[(row, column)] / variance)
    })
}

/// The trains, each as one measurement of its load.
struct Trains<'f> {
    trains: &'f [Train],
    /// The fitted layer. The samples are prepared with its cross-talk; the iteration changes only
    /// its bend.
    fitted: Layer,
    /// Standard error of each train's kappa.
    errors: Vec<f64>,
    /// Nominal kappa of the springs.
    springs: Vec<f64>,
    /// Relative standard deviation of a spring's error.
    tolerance: f64,
}

/// kappa of a train and its derivatives with respect to the quantities.
struct Slope {
    kappa: f64,
    by: Changes,
}

impl<'f> Trains<'f> {
    fn new(fit: &'f Fit, fitted: Layer, tolerance: f64) -> Result<Self, Unusable> {
        let trains = fit.problem.trains.as_slice();
        let mut springs: Vec<f64> = Vec::new();
        for train in trains {
            if train.spring && !springs.contains(&train.kappa) {
                springs.push(train.kappa);
            }
        }
        let error = |train: &Train| {
            let actuated = &fitted.actuated;
            actuated.standard_error(&train.samples, fitted.sensing_n_per_m, train.tau_s)
        };
        Ok(Self {
            trains,
            errors: trains.iter().map(error).collect::<Result<_, _>>()?,
            fitted,
            springs,
            tolerance: tolerance.max(EXACT),
        })
    }

    /// Solves for the changes and the error of each spring. Chooses the trains' scatter so that the
    /// sum of squares equals its expected value (Paule and Mandel, J. Res. Natl. Bur. Stand. 87,
    /// 1982, p. 377), but not below the minimum.
    fn solve(&self, slopes: &[Slope], changes: &Changes) -> Result<(f64, Solution), Unusable> {
        let solve = |scatter: f64| {
            let system = self.system(slopes, changes, scatter, self.tolerance);
            system.solve(QUANTITIES_BY_LOADS)
        };
        let (mut low, mut high) = (LEAST_SCATTER, MOST_SCATTER);
        let least = solve(low)?;
        if least.sigma <= 1.0 {
            return Ok((low, least));
        }
        while high > low * (1.0 + SCATTER_SETTLED) {
            let middle = (low * high).sqrt();
            if solve(middle)?.sigma > 1.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        Ok((high, solve(high)?))
    }

    fn slopes(&self, changes: &Changes) -> Result<Vec<Slope>, Unusable> {
        let prepared = &self.fitted.crosstalk;
        let layer = self.fitted.changed(changes);
        let stepped: Vec<(f64, Layer)> = STEPS
            .into_iter()
            .enumerate()
            .map(|(index, step)| {
                let mut changes = *changes;
                if let Some(change) = changes.get_mut(index) {
                    *change += step;
                }
                (step, self.fitted.changed(&changes))
            })
            .collect();
        self.trains
            .iter()
            .map(|train| {
                let kappa = layer.kappa(train, prepared)?;
                let mut by = Changes::default();
                for (slope, (step, layer)) in by.iter_mut().zip(&stepped) {
                    *slope = (layer.kappa(train, prepared)? - kappa) / step;
                }
                Ok(Slope { kappa, by })
            })
            .collect()
    }

    /// Equations for the changes and the error of each spring.
    fn system(&self, slopes: &[Slope], changes: &Changes, scatter: f64, tolerance: f64) -> System {
        let unknowns = QUANTITIES + self.springs.len();
        let mut system = System::new(unknowns);
        for ((train, slope), error) in self.trains.iter().zip(slopes).zip(&self.errors) {
            let is_own = |spring: &f64| train.spring && *spring == train.kappa;
            let springs = self.springs.iter();
            let springs = springs.map(|spring| if is_own(spring) { train.kappa } else { 0.0 });
            let row = slope.by.into_iter().chain(springs);
            let there = slope.by.iter().zip(changes);
            let there: f64 = there.map(|(slope, change)| slope * change).sum();
            let right = train.kappa - slope.kappa + there;
            let scattered = scattered(scatter, train.kappa, self.fitted.actuated.ratio);
            system.add(row, right, 1.0 / scattered.hypot(*error));
        }
        let crosstalk = self.fitted.crosstalk_at_peak().max(CARRIES_GROWTH);
        let of_crosstalk = OF_CROSSTALK.map(|part| part * crosstalk);
        let prior_deviations = [PRIOR_DEVIATION; 3].into_iter().chain(of_crosstalk);
        let springs = self.springs.iter().map(|_| tolerance);
        for (index, sigma) in prior_deviations.chain(springs).enumerate() {
            let row = (0..unknowns).map(|of| f64::from(u8::from(of == index)));
            system.add(row, 0.0, 1.0 / sigma);
        }
        system
    }

    fn bends(&self, layer: &Layer) -> Result<Vec<Bend>, Unusable> {
        let bend = |train: &Train| {
            let samples = layer.samples(train, &self.fitted.crosstalk);
            let actuated = &layer.actuated;
            actuated.bend(&samples, layer.sensing_n_per_m, train.tau_s)
        };
        self.trains.iter().map(bend).collect()
    }

    fn misses(&self, layer: &Layer) -> Result<Vec<(f64, f64)>, Unusable> {
        let miss = |train: &Train| {
            let found = layer.kappa(train, &self.fitted.crosstalk)?;
            Ok((train.kappa, found - train.kappa))
        };
        self.trains.iter().map(miss).collect()
    }
}

#[cfg(test)]
mod tests {
    use palpate_sim::random::Stream;

    use super::*;
    use crate::made::{self, RATIO, RISE, SENSING_N_PER_M, Sensor};

    /// Cross-talk of 2 µm at the peak, which grows by a half over the deepest press.
    const SENSOR: Sensor = Sensor {
        untouched_m_per_a2: 2e-8,
        growth_per_m: 1e3,
    };

    /// The true layer with errors added to its quantities.
    fn layer(errors: &Changes) -> Layer {
        let exact = made::problem(&Sensor::EXACT, made::KAPPAS, &mut || 0.0);
        let fit = exact.fit().unwrap();
        let layer = Layer {
            actuated: fit.actuated,
            crosstalk: Crosstalk {
                untouched_m_per_a2: SENSOR.untouched_m_per_a2,
                growth_per_m: SENSOR.growth_per_m,
            },
            depth_m: fit.problem.depth_m,
            sensing_n_per_m: SENSING_N_PER_M,
        };
        layer.changed(errors)
    }

    /// A wrong fit to trains whose readings and springs are otherwise exact.
    fn fitted(layer: &Layer, trains: Vec<Train>) -> Fit {
        let mut fit = made::problem(&Sensor::EXACT, made::KAPPAS, &mut || 0.0)
            .fit()
            .unwrap();
        fit.actuated = layer.actuated.clone();
        fit.problem.trains = trains;
        for sample in fit
            .problem
            .trains
            .iter_mut()
            .flat_map(|train| &mut train.samples)
        {
            sample.deformation_m = layer
                .crosstalk
                .without(sample.deformation_m, sample.current_a);
        }
        fit
    }

    #[test]
    fn errors_of_all_five_quantities_and_of_the_bend_are_found() {
        let mut wrong = layer(&Changes::default());
        wrong.actuated.ratio *= 1.1;
        wrong
            .actuated
            .regressor
            .iter_mut()
            .for_each(|term| *term *= 0.95);
        wrong.actuated.bend = 0.1;
        wrong.actuated.attraction_n_per_a2 *= 1.1;
        wrong.crosstalk.untouched_m_per_a2 *= 1.05;
        wrong.crosstalk.growth_per_m *= 0.8;
        let trains = made::problem(&SENSOR, made::KAPPAS, &mut || 0.0).trains;
        let fit = fitted(&wrong, trains);
        let adjusted = adjust(&fit, wrong.crosstalk, 0.01).unwrap();
        let layer = &adjusted.layer;
        let square_a2 = made::PEAK_A * made::PEAK_A;
        let figures = [
            ("c_S/c_D0", layer.actuated.ratio, RATIO),
            ("rise", layer.actuated.rise(made::PEAK_A), RISE),
            (
                "attraction, N",
                layer.actuated.attraction_n_per_a2 * square_a2,
                made::ATTRACTION_N_PER_A2 * square_a2,
            ),
            (
                "cross-talk, m",
                layer.crosstalk.untouched_m_per_a2 * square_a2,
                2e-6,
            ),
            ("growth, 1/m", layer.crosstalk.growth_per_m, 1e3),
            ("1 + bend", 1.0 + layer.actuated.bend, 1.0),
        ];
        for (name, found, truth) in figures {
            println!("{name}: {found}, true {truth}");
            assert!(
                (found / truth - 1.0).abs() < 0.01,
                "{name}: {found} {truth}"
            );
        }
    }

    #[test]
    fn an_error_of_the_stiffening_counts_more_where_the_attraction_takes_from_it() {
        let exact = layer(&Changes::default());
        // An attraction that takes four tenths of the stiffening's signal.
        let h = exact.actuated.regressor(made::PEAK_A).abs();
        let layer = exact.changed(&[0.0, 0.0, 0.4 * h / RATIO, 0.0, 0.0]);
        let step = 1e-4;
        let wrong = layer.changed(&[0.0, step, 0.0, 0.0, 0.0]);
        for kappa in [0.2, 1.0, 5.0] {
            let moved = (wrong.reads(&layer, kappa, 0.3e-3) - kappa) / step;
            let counted = (1.0 + kappa + RATIO) * layer.stiffening_of_signal();
            println!("{kappa}: {moved} {counted}");
            assert!(
                (moved / counted - 1.0).abs() < 0.1,
                "{kappa}: {moved} {counted}"
            );
            assert!(moved > 1.5 * (1.0 + kappa + RATIO));
        }
    }

    #[test]
    fn a_train_that_is_noisy_counts_less() {
        let exact = layer(&Changes::default());
        // One train in three has a hundred times the noise of the others, as on a bench that shakes
        // during some trains.
        let trains = |noisy: f64| {
            let mut stream = Stream::named(7, "bench");
            let presses = made::KAPPAS.into_iter();
            let presses = presses.flat_map(|kappa| made::DEPTHS_M.map(|depth_m| (kappa, depth_m)));
            let trains = presses.enumerate().map(|(index, press)| {
                let sigma_m = if index % 3 == 0 { noisy } else { 1e-8 };
                let mut off_m = || sigma_m * stream.normal();
                made::train_of(6, &Sensor::EXACT, press, &mut off_m)
            });
            trains.collect::<Vec<Train>>()
        };
        let none = Crosstalk {
            untouched_m_per_a2: 0.0,
            growth_per_m: 0.0,
        };
        let exact = Layer {
            crosstalk: none,
            ..exact
        };
        let [quiet, shaken] = [1e-8, 1e-6].map(|noisy| {
            let adjusted = adjust(&fitted(&exact, trains(noisy)), none, 0.01).unwrap();
            let error = adjusted.layer.actuated.ratio / RATIO - 1.0;
            println!("{error} {}", adjusted.scatter);
            (error, adjusted.covariance[0][0].sqrt())
        });
        // If all trains had equal weights, the error would be a quarter.
        assert!(shaken.0.abs() < 0.005, "{shaken:?}");
        assert!(quiet.0.abs() < 0.005, "{quiet:?}");
        assert!(shaken.0.abs() < 3.0 * shaken.1, "{shaken:?}");
    }

    /// Compares a load's error, from wrong springs and scattering trains, with the covariance.
    #[test]
    fn the_covariance_is_that_of_many_benches() {
        const TOLERANCE: f64 = 0.01;
        const SCATTER: f64 = 0.003;
        const BENCHES: u64 = 30;
        let exact = layer(&Changes::default());
        let loads = [0.0, 0.2, 1.0, 5.0];
        let (mut squares, mut promised) = ([0.0; 4], [0.0; 4]);
        for bench in 0..BENCHES {
            let mut stream = Stream::named(bench, "bench");
            let mut trains = Vec::new();
            for kappa in made::KAPPAS {
                let off = stream.between(1.0 - TOLERANCE, 1.0 + TOLERANCE);
                for depth_m in made::DEPTHS_M {
                    // A train's scatter acts like a change of its load.
                    let scatters = scattered(SCATTER, kappa, RATIO) * stream.normal();
                    let train = made::train(&SENSOR, kappa * off + scatters, depth_m, &mut || 0.0);
                    trains.push(Train {
                        kappa,
                        spring: kappa > 0.0,
                        ..train
                    });
                }
            }
            let fit = fitted(&exact, trains);
            let adjusted = adjust(&fit, exact.crosstalk, TOLERANCE).unwrap();
            for (index, kappa) in loads.into_iter().enumerate() {
                let reads = |layer: &Layer| layer.reads(&exact, kappa, 0.3e-3);
                squares[index] += (reads(&adjusted.layer) - kappa).powi(2);
                let slopes: Changes = std::array::from_fn(|quantity| {
                    let mut changes = Changes::default();
                    changes[quantity] = 1e-6;
                    (reads(&exact.changed(&changes)) - kappa) / 1e-6
                });
                promised[index] += (0..QUANTITIES)
                    .flat_map(|row| (0..QUANTITIES).map(move |column| (row, column)))
                    .map(|(row, column)| {
                        slopes[row] * adjusted.covariance[row][column] * slopes[column]
                    })
                    .sum::<f64>();
            }
        }
        for (index, kappa) in loads.into_iter().enumerate() {
            let ratio = (squares[index] / promised[index]).sqrt();
            println!("{kappa}: error over promise {ratio:.3}");
            // From 30 benches a standard deviation is known within an eighth.
            assert!((0.6..1.4).contains(&ratio), "{kappa}: {ratio}");
        }
    }
}
