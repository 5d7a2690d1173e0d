//! The covariance in five numbers, and the number of presses that would be enough.
//!
//! At presses all over the disc, the covariance of all parameters gives that of the predicted
//! readings, C. Two numbers describe its diagonal, as if the errors of the coils were independent: a
//! part of the coil's own reading and a part of the largest reading. One factor reduces both until
//! the place has the mean variance that C gives. The rest of the variances of ln F and ln a is common
//! to all coils.

use super::fit::{FORM_OF_LARGEST, cholesky};
use super::profile::{At, Predicted};
use super::{ArrayCalibration, Design, KnownPress};
use crate::Unusable;

/// Standard uncertainty of a predicted reading, independent from coil to coil.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadingError {
    /// Part relative to the coil's own reading.
    pub relative: f64,
    /// Part relative to the largest reading of the scan.
    pub of_largest: f64,
}

/// Standard uncertainty that is common to all coils.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CommonError {
    /// Standard uncertainty of x and of y, m.
    pub place_m: f64,
    /// Standard uncertainty of ln F, with the force F.
    pub ln_force: f64,
    /// Standard uncertainty of ln a, with the contact radius a.
    pub ln_radius: f64,
}

/// Greatest standard errors that the calibration may add to a press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// Greatest standard error of x and of y, m.
    pub place_m: f64,
    /// Greatest standard error of ln F, with the force F.
    pub ln_force: f64,
}

/// A press of the lattice.
struct Point {
    /// Largest reading.
    largest: f64,
    readings: Vec<f64>,
    by_press: Vec<[f64; 4]>,
    /// Covariance of the predicted readings by the calibration.
    covariance: Vec<Vec<f64>>,
}

impl ArrayCalibration {
    /// Standard errors that the calibration's covariance adds to x or y (m), ln F and ln a: root mean
    /// square over the disc and the radii.
    ///
    /// # Errors
    /// If the readings do not determine a press.
    pub fn added_errors(&self) -> Result<CommonError, Unusable> {
        let points = self.lattice();
        let mut sum = [0.0; 4];
        for point in &points {
            let gain = point.gain(&self.design, self.reading_error)?;
            let added = squares(&gain, |i, j| point.covariance[i][j]);
            for (sum, added) in sum.iter_mut().zip(added) {
                *sum += added / points.len() as f64;
            }
        }
        Ok(common(sum))
    }

    /// Number of further presses, like those used, that bring the calibration's added errors down
    /// to the goal: errors fall with the root of the number.
    ///
    /// # Errors
    /// If the readings do not determine a press.
    pub fn more_presses(&self, goal: &Goal) -> Result<usize, Unusable> {
        let added = self.added_errors()?;
        let ratio = (added.place_m / goal.place_m).max(added.ln_force / goal.ln_force);
        let more = self.presses as f64 * (ratio * ratio - 1.0);
        Ok(more.max(0.0).ceil() as usize)
    }

    /// The Cramer-Rao bound of a press that is read with the design's noise: least variances of x, y (m),
    /// ln F and ln a, by the whole covariance of the calibration, what the profile's form leaves out, the
    /// radius that is known beforehand and the bench's common errors.
    ///
    /// What the form leaves out is no noise: each sensor has its own, and it is the same each time. But
    /// neither readings nor calibration show what it is at a press, only how large it is, so an estimate
    /// with this profile cannot do without. The creep of the layer is left out.
    ///
    /// # Errors
    /// If the readings do not determine a press.
    pub fn bound(&self, press: &KnownPress) -> Result<[f64; 4], Unusable> {
        const WHAT: Unusable = Unusable::Undetermined("a press, by this array's readings");
        let (design, point) = (&self.design, self.point(press.at()));
        let form = self.of_form();
        let variance = |i: usize, j: usize| {
            let own = design.noise.powi(2) + point.variance(form, i);
            point.covariance[i][j] + if i == j { own } else { 0.0 }
        };
        let lower = cholesky(point.readings.len(), variance).ok_or(WHAT)?;
        let mut rows = point.by_press;
        for i in 0..rows.len() {
            for j in 0..i {
                let done = rows[j];
                rows[i]
                    .iter_mut()
                    .zip(done)
                    .for_each(|(to, of)| *to -= lower[i][j] * of);
            }
            rows[i].iter_mut().for_each(|of| *of /= lower[i][i]);
        }
        let information = |i: usize, j: usize| {
            let sum: f64 = rows.iter().map(|row| row[i] * row[j]).sum();
            let prior = design.radius_in_use.powi(-2);
            sum + if i == 3 && j == 3 { prior } else { 0.0 }
        };
        let lower = cholesky(4, information).ok_or(WHAT)?;
        let common = design.bench.common;
        let common = [
            common.place_m,
            common.place_m,
            common.ln_force,
            common.ln_radius,
        ];
        Ok(std::array::from_fn(|i| {
            let unit = std::array::from_fn(|j| f64::from(u8::from(i == j)));
            solve(&lower, unit)[i] + common[i].powi(2)
        }))
    }

    /// Error of a reading by what the profile's form leaves out.
    fn of_form(&self) -> ReadingError {
        ReadingError {
            relative: self.form,
            of_largest: FORM_OF_LARGEST * self.form,
        }
    }

    pub(super) fn reduced(&self) -> Result<(ReadingError, CommonError), Unusable> {
        let points = self.lattice();
        let diagonal = independent(&points);
        let form = self.of_form();
        let with_form = |of: ReadingError| ReadingError {
            relative: of.relative.hypot(form.relative),
            of_largest: of.of_largest.hypot(form.of_largest),
        };
        let whole = with_form(diagonal);
        let [exact, stated] = self.moved(&points, (whole, diagonal))?;
        // Errors that coils have in common move a place less than independent ones.
        let share = ((exact[0] + exact[1]) / (stated[0] + stated[1])).min(1.0);
        let own = ReadingError {
            relative: diagonal.relative * share.sqrt(),
            of_largest: diagonal.of_largest * share.sqrt(),
        };
        let error = with_form(own);
        let [exact, stated] = self.moved(&points, (error, own))?;
        let sum = std::array::from_fn(|i| exact[i] - stated[i]);
        let (rest, bench) = (common(sum), self.design.bench.common);
        Ok((
            error,
            CommonError {
                place_m: rest.place_m.hypot(bench.place_m),
                ln_force: rest.ln_force.hypot(bench.ln_force),
                ln_radius: rest.ln_radius.hypot(bench.ln_radius),
            },
        ))
    }

    /// Mean variances of x, y, ln F and ln a: first from the covariance, then from the error
    /// `independent` of each reading. The fit weighs the readings by the error `weighed`.
    fn moved(
        &self,
        points: &[Point],
        (weighed, independent): (ReadingError, ReadingError),
    ) -> Result<[[f64; 4]; 2], Unusable> {
        let mut sums = [[0.0; 4]; 2];
        for point in points {
            let gain = point.gain(&self.design, weighed)?;
            let exact = squares(&gain, |i, j| point.covariance[i][j]);
            let of = |i: usize| point.variance(independent, i);
            let stated = squares(&gain, |i, j| if i == j { of(i) } else { 0.0 });
            for (sum, variances) in sums.iter_mut().zip([exact, stated]) {
                for (sum, variance) in sum.iter_mut().zip(variances) {
                    *sum += variance / points.len() as f64;
                }
            }
        }
        Ok(sums)
    }

    /// Presses all over the disc, with three radii and the mean force.
    fn lattice(&self) -> Vec<Point> {
        let [weakest, strongest] = self.forces_n;
        let ln_force = 0.5 * (weakest * strongest).ln();
        let [least, greatest] = self.design.scales.radii_m.map(f64::sqrt);
        let roots = [0.2, 0.5, 0.8].map(|share| least + share * (greatest - least));
        let places = [(0.0, 1), (0.4, 6), (0.7, 9), (0.95, 12)];
        let mut points = Vec::new();
        for (share, count) in places {
            for spoke in 0..count {
                let angle = std::f64::consts::TAU * (f64::from(spoke) + 0.3) / f64::from(count);
                let r = share * self.design.reach_m;
                let [x, y] = [r * angle.cos(), r * angle.sin()];
                points.extend(roots.map(|root| self.point([x, y, ln_force, 2.0 * root.ln()])));
            }
        }
        points
    }

    fn point(&self, at: At) -> Point {
        let coils = 0..self.parameters.coils;
        let predicted: Vec<Predicted> = coils
            .map(|coil| self.parameters.predict(coil, at))
            .collect();
        let count = self.parameters.values.len();
        let spread: Vec<Vec<f64>> = predicted
            .iter()
            .map(|of| {
                let column = |k: usize| {
                    let parts = of.by_parameters.iter().enumerate();
                    parts.map(|(l, by)| by * self.covariance[(l, k)]).sum()
                };
                (0..count).map(column).collect()
            })
            .collect();
        let entry = |i: usize, j: usize| -> f64 {
            let parts = spread[i].iter().zip(&predicted[j].by_parameters);
            parts.map(|(a, b)| a * b).sum()
        };
        let all = 0..predicted.len();
        Point {
            largest: predicted
                .iter()
                .fold(0.0, |most, of| of.value.abs().max(most)),
            readings: predicted.iter().map(|of| of.value).collect(),
            by_press: predicted.iter().map(|of| of.by_press).collect(),
            covariance: all
                .clone()
                .map(|i| all.clone().map(|j| entry(i, j)).collect())
                .collect(),
        }
    }
}

impl Point {
    /// Variance of a reading, as the instrument states it, without noise.
    fn variance(&self, error: ReadingError, coil: usize) -> f64 {
        let own = error.relative * self.readings[coil];
        let of_largest = error.of_largest * self.largest;
        own * own + of_largest * of_largest
    }

    /// Change of x, y, ln F and ln a with each reading, of the instrument's fit.
    fn gain(&self, design: &Design, error: ReadingError) -> Result<[Vec<f64>; 4], Unusable> {
        let variances = (0..self.readings.len())
            .map(|coil| design.noise * design.noise + self.variance(error, coil));
        let weights: Vec<f64> = variances.map(|variance| 1.0 / variance).collect();
        let information = |i: usize, j: usize| {
            let rows = self.by_press.iter().zip(&weights);
            let sum: f64 = rows.map(|(row, weight)| weight * row[i] * row[j]).sum();
            let prior = design.radius_in_use.powi(-2);
            sum + if i == 3 && j == 3 { prior } else { 0.0 }
        };
        let lower = cholesky(4, information)
            .ok_or(Unusable::Undetermined("a press, by this array's readings"))?;
        let column = |(row, weight): (&[f64; 4], &f64)| solve(&lower, row.map(|of| of * weight));
        let columns: Vec<[f64; 4]> = self.by_press.iter().zip(&weights).map(column).collect();
        Ok(std::array::from_fn(|i| {
            columns.iter().map(|column| column[i]).collect()
        }))
    }
}

fn solve(lower: &[Vec<f64>], mut right: [f64; 4]) -> [f64; 4] {
    for i in 0..4 {
        let known: f64 = (0..i).map(|j| lower[i][j] * right[j]).sum();
        right[i] = (right[i] - known) / lower[i][i];
    }
    for i in (0..4).rev() {
        let known: f64 = (i + 1..4).map(|j| lower[j][i] * right[j]).sum();
        right[i] = (right[i] - known) / lower[i][i];
    }
    right
}

/// Variances of x, y, ln F and ln a from a covariance of the readings.
fn squares(gain: &[Vec<f64>; 4], covariance: impl Fn(usize, usize) -> f64) -> [f64; 4] {
    std::array::from_fn(|of| {
        let row = &gain[of];
        let entry = |i: usize| -> f64 {
            let parts = row.iter().enumerate();
            row[i] * parts.map(|(j, by)| by * covariance(i, j)).sum::<f64>()
        };
        (0..row.len()).map(entry).sum()
    })
}

fn common([x, y, ln_force, ln_radius]: [f64; 4]) -> CommonError {
    let root = |of: f64| of.max(0.0).sqrt();
    CommonError {
        place_m: root(0.5 * (x + y)),
        ln_force: root(ln_force),
        ln_radius: root(ln_radius),
    }
}

/// The two numbers that describe the diagonals best, by least squares, relative to the largest
/// reading.
fn independent(points: &[Point]) -> ReadingError {
    let [mut count, mut own, mut square, mut right, mut cross] = [0.0; 5];
    for point in points {
        for (coil, reading) in point.readings.iter().enumerate() {
            let part = (reading / point.largest).powi(2);
            let variance = point.covariance[coil][coil] / point.largest.powi(2);
            count += 1.0;
            own += part;
            square += part * part;
            right += variance;
            cross += part * variance;
        }
    }
    let determinant = count * square - own * own;
    let relative = (count * cross - own * right) / determinant;
    let of_largest = (square * right - own * cross) / determinant;
    let (relative, of_largest) = if relative < 0.0 {
        (0.0, right / count)
    } else if of_largest < 0.0 {
        (cross / square, 0.0)
    } else {
        (relative, of_largest)
    };
    ReadingError {
        relative: relative.max(0.0).sqrt(),
        of_largest: of_largest.max(0.0).sqrt(),
    }
}
