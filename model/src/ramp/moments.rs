//! Running sums of a weighted least-squares fit, and their solution.
//!
//! **Why wide numbers.** At a stiffening of 0.5 % and with a load ten times as stiff as the sensor,
//! the result depends on the seventh digit of a slope. Normal equations square the condition
//! number, which drift terms increase further. Sums of `f32`, even centred (Welford), are off by
//! 3e-5 of c_L there, and by 2e-3 with a creep term (`examples/precision.rs`); compensated
//! summation does not repair the rounding of the products. So rows are formed, multiplied and
//! summed as [`Wide`] integers of 62 bits: the sums are exact for the given inputs, however long
//! the ramp, and on a processor without a floating-point unit they cost no more than `f32` sums
//! with compensation. Centring then needs no special care: it is the first elimination step. Only
//! the `f32` rounding of the inputs and of the result remains.

use super::MOST_TERMS;
use crate::math::Wide;

/// One number for each possible unknown; zero for unknowns that the basis does not have.
pub(super) type Row<T> = [T; MOST_TERMS];

/// Upper triangle of the weighted cross products of the columns with each other, and their cross
/// products with the response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moments {
    products: Row<Row<Wide>>,
    with_response: Row<Wide>,
    response: Wide,
    rows: u32,
}

/// The solution of the normal equations.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solution {
    /// Coefficients of the unknowns.
    pub(super) theta: Row<Wide>,
    /// Inverse of the matrix of cross products: the covariance of `theta` if a row has unit
    /// variance.
    pub(super) inverse: Row<Row<Wide>>,
    /// Sum of the squared residuals.
    pub(super) residual: Wide,
    /// Mean of the slope's column divided by the mean of the level's column.
    pub(super) centre: f32,
}

/// Error: the column with this index is nearly a linear combination of the columns before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dependent(pub(super) usize);

/// Index of the level's column: its elimination centres all other columns.
const LEVEL: usize = 0;
/// Index of the slope's column.
const SLOPE: usize = 1;

/// Smallest fraction of a column's sum of squares that must remain after centring.
///
/// `f32` inputs resolve 6e-8 of a column. A remainder of 1e-10 of its square is a spread of 1e-5,
/// known to 0.6 %: with less there is no usable regressor.
const CENTRED_MIN: f32 = 1e-10;

/// Smallest fraction of a centred column's sum of squares that must remain after the elimination of
/// the other columns: the inverse of the largest variance inflation.
///
/// At one millionth the standard errors are a thousand times those of a fit with that column alone,
/// far too large to be used, and the sums still contain seven digits of the remainder.
const TOLERANCE_MIN: f32 = 1e-6;

impl Moments {
    pub(super) const EMPTY: Self = Self {
        products: [[Wide::ZERO; MOST_TERMS]; MOST_TERMS],
        with_response: [Wide::ZERO; MOST_TERMS],
        response: Wide::ZERO,
        rows: 0,
    };

    pub(super) const fn rows(&self) -> u32 {
        self.rows
    }

    /// Adds one row, which the caller has multiplied by the square root of its weight.
    pub(super) fn add(&mut self, row: &[Wide], response: Wide) {
        let sums = self.products.iter_mut().zip(&mut self.with_response);
        for (i, (&a, (products, with_response))) in row.iter().zip(sums).enumerate() {
            for (sum, &b) in products.iter_mut().zip(row).skip(i) {
                *sum = *sum + a * b;
            }
            *with_response = *with_response + a * response;
        }
        self.response = self.response + response * response;
        self.rows = self.rows.saturating_add(1);
    }

    /// The sums of the rows added since `earlier`. Their only error is the rounding of the sums
    /// themselves, 2^-60 of the sums of all rows.
    pub(super) fn since(&self, earlier: &Self) -> Self {
        let mut since = *self;
        let rows = since.products.iter_mut().zip(&earlier.products);
        for (sum, &before) in rows.flat_map(|(row, before)| row.iter_mut().zip(before)) {
            *sum = *sum - before;
        }
        for (sum, &before) in since.with_response.iter_mut().zip(&earlier.with_response) {
            *sum = *sum - before;
        }
        since.response = since.response - earlier.response;
        since.rows = since.rows.saturating_sub(earlier.rows);
        since
    }

    /// Solves for the first `count` columns by sweeping them one after another (Goodnight, *A
    /// tutorial on the SWEEP operator*, The American Statistician 33, 1979). The level is first,
    /// which centres the others; then come disturbances and curvature. The slope is last, so that
    /// its pivot is the part of the slope's column that the others do not explain.
    pub(super) fn solve(&self, count: usize) -> Result<Solution, Dependent> {
        let mut sweep = Sweep {
            count,
            rows: symmetric(&self.products, count),
            with_response: first(&self.with_response, count),
            residual: self.response,
        };
        let raw = sweep.diagonal();
        let mut centred = raw;
        let order = core::iter::once(LEVEL)
            .chain(2..count)
            .chain(core::iter::once(SLOPE));
        for k in order {
            let pivot = sweep.pivot(k);
            let (&before, &alone) = raw.get(k).zip(centred.get(k)).ok_or(Dependent(k))?;
            // Written so that NaN fails the test too.
            let sound = pivot >= TOLERANCE_MIN * alone && alone > CENTRED_MIN * before;
            if !sound || !pivot.is_finite() {
                return Err(Dependent(k));
            }
            sweep.eliminate(k).ok_or(Dependent(k))?;
            if k == LEVEL {
                centred = sweep.diagonal();
            }
        }
        Ok(Solution {
            theta: sweep.with_response,
            inverse: sweep.rows,
            residual: sweep.residual,
            centre: self.centre(),
        })
    }

    fn centre(&self) -> f32 {
        let [[squares, cross, ..], ..] = self.products;
        (cross / squares).to_f32()
    }
}

/// Cross products during the Gauss-Jordan elimination in place: swept columns contain the inverse,
/// all others the remaining cross products.
struct Sweep {
    count: usize,
    rows: Row<Row<Wide>>,
    with_response: Row<Wide>,
    residual: Wide,
}

impl Sweep {
    fn diagonal(&self) -> Row<f32> {
        core::array::from_fn(|k| self.pivot(k))
    }

    fn pivot(&self, k: usize) -> f32 {
        self.rows
            .get(k)
            .and_then(|row| row.get(k))
            .map_or(f32::NAN, |pivot| pivot.to_f32())
    }

    /// Sweeps column `k`. `None` only for a `k` that does not exist.
    fn eliminate(&mut self, k: usize) -> Option<()> {
        let pivot_row = *self.rows.get(k)?;
        let pivot_response = *self.with_response.get(k)?;
        let inverse = Wide::ONE / *pivot_row.get(k)?;
        let rows = self.rows.iter_mut().zip(&mut self.with_response);
        for (i, (row, response)) in rows.take(self.count).enumerate() {
            let factor = if i == k {
                *row = [Wide::ZERO; MOST_TERMS];
                *response = Wide::ZERO;
                -inverse
            } else {
                *row.get(k)? * inverse
            };
            for (entry, &above) in row.iter_mut().zip(&pivot_row).take(self.count) {
                *entry = *entry - factor * above;
            }
            *row.get_mut(k)? = -factor;
            *response = *response - factor * pivot_response;
        }
        self.residual = self.residual - pivot_response * pivot_response * inverse;
        Some(())
    }
}

/// The first `count` entries of a row; all others are zero.
fn first(row: &Row<Wide>, count: usize) -> Row<Wide> {
    core::array::from_fn(|i| match row.get(i) {
        Some(&entry) if i < count => entry,
        _ => Wide::ZERO,
    })
}

/// The full symmetric matrix of the first `count` rows and columns, from its upper triangle; all
/// other entries are zero.
fn symmetric(upper: &Row<Row<Wide>>, count: usize) -> Row<Row<Wide>> {
    core::array::from_fn(|i| {
        core::array::from_fn(|j| {
            let (row, column) = if i <= j { (i, j) } else { (j, i) };
            let entry = upper.get(row).and_then(|row| row.get(column)).copied();
            entry.filter(|_| column < count).unwrap_or_default()
        })
    })
}
