//! Expected error of a press and its causes: the uncertainty that the bench leaves, the errors of
//! the press's own train, and temperature.

use super::bench::{PlannedBench, add, of_train, slopes};
use super::causes::{Cause, QUANTITIES};
use super::information::Information;
use super::line::TrainLine;

/// Half-width of a 95 % interval, in standard errors.
const NORMAL_975: f64 = 1.959_964;
/// Greatest depth of a press, in units of the bench's deepest train. Creep changes a depth by a
/// twentieth.
const BEYOND_BENCH: f64 = 1.08;
/// Smallest depth of a press, in units of the bench's shallowest train.
const WITHIN_BENCH: f64 = 0.95;

/// Standard deviations of kappa by errors of the calibration's model: the first relative to W, the
/// second relative to kappa. They are the errors of 15 sensors of [`ASSUMED_FROM`], at their
/// bench's temperature, in excess of all other causes (`cargo campaign efficiency --plants 16
/// --seed 830001 --bench-temperature`: 1.1, 1.6 and 4.5 % at 0.2, 1 and 5 c_S). They are assumed
/// for other designs too (docs/stiffness.md). They include creep that ends before a train, and
/// differences between stands.
const MODEL: [f64; 2] = [0.0035, 0.007];
/// Sensor design for which [`MODEL`] and [`CREEP`](super::bench::CREEP) were determined.
pub(super) const ASSUMED_FROM: &str = "ultrasoft";

/// A press in use.
#[derive(Clone, Copy, Debug)]
pub struct PlannedPress {
    /// Depth in units of the working depth.
    pub depth: f64,
    /// Temperature difference from the bench, K.
    pub away_k: f64,
}

/// Expected result of a press onto a load. Errors are standard errors of ln(c_L).
#[derive(Clone, Debug)]
pub struct ExpectedError {
    /// Load as c_L/c_S.
    pub load: f64,
    /// Standard error of ln(c_L) by all causes.
    pub standard_error_ln: f64,
    /// Standard error of ln(c_L) by each of [`Cause::ALL`].
    pub causes_ln: [f64; Cause::ALL.len()],
    /// For each calibrated quantity the part of the standard error that its exact knowledge would
    /// remove: root of the difference of the variances.
    pub quantities_ln: [f64; QUANTITIES],
    /// Half the width of the 95 % interval in ln(c_L); `None` where the interval has no upper end.
    pub half_width_ln: Option<f64>,
    /// Reason for which the instrument would refuse the press.
    pub refusal: Option<&'static str>,
}

impl ExpectedError {
    /// Cause with the largest variance.
    pub(crate) fn limit(&self) -> Cause {
        let causes = Cause::ALL.into_iter().zip(self.causes_ln);
        let most = causes.max_by(|one, other| one.1.total_cmp(&other.1));
        most.map_or(Cause::Conversions, |(cause, _)| cause)
    }
}

impl PlannedBench<'_> {
    /// Returns the line of a press: that of a bench's train at the same depth, or a new one.
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

    /// Derivatives of kappa of a press, c_S/c_L of its load, with respect to the unknowns.
    pub(super) fn row(&self, line: &TrainLine, kappa: f64) -> Vec<f64> {
        let mut row = vec![0.0; self.prior_variances.len()];
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

    /// Standard errors of ln(c_L) of presses onto loads, c_L/c_S.
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

    /// Expected result of a press onto each load, c_L/c_S.
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

    /// Expected result for one load. `exact` has the bench's information with one quantity each
    /// known exactly.
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

    /// Variance of kappa by the temperature coefficients, at `away_k` kelvin from the bench.
    fn of_temperature(&self, line: &TrainLine, kappa: f64, away_k: f64) -> f64 {
        let known = &self.sensor.known;
        // The coefficient is that of the rise; the relative change of h is smaller by 1 + rise.
        let rise = self.sensor.rise(self.settings.peak_current_a.into());
        let of_stiffening =
            self.sensor.whole(kappa) * line.of.stiffening * known.rise_per_k / (1.0 + rise);
        let of_springs = kappa * known.springs_per_k;
        away_k * away_k * (of_stiffening * of_stiffening + of_springs * of_springs)
    }

    /// Reason for which the instrument refuses a press; `None` if it does not. `of_slope` is the
    /// relative error of the slope by noise, `standard_error_ln` the total error of the stiffness.
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
