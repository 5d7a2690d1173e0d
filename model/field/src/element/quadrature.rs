//! Gauss quadrature on the line and the triangle.

/// Nodes on [0, 1] and weights for the Jacobi weight (1 − t)^`alpha` with `alpha` 0 or 1.
///
/// `count` nodes are exact for polynomials up to degree 2·`count` − 1.
#[must_use]
pub fn gauss(count: usize, alpha: f64) -> Vec<(f64, f64)> {
    let mut roots: Vec<f64> = Vec::with_capacity(count);
    for index in 0..count {
        // Chebyshev's nodes are good first guesses for Newton's method; the roots found so far are
        // divided out, so that no root is found twice.
        let guess = (2 * index + 1) as f64 / (2 * count) as f64 * core::f64::consts::PI;
        let mut x = guess.cos();
        for _ in 0..100 {
            let (value, slope) = jacobi(count, alpha, x);
            let known: f64 = roots.iter().map(|root| 1.0 / (x - root)).sum();
            let step = value / (slope - value * known);
            x -= step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        roots.push(x);
    }
    roots
        .into_iter()
        .map(|x| {
            let (_, slope) = jacobi(count, alpha, x);
            // Weights of Gauss-Jacobi with beta = 0: the gamma functions cancel for both alphas.
            let weight = 2.0_f64.powf(alpha + 1.0) / ((1.0 - x * x) * slope * slope);
            (0.5 * (1.0 + x), weight * 0.5_f64.powf(alpha + 1.0))
        })
        .collect()
}

/// Jacobi polynomial P_n^(α, 0) and its derivative, by recurrence.
fn jacobi(n: usize, alpha: f64, x: f64) -> (f64, f64) {
    let mut last = 1.0;
    let mut value = 0.5 * (alpha + (alpha + 2.0) * x);
    if n == 0 {
        return (1.0, 0.0);
    }
    for k in 1..n {
        let k = k as f64;
        let s = 2.0 * k + alpha;
        let a = 2.0 * (k + 1.0) * (k + alpha + 1.0) * s;
        let b = (s + 1.0) * alpha * alpha;
        let c = s * (s + 1.0) * (s + 2.0);
        let d = 2.0 * (k + alpha) * k * (s + 2.0);
        (value, last) = (((b + c * x) * value - d * last) / a, value);
    }
    let n = n as f64;
    let s = 2.0 * n + alpha;
    let slope = (n * (alpha - s * x) * value + 2.0 * (n + alpha) * n * last) / (s * (1.0 - x * x));
    (value, slope)
}

/// Barycentric coordinates and weights on a triangle of area 1, by collapsing a square.
///
/// `count`² nodes are exact for polynomials up to degree 2·`count` − 1.
#[must_use]
pub fn triangle(count: usize) -> Vec<([f64; 3], f64)> {
    let mut nodes = Vec::with_capacity(count * count);
    for (v, weight_v) in gauss(count, 1.0) {
        for (u, weight_u) in gauss(count, 0.0) {
            let second = u * (1.0 - v);
            nodes.push(([1.0 - v - second, second, v], 2.0 * weight_u * weight_v));
        }
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_for_polynomials() {
        for count in 1..9_usize {
            for alpha in [0.0, 1.0] {
                for power in 0..2 * count {
                    let sum: f64 = gauss(count, alpha)
                        .iter()
                        .map(|(t, w)| w * t.powi(power as i32))
                        .sum();
                    let n = power as f64 + 1.0;
                    let exact = if alpha == 0.0 {
                        1.0 / n
                    } else {
                        1.0 / n - 1.0 / (n + 1.0)
                    };
                    assert!(
                        (sum - exact).abs() < 1e-13,
                        "{count} {alpha} {power}: {sum} {exact}"
                    );
                }
            }
        }
    }

    #[test]
    fn triangle_moments() {
        // Mean of a^i b^j over a triangle: 2 i! j! / (i + j + 2)!.
        let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
        let nodes = triangle(5);
        for i in 0..6_u32 {
            for j in 0..(9 - i).min(6) {
                let sum: f64 = nodes
                    .iter()
                    .map(|(l, w)| w * l[0].powi(i as i32) * l[1].powi(j as i32))
                    .sum();
                let exact = 2.0 * factorial(i) * factorial(j) / factorial(i + j + 2);
                assert!((sum / exact - 1.0).abs() < 1e-12, "{i} {j}: {sum} {exact}");
            }
        }
    }
}
