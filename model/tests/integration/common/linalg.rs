//! Small dense least squares by Householder reflections.
// Indices as in the textbook.
#![allow(clippy::needless_range_loop)]

/// Minimises |A x - b|, where `a` contains the rows of A; returns x and the inverse of A'A.
pub fn least_squares(a: &[Vec<f64>], b: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
    let (rows, columns) = (a.len(), a[0].len());
    let mut a = a.to_vec();
    let mut b = b.to_vec();
    for k in 0..columns {
        let norm = (k..rows).map(|i| a[i][k] * a[i][k]).sum::<f64>().sqrt();
        let alpha = if a[k][k] > 0.0 { -norm } else { norm };
        let mut v: Vec<f64> = (k..rows).map(|i| a[i][k]).collect();
        v[0] -= alpha;
        let squared: f64 = v.iter().map(|v| v * v).sum();
        for j in k..columns {
            let dot: f64 = (k..rows).map(|i| v[i - k] * a[i][j]).sum();
            for i in k..rows {
                a[i][j] -= 2.0 * v[i - k] * dot / squared;
            }
        }
        let dot: f64 = (k..rows).map(|i| v[i - k] * b[i]).sum();
        for i in k..rows {
            b[i] -= 2.0 * v[i - k] * dot / squared;
        }
    }
    let back = |right: &[f64]| {
        let mut x = vec![0.0; columns];
        for k in (0..columns).rev() {
            let known: f64 = (k + 1..columns).map(|j| a[k][j] * x[j]).sum();
            x[k] = (right[k] - known) / a[k][k];
        }
        x
    };
    let x = back(&b);
    // (R'R)^-1 = R^-1 R^-T, from the columns of R^-1.
    let inverse_columns: Vec<Vec<f64>> = (0..columns)
        .map(|k| {
            back(
                &(0..columns)
                    .map(|i| f64::from(u8::from(i == k)))
                    .collect::<Vec<_>>(),
            )
        })
        .collect();
    let covariance = (0..columns)
        .map(|i| {
            (0..columns)
                .map(|j| {
                    inverse_columns
                        .iter()
                        .map(|column| column[i] * column[j])
                        .sum()
                })
                .collect()
        })
        .collect();
    (x, covariance)
}
