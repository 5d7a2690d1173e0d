//! Inductance as a function of the gap: a Chebyshev series, built once for each coil.

use core::f64::consts::PI;
use std::sync::{Arc, Mutex, PoisonError};

use super::CoilDesign;
use super::integral::{CoilIntegral, LEAST_GAP_M};

/// Largest gap of the curve, m.
pub const LARGEST_GAP_M: f64 = 4e-3;

/// Terms of the series. The inductance is analytic for gaps of positive real part. In the logarithm
/// of the gap this is a strip of half-width π/2, so each term reduces the error by a factor of
/// about 2.2.
const TERMS: usize = 36;

/// L(gap) between [`LEAST_GAP_M`] and [`LARGEST_GAP_M`]. Relative to [`CoilIntegral::inductance_h`]
/// its error is below 10⁻¹², and that of its slope within 10⁻¹⁰. Outside this range the curve keeps
/// its end values, with zero slope: a gap of 0.1 mm means that the layer is pressed flat.
///
/// ```
/// use palpate_sim::sensing_coil::{CoilDesign, curve::CoilCurve};
///
/// let curve = CoilCurve::shared(&CoilDesign::REFERENCE, None);
/// let (at_rest, slope) = curve.at(1e-3);
/// assert!(slope < 0.0, "MSE that comes closer raises the inductance");
/// assert!((slope / at_rest * -0.5e-6 - 158e-6).abs() < 0.5e-6, "158 ppm of f per um");
/// ```
#[derive(Clone, Debug)]
pub struct CoilCurve {
    /// Series of L, H, in the Chebyshev polynomials of the scaled logarithm of the gap.
    value: [f64; TERMS],
    /// Series of dL/d(ln gap), H.
    slope: [f64; TERMS],
    in_air_h: f64,
}

type Known = ((CoilDesign, Option<f64>, f64), Arc<CoilCurve>);

/// Curves built so far. The quadrature takes tens of milliseconds, and a campaign makes thousands
/// of plants with one coil.
static KNOWN: Mutex<Vec<Known>> = Mutex::new(Vec::new());

/// Capacity of the cache of curves: more coils than any campaign compares. Beyond it the oldest
/// curve is dropped.
const KNOWN_AT_MOST: usize = 16;

impl CoilCurve {
    /// Builds the curve of a coil, with a plane of copper at `copper_m` from its turns or without
    /// (see [`CoilIntegral::new`]).
    #[must_use]
    pub fn new(design: &CoilDesign, copper_m: Option<f64>) -> Self {
        Self::of(&CoilIntegral::new(*design, copper_m))
    }

    fn of(integral: &CoilIntegral) -> Self {
        let value = chebyshev_series(|x| integral.inductance_h(gap_of(x)));
        Self {
            value,
            slope: differentiated(&value).map(|term| term / HALF_SPAN),
            in_air_h: integral.design().inductance_in_air_h(),
        }
    }

    /// A shared curve, built at most once in this process (see [`Self::new`]).
    #[must_use]
    pub fn shared(design: &CoilDesign, copper_m: Option<f64>) -> Arc<Self> {
        Self::shared_facing(design, copper_m, 0.0)
    }

    /// A shared curve of a coil with an object's face on the upper slab (see
    /// [`CoilIntegral::facing`]).
    #[must_use]
    pub fn shared_facing(design: &CoilDesign, copper_m: Option<f64>, reflection: f64) -> Arc<Self> {
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (*design, copper_m, reflection);
        if let Some((_, curve)) = known.iter().find(|(other, _)| *other == key) {
            return Arc::clone(curve);
        }
        let integral = CoilIntegral::new(*design, copper_m).facing(reflection);
        let curve = Arc::new(Self::of(&integral));
        if known.len() >= KNOWN_AT_MOST {
            known.remove(0);
        }
        known.push((key, Arc::clone(&curve)));
        curve
    }

    /// Inductance, H, and its slope in the gap, H/m.
    #[must_use]
    pub fn at(&self, gap_m: f64) -> (f64, f64) {
        let clamped_m = gap_m.clamp(LEAST_GAP_M, LARGEST_GAP_M);
        let x = (libm::log(clamped_m) - CENTRE) / HALF_SPAN;
        let (value, slope) = clenshaw(&self.value, &self.slope, x);
        if clamped_m == gap_m {
            (value, slope / clamped_m)
        } else {
            (value, 0.0)
        }
    }

    /// Inductance without MSE and copper, H.
    #[must_use]
    pub fn in_air_h(&self) -> f64 {
        self.in_air_h
    }
}

/// Centre of the logarithm of the gap, from ln 0.1 mm to ln 4 mm, and half of its span.
const CENTRE: f64 = -7.365_900_644_919_214;
const HALF_SPAN: f64 = 1.844_439_727_056_968;

fn gap_of(x: f64) -> f64 {
    libm::exp(CENTRE + HALF_SPAN * x)
}

/// Interpolation of `f` on [−1, 1] at the Chebyshev nodes.
fn chebyshev_series(f: impl Fn(f64) -> f64) -> [f64; TERMS] {
    let angle = |node: usize| PI * (node as f64 + 0.5) / TERMS as f64;
    let values: [f64; TERMS] = core::array::from_fn(|node| f(libm::cos(angle(node))));
    core::array::from_fn(|term| {
        let sum: f64 = (0..TERMS)
            .zip(values)
            .map(|(node, value)| value * libm::cos(term as f64 * angle(node)))
            .sum();
        let share = if term == 0 { 1.0 } else { 2.0 };
        share * sum / TERMS as f64
    })
}

/// The series of the derivative (Clenshaw 1957): c'ₙ₋₁ = c'ₙ₊₁ + 2 n cₙ, the first one halved.
fn differentiated(series: &[f64; TERMS]) -> [f64; TERMS] {
    let mut slope = [0.0; TERMS];
    let (mut next, mut after) = (0.0, 0.0);
    for (n, term) in series.iter().enumerate().skip(1).rev() {
        let this = after + 2.0 * n as f64 * term;
        (after, next) = (next, this);
        if let Some(term) = slope.get_mut(n - 1) {
            *term = if n == 1 { 0.5 * this } else { this };
        }
    }
    slope
}

/// Σ cₙ Tₙ(x) of two series (Clenshaw 1955), interleaved so that the processor overlaps them.
fn clenshaw(one: &[f64; TERMS], other: &[f64; TERMS], x: f64) -> (f64, f64) {
    let twice = 2.0 * x;
    let (mut a, mut a_before) = (0.0, 0.0);
    let (mut b, mut b_before) = (0.0, 0.0);
    let ([one_first, one_rest @ ..], [other_first, other_rest @ ..]) = (one, other);
    for (one, other) in one_rest.iter().zip(other_rest).rev() {
        (a, a_before) = (one + twice * a - a_before, a);
        (b, b_before) = (other + twice * b - b_before, b);
    }
    (one_first + x * a - a_before, other_first + x * b - b_before)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_domain_is_as_stated() {
        assert!((gap_of(-1.0) / LEAST_GAP_M - 1.0).abs() < 1e-14);
        assert!((gap_of(1.0) / LARGEST_GAP_M - 1.0).abs() < 1e-14);
    }

    #[test]
    fn the_series_keeps_to_the_integral_within_1e_12() {
        for copper_m in [None, Some(5e-3)] {
            let integral = CoilIntegral::new(CoilDesign::REFERENCE, copper_m);
            let curve = CoilCurve::new(&CoilDesign::REFERENCE, copper_m);
            let mut worst: f64 = 0.0;
            for step in 0..=60 {
                let gap_m = 0.1e-3 * 40_f64.powf(f64::from(step) / 60.0) * 0.999_999_9;
                let error = curve.at(gap_m).0 / integral.inductance_h(gap_m) - 1.0;
                worst = worst.max(error.abs());
            }
            println!("worst {worst:e}");
            assert!(worst < 1e-12, "{worst}");
        }
    }

    #[test]
    fn the_slope_is_that_of_the_curve() {
        let curve = CoilCurve::new(&CoilDesign::REFERENCE, None);
        for gap_m in [0.2e-3, 0.6e-3, 1e-3, 2.5e-3] {
            let h = 1e-4 * gap_m;
            let value = |offset: f64| curve.at(gap_m + offset * h).0;
            let fourth_order =
                (8.0 * (value(1.0) - value(-1.0)) - (value(2.0) - value(-2.0))) / (12.0 * h);
            let error = curve.at(gap_m).1 / fourth_order - 1.0;
            println!("{error:e}");
            assert!(error.abs() < 1e-10, "{gap_m}: {error}");
        }
    }

    #[test]
    fn it_falls_with_the_gap_and_stays_put_beyond_its_ends() {
        let curve = CoilCurve::new(&CoilDesign::REFERENCE, None);
        let mut last = f64::INFINITY;
        for step in 1..390 {
            let (value, slope) = curve.at(0.1e-3 + 1e-5 * f64::from(step));
            assert!(value < last && slope < 0.0, "{step}");
            last = value;
        }
        assert_eq!(curve.at(0.05e-3), (curve.at(0.1e-3).0, 0.0));
        assert_eq!(curve.at(9e-3).1, 0.0);
    }

    #[test]
    fn copper_leaves_it_monotone_where_the_layer_works() {
        let curve = CoilCurve::new(&CoilDesign::REFERENCE, Some(5e-3));
        for step in 1..=150 {
            let gap_m = 0.1e-3 + 1e-5 * f64::from(step);
            assert!(curve.at(gap_m).1 < 0.0, "{gap_m}");
        }
    }

    #[test]
    fn a_coil_is_computed_once() {
        let one = CoilCurve::shared(&CoilDesign::REFERENCE, None);
        let again = CoilCurve::shared(&CoilDesign::REFERENCE, None);
        let other = CoilCurve::shared(&CoilDesign::REFERENCE, Some(5e-3));
        assert!(Arc::ptr_eq(&one, &again));
        assert!(!Arc::ptr_eq(&one, &other));
    }
}
