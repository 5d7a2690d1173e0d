//! The radial profile: reading of a coil against the distance of the press.

use crate::math::{exp, ln, sqrt};
use crate::units::{Metre, Newton, OutOfRange, Requirement};

/// Number of coefficients of the profile in the middle of the radii.
pub const BASE: usize = 9;
/// Number of coefficients of each change by the radius, which reaches less far.
pub const BY_RADIUS: usize = 5;
/// Number of coefficients of each part that grows with the square of the force.
pub const BENT: usize = 4;

/// Coefficients of a profile.
///
/// With s = (sqrt(a) - sqrt(a_mid)) / half, which is -1 and 1 at the ends of the radii,
///
/// Phi(r, a) = sum of (base_j + linear_j s + quadratic_j s^2) B(r/spacing - j),
///
/// where B is the cubic B-spline with knots at whole numbers, and the coefficients at -j are those
/// at j. Psi(r, a) is made in the same way of the coefficients `bent`. Phi is even in r, has two
/// continuous derivatives, and is zero from ten knots on. An array that is wider than this reach needs
/// a wider spacing.
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
    /// Change of `base` with s, 1/N.
    pub linear: [f32; BY_RADIUS],
    /// Change of `base` with s^2, 1/N.
    pub quadratic: [f32; BY_RADIUS],
    /// Psi in the middle of the radii, its change with s, and with s^2, 1/N^2.
    pub bent: [[f32; BENT]; 3],
    /// Greatest force of the calibration. Beyond it, readings grow linearly with the force.
    pub greatest_force: Newton,
}

/// The profile of all coils of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    coefficients: Coefficients,
    middle: f32,
    half: f32,
    /// Knots per metre.
    per_metre: f32,
    ln_radii: [f32; 2],
}

/// A reading and its derivatives by the distance (in knots), by ln F and by ln a.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Response {
    pub(super) value: f32,
    pub(super) by_distance: f32,
    pub(super) by_ln_force: f32,
    pub(super) by_ln_radius: f32,
}

/// The coefficients at a contact radius, with their derivatives by ln a, 1/N.
#[derive(Clone, Copy, Debug)]
pub(super) struct Table {
    values: [f32; BASE],
    by_ln_radius: [f32; BY_RADIUS],
    bent: [f32; BENT],
    bent_by_ln_radius: [f32; BENT],
    greatest_force: f32,
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
        Newton::positive(of.greatest_force.0)?;
        for &value in all.chain(of.bent.as_flattened()) {
            // The magnitude: a coefficient may have either sign.
            OutOfRange::check(value.abs(), Requirement::NonNegative)?;
        }
        let [least, greatest] = [of.least_radius, of.greatest_radius].map(|of| sqrt(of.0));
        Ok(Self {
            coefficients,
            middle: 0.5 * (greatest + least),
            half: Metre::positive(0.5 * (greatest - least))?.0,
            per_metre: OutOfRange::check(1.0 / of.spacing.0, Requirement::Positive)?,
            ln_radii: [of.least_radius, of.greatest_radius].map(|of| ln(of.0)),
        })
    }

    /// Distance from a coil beyond which its reading is zero: the end of the last spline.
    pub fn reach(&self) -> Metre {
        self.coefficients.spacing * (BASE + 1) as f32
    }

    /// The coefficients.
    #[inline(always)]
    pub const fn coefficients(&self) -> &Coefficients {
        &self.coefficients
    }

    /// Relative change of inductance that a press of `force_n` at the distance causes in a coil of
    /// gain 1. Radii beyond the calibration's count as the nearest one.
    pub fn reading(&self, force_n: f32, distance: Metre, radius: Metre) -> f32 {
        let table = self.table(ln(radius.0));
        table.response(self.knots(distance), force_n).value
    }

    pub(super) fn table(&self, ln_radius: f32) -> Table {
        let of = &self.coefficients;
        let root = exp(0.5 * ln_radius);
        let s = ((root - self.middle) / self.half).clamp(-1.0, 1.0);
        let s_by_ln_radius = 0.5 * root / self.half;
        let mut table = Table {
            values: of.base,
            by_ln_radius: [0.0; BY_RADIUS],
            bent: [0.0; BENT],
            bent_by_ln_radius: [0.0; BENT],
            greatest_force: of.greatest_force.0,
        };
        let sums = table.values.iter_mut().zip(&mut table.by_ln_radius);
        for ((value, by), (linear, quadratic)) in sums.zip(of.linear.iter().zip(&of.quadratic)) {
            let bent = s * quadratic;
            *value += s * (linear + bent);
            *by = s_by_ln_radius * (linear + 2.0 * bent);
        }
        let [middle, linear, quadratic] = &of.bent;
        let sums = table.bent.iter_mut().zip(&mut table.bent_by_ln_radius);
        let parts = middle.iter().zip(linear).zip(quadratic);
        for ((value, by), ((middle, linear), quadratic)) in sums.zip(parts) {
            let bent = s * quadratic;
            *value = middle + s * (linear + bent);
            *by = s_by_ln_radius * (linear + 2.0 * bent);
        }
        table
    }

    pub(super) const fn spacing(&self) -> Metre {
        self.coefficients.spacing
    }

    /// A length in knots.
    pub(super) const fn knots(&self, length: Metre) -> f32 {
        length.0 * self.per_metre
    }

    /// ln a of the least and the greatest radius.
    pub(super) const fn ln_radii(&self) -> [f32; 2] {
        self.ln_radii
    }
}

impl Table {
    /// A coil's reading of a force at a distance in knots, with its derivatives.
    pub(super) fn response(&self, distance: f32, force: f32) -> Response {
        let at = Interval::new(distance);
        let (parts, slopes) = (at.parts(), at.slopes());
        let straight = at.sum(&parts, &self.values);
        let bent = at.sum(&parts, &self.bent);
        // F^2, or its tangent beyond the calibrated forces.
        let within = force.min(self.greatest_force);
        let square = within * (2.0 * force - within);
        let by_force = 2.0 * within;
        Response {
            value: force * straight + square * bent,
            by_distance: force * at.sum(&slopes, &self.values)
                + square * at.sum(&slopes, &self.bent),
            by_ln_force: force * (straight + by_force * bent),
            by_ln_radius: force * at.sum(&parts, &self.by_ln_radius)
                + square * at.sum(&parts, &self.bent_by_ln_radius),
        }
    }

    /// Phi at a distance in knots.
    pub(super) fn value(&self, distance: f32) -> f32 {
        let at = Interval::new(distance);
        at.sum(&at.parts(), &self.values)
    }
}

/// A place between two knots.
struct Interval {
    knot: usize,
    share: f32,
}

impl Interval {
    /// At a distance in knots, at least zero. It saturates for large numbers; NaN counts as zero, and
    /// the share stays NaN.
    fn new(distance: f32) -> Self {
        let knot = distance as usize;
        Self {
            knot,
            share: distance - knot as f32,
        }
    }

    /// The four B-splines that are not zero here; they add up to one.
    fn parts(&self) -> [f32; 4] {
        const SIXTH: f32 = 1.0 / 6.0;
        let t = self.share;
        let (u, tt) = (1.0 - t, t * t);
        let [first, last] = [SIXTH * u * u * u, SIXTH * t * tt];
        let second = 0.5 * t * tt - tt + 2.0 * (1.0 / 3.0);
        [first, second, 1.0 - first - second - last, last]
    }

    /// Their slopes, which add up to zero.
    fn slopes(&self) -> [f32; 4] {
        let t = self.share;
        let (u, tt) = (1.0 - t, t * t);
        let [first, last] = [-0.5 * u * u, 0.5 * tt];
        let second = 1.5 * tt - 2.0 * t;
        [first, second, -first - second - last, last]
    }

    /// Sum of a table's splines, by their values or slopes. The table is even about its first knot.
    fn sum(&self, splines: &[f32; 4], table: &[f32]) -> f32 {
        let indices = [
            self.knot.abs_diff(1),
            self.knot,
            self.knot.saturating_add(1),
            self.knot.saturating_add(2),
        ];
        let pairs = indices.iter().zip(splines);
        let product = |(index, spline): (&usize, &f32)| Some(table.get(*index)? * spline);
        pairs.filter_map(product).sum()
    }
}
