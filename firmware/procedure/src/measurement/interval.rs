//! Computes the estimate and its interval from the sums.

use palpate_model::magnetorheological::{self, Stiffening};
use palpate_model::math::{exp_m1, hypot, sqrt};
use palpate_model::ramp::{
    Bend, Fit, LoadCurvePoint, LoadRatio, LoadStiffness, RampRefusal, Reference, SLOPE_BY_BEND,
};
use palpate_model::uncertainty::{Budget, Calibration, OperatingPoint};
use palpate_model::units::{Ampere, Celsius, Metre, Newton, NewtonPerMetre};
use palpate_wire::code::RefusalReason;
use palpate_wire::command::{Settings, TemperatureEffect};
use palpate_wire::record::{Estimate, LoadPoint, Refusal, UncertaintyBudget};

use super::{Measurement, Reason, refusal};
use crate::configuration::Calibrated;
use crate::time::{Instant, seconds};

/// Outcome of a measurement.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one of it, and no heap to put the larger one on"
)]
pub(crate) enum MeasurementOutcome {
    Estimate(EstimateReport),
    Refusal(Refusal),
}

/// Estimate and load curve, whose points are computed one by one.
#[derive(Clone, Debug)]
pub(crate) struct EstimateReport {
    pub(crate) estimate: Estimate,
    curve: Option<LoadCurve>,
}

/// Load curve along the train.
#[derive(Clone, Debug)]
struct LoadCurve {
    fit: Fit,
    sensing: NewtonPerMetre,
    total: Metre,
    regressors: (f32, f32),
    /// Force in the middle of the ramps.
    middle: Newton,
    /// Standard error of c_S/c_L that the calibration causes: such an error rotates the curve about its
    /// middle.
    of_calibration: f32,
    /// Ratio of the noise that the scatter of the ramps shows to the noise that the fit assumes.
    scatter: f32,
    /// Number of points to report.
    points: u8,
}

impl Measurement {
    /// Ends with an estimate or a refusal.
    pub(crate) fn finish(&mut self, settings: &Settings, now: Instant) -> MeasurementOutcome {
        let number = self.number;
        match self.conclude(settings, now) {
            Ok(report) => MeasurementOutcome::Estimate(report),
            Err(reason) => MeasurementOutcome::Refusal(refusal(number, reason)),
        }
    }

    fn conclude(&mut self, settings: &Settings, now: Instant) -> Result<EstimateReport, Reason> {
        let (completed, began) = (self.drive.train().completed(), self.drive.began);
        let ramps = self.ramps.as_mut().ok_or(Reason::new(
            RefusalReason::TooFewSamples,
            Some(0.0),
            Some(4.0),
        ))?;
        let (fit, curved) = ramps.solve()?;
        let ratio = fit.load_ratio()?;
        let scatter = ramps.scatter().of_mean().unwrap_or(1.0).max(1.0);
        let of_noise = widened(&ratio, scatter);
        let reference = *ramps.reference();
        let at = operating_point(&self.calibrated, &reference, settings);
        let mut calibration = uncertainties(&self.calibrated, &of_noise, &at, settings);
        let Metre(calibrated_m) = calibration.zero;
        calibration.zero = Metre(sqrt(calibrated_m * calibrated_m + self.zero.variance_m2));
        let temperature = of_temperature(&self.calibrated);
        let uncorrected = uncorrected(&self.calibrated).budget(of_noise.value, &at);
        let uncorrected = uncorrected.force_scale + uncorrected.stiffening;
        let bend = curved.and_then(|curved| Bend::of(&fit, &curved, ramps.span()));
        // The same temperature difference causes the errors of springs and rise, so the two add
        // linearly.
        let claim = temperature
            .widen(&calibration.widen(&of_noise, &at), &at)
            .with_uncertainty(uncorrected);
        let sensing = NewtonPerMetre(self.calibrated.springs.sensing_n_per_m);
        claim.stiffness(sensing)?;
        let usual = self.calibrated.springs.bend;
        let straight = claim.standard_error;
        let claim = with_misfit(claim, bend, (scatter, usual), &at)?;
        let of_calibration = calibration.budget(of_noise.value, &at);
        let of_temperature = temperature.budget(claim.value, &at);
        let budget = UncertaintyBudget {
            measurement: self.number,
            noise: of_noise.standard_error,
            springs: of_calibration.springs(),
            stiffening: hypot(of_calibration.stiffening, of_calibration.current),
            zero: of_calibration.zero,
            temperature: hypot(of_temperature.total(), uncorrected),
            bend: root_of_rest(claim.standard_error, straight),
            off_calibration_k: off_calibration_k(&self.calibrated),
        };
        self.budget = budget.validate().is_ok().then_some(budget);
        let claim = match (
            &self.calibrated.temperature_coefficients,
            self.calibrated.temperature,
        ) {
            (None, Some(_)) => claim.with_uniform_part(both_uniform(&of_temperature)),
            // Without a thermometer the interval holds at each temperature, not on average over
            // temperatures.
            _ => claim,
        };
        let load = claim.stiffness(sensing)?;
        too_uncertain(&load, settings)?;
        let total = fit.total_displacement();
        let (low, high) = ramps.regressors();
        let curve = curved.map(|fit| LoadCurve {
            middle: fit
                .load_point_within(0.5 * (low + high), sensing, total)
                .force,
            fit,
            sensing,
            total,
            regressors: (low, high),
            of_calibration: root_of_rest(claim.standard_error, of_noise.standard_error),
            scatter,
            points: settings.load_points,
        });
        // A press that changes during the ramps may give a stiffness but no curve.
        let curve = curve.filter(|curve| curve.can_be_reported(self.number));
        let tangent = curve.as_ref().and_then(|curve| curve.tangent(sensing));
        let estimate = Estimate {
            measurement: self.number,
            stiffness_n_per_m: load.value().map(|load| load.0),
            standard_error_n_per_m: match load {
                LoadStiffness::Within { standard_error, .. } => Some(standard_error.0),
                LoadStiffness::AtLeast { .. } => None,
            },
            lower_n_per_m: load.low().0,
            upper_n_per_m: load.high().map(|high| high.0),
            load_ratio: claim.value,
            load_ratio_standard_error: claim.standard_error,
            samples: ramps.samples(),
            ramps: completed.into(),
            reduced_chi_square: fit.reduced_chi_square(),
            tangent_n_per_m: tangent.map(|(value, _)| value.0),
            tangent_standard_error_n_per_m: tangent.map(|(_, error)| error.0),
            two_state_n_per_m: self.two_states.load(sensing).map(|load| load.0),
            force_n: (sensing * reference.deformation()).0,
            total_displacement_m: total.0,
            temperature_c: self.calibrated.temperature.map(|temperature| temperature.0),
            duration_s: seconds(began, now).0,
            load_points: curve.as_ref().map_or(0, |curve| curve.points),
        };
        // A calibration or sigmas far from those of any sensor may exceed the protocol's range.
        if estimate.validate().is_err() {
            return Err(RampRefusal::NotFinite.into());
        }
        Ok(EstimateReport { estimate, curve })
    }
}

impl EstimateReport {
    /// Returns a point of the load curve; points are evenly spaced along the regressor.
    pub(crate) fn load_point(&self, index: u8) -> Option<LoadPoint> {
        let curve = self.curve.as_ref()?;
        let last = curve.points.checked_sub(1).filter(|last| index <= *last)?;
        let part = if last > 0 {
            f32::from(index) / f32::from(last)
        } else {
            0.5
        };
        curve.point(self.estimate.measurement, index, part)
    }
}

impl LoadCurve {
    /// Returns whether both ends and the middle are within the protocol's range. The other points, up to
    /// 64, are computed one by one when they are sent, so that no step is long.
    fn can_be_reported(&self, measurement: u32) -> bool {
        let point = |part| self.point(measurement, 0, part);
        self.points == 0 || [0.0, 0.5, 1.0].map(point).iter().all(Option::is_some)
    }

    /// Returns the point at a fraction `part` of the regressor's range, if the protocol can represent
    /// it.
    fn point(&self, measurement: u32, index: u8, part: f32) -> Option<LoadPoint> {
        let (low, high) = self.regressors;
        let point = self.at(low + (high - low) * part);
        let reported = LoadPoint {
            measurement,
            index,
            points: self.points,
            displacement_m: point.displacement.0,
            displacement_sigma_m: point.displacement_sigma.0,
            force_n: point.force.0,
            force_sigma_n: point.force_sigma.0,
        };
        reported.validate().is_ok().then_some(reported)
    }

    /// Returns the point at a regressor. The calibration's part of the displacement's uncertainty grows
    /// with the distance from the middle of the ramps.
    fn at(&self, regressor: f32) -> LoadCurvePoint {
        let point = self
            .fit
            .load_point_within(regressor, self.sensing, self.total);
        let from_middle = point.force - self.middle;
        let turned = self.of_calibration * from_middle.0 / self.sensing.0;
        LoadCurvePoint {
            force_sigma: point.force_sigma * self.scatter,
            displacement_sigma: Metre(hypot(point.displacement_sigma.0 * self.scatter, turned)),
            ..point
        }
    }

    /// Returns the tangent stiffness in the ramp's middle with its standard error, if it is valid.
    fn tangent(&self, sensing: NewtonPerMetre) -> Option<(NewtonPerMetre, NewtonPerMetre)> {
        let ratio = self.fit.load_ratio();
        match ratio.and_then(|ratio| ratio.stiffness(sensing)) {
            Ok(LoadStiffness::Within {
                value,
                standard_error,
                ..
            }) => Some((value, standard_error)),
            _ => None,
        }
    }
}

/// Returns the noise interval, widened if the single ramps scatter by more than their own errors:
/// disturbances slower than a conversion and faster than the train, such as vibration, are not white.
fn widened(ratio: &LoadRatio, factor: f32) -> LoadRatio {
    LoadRatio {
        value: ratio.value,
        standard_error: ratio.standard_error * factor,
        low: ratio.value - (ratio.value - ratio.low) * factor,
        high: ratio.value + (ratio.high - ratio.value) * factor,
    }
}

/// Bend of the ramps that is always allowed, as the relative standard uncertainty of the slope that it
/// causes: an ideal sensor's ramps bend by this amount, because conversions and current readings are
/// averages.
const LEAST_MISFIT: f32 = 0.005;

/// Allowed bend as a multiple of the bend of the calibration's own trains. Vibration synchronous with
/// the ramps bends each train differently, by up to the square root of two times that bend.
const OF_USUAL_BEND: f32 = 2.0;

/// Adds the uncertainty that the bend of the ramps' line causes to the claim. Refuses a bend whose
/// uncertainty exceeds the allowed one and that of the claim. `scatter` is the ratio of the noise
/// that the ramps show to the noise of the fit, `usual` the bend of the calibration's trains.
fn with_misfit(
    claim: LoadRatio,
    bend: Option<Bend>,
    (scatter, usual): (f32, f32),
    at: &OperatingPoint,
) -> Result<LoadRatio, Reason> {
    let whole = 1.0 + claim.value + at.actuated_ratio;
    let of = |uncertainty: fn(&Bend, f32, f32) -> f32| {
        bend.map_or(0.0, |bend| uncertainty(&bend, whole, scatter))
    };
    let misfit = of(Bend::significant_uncertainty);
    let allowed = LEAST_MISFIT.max(OF_USUAL_BEND * SLOPE_BY_BEND * usual);
    let limit = claim.standard_error.max(allowed * whole);
    // A misfit or limit of NaN is refused as well.
    if misfit.is_nan() || limit.is_nan() || misfit > limit {
        let reason = if bend.is_some_and(|bend| bend.relative.value < 0.0) {
            RefusalReason::Relaxes
        } else {
            RefusalReason::Misfit
        };
        return Err(Reason::new(reason, Some(misfit), Some(limit)));
    }
    Ok(claim.with_uncertainty(of(Bend::uncertainty)))
}

fn operating_point(
    calibrated: &Calibrated,
    reference: &Reference,
    settings: &Settings,
) -> OperatingPoint {
    let peak = Ampere(settings.peak_current_a);
    OperatingPoint {
        actuated_ratio: reference.regressor(),
        rise: calibrated.law.rise(peak).value,
        logarithmic_slope: calibrated.law.law.logarithmic_slope(peak),
        deformation: reference.deformation(),
    }
}

/// Returns the calibration's uncertainties. Those of cross-talk and attraction are expressed as relative
/// uncertainties of the stiffening: at the peak both change the signal as an error of the stiffening
/// would.
///
/// With deformation x, load ratio kappa, actuated ratio g and relative rise rho, the ramp changes x by
/// the fraction |h|/W, where W = 1 + kappa + g is the whole compliance and h = -g rho/(1 + rho) the
/// regressor's change. An error o of x at the peak alone is the fraction (o/x) W/|h| of the ramp's
/// change. An attraction p c_D0 with the relative error u is the fraction (p/x) u/|h| of that change.
fn uncertainties(
    calibrated: &Calibrated,
    ratio: &LoadRatio,
    at: &OperatingPoint,
    settings: &Settings,
) -> Calibration {
    let Calibrated {
        deepest: _,
        springs,
        law,
        rise_uncertainty,
        coil,
        attraction,
        crosstalk,
        temperature_effect: _,
        temperature_coefficients: _,
        contact,
        temperature: _,
    } = calibrated;
    let of_contact = contact.as_ref();
    let of_place = of_contact.map_or(0.0, |of| of.rise_uncertainty);
    let of_tilt_m = of_contact.map_or(0.0, |of| of.zero_uncertainty_m);
    let peak = Ampere(settings.peak_current_a);
    let sensing = NewtonPerMetre(springs.sensing_n_per_m);
    let change = law.regressor(sensing, peak).deviation.abs();
    let whole = 1.0 + ratio.value + at.actuated_ratio;
    let pulled =
        magnetorheological::attraction(calibrated.pull(peak), law.spring(peak), at.deformation);
    let seen = crosstalk.apparent_m_per_a2 * peak.0 * peak.0 / at.deformation.0;
    let of_signal = hypot(
        pulled / change * attraction.uncertainty,
        seen * whole / change * crosstalk.uncertainty,
    );
    Calibration {
        force_scale: springs.force_scale_uncertainty,
        sensing: springs.sensing_uncertainty,
        actuated: springs.actuated_uncertainty,
        // `Calibration` scales the stiffening's error by W/(1 + rho), the signal's by W.
        stiffening: hypot(
            hypot(*rise_uncertainty, of_place),
            of_signal * (1.0 + at.rise),
        ),
        current: coil.current_uncertainty,
        zero: Metre(hypot(springs.zero_uncertainty_m, of_tilt_m)),
    }
}

/// Temperature range that is assumed without a thermometer, degrees Celsius: from a cold workshop to a
/// warm room of 30 with the coil at its continuous power, 3.5 W through 8 K/W.
const UNMEASURED_C: [f32; 2] = [0.0, 60.0];

/// Returns the measurement's temperature minus the calibration's, K.
fn off_calibration_k(calibrated: &Calibrated) -> Option<f32> {
    let Celsius(now_c) = calibrated.temperature?;
    let effect = calibrated.temperature_effect.as_ref()?;
    Some(now_c - effect.calibrated_at_c)
}

/// Returns the largest possible difference from the calibration's temperature, K.
fn difference_k(effect: &TemperatureEffect, temperature: Option<Celsius>) -> f32 {
    let from = |now_c: f32| (now_c - effect.calibrated_at_c).abs();
    match temperature {
        Some(Celsius(now_c)) => from(now_c),
        None => {
            let [cold, warm] = UNMEASURED_C.map(from);
            cold.max(warm)
        }
    }
}

/// Returns the uncertainty of springs and rise from their uncorrected change with temperature if there
/// is no thermometer. The change is taken as uniform within its limits, and 1.96 standard errors cover
/// the whole range.
fn uncorrected(calibrated: &Calibrated) -> Calibration {
    let Calibrated {
        temperature_effect: Some(effect),
        temperature_coefficients: Some(coefficients),
        temperature: None,
        ..
    } = calibrated
    else {
        return Calibration::default();
    };
    let difference_k = difference_k(effect, None);
    let of = |per_k: f32| exp_m1(per_k.abs() * difference_k) / sqrt(3.0);
    Calibration {
        force_scale: of(coefficients.springs_per_k),
        stiffening: of(coefficients.rise_per_k),
        ..Calibration::default()
    }
}

/// Returns the uncertainty of springs and rise from the difference between the measurement's and the
/// calibration's temperature.
fn of_temperature(calibrated: &Calibrated) -> Calibration {
    let Some(effect) = &calibrated.temperature_effect else {
        return Calibration::default();
    };
    let difference_k = difference_k(effect, calibrated.temperature);
    Calibration {
        force_scale: effect.springs_uncertainty_per_k * difference_k,
        stiffening: effect.rise_uncertainty_per_k * difference_k,
        ..Calibration::default()
    }
}

/// Returns the standard error of one uniform error that replaces the two of springs and stiffening.
/// Its fourth cumulant is the sum of theirs, which keeps the shape of the distribution; a fourth
/// cumulant grows with the fourth power of its error.
fn both_uniform(temperature: &Budget) -> f32 {
    let fourth = |error: f32| (error * error) * (error * error);
    sqrt(sqrt(
        fourth(temperature.force_scale) + fourth(temperature.stiffening),
    ))
}

fn too_uncertain(load: &LoadStiffness, settings: &Settings) -> Result<(), Reason> {
    let LoadStiffness::Within {
        value,
        standard_error,
        ..
    } = load
    else {
        return Ok(());
    };
    let part = *standard_error / *value;
    if part <= settings.greatest_error {
        return Ok(());
    }
    Err(Reason::new(
        RefusalReason::TooUncertain,
        Some(part),
        Some(settings.greatest_error),
    ))
}

/// Reasons that the estimator decides: `git grep RampRefusal:: -- model/src/ramp`.
impl From<RampRefusal> for Reason {
    fn from(refusal: RampRefusal) -> Self {
        let (code, value, limit) = match refusal {
            RampRefusal::TooFewSamples { have, need } => (
                RefusalReason::TooFewSamples,
                Some(have as f32),
                Some(need as f32),
            ),
            RampRefusal::IllConditioned { term } => {
                (RefusalReason::IllConditioned, Some(term as f32), None)
            }
            RampRefusal::NotFinite => (RefusalReason::NotFinite, None, None),
            RampRefusal::SignalTooSmall { significance } => (
                RefusalReason::SignalTooSmall,
                Some(significance),
                Some(palpate_model::math::student::NORMAL_975),
            ),
            RampRefusal::SignalReversed { significance } => {
                (RefusalReason::SignalReversed, Some(significance), None)
            }
            RampRefusal::NegativeStiffness { highest_load_ratio } => (
                RefusalReason::NegativeStiffness,
                Some(highest_load_ratio),
                None,
            ),
        };
        Self::new(code, value, limit)
    }
}

/// Returns the rest of a standard error after removing a part, in quadrature.
fn root_of_rest(whole: f32, part: f32) -> f32 {
    sqrt((whole * whole - part * part).max(0.0))
}

#[cfg(test)]
mod tests {
    use palpate_model::ramp::{Basis, Noise, Ramp, RampSample};
    use palpate_model::units::Second;

    use super::*;

    /// Load curve of three equal springs; the ratio `scatter` applies to its single ramps.
    fn curve(scatter: f32) -> LoadCurve {
        let deformation = Metre(0.3e-3);
        let reference = Reference::new(deformation, 1.0).unwrap();
        let mut ramp = Ramp::new(reference, Basis::LINEAR);
        for i in 0..100_u8 {
            let h = -0.03 * (1.0 - f32::from(i) / 99.0);
            let sample = RampSample {
                time: Second(0.0),
                deformation: Metre(-0.3e-3 * h / (3.0 + h)),
                regressor: h,
                sigma: Metre(30e-9),
            };
            ramp.push(&sample).unwrap();
        }
        let fit = ramp.fit(Noise::Larger).unwrap();
        LoadCurve {
            total: fit.total_displacement(),
            fit,
            sensing: NewtonPerMetre(6e3),
            regressors: (-0.03, 0.0),
            middle: Newton(1.8),
            of_calibration: 0.05,
            scatter,
            points: 16,
        }
    }

    /// A press that changes within the ramps gives a stiffness or only a lower bound, but points of the
    /// curve with uncertainties of metres. Random sequences have found such cases.
    #[test]
    fn a_curve_beyond_what_the_protocol_holds_is_not_reported() {
        assert!(curve(1.0).can_be_reported(1));
        assert!(curve(1e3).can_be_reported(1));
        assert!(!curve(1e9).can_be_reported(1));
        let points = 0;
        assert!(
            LoadCurve {
                points,
                ..curve(1e9)
            }
            .can_be_reported(1)
        );
    }
}
