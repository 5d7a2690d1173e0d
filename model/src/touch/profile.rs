//! The radial profile: reading of a coil against the distance of the press.

use crate::math::{exp, ln, sqrt};
use crate::units::{Metre, OutOfRange, Requirement};

/// Number of coefficients of the profile in the middle of the radii.
pub const BASE: usize = 9;
/// Number of coefficients of each change by the radius, which reaches less far.
pub const BY_RADIUS: usize = 5;

/// Coefficients of a profile.
///
/// With s = (sqrt(a) - sqrt(a_mid)) / half, which is -1 and 1 at the ends of the radii,
///
/// Phi(r, a) = sum of (base_j + linear_j s + quadratic_j s^2) B(r/spacing - j),
///
/// where B is the cubic B-spline with knots at whole numbers, and the coefficients at -j are those
/// at j: Phi is even in r, has two continuous derivatives, and is zero beyond the last knots.
///
/// The form fits the profiles of a bonded layer of 3 and 5 mm under coils from 2 to 6.5 mm, for
/// contacts from 1 to 5 mm, within 0.3 to 0.4 % of the peak (root mean square) and 2.5 % (greatest,
/// at the smallest contact), with a spacing of 2 mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    /// Distance between two knots.
    pub spacing: Metre,
    /// Least contact radius of the calibration.
    pub least_radius: Metre,
    /// Greatest contact radius of the calibration.
    pub greatest_radius: Metre,
    /// Relative change of inductance per newton, in the middle of the radii.
    pub base: [f32; BASE],
    /// Change with s, 1/N.
    pub linear: [f32; BY_RADIUS],
    /// Change with s^2, 1/N.
    pub quadratic: [f32; BY_RADIUS],
    /// Bend c of the curve f: f(y) = y (1 + c y) if c y is above zero, else y/(1 - c y). f is
    /// monotone, with the slope 1 at zero.
    pub bend: f32,
}

/// The profile of all coils of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    coefficients: Coefficients,
    middle: f32,
    half: f32,
}

/// F Phi and its derivatives by the distance (in knots) and by ln a.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Response {
    pub(super) value: f32,
    pub(super) by_distance: f32,
    pub(super) by_ln_radius: f32,
}

/// s of a contact radius, with its derivative by ln a.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    s: f32,
    by_ln_radius: f32,
}

impl Profile {
    /// Checks and takes the coefficients: all finite, lengths above zero, and the greatest radius
    /// above the least one.
    pub fn new(coefficients: Coefficients) -> Result<Self, OutOfRange> {
        let of = coefficients;
        Metre::positive(of.spacing.0)?;
        Metre::positive(of.least_radius.0)?;
        Metre::positive((of.greatest_radius - of.least_radius).0)?;
        let all = of.base.iter().chain(&of.linear).chain(&of.quadratic);
        for &value in all.chain([&of.bend]) {
            // The magnitude: a coefficient may have either sign.
            OutOfRange::check(value.abs(), Requirement::NonNegative)?;
        }
        let [least, greatest] = [of.least_radius, of.greatest_radius].map(|of| sqrt(of.0));
        Ok(Self {
            coefficients,
            middle: 0.5 * (greatest + least),
            half: Metre::positive(0.5 * (greatest - least))?.0,
        })
    }

    /// The coefficients.
    pub const fn coefficients(&self) -> &Coefficients {
        &self.coefficients
    }

    /// Relative change of inductance that a press of `force_n` at the distance causes in a coil of
    /// gain 1. Radii beyond the calibration's count as the nearest one.
    pub fn reading(&self, force_n: f32, distance: Metre, radius: Metre) -> f32 {
        let shape = self.shape(ln(radius.0));
        let response = self.response(distance / self.coefficients.spacing, shape);
        self.curve(force_n * response.value).0
    }

    pub(super) fn shape(&self, ln_radius: f32) -> Shape {
        let root = exp(0.5 * ln_radius);
        Shape {
            s: ((root - self.middle) / self.half).clamp(-1.0, 1.0),
            by_ln_radius: 0.5 * root / self.half,
        }
    }

    /// Phi at a distance in knots, 1/N.
    pub(super) fn response(&self, distance: f32, Shape { s, by_ln_radius }: Shape) -> Response {
        // Saturates for large numbers; NaN counts as zero, and the fraction stays NaN.
        let knot = distance as usize;
        let spline = Spline::new(distance - knot as f32);
        let of = &self.coefficients;
        let [base, base_slope] = spline.at(&of.base, knot);
        let [linear, linear_slope] = spline.at(&of.linear, knot);
        let [quadratic, quadratic_slope] = spline.at(&of.quadratic, knot);
        Response {
            value: base + s * (linear + s * quadratic),
            by_distance: base_slope + s * (linear_slope + s * quadratic_slope),
            by_ln_radius: by_ln_radius * (linear + 2.0 * s * quadratic),
        }
    }

    /// f and its slope.
    pub(super) fn curve(&self, y: f32) -> (f32, f32) {
        let bent = self.coefficients.bend * y;
        if bent > 0.0 {
            (y * (1.0 + bent), 1.0 + 2.0 * bent)
        } else {
            let scale = 1.0 / (1.0 - bent);
            (y * scale, scale * scale)
        }
    }

    /// The inverse of f.
    pub(super) fn straight(&self, value: f32) -> f32 {
        let bent = self.coefficients.bend * value;
        if bent > 0.0 {
            2.0 * value / (1.0 + sqrt(1.0 + 4.0 * bent))
        } else {
            // f stays above -1/c: beyond, a number far below.
            value / (1.0 + bent).max(1e-3)
        }
    }

    pub(super) const fn spacing(&self) -> Metre {
        self.coefficients.spacing
    }

    pub(super) const fn radii(&self) -> [Metre; 2] {
        [
            self.coefficients.least_radius,
            self.coefficients.greatest_radius,
        ]
    }
}

/// The four parts of the B-splines that are not zero between two knots, and their slopes.
struct Spline {
    parts: [f32; 4],
    slopes: [f32; 4],
}

impl Spline {
    /// At a fraction `t` of the interval.
    fn new(t: f32) -> Self {
        const SIXTH: f32 = 1.0 / 6.0;
        let (u, tt) = (1.0 - t, t * t);
        let uu = u * u;
        let [first, last] = [SIXTH * u * uu, SIXTH * t * tt];
        let second = 0.5 * t * tt - tt + 2.0 * (1.0 / 3.0);
        let slope = 1.5 * tt - 2.0 * t;
        Self {
            // The four parts add up to one, their slopes to zero.
            parts: [first, second, 1.0 - first - second - last, last],
            slopes: [-0.5 * uu, slope, 0.5 * uu - slope - 0.5 * tt, 0.5 * tt],
        }
    }

    /// Sum of a table's B-splines and its slope, above the knot.
    fn at(&self, table: &[f32], knot: usize) -> [f32; 2] {
        let indices = [
            knot.abs_diff(1),
            knot,
            knot.saturating_add(1),
            knot.saturating_add(2),
        ];
        let mut sums = [0.0; 2];
        for (index, (part, slope)) in indices.iter().zip(self.parts.iter().zip(&self.slopes)) {
            if let Some(coefficient) = table.get(*index) {
                sums = [sums[0] + coefficient * part, sums[1] + coefficient * slope];
            }
        }
        sums
    }
}
