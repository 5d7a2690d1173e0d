//! A monotone curve through calibration points.
//!
//! Calibration gives pairs of values: inductance change and deformation, current and stiffening.
//! The curve between the points must be monotone, because otherwise one reading would mean two
//! deformations. It must be smooth, because its slope converts a sigma of the reading to a sigma of
//! the deformation. A cubic spline overshoots, so this module uses the piecewise cubic Hermite
//! interpolant with the slopes of Fritsch and Butland (*A method for constructing local monotone
//! piecewise cubic interpolants*, SIAM J. Sci. Stat. Comput. 5, 1984), known as PCHIP. It meets the
//! sufficient condition of Fritsch and Carlson (SIAM J. Numer. Anal. 17, 1980): no slope at a point
//! above three times the slope of either neighbouring secant.
//!
//! Between points of a smooth function at the spacing h, the error falls at least as fast as h^3.

use core::fmt;

/// A calibration point with the slope of the curve there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Knot {
    x: f32,
    y: f32,
    slope: f32,
}

/// A monotone function through up to `N` points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonotoneCurve<const N: usize> {
    knots: [Knot; N],
    len: usize,
}

/// Reason why a list of points is not a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveError {
    /// Fewer than two points.
    TooFew {
        /// Number of points given.
        given: usize,
    },
    /// More points than the curve can hold.
    TooMany {
        /// Number of points given.
        given: usize,
        /// Number of points that fit.
        capacity: usize,
    },
    /// The point at `index` is infinite or NaN, or so close to the previous one that the slope of
    /// the secant overflows.
    NotFinite {
        /// Index of the point.
        index: usize,
    },
    /// The argument at `index` is not above the previous one.
    NotIncreasing {
        /// Index of the point.
        index: usize,
    },
    /// The value at `index` equals the previous one, or reverses the direction: all values must
    /// rise, or all must fall.
    NotMonotone {
        /// Index of the point.
        index: usize,
    },
}

impl fmt::Display for CurveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooFew { given } => write!(f, "{given} calibration points, at least 2 needed"),
            Self::TooMany { given, capacity } => {
                write!(f, "{given} calibration points, at most {capacity} fit")
            }
            Self::NotFinite { index } => write!(f, "calibration point {index} is not finite"),
            Self::NotIncreasing { index } => {
                write!(f, "argument of calibration point {index} does not increase")
            }
            Self::NotMonotone { index } => {
                write!(f, "value of calibration point {index} is not monotone")
            }
        }
    }
}

impl core::error::Error for CurveError {}

/// Value and slope of a curve at one argument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Value.
    pub value: f32,
    /// Derivative of the value with respect to the argument.
    pub slope: f32,
    /// Whether the argument lies outside the range of the calibration points; value and slope are
    /// then those of the tangent at the nearest end.
    pub extrapolated: bool,
}

impl CurvePoint {
    /// Standard deviation of the value if the argument has the standard deviation `sigma`, to first
    /// order.
    pub const fn sigma(&self, sigma: f32) -> f32 {
        self.slope.abs() * sigma
    }
}

impl<const N: usize> MonotoneCurve<N> {
    /// Creates a curve from points (argument, value) with increasing arguments and rising or
    /// falling values.
    ///
    /// ```
    /// use palpate_model::calibration_curve::{CurveError, MonotoneCurve};
    /// let curve = MonotoneCurve::<8>::new(&[(0.0, 0.0), (0.1, 0.2e-3), (0.25, 0.4e-3)])?;
    /// let point = curve.at(0.1);
    /// assert_eq!(point.value, 0.2e-3);
    /// assert!(point.slope > 0.0 && !point.extrapolated);
    /// assert_eq!(
    ///     MonotoneCurve::<8>::new(&[(0.0, 0.0), (0.1, 0.2e-3), (0.2, 0.1e-3)]),
    ///     Err(CurveError::NotMonotone { index: 2 }),
    /// );
    /// # Ok::<(), CurveError>(())
    /// ```
    pub fn new(points: &[(f32, f32)]) -> Result<Self, CurveError> {
        let given = points.len();
        if given > N {
            return Err(CurveError::TooMany { given, capacity: N });
        }
        if given < 2 {
            return Err(CurveError::TooFew { given });
        }
        validate(points)?;
        let mut knots = [Knot::default(); N];
        for (knot, &(x, y)) in knots.iter_mut().zip(points) {
            *knot = Knot { x, y, slope: 0.0 };
        }
        set_slopes(&mut knots, points);
        Ok(Self { knots, len: given })
    }

    /// Value and slope at `x`.
    ///
    /// The slope never changes sign. In exact arithmetic the value is monotone in `x`. Rounding may
    /// move it against that direction by at most 6 ulp of the larger of the segment's two end
    /// values (4 occurred in 4e7 random pairs), but never carries it beyond those end values. At a
    /// calibration point the value is exact.
    pub fn at(&self, x: f32) -> CurvePoint {
        let knots = self.knots.get(..self.len).unwrap_or(&self.knots);
        let above = knots.partition_point(|knot| knot.x < x);
        let right = knots.get(above);
        let left = above.checked_sub(1).and_then(|below| knots.get(below));
        match (left, right) {
            (Some(left), Some(right)) => left.towards(right, x),
            (Some(end), None) | (None, Some(end)) => end.tangent(x),
            (None, None) => CurvePoint {
                value: f32::NAN,
                slope: f32::NAN,
                extrapolated: true,
            },
        }
    }

    /// The calibration points, argument and value.
    pub fn points(&self) -> impl ExactSizeIterator<Item = (f32, f32)> + '_ {
        let knots = self.knots.get(..self.len).unwrap_or(&self.knots);
        knots.iter().map(|knot| (knot.x, knot.y))
    }

    /// Checksum over points and slopes; it differs if any one of them differs.
    ///
    /// ```
    /// use palpate_model::calibration_curve::MonotoneCurve;
    /// let sum = |y| MonotoneCurve::<8>::new(&[(0.0, 0.0), (0.1, y)]).map(|of| of.checksum());
    /// assert_eq!(sum(0.2e-3)?, sum(0.2e-3)?);
    /// assert_ne!(sum(0.2e-3)?, sum(f32::next_up(0.2e-3))?);
    /// # Ok::<(), palpate_model::calibration_curve::CurveError>(())
    /// ```
    pub fn checksum(&self) -> u32 {
        // Each step is invertible, so a change of a single word always changes the result. The
        // factor is 2^32 divided by the golden ratio, rounded to an odd number, as usual for
        // hashes.
        let mix = |sum: u32, word: u32| (sum.rotate_left(5) ^ word).wrapping_mul(0x9E37_79B9);
        let knots = self.knots.get(..self.len).unwrap_or(&self.knots);
        let words = knots.iter().flat_map(|of| [of.x, of.y, of.slope]);
        words.fold(self.len as u32, |sum, word| mix(sum, word.to_bits()))
    }
}

impl Knot {
    fn tangent(&self, x: f32) -> CurvePoint {
        CurvePoint {
            value: self.y + self.slope * (x - self.x),
            slope: self.slope,
            extrapolated: x != self.x,
        }
    }

    /// Value and slope at `x` of the cubic between this knot and `right`, expanded about the nearer
    /// of the two.
    fn towards(&self, right: &Self, x: f32) -> CurvePoint {
        let width = right.x - self.x;
        let secant = (right.y - self.y) / width;
        let (near, far) = if x - self.x <= right.x - x {
            (self, right)
        } else {
            (right, self)
        };
        // Hermite's cubic is written as the secant plus the deviations of the two slopes from it.
        // `s` is the distance from `near` in units of the width, at most a half: there the cubic
        // has covered at most 7/8 of the step to `far`, so rounding does not carry it beyond `far`.
        let way = x - near.x;
        let s = way.abs() / width;
        let rest = 1.0 - s;
        let (a, b) = ((near.slope - secant) * rest, (far.slope - secant) * s);
        let bend = a - b;
        let value = near.y + way * (secant + rest * bend);
        let slope = secant + bend * (1.0 - 3.0 * s) - b;
        CurvePoint {
            value,
            slope: if secant > 0.0 {
                slope.max(0.0)
            } else {
                slope.min(0.0)
            },
            extrapolated: false,
        }
    }
}

fn validate(points: &[(f32, f32)]) -> Result<(), CurveError> {
    let rising = match points {
        [(_, first), .., (_, last)] => last > first,
        _ => {
            return Err(CurveError::TooFew {
                given: points.len(),
            });
        }
    };
    let finite = |&(x, y): &(f32, f32)| x.is_finite() && y.is_finite();
    if let Some(index) = points.iter().position(|point| !finite(point)) {
        return Err(CurveError::NotFinite { index });
    }
    for (index, (&(x0, y0), &(x1, y1))) in (1..).zip(points.iter().zip(points.iter().skip(1))) {
        if x1 <= x0 {
            return Err(CurveError::NotIncreasing { index });
        }
        if y0 == y1 || (y1 > y0) != rising {
            return Err(CurveError::NotMonotone { index });
        }
        let secant = (y1 - y0) / (x1 - x0);
        if !(3.0 * secant).is_finite() || secant == 0.0 || !(x1 - x0).is_finite() {
            return Err(CurveError::NotFinite { index });
        }
    }
    Ok(())
}

/// Sets the slopes: Fritsch and Butland's at inner points, the limited three-point formula at the
/// two ends.
fn set_slopes(knots: &mut [Knot], points: &[(f32, f32)]) {
    match points {
        [a, b] => knots
            .iter_mut()
            .take(2)
            .for_each(|knot| knot.slope = Chord::between(*a, *b).1),
        [a, b, c, ..] => {
            let triples = points
                .iter()
                .zip(points.iter().skip(1))
                .zip(points.iter().skip(2));
            for (knot, ((&left, &here), &right)) in knots.iter_mut().skip(1).zip(triples) {
                knot.slope = inner_slope(Chord::between(left, here), Chord::between(here, right));
            }
            if let Some(first) = knots.first_mut() {
                first.slope = end_slope(Chord::between(*a, *b), Chord::between(*b, *c));
            }
            if let ([.., c, b, a], Some(last)) =
                (points, knots.iter_mut().take(points.len()).last())
            {
                last.slope = end_slope(Chord::between(*b, *a), Chord::between(*c, *b));
            }
        }
        _ => {}
    }
}

/// Width of a segment, and slope of its secant.
#[derive(Clone, Copy)]
struct Chord(f32, f32);

impl Chord {
    fn between((x0, y0): (f32, f32), (x1, y1): (f32, f32)) -> Self {
        Self(x1 - x0, (y1 - y0) / (x1 - x0))
    }
}

/// Weighted harmonic mean of the slopes of two secants with the same sign: at most three times the
/// smaller slope.
fn inner_slope(Chord(h0, d0): Chord, Chord(h1, d1): Chord) -> f32 {
    let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
    // (w0 + w1) / (w0/d0 + w1/d1), arranged so that no quotient of extreme values overflows.
    let share = w0 / (w0 + w1);
    let (small, large, weight) = if d0.abs() < d1.abs() {
        (d0, d1, share)
    } else {
        (d1, d0, 1.0 - share)
    };
    small / (weight + (1.0 - weight) * (small / large))
}

/// Slope at an end point, of the parabola through that point and its two neighbours, or zero if
/// this slope has the wrong sign. It is at most twice the slope of the end's own secant, since both
/// secants have the same sign.
fn end_slope(Chord(h0, d0): Chord, Chord(h1, d1): Chord) -> f32 {
    let slope = d0 + (d0 - d1) * (h0 / (h0 + h1));
    let sign = d0.signum();
    sign * (slope * sign).max(0.0)
}
