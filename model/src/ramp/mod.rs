//! The estimator: a load's stiffness from a whole ramp of the current, in fixed memory.
//!
//! # Model
//!
//! Three springs in series keep x (1 + kappa + g) = x_0 (see [`springs`](crate::springs)). So the
//! reciprocal of the deformation is linear in the regressor g = c_S/c_D(I), and a disturbance x ->
//! x (1 + d phi(t)) adds a column:
//!
//! x_ref/x (1 + d phi) = 1 + alpha + beta h, with h = g - g_ref.
//!
//! Then kappa = (1 + alpha)/beta - (1 + g_ref) and c_L = c_S/kappa; x_ref and g_ref are any
//! constants near the data. Multiplied by x, the equation has no reciprocal. It is solved in this
//! form, with u = x - x_ref:
//!
//! -u = alpha x + beta h x - d phi x_ref + noise, weight 1/var = (x / (x_ref sigma))^2,
//!
//! which is the fit of 1/x on g with weights x^4/sigma^2, exact for a drift of any size; for two
//! samples it is eq. (2) of [`springs`](crate::springs). The noise in the columns causes a bias of
//! second order only: the fraction 3 (sigma/x)^2 of alpha + 1 and of beta, which cancels in their
//! ratio. The weights omit 1 + d phi, so stated standard errors are off by the fraction d phi.
//!
//! A non-linear load bends the line: [`Term::Quadratic`] and [`Term::Cubic`] fit the bend, and
//! tangent stiffness and load curve are computed from the bent line. The stiffness is always that
//! of the tangent, since the ramp does not contain the displacement from the load's first touch to
//! its state on the ramp.
//!
//! # Design of the ramp
//!
//! Standard error of c_L for 400 samples with relative noise of 1e-4, a stiffening of 3 % and three
//! equal springs: 0.51 % with no drift term; 2.1 % with a linear one; 3.2 % with a logarithmic one;
//! but 0.51 % with the logarithmic term if the samples cover eight short falling ramps. Use many
//! short ramps, and push them all into one [`Ramp`].
//!
//! # Example
//!
//! ```
//! use palpate_model::ramp::{Basis, Noise, Ramp, Reference, RampSample};
//! use palpate_model::units::{Metre, NewtonPerMetre, Second};
//!
//! // Three equal springs, pressed 0.9 mm in all, while the actuated layer softens from 3 % above.
//! let sensing = NewtonPerMetre(6e3);
//! let reference = Reference::new(Metre(0.3e-3), 1.0).unwrap();
//! let mut ramp = Ramp::new(reference, Basis::LINEAR);
//! for i in 0..100 {
//!     let rise = 0.03 * (1.0 - i as f32 / 99.0);
//!     let h = -rise / (1.0 + rise);
//!     // x - x_ref, formed so that it keeps its digits: x = 0.9 mm / (3 + h).
//!     let deviation = -0.3e-3 * h / (3.0 + h);
//!     ramp.push(&RampSample {
//!         time: Second(i as f32 * 1e-3),
//!         deformation: Metre(deviation),
//!         regressor: h,
//!         sigma: Metre(30e-9),
//!     })?;
//! }
//! let fit = ramp.fit(Noise::Stated)?;
//! let load = fit.load_ratio()?.stiffness(sensing)?;
//! assert!((load.value().unwrap().0 - 6e3).abs() < 0.1);
//! assert!(load.contains(NewtonPerMetre(6e3)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod basis;
mod fit;
mod interval;
mod misfit;
mod moments;
mod reference;
mod refusal;
mod scatter;

pub use basis::{Basis, BasisError, DriftModel, MOST_TERMS, Term};
pub use fit::{Coefficient, Fit, LoadCurvePoint, Noise};
pub use interval::{LoadRatio, LoadStiffness};
pub use misfit::{Bend, SLOPE_BY_BEND};
pub use reference::Reference;
pub use refusal::{RampRefusal, Rejected};
pub use scatter::Scatter;

use crate::math::{Wide, student};
use crate::units::{Metre, Second};
use fit::ErrorScale;
use moments::{Dependent, Moments, Row};

/// One reading on the ramp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RampSample {
    /// Time from the origin of the drift terms to the middle of the reading's window.
    pub time: Second,
    /// Deviation u = x - x_ref. If x is available as an `f32`, the subtraction x - x_ref is exact
    /// for x within a factor of two of x_ref (Sterbenz).
    pub deformation: Metre,
    /// Deviation h = g - g_ref, from the current averaged over the reading's window.
    pub regressor: f32,
    /// Standard deviation of u, including that of the regressor if it matters.
    pub sigma: Metre,
}

/// Running sums of one measurement: they take 0.7 kB for any number of samples.
///
/// See the [module](self) for the model and an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    basis: Basis,
    reference: Reference,
    /// Sigma of the first sample; the weights of all samples are relative to it.
    sigma: Option<Metre>,
    moments: Moments,
}

impl Ramp {
    /// Creates sums without samples.
    pub const fn new(reference: Reference, basis: Basis) -> Self {
        Self {
            basis,
            reference,
            sigma: None,
            moments: Moments::EMPTY,
        }
    }

    /// The unknowns of the fit.
    pub const fn basis(&self) -> &Basis {
        &self.basis
    }

    /// The reference point of the samples.
    pub const fn reference(&self) -> &Reference {
        &self.reference
    }

    /// Number of samples taken.
    pub const fn samples(&self) -> u32 {
        self.moments.rows()
    }

    /// Adds a sample to the sums; on an error the sums are unchanged.
    pub fn push(&mut self, sample: &RampSample) -> Result<(), Rejected> {
        let (x_ref, u) = (self.reference.deformation, sample.deformation);
        let h = sample.regressor;
        let first = self.sigma.unwrap_or(sample.sigma);
        let x = x_ref + u;
        let terms = self.basis.terms();
        let mut phis: Row<f32> = [0.0; MOST_TERMS];
        for (phi, term) in phis.iter_mut().zip(terms) {
            if let Term::Drift(drift) = term {
                *phi = drift.at(sample.time);
            }
        }
        let mut numbers = phis.into_iter().chain([x.0, h, sample.sigma.0]);
        if !numbers.all(f32::is_finite) {
            return Err(Rejected::NotFinite);
        }
        if x.0 <= 0.0 {
            return Err(Rejected::Unpressed);
        }
        // Square root of the sample's weight, relative to the first sample's.
        let weight = x / x_ref * (first / sample.sigma);
        // Negated, so that NaN (zero divided by zero) is rejected too.
        if !(weight > 0.0 && weight.is_finite()) {
            return Err(Rejected::Sigma);
        }
        let weight = Wide::from_f32(weight);
        let [x_ref, u] = [x_ref, u].map(|length| Wide::from_f32(length.0) * weight);
        let level = x_ref + u;
        let slope = level.scale(h);
        let mut row: Row<Wide> = [level; MOST_TERMS];
        for (entry, (term, phi)) in row.iter_mut().zip(terms.iter().zip(phis)) {
            *entry = match term {
                Term::Level => level,
                Term::Slope => slope,
                Term::Quadratic => slope.scale(h),
                Term::Cubic => slope.scale(h).scale(h),
                Term::Drift(_) => x_ref.scale(-phi),
            };
        }
        let row = row.get(..terms.len()).unwrap_or_default();
        self.moments.add(row, -u);
        self.sigma = Some(first);
        Ok(())
    }

    /// Returns the sums of the samples added since `earlier`, a copy of these sums. One set of
    /// running sums thus serves both a train of ramps and each single ramp. `None` if `earlier` is
    /// not such a copy.
    ///
    /// ```
    /// # use palpate_model::ramp::{Basis, Noise, Ramp, Reference, RampSample};
    /// # use palpate_model::units::{Metre, Second};
    /// let reference = Reference::new(Metre(0.3e-3), 1.0).unwrap();
    /// let sample = |i: u16| {
    ///     let h = f32::from(i) * -1e-3;
    ///     let deformation = Metre(h * h * 1e-6 - 0.1e-3 * h);
    ///     RampSample { time: Second(0.0), deformation, regressor: h, sigma: Metre(30e-9) }
    /// };
    /// let (mut both, mut second) = (Ramp::new(reference, Basis::LINEAR), Ramp::new(reference, Basis::LINEAR));
    /// (0..20).try_for_each(|i| both.push(&sample(i)))?;
    /// let first = both;
    /// (5..20).try_for_each(|i| both.push(&sample(i)))?;
    /// (5..20).try_for_each(|i| second.push(&sample(i)))?;
    /// let since = both.since(&first).unwrap();
    /// assert_eq!(since.samples(), 15);
    /// assert_eq!(since.fit(Noise::Larger)?.load_ratio()?, second.fit(Noise::Larger)?.load_ratio()?);
    /// assert!(first.since(&both).is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Option<Self> {
        let begun = earlier.sigma.is_none() || earlier.sigma == self.sigma;
        let copied = (self.basis, self.reference) == (earlier.basis, earlier.reference);
        (begun && copied && earlier.samples() <= self.samples()).then(|| Self {
            moments: self.moments.since(&earlier.moments),
            ..*self
        })
    }

    /// Solves for the load and the drifts. The sums are kept, so a ramp can be evaluated while
    /// samples are still being added.
    pub fn fit(&self, noise: Noise) -> Result<Fit, RampRefusal> {
        self.solve(&self.basis, noise)
    }

    /// Solves for the first `count` unknowns only. The result is bit for bit as if the samples had
    /// been pushed to sums of only these unknowns. One set of running sums thus serves both a
    /// simple evaluation and one with further terms. `None` if there are fewer unknowns.
    ///
    /// ```
    /// # use palpate_model::ramp::{Basis, Noise, Ramp, Reference, RampSample, Term};
    /// # use palpate_model::units::{Metre, Second};
    /// let reference = Reference::new(Metre(0.3e-3), 1.0).unwrap();
    /// let bent = Basis::new(&[Term::Level, Term::Slope, Term::Quadratic]).unwrap();
    /// let (mut both, mut straight) = (Ramp::new(reference, bent), Ramp::new(reference, Basis::LINEAR));
    /// for i in 0..20 {
    ///     let (time, h) = (Second(i as f32 * 1e-3), i as f32 * -1e-3);
    ///     let deformation = Metre(h * h * 1e-6 - 0.1e-3 * h);
    ///     let sample = RampSample { time, deformation, regressor: h, sigma: Metre(30e-9) };
    ///     both.push(&sample)?;
    ///     straight.push(&sample)?;
    /// }
    /// let of_both = both.fit_first(2, Noise::Larger).unwrap()?;
    /// assert_eq!(of_both.load_ratio()?, straight.fit(Noise::Larger)?.load_ratio()?);
    /// assert!(both.fit_first(4, Noise::Larger).is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn fit_first(&self, count: usize, noise: Noise) -> Option<Result<Fit, RampRefusal>> {
        let basis = self.basis.first(count)?;
        Some(self.solve(&basis, noise))
    }

    fn solve(&self, basis: &Basis, noise: Noise) -> Result<Fit, RampRefusal> {
        let have = self.moments.rows();
        let count = basis.terms().len();
        let unknowns = count as u32;
        let need = unknowns.saturating_add(u32::from(noise == Noise::Residual));
        if have < need {
            return Err(RampRefusal::TooFewSamples { have, need });
        }
        let solution = self
            .moments
            .solve(count)
            .map_err(|Dependent(term)| RampRefusal::IllConditioned { term })?;
        let degrees = have.saturating_sub(unknowns);
        let sigma = Wide::from_f32(self.sigma.unwrap_or_default().0);
        let stated = sigma * sigma;
        let chi_square = (solution.residual / stated).to_f32().max(0.0);
        // Chi-square per degree of freedom, by which the stated variances are multiplied.
        let factor = match noise {
            Noise::Stated => 1.0,
            Noise::Larger if degrees == 0 => 1.0,
            Noise::Larger => (chi_square / degrees as f32).max(1.0),
            Noise::Residual => chi_square / degrees as f32,
        };
        let quantile = match noise {
            Noise::Stated => student::NORMAL_975,
            Noise::Larger if degrees == 0 => student::NORMAL_975,
            Noise::Larger | Noise::Residual => student::quantile_975(degrees),
        };
        let row_variance = stated.scale(factor.min(f32::MAX));
        Fit::new(
            *basis,
            self.reference,
            &solution,
            ErrorScale {
                row_variance,
                chi_square,
                degrees,
                quantile,
            },
        )
    }
}
