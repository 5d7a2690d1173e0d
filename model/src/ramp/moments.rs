//! Running sums of a weighted least-squares fit, and their solution.
//!
//! **Why wide numbers.** At a stiffening of 0.5 % and a load ten times the sensor's stiffness the
//! answer hangs on the seventh digit of a slope, and normal equations square the condition that
//! drifts bring. Sums of `f32`, even centred (Welford), are off by 3e-5 of c_L there, and by 2e-3
//! with a creep term (`examples/precision.rs`); compensation does not mend the rounding of the
//! products. So rows are formed, multiplied and summed as [`Wide`] integers of 62 bits: the sums
//! are those of the very inputs, however long the ramp, and on a processor without a
//! floating-point unit they cost no more than `f32` sums
//! with compensation would. Centring is then no art any more, it is the
//! first elimination step. What is left is the `f32` rounding of the inputs and of the result.

use crate::math::Wide;

/// Upper triangle of the weighted cross products of P columns, and those with the response.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Moments<const P: usize> {
    products: [[Wide; P]; P],
    with_response: [Wide; P],
    response: Wide,
    rows: u32,
}

/// The solved equations.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solution<const P: usize> {
    /// Coefficients.
    pub(super) theta: [Wide; P],
    /// Inverse of the cross products: covariance of `theta` at unit variance of a row.
    pub(super) inverse: [[Wide; P]; P],
    /// Sum of the squared residuals.
    pub(super) residual: Wide,
    /// Mean of the slope's column over that of the level.
    pub(super) centre: f32,
    /// By how much the other columns inflate the variance of the slope.
    pub(super) inflation: f32,
}

/// The column at this place has too little that the ones before it have not.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dependent(pub(super) usize);

/// Place of the level's column, the one that centres all others.
const LEVEL: usize = 0;
/// Place of the slope's column.
const SLOPE: usize = 1;

/// Smallest part of a column's sum of squares that may be left after centring.
///
/// `f32` inputs resolve 6e-8 of a column, so 1e-10 of its square is a spread of 1e-5, known to
/// 0.6 %: with less there is no regressor.
const CENTRED_MIN: f32 = 1e-10;

/// Smallest part of a centred column's sum of squares that may be left after the elimination of
/// the others: the inverse of the largest variance inflation.
///
/// At one millionth the standard errors are a thousand times those of the column alone, far
/// beyond use, and the sums still carry seven digits of what is left.
const TOLERANCE_MIN: f32 = 1e-6;

impl<const P: usize> Moments<P> {
    pub(super) const EMPTY: Self = Self {
        products: [[Wide::ZERO; P]; P],
        with_response: [Wide::ZERO; P],
        response: Wide::ZERO,
        rows: 0,
    };

    pub(super) const fn rows(&self) -> u32 {
        self.rows
    }

    /// Adds one row, already multiplied by the root of its weight.
    pub(super) fn add(&mut self, row: &[Wide; P], response: Wide) {
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

    /// The sums of the first columns alone: those that fewer columns would have given.
    pub(super) fn leading<const Q: usize>(&self) -> Moments<Q> {
        let mut leading = Moments::<Q>::EMPTY;
        for (into, from) in leading.products.iter_mut().zip(&self.products) {
            for (entry, &sum) in into.iter_mut().zip(from) {
                *entry = sum;
            }
        }
        for (into, &sum) in leading.with_response.iter_mut().zip(&self.with_response) {
            *into = sum;
        }
        leading.response = self.response;
        leading.rows = self.rows;
        leading
    }

    /// Solves by sweeping the columns one after another (Goodnight, *A tutorial on the SWEEP
    /// operator*, The American Statistician 33, 1979): the level first, which centres; then
    /// disturbances and curvature; the slope last, so that its pivot is what they have left of it.
    pub(super) fn solve(&self) -> Result<Solution<P>, Dependent> {
        let mut sweep = Sweep {
            rows: symmetric(&self.products),
            with_response: self.with_response,
            residual: self.response,
        };
        let raw = sweep.diagonal();
        let mut centred = raw;
        let mut inflation = 1.0;
        let order = core::iter::once(LEVEL)
            .chain(2..P)
            .chain(core::iter::once(SLOPE));
        for k in order {
            let pivot = sweep.pivot(k);
            let (&before, &alone) = raw.get(k).zip(centred.get(k)).ok_or(Dependent(k))?;
            // Written so that NaN fails too.
            let sound = pivot >= TOLERANCE_MIN * alone && alone > CENTRED_MIN * before;
            if !sound || !pivot.is_finite() {
                return Err(Dependent(k));
            }
            inflation = alone / pivot;
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
            inflation,
        })
    }

    fn centre(&self) -> f32 {
        let mut level = self.products.iter().take(1).flatten();
        match (level.next(), level.next()) {
            (Some(&squares), Some(&cross)) => (cross / squares).to_f32(),
            _ => 0.0,
        }
    }
}

/// Cross products in the course of Gauss-Jordan elimination in place: swept columns already hold
/// the inverse, the others what is left of them.
struct Sweep<const P: usize> {
    rows: [[Wide; P]; P],
    with_response: [Wide; P],
    residual: Wide,
}

impl<const P: usize> Sweep<P> {
    fn diagonal(&self) -> [f32; P] {
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
        for (i, (row, response)) in self
            .rows
            .iter_mut()
            .zip(&mut self.with_response)
            .enumerate()
        {
            let factor = if i == k {
                *row = [Wide::ZERO; P];
                *response = Wide::ZERO;
                -inverse
            } else {
                *row.get(k)? * inverse
            };
            for (entry, &above) in row.iter_mut().zip(&pivot_row) {
                *entry = *entry - factor * above;
            }
            *row.get_mut(k)? = -factor;
            *response = *response - factor * pivot_response;
        }
        self.residual = self.residual - pivot_response * pivot_response * inverse;
        Some(())
    }
}

fn symmetric<const P: usize>(upper: &[[Wide; P]; P]) -> [[Wide; P]; P] {
    core::array::from_fn(|i| {
        core::array::from_fn(|j| {
            let (row, column) = if i <= j { (i, j) } else { (j, i) };
            upper
                .get(row)
                .and_then(|row| row.get(column))
                .copied()
                .unwrap_or_default()
        })
    })
}
