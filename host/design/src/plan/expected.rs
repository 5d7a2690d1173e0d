//! The error that a press is expected to have, and what it comes from: what the bench leaves open, the errors of the press's own
//! train, and the temperature's.

use super::bench::{PlannedBench, add, of_train, slopes};
use super::causes::{Cause, QUANTITIES};
use super::information::Information;
use super::line::TrainLine;

/// Half of an interval of 95 %, in standard errors.
const NORMAL_975: f64 = 1.959_964;
/// The deepest press of the bench goes so many times deeper than its trains, and a press in use a twentieth less deep than its
/// shallowest: what creep does to one.
const BEYOND_BENCH: f64 = 1.08;
const WITHIN_BENCH: f64 = 0.95;

/// What the calibration's model leaves out of a press, standard deviations as parts of W and of kappa: by so much the errors of 15
/// sensors of [`ASSUMED_FROM`] at their bench's temperature were above all else (`cargo campaign efficiency --plants 16 --seed 830001
/// --bench-temperature`: 1.1, 1.6 and 4.5 % at 0.2, 1 and 5 c_S). For other stacks the same is assumed (docs/stiffness.md). Creep that is over before a train, and what a stand differs by, are in it.
const MODEL: [f64; 2] = [0.0035, 0.007];
/// The stack with which that and [`CREEP`](super::bench::CREEP) were found.
pub(super) const ASSUMED_FROM: &str = "ultrasoft";

/// A press in use.
#[derive(Clone, Copy, Debug)]
pub struct PlannedPress {
    /// In units of the working depth.
    pub depth: f64,
    /// Temperature away from the bench's, K.
    pub away_k: f64,
}

/// What a press upon a load is expected to come to. Errors are standard errors of ln(c_L).
#[derive(Clone, Debug)]
pub struct ExpectedError {
    /// c_L/c_S.
    pub load: f64,
    /// Of the estimate.
    pub standard_error_ln: f64,
    /// By each of [`Cause::ALL`].
    pub causes_ln: [f64; Cause::ALL.len()],
    /// What knowing each of the calibrated quantities exactly would take off: root of the difference of the variances.
    pub quantities_ln: [f64; QUANTITIES],
    /// Half the width of the 95 % interval in ln(c_L); nothing where it has no upper end.
    pub half_width_ln: Option<f64>,
    /// Why the instrument would refuse the press.
    pub refusal: Option<&'static str>,
}

impl ExpectedError {
    /// The cause of most of the variance.
    pub(crate) fn limit(&self) -> Cause {
        let causes = Cause::ALL.into_iter().zip(self.causes_ln);
        let most = causes.max_by(|one, other| one.1.total_cmp(&other.1));
        most.map_or(Cause::Conversions, |(cause, _)| cause)
    }
}

impl PlannedBench<'_> {
    /// The line of a press; that of a bench's train as deep is the same.
    fn line(&self, press: &PlannedPress) -> Option<TrainLine> {
        let deformation_m = press.depth * self.sensor.depth_m;
        let of_bench = self
            .lines
            .iter()
            .find(|line| line.deformation_m == deformation_m);
        let new = || {
            TrainLine::new(
                self.sensor,
                &self.settings,
                &self.conversions,
                deformation_m,
            )
        };
        of_bench.cloned().or_else(new)
    }

    /// How a press upon a load, c_S/c_L, changes with the unknowns.
    pub(super) fn row(&self, line: &TrainLine, kappa: f64) -> Vec<f64> {
        let mut row = vec![0.0; self.beforehand.len()];
        row.splice(..QUANTITIES, slopes(self.sensor, line, kappa));
        row
    }

    /// Variances of kappa = c_S/c_L of a press, by [`Cause::ALL`].
    fn variances(
        &self,
        line: &TrainLine,
        kappa: f64,
        away_k: f64,
    ) -> Option<[f64; Cause::ALL.len()]> {
        let mut causes = self.of_bench(&self.row(line, kappa))?;
        for (cause, variance) in Cause::OF_TRAIN
            .into_iter()
            .zip(of_train(self.sensor, line, kappa))
        {
            add(&mut causes, cause, variance);
        }
        let gain = self.sensor.known.load_cell_gain.unwrap_or(0.0) / 3_f64.sqrt();
        add(&mut causes, Cause::LoadCell, (gain * kappa).powi(2));
        add(
            &mut causes,
            Cause::Temperature,
            self.of_temperature(line, kappa, away_k),
        );
        let [of_whole, of_load] = MODEL;
        let left_out = (of_whole * self.sensor.whole(kappa)).hypot(of_load * kappa);
        add(&mut causes, Cause::Model, left_out * left_out);
        Some(causes)
    }

    /// Standard errors of ln(c_L) of presses upon loads, c_L/c_S.
    pub fn standard_errors_ln<const N: usize>(
        &self,
        loads: [f64; N],
        press: &PlannedPress,
    ) -> Option<[f64; N]> {
        let line = self.line(press)?;
        let mut errors_ln = [0.0; N];
        for (error, load) in errors_ln.iter_mut().zip(loads) {
            let variances = self.variances(&line, 1.0 / load, press.away_k)?;
            *error = variances.iter().sum::<f64>().sqrt() * load;
        }
        Some(errors_ln)
    }

    /// What a press upon each load, c_L/c_S, is expected to come to.
    pub fn expected(&self, loads: &[f64], press: &PlannedPress) -> Option<Vec<ExpectedError>> {
        let line = self.line(press)?;
        let exact: Vec<Information> = (0..QUANTITIES)
            .map(|unknown| self.informed(Some(unknown)))
            .collect();
        loads
            .iter()
            .map(|load| self.expected_of(*load, press, &line, &exact))
            .collect()
    }

    /// The same of one load; `exact` is what the bench would say if it gave each quantity exactly.
    fn expected_of(
        &self,
        load: f64,
        press: &PlannedPress,
        line: &TrainLine,
        exact: &[Information],
    ) -> Option<ExpectedError> {
        let kappa = 1.0 / load;
        let row = self.row(line, kappa);
        let causes = self.variances(line, kappa, press.away_k)?;
        let of_bench = self.information.variance(&row)?;
        let mut quantities_ln = [0.0; QUANTITIES];
        for (value, exact) in quantities_ln.iter_mut().zip(exact) {
            *value = (of_bench - exact.variance(&row)?).max(0.0).sqrt() / kappa;
        }
        let standard_error = causes.iter().sum::<f64>().sqrt();
        let reach = NORMAL_975 * standard_error;
        let noise = of_train(self.sensor, line, kappa)
            .iter()
            .sum::<f64>()
            .sqrt();
        Some(ExpectedError {
            load,
            standard_error_ln: standard_error / kappa,
            causes_ln: causes.map(|variance| variance.sqrt() / kappa),
            quantities_ln,
            half_width_ln: (reach < kappa).then(|| 0.5 * ((kappa + reach) / (kappa - reach)).ln()),
            refusal: self.refusal(
                press,
                noise / self.sensor.whole(kappa),
                standard_error / kappa,
            ),
        })
    }

    /// Variance of kappa by the temperature's coefficients, so many kelvins away from the bench.
    fn of_temperature(&self, line: &TrainLine, kappa: f64, away_k: f64) -> f64 {
        let known = &self.sensor.known;
        // The coefficient is the rise's: h changes by less.
        let rise = self.sensor.rise(self.settings.peak_current_a.into());
        let of_stiffening =
            self.sensor.whole(kappa) * line.of.stiffening * known.rise_per_k / (1.0 + rise);
        let of_springs = kappa * known.springs_per_k;
        away_k * away_k * (of_stiffening * of_stiffening + of_springs * of_springs)
    }

    /// Why the instrument refuses a press whose slope has a relative error by noise, and its stiffness one in all.
    fn refusal(
        &self,
        press: &PlannedPress,
        of_slope: f64,
        standard_error_ln: f64,
    ) -> Option<&'static str> {
        let depths = &self.sensor.bench_depths;
        let shallowest = depths.iter().copied().fold(f64::INFINITY, f64::min);
        let deepest = depths.iter().copied().fold(0.0, f64::max);
        if press.depth < WITHIN_BENCH * shallowest {
            Some("pressed_too_little")
        } else if press.depth > BEYOND_BENCH * deepest {
            Some("pressed_too_far")
        } else if of_slope * NORMAL_975 > 1.0 {
            Some("signal_too_small")
        } else if standard_error_ln > f64::from(self.settings.greatest_error) {
            Some("too_uncertain")
        } else {
            None
        }
    }
}
