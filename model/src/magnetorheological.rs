//! Stiffness of the actuated layer as a function of the coil's current.
//!
//! A magnetosensitive elastomer stiffens with the field B, quadratically at first, then less: E(B)
//! = E_0 [1 + R s], s = B^2 / (B^2 + Bc^2), with the rise R at saturation, half of it at Bc. B is
//! proportional to the current I. With the relative rise rho(I), the actuated spring and the
//! estimator's regressor are
//!
//! c_D(I) = c_D0 (1 + rho(I)), g(I) = c_S / c_D(I),
//!
//! and the estimator uses the deviation of g from g_0 = c_S/c_D0, h = g - g_0 = -g_0 rho/(1 + rho).
//! In this form h keeps the seven digits of `f32`; the difference of two ratios, at a rho of 0.005,
//! would keep five. No published table gives R and Bc for the materials in question, so the numbers
//! come from a board's own calibration, as a law of this form or as a table.

use crate::calibration_curve::MonotoneCurve;
use crate::math::exp;
use crate::units::{Ampere, Metre, Newton, NewtonPerMetre, OutOfRange, Requirement, Tesla};

/// Relative rise of the actuated spring at one current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rise {
    /// rho = c_D/c_D0 - 1.
    pub value: f32,
    /// Derivative d rho/dI, 1/A.
    pub per_ampere: f32,
}

/// The estimator's regressor at one current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regressor {
    /// Deviation h = g(I) - g(0), zero or negative.
    pub deviation: f32,
    /// Derivative dg/dI, 1/A: converts a sigma of the current to a sigma of the regressor.
    pub per_ampere: f32,
}

/// Stiffness of the actuated layer as a function of the current; implemented by a law and by a
/// table.
pub trait Stiffening {
    /// Spring without current, c_D0.
    fn at_rest(&self) -> NewtonPerMetre;

    /// Relative rise rho(I); the sign of the current does not matter.
    fn rise(&self, current: Ampere) -> Rise;

    /// Spring at a current, c_D(I) = c_D0 (1 + rho(I)).
    fn spring(&self, current: Ampere) -> NewtonPerMetre {
        self.at_rest() * (1.0 + self.rise(current).value)
    }

    /// Ratio g_0 = c_S/c_D0, the reference of the deviation in [`regressor`](Self::regressor).
    fn reference_ratio(&self, sensing: NewtonPerMetre) -> f32 {
        sensing / self.at_rest()
    }

    /// Regressor at a current: h(I) = g(I) - g(0) and dg/dI = -g_0 rho'/(1 + rho)^2.
    ///
    /// Relative error of both at most 4.0e-7, in addition to the error of the rise.
    fn regressor(&self, sensing: NewtonPerMetre, current: Ampere) -> Regressor {
        let rise = self.rise(current);
        let stiffened = 1.0 + rise.value;
        let reference = self.reference_ratio(sensing);
        Regressor {
            deviation: deviation(reference, rise.value),
            per_ampere: -reference / stiffened * rise.per_ampere / stiffened,
        }
    }
}

/// Deviation h = g - g_0 = -g_0 rho/(1 + rho) for a given rise, for example one that lags behind
/// the current.
pub fn deviation(reference_ratio: f32, rise: f32) -> f32 {
    -reference_ratio / (1.0 + rise) * rise
}

/// Addition to h for the force `pull` with which the two halves of the actuated layer attract each
/// other; the layer has the spring `actuated`, c_D(I).
///
/// The attraction f shortens the layer by p = f/c_D(I), so x (1 + kappa + g) = x_0 - p. This equals
/// a regressor g + p/x, with the measured deformation x. If the addition is omitted, 0.3 mN/A^2 at
/// 10 A causes an error of 40 % of c_L for c_L = c_S = 6 N/mm, c_D0 = 4 N/mm and a stiffening of
/// 10 %.
pub fn attraction(pull: Newton, actuated: NewtonPerMetre, deformation: Metre) -> f32 {
    pull / actuated / deformation
}

/// The quadratic, saturating law, defined by its rise at a peak current:
///
/// rho(I) = eps s(I)/s(I_peak) = eps y (1 + r^2)/(1 + r^2 y), y = (I/I_peak)^2,
///
/// where r = B_peak/Bc is the field at the peak current in units of the field of half the rise; r =
/// 0 is the purely quadratic law. Relative error of the rise at most 6.0e-7.
///
/// ```
/// use palpate_model::magnetorheological::{Saturating, Stiffening};
/// use palpate_model::units::{Ampere, NewtonPerMetre, Tesla};
/// // The stack "ultrasoft": 10 % at 10 A and 22 mT, half way at 250 mT.
/// let law = Saturating::new(NewtonPerMetre(4e3), 0.10, Ampere(10.0))
///     .and_then(|law| law.saturating(Tesla(0.022), Tesla(0.25)))?;
/// assert!((law.spring(Ampere(10.0)).0 - 4.4e3).abs() < 1e-2);
/// let h = law.regressor(NewtonPerMetre(6e3), Ampere(10.0)).deviation;
/// assert!((h - (6.0 / 4.4 - 6.0 / 4.0)).abs() < 1e-6);
/// # Ok::<(), palpate_model::units::OutOfRange>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saturating {
    at_rest: NewtonPerMetre,
    rise_at_peak: f32,
    peak: Ampere,
    /// r^2.
    saturation: f32,
}

impl Saturating {
    /// The quadratic law c_D = c_D0 (1 + eps (I/I_peak)^2); all three parameters above zero.
    pub const fn new(
        at_rest: NewtonPerMetre,
        rise_at_peak: f32,
        peak: Ampere,
    ) -> Result<Self, OutOfRange> {
        match (
            NewtonPerMetre::positive(at_rest.0),
            OutOfRange::check(rise_at_peak, Requirement::Positive),
            Ampere::positive(peak.0),
        ) {
            (Ok(at_rest), Ok(rise_at_peak), Ok(peak)) => Ok(Self {
                at_rest,
                rise_at_peak,
                peak,
                saturation: 0.0,
            }),
            (Err(error), ..) | (_, Err(error), _) | (.., Err(error)) => Err(error),
        }
    }

    /// The saturating law with the same rise at the peak current. `at_peak` is B at the peak
    /// current, `half` is Bc.
    pub fn saturating(self, at_peak: Tesla, half: Tesla) -> Result<Self, OutOfRange> {
        let ratio = Tesla::non_negative(at_peak.0)? / Tesla::positive(half.0)?;
        let saturation = OutOfRange::check(ratio * ratio, Requirement::NonNegative)?;
        Ok(Self { saturation, ..self })
    }

    /// Rise at the peak current, eps.
    pub const fn rise_at_peak(&self) -> f32 {
        self.rise_at_peak
    }

    /// Logarithmic slope d ln rho / d ln I = 2/(1 + r^2 y): relative error of the rise per relative
    /// error of the current. It is two for the quadratic law.
    pub fn logarithmic_slope(&self, current: Ampere) -> f32 {
        let relative = current / self.peak;
        2.0 / (1.0 + self.saturation * relative * relative)
    }
}

impl Stiffening for Saturating {
    fn at_rest(&self) -> NewtonPerMetre {
        self.at_rest
    }

    fn rise(&self, current: Ampere) -> Rise {
        let relative = current / self.peak;
        let shape = (1.0 + self.saturation) / (1.0 + self.saturation * relative * relative);
        let per_relative = self.rise_at_peak * shape * relative;
        Rise {
            value: per_relative * relative,
            per_ampere: per_relative * self.logarithmic_slope(current) / self.peak.0,
        }
    }
}

/// Changes of springs and rise since their calibration, as factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factors {
    /// Factor of both c_S and c_D0, so their ratio c_S/c_D0 does not change.
    pub springs: f32,
    /// Factor of the rise; it is the same at all currents.
    pub rise: f32,
}

impl Factors {
    /// No change.
    pub const NONE: Self = Self {
        springs: 1.0,
        rise: 1.0,
    };

    /// Factors at a temperature `warmer_k` above that of the calibration, with coefficients in 1/K:
    /// each factor is exp(b dT). Relative error at most 1.2e-7 + 6e-8 b dT.
    pub fn at(warmer_k: f32, springs_per_k: f32, rise_per_k: f32) -> Self {
        Self {
            springs: exp(springs_per_k * warmer_k),
            rise: exp(rise_per_k * warmer_k),
        }
    }
}

/// A calibrated stiffening, modified by factors.
///
/// ```
/// use palpate_model::magnetorheological::{Changed, Factors, Saturating, Stiffening};
/// use palpate_model::units::{Ampere, NewtonPerMetre};
/// // A rise of 10 % that falls by 0.5 % for every kelvin, ten kelvin warmer.
/// let law = Saturating::new(NewtonPerMetre(4e3), 0.10, Ampere(10.0))?;
/// let warm = Changed { law, by: Factors::at(10.0, 0.0, -5e-3) };
/// assert!((warm.rise(Ampere(10.0)).value - 0.095_12).abs() < 1e-5);
/// # Ok::<(), palpate_model::units::OutOfRange>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Changed<S> {
    /// The stiffening as calibrated.
    pub law: S,
    /// The factors that modify it.
    pub by: Factors,
}

impl<S: Stiffening> Stiffening for Changed<S> {
    fn at_rest(&self) -> NewtonPerMetre {
        self.law.at_rest() * self.by.springs
    }

    fn rise(&self, current: Ampere) -> Rise {
        let rise = self.law.rise(current);
        Rise {
            value: rise.value * self.by.rise,
            per_ampere: rise.per_ampere * self.by.rise,
        }
    }
}

/// A calibrated table of the rise against the current, interpolated monotonically.
///
/// The table starts at zero current and zero rise. Beyond its end the tangent continues, which
/// overstates a saturating rise: calibrate up to the largest current that will be used.
///
/// ```
/// use palpate_model::calibration_curve::MonotoneCurve;
/// use palpate_model::magnetorheological::{Stiffening, Tabulated};
/// use palpate_model::units::{Ampere, NewtonPerMetre};
/// let rise = MonotoneCurve::<4>::new(&[(0.0, 0.0), (5.0, 0.025), (10.0, 0.1)]).unwrap();
/// let table = Tabulated::new(NewtonPerMetre(4e3), rise)?;
/// assert_eq!(table.rise(Ampere(-10.0)).value, 0.1);
/// # Ok::<(), palpate_model::units::OutOfRange>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tabulated<const N: usize> {
    at_rest: NewtonPerMetre,
    rise: MonotoneCurve<N>,
}

impl<const N: usize> Tabulated<N> {
    /// Creates a table from c_D0 and the curve of rho against the current's magnitude in amperes.
    pub fn new(at_rest: NewtonPerMetre, rise: MonotoneCurve<N>) -> Result<Self, OutOfRange> {
        Ok(Self {
            at_rest: NewtonPerMetre::positive(at_rest.0)?,
            rise,
        })
    }
}

impl<const N: usize> Stiffening for Tabulated<N> {
    fn at_rest(&self) -> NewtonPerMetre {
        self.at_rest
    }

    fn rise(&self, current: Ampere) -> Rise {
        let point = self.rise.at(current.0.abs());
        Rise {
            value: point.value,
            per_ampere: if current.0 < 0.0 {
                -point.slope
            } else {
                point.slope
            },
        }
    }
}
