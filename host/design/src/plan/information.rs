//! Fisher information of readings and prior knowledge about unknowns, as a symmetric matrix.
//!
//! For readings y = f(theta) with Gaussian errors the information is the sum of J'J/variance over the readings, where J
//! is the row of derivatives. Prior knowledge of an unknown adds the inverse of its variance. The inverse of the
//! information bounds the covariance of every estimate (Cramer and Rao; van Trees, "Detection, Estimation, and
//! Modulation Theory", part I, section 2.4).

/// Information on several unknowns.
#[derive(Clone, Debug)]
pub struct Information {
    unknowns: usize,
    /// Matrix entries, row by row.
    entries: Vec<f64>,
}

impl Information {
    /// Creates empty information.
    pub fn new(unknowns: usize) -> Self {
        Self {
            unknowns,
            entries: vec![0.0; unknowns * unknowns],
        }
    }

    /// Adds a reading with its derivatives `row` and the variance of its error.
    pub fn read(&mut self, row: &[f64], variance: f64) {
        let columns = self.unknowns.max(1);
        for (entries, at) in self.entries.chunks_mut(columns).zip(row) {
            if *at == 0.0 {
                continue;
            }
            let share = at / variance;
            for (entry, with) in entries.iter_mut().zip(row) {
                *entry += share * with;
            }
        }
    }

    /// Adds prior knowledge of an unknown, as a variance.
    pub fn know(&mut self, unknown: usize, variance: f64) {
        if let Some(entry) = self.entries.get_mut(unknown * (self.unknowns + 1)) {
            *entry += 1.0 / variance;
        }
    }

    /// Number of unknowns.
    pub const fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// Adds the information `other` on the first unknowns.
    pub fn add(&mut self, other: &Self) {
        let rows = self.entries.chunks_mut(self.unknowns.max(1));
        for (row, of) in rows.zip(other.entries.chunks(other.unknowns.max(1))) {
            for (entry, of) in row.iter_mut().zip(of) {
                *entry += of;
            }
        }
    }

    /// Eliminates all unknowns after the first `keep`, without prior knowledge of them.
    pub fn marginal(mut self, keep: usize) -> Self {
        for last in (keep..self.unknowns).rev() {
            let rows: Vec<Vec<f64>> = self
                .entries
                .chunks(self.unknowns)
                .map(<[f64]>::to_vec)
                .collect();
            let pivot = rows[last][last];
            let mut left = Self::new(last);
            for (row, entries) in rows[..last].iter().zip(left.entries.chunks_mut(last)) {
                // An unknown without any reading takes no information from the others.
                let share = if pivot > 0.0 { row[last] / pivot } else { 0.0 };
                for (column, entry) in entries.iter_mut().enumerate() {
                    *entry = row[column] - share * rows[last][column];
                }
            }
            self = left;
        }
        self
    }

    /// Returns the product of the inverse and a vector; `None` for a singular matrix.
    pub fn solve(&self, right: &[f64]) -> Option<Vec<f64>> {
        let scales = self.scales();
        let mut matrix: Vec<Vec<f64>> = self
            .entries
            .chunks(self.unknowns.max(1))
            .zip(&scales)
            .map(|(row, scale)| {
                row.iter()
                    .zip(&scales)
                    .map(|(e, s)| e * s * scale)
                    .collect()
            })
            .collect();
        let mut solved: Vec<f64> = right.iter().zip(&scales).map(|(r, s)| r * s).collect();
        factorise(&mut matrix)?;
        substitute(&matrix, &mut solved);
        let unknowns = solved
            .iter()
            .zip(&scales)
            .map(|(value, scale)| value * scale);
        Some(unknowns.collect())
    }

    /// Smallest variance of a linear combination of the unknowns for any unbiased estimate.
    pub fn variance(&self, of: &[f64]) -> Option<f64> {
        let solved = self.solve(of)?;
        Some(of.iter().zip(&solved).map(|(one, other)| one * other).sum())
    }

    /// Scales that make every diagonal entry one, so that the pivots do not depend on units.
    fn scales(&self) -> Vec<f64> {
        let diagonal = self.entries.iter().step_by(self.unknowns + 1);
        diagonal
            .map(|entry| {
                if *entry > 0.0 {
                    entry.sqrt().recip()
                } else {
                    0.0
                }
            })
            .collect()
    }
}

/// Smallest pivot of a matrix with a unit diagonal; below it the columns are dependent within
/// rounding.
const LEAST_PIVOT: f64 = 1e-13;

/// Computes Cholesky's lower triangle, in place; `None` if the matrix is not positive definite.
fn factorise(matrix: &mut [Vec<f64>]) -> Option<()> {
    for row in 0..matrix.len() {
        let (above, rest) = matrix.split_at_mut(row);
        let current = rest.first_mut()?;
        for (column, of) in above.iter().enumerate() {
            let product: f64 = dot(&current[..column], &of[..column]);
            current[column] = (current[column] - product) / of[column];
        }
        let pivot = current[row] - dot(&current[..row], &current[..row]);
        if pivot.is_nan() || pivot < LEAST_PIVOT {
            return None;
        }
        current[row] = pivot.sqrt();
    }
    Some(())
}

/// Solves L L' z = right, in place.
fn substitute(lower: &[Vec<f64>], right: &mut [f64]) {
    for row in 0..lower.len() {
        let sum = dot(&lower[row][..row], &right[..row]);
        right[row] = (right[row] - sum) / lower[row][row];
    }
    for row in (0..lower.len()).rev() {
        let below = row + 1..lower.len();
        let sum: f64 = below.map(|other| lower[other][row] * right[other]).sum();
        right[row] = (right[row] - sum) / lower[row][row];
    }
}

fn dot(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

#[cfg(test)]
mod tests {
    use palpate_sim::random::Stream;

    use super::*;

    /// Compares with many estimates of a line a + b t with a prior for b. The estimate uses
    /// hand-written normal equations of two unknowns, and shares no code with the information.
    #[test]
    fn the_variance_is_that_of_many_estimates() {
        const SIGMA: f64 = 0.3;
        const PRIOR: f64 = 0.05;
        let times: Vec<f64> = (0..20).map(|index| 0.1 * f64::from(index)).collect();
        let mut information = Information::new(2);
        for time in &times {
            information.read(&[1.0, *time], SIGMA * SIGMA);
        }
        information.know(1, PRIOR * PRIOR);
        let at_three = information.variance(&[1.0, 3.0]).unwrap();
        let mut stream = Stream::named(1, "information");
        let mut squares = 0.0;
        let count = 20_000;
        for _ in 0..count {
            let slope = PRIOR * stream.normal();
            let (mut n, mut t, mut tt, mut y, mut ty) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for time in &times {
                let read = slope * time + SIGMA * stream.normal();
                (n, t, tt) = (n + 1.0, t + time, tt + time * time);
                (y, ty) = (y + read, ty + time * read);
            }
            tt += (SIGMA / PRIOR).powi(2);
            let b = (n * ty - t * y) / (n * tt - t * t);
            let a = (y - b * t) / n;
            squares += (a + 3.0 * b - 3.0 * slope).powi(2);
        }
        let ratio = squares / f64::from(count) / at_three;
        // The mean of 20,000 squares is accurate to 1 %.
        assert!((ratio - 1.0).abs() < 0.04, "{ratio}");
    }

    #[test]
    fn eliminated_unknowns_leave_the_variance_of_the_others() {
        let mut stream = Stream::named(2, "information");
        let mut information = Information::new(5);
        for _ in 0..40 {
            let row: Vec<f64> = (0..5).map(|_| stream.normal()).collect();
            information.read(&row, 0.5);
        }
        let of = [1.0, -2.0, 0.5];
        let all = information
            .variance(&[of.as_slice(), &[0.0, 0.0]].concat())
            .unwrap();
        let kept = information.marginal(3).variance(&of).unwrap();
        assert!((all / kept - 1.0).abs() < 1e-12, "{all} {kept}");
    }

    #[test]
    fn what_no_reading_shows_has_no_variance() {
        let mut information = Information::new(2);
        information.read(&[1.0, 1.0], 1.0);
        information.read(&[2.0, 2.0], 1.0);
        assert_eq!(information.variance(&[1.0, 0.0]), None);
        information.know(1, 1.0);
        assert!(information.variance(&[1.0, 0.0]).is_some());
    }
}
