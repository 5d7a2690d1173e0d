//! Fit of a line to one train, which gives its load.
//!
//! x (1 + kappa + g) = x_0 (1 + d phi(t) + e t), with g the compliance of the actuated layer over
//! that of the sensing layer. Like the [fit of all trains](super::actuated), the iteration
//! minimises the squares of the deformations' residuals, so that no coefficient contains noise.

use super::Unusable;
use super::actuated_layer::Actuated;
use super::least_squares::System;

/// Maximum number of steps of the iteration from its start, the solution of the linear equation:
/// trains of the shipped designs take four, with four times their noise nine.
pub(crate) const MOST_STEPS: usize = 20;
/// The iteration ends when a step changes 1 + c_S/c_L of a train, or c_S/c_D0, by less than this,
/// relative: the effect on a load is a ten-thousandth of the smallest uncertainty.
pub(crate) const SETTLED: f64 = 1e-7;

/// A sample of a fall.
#[derive(Clone, Copy, Debug)]
pub struct FallSample {
    /// Time since the start of the train, s.
    pub time_s: f64,
    /// Deformation without the cross-talk, m.
    pub deformation_m: f64,
    /// Effective current over the conversion, A.
    pub current_a: f64,
}

impl Actuated {
    /// Compliance to add to 1 + kappa: g(I), with the attraction as a compliance.
    pub fn compliance(&self, sample: &FallSample, sensing_n_per_m: f64) -> f64 {
        let ratio_now = self.ratio + self.regressor(sample.current_a);
        let pull_n = self.attraction_n_per_a2 * sample.current_a.powi(2);
        ratio_now + pull_n * ratio_now / sensing_n_per_m / sample.deformation_m
    }

    /// The samples of a train as points of its line.
    fn points(&self, samples: &[FallSample], sensing_n_per_m: f64, tau_s: f64) -> Vec<LinePoint> {
        let point = |sample: &FallSample| {
            let compliance = self.compliance(sample, sensing_n_per_m);
            LinePoint::new(sample.time_s, tau_s, sample.deformation_m, compliance)
        };
        samples.iter().map(point).collect()
    }

    /// Fits the bend of a train's line.
    pub(crate) fn bend(
        &self,
        samples: &[FallSample],
        sensing_n_per_m: f64,
        tau_s: f64,
    ) -> Result<Bend, Unusable> {
        let points = self.points(samples, sensing_n_per_m, tau_s);
        let line = TrainFit::of(&points)?;
        let depth_m = mean_m(points.iter().map(|point| point.deformation_m));
        let mut system = System::new(5);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for point in &points {
            let h = point.compliance - self.ratio;
            (low, high) = (low.min(h), high.max(h));
            let (row, residual) = line.linearised(point, depth_m);
            let bent = line.by_compliance(point) * h * h;
            system.add(row.into_iter().chain([bent]), residual, 1.0 / depth_m);
        }
        let solved = system.solve("the bend of a train by itself")?;
        // h is zero or negative, and its span counts as negative too.
        let span = low - high;
        Ok(Bend {
            value: solved.unknowns.last().copied().unwrap_or(0.0) * span,
            variance: solved.covariance[(4, 4)] * span * span,
        })
    }

    /// Fits a line to one train; `tau_s` is the age of the press at the start of the train, s.
    ///
    /// # Errors
    /// If the samples do not determine the line.
    pub fn line(
        &self,
        samples: &[FallSample],
        sensing_n_per_m: f64,
        tau_s: f64,
    ) -> Result<TrainFit, Unusable> {
        TrainFit::of(&self.points(samples, sensing_n_per_m, tau_s))
    }

    /// Standard error of kappa by a train's own line, from the scatter between its falls: noise and
    /// movements of the sensor are independent between falls, and arbitrary within one (Liang and
    /// Zeger, Biometrika 73, 1986, p. 13).
    ///
    /// The scatter is that about a slow change: while the layers creep and warm, the slopes of the
    /// falls change smoothly, by 2.5 % of W from the first fall to the last
    /// (simulated sensors of the design `ultrasoft`, seeds 2100001 to 2100050).
    pub(crate) fn standard_error(
        &self,
        samples: &[FallSample],
        sensing_n_per_m: f64,
        tau_s: f64,
    ) -> Result<f64, Unusable> {
        /// Index of kappa among the unknowns.
        const KAPPA: usize = 2;
        let points = self.points(samples, sensing_n_per_m, tau_s);
        let line = TrainFit::of(&points)?;
        let depth_m = mean_m(points.iter().map(|point| point.deformation_m));
        let rows: Vec<_> = points
            .iter()
            .map(|point| line.linearised(point, depth_m))
            .collect();
        let mut system = System::new(4);
        for (row, residual) in &rows {
            system.add(*row, *residual, 1.0);
        }
        let solved = system.solve(TRAIN)?;
        let variance = solved.sigma * solved.sigma;
        // Contribution of a sample's error to kappa.
        let moved = |(row, residual): &([f64; 4], f64)| {
            let terms = row.iter().enumerate();
            let terms = terms.map(|(place, entry)| solved.covariance[(KAPPA, place)] * entry);
            terms.sum::<f64>() / variance * residual
        };
        // The current rises between two falls.
        let falls = samples.chunk_by(|before, after| after.current_a < before.current_a);
        let mut rows = rows.iter();
        let of_falls: Vec<f64> = falls
            .map(|fall| rows.by_ref().take(fall.len()).map(moved).sum())
            .collect();
        let each = scatter_about_parabola(&of_falls)?;
        Ok(each * (of_falls.len() as f64).sqrt())
    }
}

/// Standard deviation of values about a parabola over their index, about a simpler curve if they are
/// three or fewer; zero for a single value.
fn scatter_about_parabola(values: &[f64]) -> Result<f64, Unusable> {
    let terms = values.len().saturating_sub(1).min(3);
    if terms == 0 {
        return Ok(0.0);
    }
    let mut system = System::new(terms);
    for (index, value) in values.iter().enumerate() {
        let from_middle = index as f64 - 0.5 * (values.len() - 1) as f64;
        system.add([1.0, from_middle, from_middle.powi(2)], *value, 1.0);
    }
    Ok(system.solve(TRAIN)?.sigma)
}

/// Relative change of a line's slope from the middle to the peak of its span of h.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bend {
    pub(crate) value: f64,
    pub(crate) variance: f64,
}

impl Bend {
    /// Mean of the bends, each weighted by the inverse of its variance.
    pub(crate) fn mean(bends: &[Self]) -> f64 {
        let (sum, weights) = bends.iter().fold((0.0, 0.0), |(sum, weights), bend| {
            (
                sum + bend.value / bend.variance,
                weights + 1.0 / bend.variance,
            )
        });
        sum / weights
    }

    /// Root mean square, without the contribution of noise.
    pub(crate) fn root_mean_square(bends: &[Self]) -> f64 {
        let squares = bends
            .iter()
            .map(|bend| bend.value * bend.value - bend.variance);
        let count = bends.len().max(1) as f64;
        (squares.sum::<f64>() / count).max(0.0).sqrt()
    }
}

/// Mean of deformations, m.
pub(crate) fn mean_m(deformations_m: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = deformations_m.len().max(1) as f64;
    deformations_m.sum::<f64>() / count
}

/// A sample of a train with the compliance to add to 1 + kappa.
#[derive(Clone, Copy, Debug)]
pub struct LinePoint {
    /// Time since the start of the train, s.
    pub time_s: f64,
    /// Deformation without the cross-talk, m.
    pub deformation_m: f64,
    /// c_S/c_D(I), with the attraction as a compliance.
    pub compliance: f64,
    /// phi(t).
    phi: f64,
}

impl LinePoint {
    /// Point of a train; `tau_s` is the age of the press at the start of the train, s.
    pub fn new(time_s: f64, tau_s: f64, deformation_m: f64, compliance: f64) -> Self {
        Self {
            time_s,
            deformation_m,
            compliance,
            phi: (time_s / tau_s).ln_1p(),
        }
    }

    /// Equation of the point: coefficients (total travel over `depth_m` and its drifts, kappa),
    /// right side and weight.
    fn row(&self, depth_m: f64) -> ([f64; 4], f64, f64) {
        let level = depth_m / self.deformation_m;
        let right = 1.0 + self.compliance;
        // Noise of x changes the equation by x_0/x^2 times the noise.
        let weight = (level * level).recip();
        let row = [level, level * self.phi, -1.0, level * self.time_s];
        (row, right, weight)
    }
}

/// Name of a train's line in errors.
const TRAIN: &str = "a train by itself";

/// Fit of x (1 + kappa + g) = x_0 (1 + d phi(t) + e t) to a train.
#[derive(Clone, Copy, Debug, Default)]
pub struct TrainFit {
    /// Total travel x_0, m.
    pub total_m: f64,
    /// Logarithmic drift d.
    pub drift: f64,
    /// Linear drift, 1/s.
    pub linear: f64,
    /// Load as c_S/c_L.
    pub kappa: f64,
}

impl TrainFit {
    /// Fits a line to the points of one train.
    ///
    /// # Errors
    /// If the points do not determine the line.
    pub fn of(points: &[LinePoint]) -> Result<Self, Unusable> {
        let depth_m = mean_m(points.iter().map(|point| point.deformation_m));
        let mut system = System::new(4);
        for point in points {
            let (row, right, weight) = point.row(depth_m);
            system.add(row, right, weight);
        }
        let mut line = Self::default().changed(&system.solve(TRAIN)?.unknowns, depth_m)?;
        for _ in 0..MOST_STEPS {
            let mut system = System::new(4);
            for point in points {
                let (row, residual) = line.linearised(point, depth_m);
                system.add(row, residual, 1.0 / depth_m);
            }
            let before = line.kappa;
            line = line.changed(&system.solve(TRAIN)?.unknowns, depth_m)?;
            if (line.kappa - before).abs() <= SETTLED * (1.0 + line.kappa.abs()) {
                return Ok(line);
            }
        }
        Err(Unusable::Undetermined(TRAIN))
    }

    /// Applies changes of the unknowns: total travel over `depth_m` and its drifts, with kappa as
    /// the third.
    fn changed(&self, changes: &[f64], depth_m: f64) -> Result<Self, Unusable> {
        let &[total, drift, kappa, linear] = changes else {
            return Err(Unusable::Undetermined(TRAIN));
        };
        let total_m = self.total_m + total * depth_m;
        let of_total = |part: f64, change: f64| (part * self.total_m + change * depth_m) / total_m;
        Ok(Self {
            total_m,
            drift: of_total(self.drift, drift),
            linear: of_total(self.linear, linear),
            kappa: self.kappa + kappa,
        })
    }

    /// Derivatives of the deformation with respect to the unknowns, and its residual, m.
    fn linearised(&self, point: &LinePoint, depth_m: f64) -> ([f64; 4], f64) {
        let by_total = depth_m / self.whole(point);
        let row = [
            by_total,
            by_total * point.phi,
            self.by_compliance(point),
            by_total * point.time_s,
        ];
        (row, point.deformation_m - self.deformation_m(point))
    }

    /// 1 + kappa + g at a point.
    fn whole(&self, point: &LinePoint) -> f64 {
        1.0 + self.kappa + point.compliance
    }

    /// Deformation of the line at a point, m.
    fn deformation_m(&self, point: &LinePoint) -> f64 {
        self.total_m * self.drifted(point) / self.whole(point)
    }

    /// Derivative of the deformation with respect to g, m.
    fn by_compliance(&self, point: &LinePoint) -> f64 {
        -self.deformation_m(point) / self.whole(point)
    }

    /// 1 + d phi(t) + e t.
    pub fn drifted(&self, point: &LinePoint) -> f64 {
        1.0 + self.drift * point.phi + self.linear * point.time_s
    }

    /// 1/x without drift at a compliance, 1/m.
    pub fn inverse_per_m(&self, compliance: f64) -> f64 {
        (1.0 + self.kappa + compliance) / self.total_m
    }
}

#[cfg(test)]
mod tests {
    use palpate_sim::random::Stream;

    use crate::actuated_layer::Actuated;
    use crate::made::{
        ATTRACTION_N_PER_A2, KAPPAS, PEAK_A, RATIO, RISE, SENSING_N_PER_M, Sensor, mean, noise,
        problem, train, train_of,
    };

    const DEPTH_M: f64 = 0.3e-3;

    fn exact() -> Actuated {
        let problem = problem(&Sensor::EXACT, KAPPAS, &mut || 0.0);
        problem.fit().unwrap().actuated
    }

    #[test]
    fn noise_of_the_readings_does_not_turn_the_line_of_a_train() {
        let exact = exact();
        for kappa in [0.2, 1.0, 5.0] {
            let load_ratio = |seed| {
                let train = train(&Sensor::EXACT, kappa, DEPTH_M, &mut noise(seed));
                let line = exact.line(&train.samples, SENSING_N_PER_M, train.tau_s);
                line.unwrap().kappa
            };
            let found: Vec<f64> = (0..40).map(load_ratio).collect();
            let (mean, error) = mean(&found);
            println!("{kappa}: {mean} +- {error}");
            assert!(
                (mean - kappa).abs() < 4.0 * error,
                "{kappa}: {mean} +- {error}"
            );
        }
    }

    #[test]
    fn noise_of_the_readings_does_not_bend_the_line_of_a_train() {
        let exact = exact();
        for kappa in [0.2, 1.0, 5.0] {
            let bend = |seed| {
                let train = train(&Sensor::EXACT, kappa, DEPTH_M, &mut noise(seed));
                exact.bend(&train.samples, SENSING_N_PER_M, train.tau_s)
            };
            let bends: Vec<_> = (0..40).map(|seed| bend(seed).unwrap()).collect();
            let values: Vec<f64> = bends.iter().map(|bend| bend.value).collect();
            let (mean, error) = mean(&values);
            let promised = (bends[0].variance / 40.0).sqrt();
            println!("{kappa}: {mean} +- {error}, promised {promised}");
            assert!(mean.abs() < 4.0 * error, "{kappa}: {mean} +- {error}");
            // From 40 trains a standard deviation is known within a ninth.
            assert!((0.7..1.4).contains(&(error / promised)), "{kappa}: {error}");
        }
    }

    /// Standard deviation of kappa over 60 trains of twelve falls with the errors `off_m`, and the
    /// root mean square of the stated standard error.
    fn spread<N: FnMut() -> f64>(off_m: impl Fn(u64) -> N) -> (f64, f64) {
        const TRAINS: u64 = 60;
        let exact = exact();
        let (mut found, mut squares) = (Vec::new(), 0.0);
        for seed in 0..TRAINS {
            let train = train_of(12, &Sensor::EXACT, (1.0, DEPTH_M), &mut off_m(seed));
            let line = exact.line(&train.samples, SENSING_N_PER_M, train.tau_s);
            found.push(line.unwrap().kappa);
            let error = exact.standard_error(&train.samples, SENSING_N_PER_M, train.tau_s);
            squares += error.unwrap().powi(2);
        }
        let (_, of_mean) = mean(&found);
        let trains = TRAINS as f64;
        (of_mean * trains.sqrt(), (squares / trains).sqrt())
    }

    #[test]
    fn the_standard_error_of_a_line_is_its_spread_whatever_moves_it_within_a_fall() {
        /// Samples of one fall.
        const FALL: u32 = 100;
        let white = spread(noise);
        // Each fall tilts by a different amount, as under slow vibration.
        let tilted = spread(|seed| {
            let mut stream = Stream::named(seed, "tilt");
            let (mut index, mut tilt_m) = (0, 0.0);
            move || {
                if index % FALL == 0 {
                    tilt_m = 1e-6 * stream.normal();
                }
                index += 1;
                tilt_m * f64::from(index % FALL) / f64::from(FALL)
            }
        });
        // All falls tilt more and more, as when the layers warm: that is no scatter.
        let warming = spread(|seed| {
            let (mut noise, mut index) = (noise(seed), 0);
            move || {
                let (fall, within) = (index / FALL, index % FALL);
                index += 1;
                noise() + 0.1e-6 * f64::from(fall) * f64::from(within) / f64::from(FALL)
            }
        });
        for (name, (spread, promised)) in
            [("white", white), ("tilted", tilted), ("warming", warming)]
        {
            println!("{name}: {spread}, promised {promised}");
            // From 60 trains a standard deviation is known within a tenth; the fit of the three
            // unknowns beside kappa to twelve falls makes the residuals smaller by a seventh.
            let ratio = spread / promised;
            assert!((0.75..1.35).contains(&ratio), "{name}: {ratio}");
        }
    }

    #[test]
    fn a_line_bends_by_what_the_stiffening_is_bent() {
        let exact = exact();
        // The attraction reduces the signal, but not its bend.
        let h = -RATIO * RISE / (1.0 + RISE);
        let pulled_m = ATTRACTION_N_PER_A2 * PEAK_A * PEAK_A / SENSING_N_PER_M * (RATIO + h);
        let of_signal = h / (h + pulled_m / DEPTH_M);
        for (bend, kappa) in [(0.01, 0.2), (-0.01, 5.0)] {
            let bent = Actuated {
                bend,
                ..exact.clone()
            };
            let train = train(&Sensor::EXACT, kappa, DEPTH_M, &mut || 0.0);
            let found = bent.bend(&train.samples, SENSING_N_PER_M, train.tau_s);
            let (found, expected) = (found.unwrap().value, -bend * of_signal);
            assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
        }
    }
}
