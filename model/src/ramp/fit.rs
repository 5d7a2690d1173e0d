//! Result of fitting a ramp.

use super::interval::{RatioCovariance, fieller};
use super::moments::{Row, Solution};
use super::{Basis, LoadRatio, MOST_TERMS, RampRefusal, Reference};
use crate::math::{Wide, sqrt};
use crate::units::{Metre, Newton, NewtonPerMetre};

/// What determines the level of the noise: the sigmas stated with the samples, or the residuals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Noise {
    /// The stated sigmas are right; the interval uses quantiles of the normal distribution.
    Stated,
    /// The stated sigmas are right up to a common factor, which is estimated from the residuals;
    /// the interval uses Student's quantiles.
    Residual,
    /// The larger of `Stated` and `Residual` (Birge's rule), with Student's quantiles. Noise that
    /// the sigmas do not include, such as vibration, widens the interval, and small residuals do
    /// not narrow it. With right sigmas and 400 samples a 95 % interval covers 95.4 %.
    #[default]
    Larger,
}

/// A coefficient of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Estimate.
    pub value: f32,
    /// Its standard error.
    pub standard_error: f32,
}

/// A point of the load's curve F(x_L).
///
/// The errors of force and displacement come from the same deformation, and their correlation is
/// nearly -1: an error that raises F lowers x_L.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadCurvePoint {
    /// Force F = c_S x_S.
    pub force: Newton,
    /// Displacement of the load.
    pub displacement: Metre,
    /// Standard error of the force.
    pub force_sigma: Newton,
    /// Standard error of the displacement.
    pub displacement_sigma: Metre,
}

/// The fitted ramp: x_S as a function of the regressor's deviation h, with the drifts removed,
///
/// x(h) = x_ref / l(h), l(h) = 1 + alpha + beta h (+ gamma h^2 + delta h^3).
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    basis: Basis,
    reference: Reference,
    theta: Row<Wide>,
    covariance: Row<Row<f32>>,
    chi_square: f32,
    degrees: u32,
    quantile: f32,
    centre: f32,
}

/// Values of l(h) and l'(h), with their derivatives with respect to the coefficients.
struct FittedCurve {
    level: Wide,
    slope: Wide,
    level_by: Row<f32>,
    slope_by: Row<f32>,
}

impl Fit {
    pub(super) fn new(
        basis: Basis,
        reference: Reference,
        solution: &Solution,
        scale: ErrorScale,
    ) -> Result<Self, RampRefusal> {
        let covariance = solution
            .inverse
            .map(|row| row.map(|c| (c * scale.row_variance).to_f32()));
        let theta = solution.theta.map(|theta| theta.to_f32());
        if !covariance
            .iter()
            .chain([&theta])
            .flatten()
            .all(|number| number.is_finite())
        {
            return Err(RampRefusal::NotFinite);
        }
        Ok(Self {
            basis,
            reference,
            theta: solution.theta,
            covariance,
            chi_square: scale.chi_square,
            degrees: scale.degrees,
            quantile: scale.quantile,
            centre: solution.centre,
        })
    }

    /// Load ratio kappa = c_S/c_L; for a non-linear load, from its *tangent* at the
    /// [centre](Self::centre) of the ramp.
    ///
    /// From x (1 + g) + x_L = x_0 follows c_S dx_L/dF = l/l' - (1 + g), independent of x_0. If l is
    /// a straight line, without quadratic or cubic term in the basis, the ratio is the same for all
    /// h.
    pub fn load_ratio(&self) -> Result<LoadRatio, RampRefusal> {
        let h = self.centre;
        let curve = self.curve(h);
        let slope = curve.slope.to_f32();
        let covariance = RatioCovariance {
            numerator: self.covariance(&curve.level_by, &curve.level_by),
            cross: self.covariance(&curve.level_by, &curve.slope_by),
            denominator: self.covariance(&curve.slope_by, &curve.slope_by),
        };
        let quotient = curve.level / curve.slope;
        let ratio = quotient.to_f32();
        let (below, above) = fieller(ratio, slope, covariance, self.quantile)
            .map_err(|significance| RampRefusal::SignalTooSmall { significance })?;
        if slope < 0.0 {
            let significance = slope / sqrt(covariance.denominator);
            return Err(RampRefusal::SignalReversed { significance });
        }
        // Computed with wide numbers: for a stiff load, l/l' is nearly 1 + g, and kappa is their
        // small difference.
        let value =
            (quotient - Wide::ONE - Wide::from_f32(self.reference.regressor()) - Wide::from_f32(h))
                .to_f32();
        let variance = covariance.numerator
            + ratio * (ratio * covariance.denominator - 2.0 * covariance.cross);
        let standard_error = sqrt(variance.max(0.0)) / slope;
        let result = LoadRatio {
            value,
            standard_error,
            low: value + below,
            high: value + above,
        };
        if result.low.is_finite() && result.high.is_finite() && value.is_finite() {
            Ok(result)
        } else {
            Err(RampRefusal::NotFinite)
        }
    }

    /// Force and displacement of the load at the regressor deviation `h`, with the displacement
    /// counted from the unloaded object. Needs x_0, the total displacement since contact.
    pub fn load_point_within(
        &self,
        h: f32,
        sensing: NewtonPerMetre,
        total: Metre,
    ) -> LoadCurvePoint {
        let curve = self.curve(h);
        let level = curve.level.to_f32();
        let force = sensing * (self.reference.deformation() / level);
        let relative = sqrt(self.covariance(&curve.level_by, &curve.level_by).max(0.0)) / level;
        let force_sigma = force * relative.abs();
        let stack = 1.0 + self.reference.regressor() + h;
        LoadCurvePoint {
            force,
            displacement: total - force / sensing * stack,
            force_sigma,
            displacement_sigma: force_sigma / sensing * stack,
        }
    }

    /// Total displacement x_0, if the load is linear from its first touch on: x_ref/beta at h = 0.
    pub fn total_displacement(&self) -> Metre {
        self.reference.deformation() / self.curve(0.0).slope.to_f32()
    }

    /// Coefficient of the basis' term at `index`; for a drift, its relative size d.
    pub fn coefficient(&self, index: usize) -> Option<Coefficient> {
        self.basis.terms().get(index)?;
        let variance = *self.covariance.get(index)?.get(index)?;
        let value = self.theta.get(index)?.to_f32();
        Some(Coefficient {
            value,
            standard_error: sqrt(variance.max(0.0)),
        })
    }

    /// Chi-square (the sum of the squared residuals, each divided by its stated sigma) per degree
    /// of freedom: near 1 if noise and model are as stated. `None` if there are no degrees of
    /// freedom.
    pub fn reduced_chi_square(&self) -> Option<f32> {
        (self.degrees > 0).then(|| self.chi_square / self.degrees as f32)
    }

    /// Weighted mean of the regressor's deviation over the samples.
    pub const fn centre(&self) -> f32 {
        self.centre
    }

    /// The basis that was fitted.
    pub const fn basis(&self) -> &Basis {
        &self.basis
    }

    fn curve(&self, h: f32) -> FittedCurve {
        let mut curve = FittedCurve {
            level: Wide::ONE,
            slope: Wide::ZERO,
            level_by: [0.0; MOST_TERMS],
            slope_by: [0.0; MOST_TERMS],
        };
        let by = curve.level_by.iter_mut().zip(&mut curve.slope_by);
        let terms = self.basis.terms().iter().zip(&self.theta);
        for ((term, theta), (level, slope)) in terms.zip(by) {
            if let Some(n) = term.power() {
                (*level, *slope) = (power(h, n), derivative(h, n));
                curve.level = curve.level + theta.scale(*level);
                curve.slope = curve.slope + theta.scale(*slope);
            }
        }
        curve
    }

    /// Covariance of two linear functions of the coefficients.
    fn covariance(&self, a: &Row<f32>, b: &Row<f32>) -> f32 {
        let count = self.basis.terms().len();
        let rows = self.covariance.iter().zip(a).take(count);
        let along = |row: &Row<f32>| {
            row.iter()
                .zip(b)
                .take(count)
                .map(|(c, b)| c * b)
                .sum::<f32>()
        };
        rows.map(|(row, a)| a * along(row)).sum()
    }
}

/// Factors that convert the inverse of the moments' matrix to a covariance.
#[derive(Clone, Copy, Debug)]
pub(super) struct ErrorScale {
    pub(super) row_variance: Wide,
    pub(super) chi_square: f32,
    pub(super) degrees: u32,
    pub(super) quantile: f32,
}

fn power(h: f32, exponent: u8) -> f32 {
    (0..exponent).fold(1.0, |product, _| product * h)
}

/// Derivative of h^n with respect to h.
fn derivative(h: f32, exponent: u8) -> f32 {
    exponent
        .checked_sub(1)
        .map_or(0.0, |less| f32::from(exponent) * power(h, less))
}
