//! Reference estimator in `f64` for the `f32` inputs that the device would have, by another method
//! than the crate's: a batch fit of 1/x on g by QR.

use super::linalg::least_squares;
use super::plant::Recording;

/// A drift as a function of time.
pub type Phi<'a> = &'a dyn Fn(f64) -> f64;

/// Estimate of kappa with its standard error, and the line from which it follows.
pub struct Estimate {
    pub kappa: f64,
    pub standard_error: f64,
    line: FittedLine,
}

/// The fitted straight line: 1/x at the mean of g, its slope, and their covariances.
struct FittedLine {
    mean_g: f64,
    level: f64,
    slope: f64,
    covariance: [f64; 3],
}

impl Estimate {
    /// Fieller's interval of kappa, from the textbook's quadratic in the ratio level/slope.
    pub fn interval(&self, quantile: f64) -> (f64, f64) {
        let FittedLine {
            mean_g,
            level,
            slope,
            covariance: [aa, ab, bb],
        } = self.line;
        let t = quantile * quantile;
        let [a, b, c] = [
            slope * slope - t * bb,
            level * slope - t * ab,
            level * level - t * aa,
        ];
        let root = (b * b - a * c).sqrt();
        ((b - root) / a - mean_g - 1.0, (b + root) / a - mean_g - 1.0)
    }
}

struct ReferenceReading {
    t: f64,
    x: f64,
    g: f64,
    sigma: f64,
}

fn readings(recording: &Recording) -> Vec<ReferenceReading> {
    let x_ref = f64::from(recording.reference.deformation().0);
    let g_ref = f64::from(recording.reference.regressor());
    recording
        .samples
        .iter()
        .map(|s| ReferenceReading {
            t: f64::from(s.time.0),
            x: x_ref + f64::from(s.deformation.0),
            g: g_ref + f64::from(s.regressor),
            sigma: f64::from(s.sigma.0),
        })
        .collect()
}

/// Weighted least-squares fit of 1/x on g with the weights x^4/sigma^2 and drift columns phi/x: by
/// QR of all samples at once.
pub fn reciprocal_line(recording: &Recording, phis: &[Phi<'_>]) -> Estimate {
    let readings = readings(recording);
    let mean_g = readings.iter().map(|r| r.g).sum::<f64>() / readings.len() as f64;
    let (mut rows, mut right) = (Vec::new(), Vec::new());
    for r in &readings {
        let root_weight = r.x * r.x / r.sigma;
        let mut row = vec![root_weight, root_weight * (r.g - mean_g)];
        row.extend(phis.iter().map(|phi| -root_weight * phi(r.t) / r.x));
        rows.push(row);
        right.push(root_weight / r.x);
    }
    let (theta, covariance) = least_squares(&rows, &right);
    let ratio = theta[0] / theta[1];
    let variance =
        covariance[0][0] - 2.0 * ratio * covariance[0][1] + ratio * ratio * covariance[1][1];
    Estimate {
        kappa: ratio - mean_g - 1.0,
        standard_error: variance.sqrt() / theta[1],
        line: FittedLine {
            mean_g,
            level: theta[0],
            slope: theta[1],
            covariance: [covariance[0][0], covariance[0][1], covariance[1][1]],
        },
    }
}

/// Eq. (2) as published, for two readings.
pub fn equation_2(c_s: f64, c_d: [f64; 2], x: [f64; 2]) -> f64 {
    let ([d1, d2], [x1, x2]) = (c_d, x);
    c_s * d1 * d2 * (x1 - x2) / (x2 * (d1 * d2 + c_s * d1) - x1 * (d1 * d2 + c_s * d2))
}
