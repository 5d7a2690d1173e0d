//! Calibration of an array of sensing coils from presses with known place, force and tip.
//!
//! 30 to 50 presses, by a stage with a load cell or by a template with holes, a ball and weights,
//! give one radial profile for all coils with its bend, the gain and place of each coil, and the
//! covariance of all of these ([`calibrate`]). Presses that contradict the others are named and left
//! out. What the instrument needs of the covariance is reduced to five numbers ([`ReadingError`],
//! [`CommonError`]); how many more presses would be enough follows from it
//! ([`ArrayCalibration::more_presses`]).

mod commands;
mod fit;
mod profile;
mod reduced;
mod suspect;
#[cfg(test)]
mod tests;
mod tip;

pub use commands::DeclaredIndenter;
pub use profile::{BASE, BENT, BY_RADIUS, Scales};
pub use reduced::{CommonError, Goal, ReadingError};
pub use suspect::{Cause, Suspect};
pub use tip::{Layer, Tip};

use crate::Unusable;
use crate::least_squares::Covariance;
use profile::{COMMON, PSI, Parameters};

/// What is known of the array and of the bench beforehand.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// Nominal places of the coils' axes, m.
    pub coils_m: Vec<[f64; 2]>,
    /// Standard deviation of a coil's place about its nominal one, m; includes that of the whole
    /// template.
    pub place_tolerance_m: f64,
    /// Standard deviation of a coil's gain, relative.
    pub gain_tolerance: f64,
    /// Standard deviation of a reading, as relative change of inductance.
    pub noise: f64,
    /// Scales of the profile.
    pub scales: Scales,
    /// Radius of the disc within which presses are to be claimed, m.
    pub reach_m: f64,
    /// Standard deviation of ln a beforehand, in use: 0.46 for any radius from 1 to 5 mm.
    pub radius_in_use: f64,
    /// The bench.
    pub bench: Bench,
}

/// Standard errors of the bench.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bench {
    /// Standard error of x and of y of a press, independent from press to press, m.
    pub place_m: f64,
    /// Relative standard error of a force, independent from press to press.
    pub force: f64,
    /// Relative standard error of a contact radius, independent from press to press.
    pub radius: f64,
    /// Standard errors that are common to all presses.
    pub common: CommonError,
}

/// A press with what is known of it.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownPress {
    /// Place, m.
    pub place_m: [f64; 2],
    /// Force, N.
    pub force_n: f64,
    /// Contact radius, m: [`Tip::contact_radius_m`].
    pub radius_m: f64,
    /// Relative changes of inductance, one for each coil.
    pub readings: Vec<f64>,
}

/// Place and gain of a coil, from the calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibratedCoil {
    /// Place of the axis, m.
    pub place_m: [f64; 2],
    /// Gain, with a mean logarithm of zero.
    pub gain: f64,
}

/// Calibration of an array.
#[derive(Clone, Debug)]
pub struct ArrayCalibration {
    design: Design,
    parameters: Parameters,
    covariance: Covariance,
    /// What the profile's form leaves out, relative to a reading.
    form: f64,
    presses: usize,
    forces_n: [f64; 2],
    /// Standard deviation of the residuals over the stated one.
    pub residual_ratio: f64,
    /// Presses that were left out.
    pub suspects: Vec<Suspect>,
    /// Error of a reading that differs from coil to coil.
    pub reading_error: ReadingError,
    /// Error that is common to all coils.
    pub common_error: CommonError,
}

/// Least number of presses: readings of four coils then are three for each unknown.
pub const LEAST_PRESSES: usize = 25;

/// Calibrates an array.
///
/// # Errors
/// With fewer than [`LEAST_PRESSES`] presses, readings that are not one for each coil or not finite,
/// or presses that do not determine the profile.
pub fn calibrate(design: &Design, presses: &[KnownPress]) -> Result<ArrayCalibration, Unusable> {
    let is_usable = |press: &KnownPress| {
        let numbers = [press.force_n, press.radius_m];
        press.readings.len() == design.coils_m.len()
            && press
                .readings
                .iter()
                .chain(&press.place_m)
                .all(|of| of.is_finite())
            && numbers.iter().all(|of| of.is_finite() && *of > 0.0)
    };
    if presses.len() < LEAST_PRESSES || !presses.iter().all(is_usable) {
        return Err(Unusable::Missing(
            "25 presses on the array, each with place, force, radius and all readings",
        ));
    }
    let mut weights = vec![1.0; presses.len()];
    let mut fitted = fit::fit(design, presses, &mut weights, (fit::FORM, true))?;
    // The fit without the presses that contradict it decides anew which these are.
    for _ in 0..3 {
        let left_out = suspect::left_out(design, &fitted, presses);
        let next: Vec<f64> = left_out
            .iter()
            .map(|out| f64::from(u8::from(!out)))
            .collect();
        if next == weights {
            break;
        }
        weights = next;
        let form = fit::most_likely_form(design, &fitted, presses, &weights)?;
        fitted = fit::fit(design, presses, &mut weights, (form, false))?;
    }
    let used = weights.iter().filter(|weight| **weight > 0.0).count();
    if used < LEAST_PRESSES {
        return Err(Unusable::Undetermined(
            "the profile: too many presses contradict each other",
        ));
    }
    let suspects = suspect::explain(design, &fitted, presses, &weights);
    let forces = presses.iter().map(|press| press.force_n);
    let mut calibration = ArrayCalibration {
        design: design.clone(),
        parameters: fitted.parameters,
        covariance: fitted.covariance,
        form: fitted.form,
        presses: used,
        forces_n: forces.fold([f64::MAX, 0.0], |[low, high], of| {
            [of.min(low), of.max(high)]
        }),
        residual_ratio: fitted.sigma,
        suspects,
        reading_error: ReadingError::default(),
        common_error: CommonError::default(),
    };
    (calibration.reading_error, calibration.common_error) = calibration.reduced()?;
    Ok(calibration)
}

impl ArrayCalibration {
    /// Coefficients of the profile in the middle of the radii, 1/N.
    pub fn base(&self) -> &[f64] {
        &self.parameters.values[..BASE]
    }

    /// Change of the coefficients with the scaled root of the radius, and with its square, 1/N.
    pub fn by_radius(&self) -> [&[f64]; 2] {
        let (linear, quadratic) = self.parameters.values[BASE..PSI].split_at(BY_RADIUS);
        [linear, quadratic]
    }

    /// Coefficients of the readings' part that grows with the square of the force, 1/N^2: in the middle
    /// of the radii, change with the scaled root of the radius, and with its square.
    pub fn bent(&self) -> &[f64] {
        &self.parameters.values[PSI..COMMON]
    }

    /// Greatest force of the presses, N.
    pub fn greatest_force_n(&self) -> f64 {
        self.forces_n[1]
    }

    /// Scales of the profile.
    pub fn scales(&self) -> Scales {
        self.parameters.scales
    }

    /// The coils.
    pub fn coils(&self) -> Vec<CalibratedCoil> {
        let values = &self.parameters.values;
        let coil = |coil: usize| {
            let place = self.parameters.place(coil);
            CalibratedCoil {
                place_m: [values[place.start], values[place.start + 1]],
                gain: values[self.parameters.gain(coil)].exp(),
            }
        };
        (0..self.parameters.coils).map(coil).collect()
    }

    /// Standard error of each coil's place (of x and of y, m) and of its gain's logarithm.
    pub fn coil_errors(&self) -> Vec<[f64; 3]> {
        let sigma = |index: usize| self.covariance[(index, index)].sqrt();
        let coil = |coil: usize| {
            let place = self.parameters.place(coil);
            let gain = self.parameters.gain(coil);
            [sigma(place.start), sigma(place.start + 1), sigma(gain)]
        };
        (0..self.parameters.coils).map(coil).collect()
    }
}
