//! Linear least squares with a covariance.
//!
//! Uses Householder's triangularisation (Golub and Van Loan, *Matrix Computations*, section 5.3.2)
//! with the right side as an additional column; the part of that column below the triangle is the
//! residual.

use std::array;
use std::iter;
use std::ops::Index;

use super::Unusable;

/// Rows of an overdetermined system, each with its coefficients, right side and weight; a weight is
/// one over the row's sigma, up to a factor common to all rows.
#[derive(Clone, Debug, Default)]
pub struct System {
    unknowns: usize,
    /// Coefficients times their weight, row after row.
    coefficients: Vec<f64>,
    /// Right sides times their weight.
    right: Vec<f64>,
}

/// The solution with the covariance of the unknowns.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The unknowns, in the order of a row's coefficients.
    pub unknowns: Vec<f64>,
    /// Covariance of the unknowns.
    pub covariance: Covariance,
    /// Standard deviation of a row of weight 1.
    pub sigma: f64,
}

/// A symmetric matrix, by row and column.
#[derive(Clone, Debug)]
pub struct Covariance(Vec<Vec<f64>>);

impl Index<(usize, usize)> for Covariance {
    type Output = f64;

    fn index(&self, (row, column): (usize, usize)) -> &f64 {
        &self.0[row][column]
    }
}

impl System {
    /// Creates a system of `unknowns` unknowns without rows.
    pub fn new(unknowns: usize) -> Self {
        Self {
            unknowns,
            ..Self::default()
        }
    }

    /// Adds a row; missing coefficients count as zero.
    pub fn add(&mut self, row: impl IntoIterator<Item = f64>, right: f64, weight: f64) {
        let weighted = row.into_iter().map(|c| c * weight);
        let padded = weighted.chain(iter::repeat(0.0));
        self.coefficients.extend(padded.take(self.unknowns));
        self.right.push(right * weight);
    }

    /// Solves; `what` names the unknowns in the error.
    ///
    /// # Errors
    /// If the rows do not determine the unknowns.
    pub fn solve(&self, what: &'static str) -> Result<Solution, Unusable> {
        let freedom = self.right.len().saturating_sub(self.unknowns);
        if freedom == 0 {
            return Err(Unusable::Undetermined(what));
        }
        let mut columns = self.columns();
        // Normalised columns make the steps independent of units.
        let lengths: Vec<f64> = columns.iter().map(|column| norm(column)).collect();
        for (column, length) in columns.iter_mut().zip(&lengths) {
            column.iter_mut().for_each(|entry| *entry /= length);
        }
        columns.push(self.right.clone());
        triangularise(&mut columns, self.unknowns);
        let inverse = inverse_of_triangle(&columns, self.unknowns);
        let (solved, residual) = columns[self.unknowns].split_at(self.unknowns);
        let variance = dot(residual, residual) / freedom as f64;
        let unknowns: Vec<f64> = inverse
            .iter()
            .zip(&lengths)
            .map(|(row, length)| dot(row, solved) / length)
            .collect();
        // A column of zeros, or one that depends on others, has no finite solution.
        if unknowns.iter().any(|unknown| !unknown.is_finite()) {
            return Err(Unusable::Undetermined(what));
        }
        let entry = |i: usize, j: usize| {
            dot(&inverse[i], &inverse[j]) * variance / (lengths[i] * lengths[j])
        };
        let row = |i: usize| (0..self.unknowns).map(|j| entry(i, j)).collect();
        Ok(Solution {
            unknowns,
            covariance: Covariance((0..self.unknowns).map(row).collect()),
            sigma: variance.sqrt(),
        })
    }

    /// The coefficients by column.
    fn columns(&self) -> Vec<Vec<f64>> {
        let rows = self.coefficients.chunks_exact(self.unknowns);
        (0..self.unknowns)
            .map(|index| rows.clone().map(|row| row[index]).collect())
            .collect()
    }
}

/// Reflects the columns until the first `count` form an upper triangle.
fn triangularise(columns: &mut [Vec<f64>], count: usize) {
    for index in 0..count {
        let (done, rest) = columns.split_at_mut(index + 1);
        let column = &mut done[index][index..];
        let length = norm(column);
        // The sign that avoids cancellation.
        let diagonal = if column[0] > 0.0 { -length } else { length };
        let mut mirror = column.to_vec();
        mirror[0] -= diagonal;
        let square = dot(&mirror, &mirror);
        column.fill(0.0);
        column[0] = diagonal;
        // The processor adds up four sums in the time of one.
        let (fours, others) = rest.as_chunks_mut::<4>();
        for four in fours {
            reflect(four, index, &mirror, square);
        }
        for other in others {
            reflect(array::from_mut(other), index, &mirror, square);
        }
    }
}

/// Reflects columns from row `first` on; `square` is that of the mirror's length.
fn reflect<const N: usize>(columns: &mut [Vec<f64>; N], first: usize, mirror: &[f64], square: f64) {
    let parts = columns
        .each_ref()
        .map(|column| &column[first..][..mirror.len()]);
    let mut sums = [0.0; N];
    for (row, mirror) in mirror.iter().enumerate() {
        for (sum, part) in sums.iter_mut().zip(parts) {
            *sum += mirror * part[row];
        }
    }
    for (column, sum) in columns.iter_mut().zip(sums) {
        let share = 2.0 * sum / square;
        for (entry, mirror) in column[first..].iter_mut().zip(mirror) {
            *entry -= share * mirror;
        }
    }
}

/// The inverse of the upper triangle in the first columns, by rows.
fn inverse_of_triangle(columns: &[Vec<f64>], size: usize) -> Vec<Vec<f64>> {
    let mut inverse = vec![vec![0.0; size]; size];
    for j in 0..size {
        inverse[j][j] = 1.0 / columns[j][j];
        for i in (0..j).rev() {
            let sum: f64 = (i + 1..=j).map(|k| columns[k][i] * inverse[k][j]).sum();
            inverse[i][j] = -sum / columns[i][i];
        }
    }
    inverse
}

fn dot(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

fn norm(of: &[f64]) -> f64 {
    dot(of, of).sqrt()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// NIST StRD "Longley": six economic series and a constant, so nearly dependent that a poor
    /// method loses all digits. Certified values from the National Institute of Standards and
    /// Technology (public domain).
    const LONGLEY: [[f64; 7]; 16] = [
        [
            60_323.0, 83.0, 234_289.0, 2_356.0, 1_590.0, 107_608.0, 1_947.0,
        ],
        [
            61_122.0, 88.5, 259_426.0, 2_325.0, 1_456.0, 108_632.0, 1_948.0,
        ],
        [
            60_171.0, 88.2, 258_054.0, 3_682.0, 1_616.0, 109_773.0, 1_949.0,
        ],
        [
            61_187.0, 89.5, 284_599.0, 3_351.0, 1_650.0, 110_929.0, 1_950.0,
        ],
        [
            63_221.0, 96.2, 328_975.0, 2_099.0, 3_099.0, 112_075.0, 1_951.0,
        ],
        [
            63_639.0, 98.1, 346_999.0, 1_932.0, 3_594.0, 113_270.0, 1_952.0,
        ],
        [
            64_989.0, 99.0, 365_385.0, 1_870.0, 3_547.0, 115_094.0, 1_953.0,
        ],
        [
            63_761.0, 100.0, 363_112.0, 3_578.0, 3_350.0, 116_219.0, 1_954.0,
        ],
        [
            66_019.0, 101.2, 397_469.0, 2_904.0, 3_048.0, 117_388.0, 1_955.0,
        ],
        [
            67_857.0, 104.6, 419_180.0, 2_822.0, 2_857.0, 118_734.0, 1_956.0,
        ],
        [
            68_169.0, 108.4, 442_769.0, 2_936.0, 2_798.0, 120_445.0, 1_957.0,
        ],
        [
            66_513.0, 110.8, 444_546.0, 4_681.0, 2_637.0, 121_950.0, 1_958.0,
        ],
        [
            68_655.0, 112.6, 482_704.0, 3_813.0, 2_552.0, 123_366.0, 1_959.0,
        ],
        [
            69_564.0, 114.2, 502_601.0, 3_931.0, 2_514.0, 125_368.0, 1_960.0,
        ],
        [
            69_331.0, 115.7, 518_173.0, 4_806.0, 2_572.0, 127_852.0, 1_961.0,
        ],
        [
            70_551.0, 116.9, 554_894.0, 4_007.0, 2_827.0, 130_081.0, 1_962.0,
        ],
    ];
    /// Certified coefficients and their standard deviations, the constant first.
    const CERTIFIED: [(f64, f64); 7] = [
        (-3_482_258.634_595_82, 890_420.383_607_373),
        (15.061_872_271_373_3, 84.914_925_774_766_9),
        (-0.358_191_792_925_910e-1, 0.334_910_077_722_432e-1),
        (-2.020_229_803_816_83, 0.488_399_681_651_699),
        (-1.033_226_867_173_59, 0.214_274_163_161_675),
        (-0.511_041_056_535_807e-1, 0.226_073_200_069_370),
        (1_829.151_464_613_55, 455.478_499_142_212),
    ];
    const CERTIFIED_SIGMA: f64 = 304.854_073_561_965;

    #[test]
    fn a_nearly_dependent_system_agrees_with_its_certified_solution() {
        let mut system = System::new(7);
        for [right, rest @ ..] in LONGLEY {
            system.add([&[1.0], rest.as_slice()].concat(), right, 1.0);
        }
        let solution = system.solve("Longley").unwrap();
        let near = |value: f64, certified: f64| {
            assert!(
                (value / certified - 1.0).abs() < 1e-8,
                "{value} {certified}"
            );
        };
        for (index, (certified, deviation)) in CERTIFIED.into_iter().enumerate() {
            near(solution.unknowns[index], certified);
            near(solution.covariance[(index, index)].sqrt(), deviation);
        }
        near(solution.sigma, CERTIFIED_SIGMA);
    }

    #[test]
    fn what_the_rows_do_not_determine_is_an_error() {
        let mut system = System::new(2);
        for index in 0..5 {
            system.add([f64::from(index), 0.0], 1.0, 1.0);
        }
        assert!(system.solve("a column of zeros").is_err());
        let mut short = System::new(2);
        short.add([1.0, 2.0], 1.0, 1.0);
        short.add([2.0, 1.0], 1.0, 1.0);
        assert!(short.solve("nothing left for the residual").is_err());
    }

    proptest! {
        /// The residual is orthogonal to every column, in any units.
        #[test]
        fn the_residual_is_orthogonal_to_the_columns(
            rows in prop::collection::vec((prop::array::uniform3(-1.0_f64..1.0), -1.0_f64..1.0), 8..40),
            unit in 1e-6_f64..1e6,
        ) {
            let solved = |unit: f64| {
                let mut system = System::new(3);
                for ([a, b, c], right) in &rows {
                    system.add([a * unit, *b, *c], *right, 1.0);
                }
                system.solve("random").unwrap()
            };
            let (plain, scaled) = (solved(1.0), solved(unit));
            for column in 0..3 {
                let product: f64 = rows.iter().map(|(row, right)| {
                    row[column] * (dot(row, &plain.unknowns) - right)
                }).sum();
                prop_assert!(product.abs() < 1e-9, "{product}");
            }
            let [one, other] = [plain.unknowns[0], scaled.unknowns[0] * unit];
            prop_assert!((one - other).abs() < 1e-8 * one.abs().max(1.0), "{one} {other}");
        }
    }
}
