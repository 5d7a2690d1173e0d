//! Gauss–Legendre quadrature.

use core::f64::consts::PI;

/// Nodes and weights of the rule with `count` nodes on [`from`, `to`] (Newton's method on the
/// Legendre polynomial; Press et al., "Numerical recipes", section 4.6).
pub(super) fn gauss(count: u32, from: f64, to: f64) -> Vec<(f64, f64)> {
    let (centre, half) = (0.5 * (from + to), 0.5 * (to - from));
    let node = |index: u32| {
        let mut x = -libm::cos(PI * (f64::from(index) + 0.75) / (f64::from(count) + 0.5));
        let mut slope = 1.0;
        for _ in 0..8 {
            let value;
            (value, slope) = legendre(count, x);
            x -= value / slope;
        }
        (
            centre + half * x,
            half * 2.0 / ((1.0 - x * x) * slope * slope),
        )
    };
    (0..count).map(node).collect()
}

/// Nodes and weights of `panels` equal panels with `count` nodes each.
pub(super) fn panels(panels: u32, count: u32, from: f64, to: f64) -> Vec<(f64, f64)> {
    let width = (to - from) / f64::from(panels);
    let start = |panel: u32| from + width * f64::from(panel);
    (0..panels)
        .flat_map(|panel| gauss(count, start(panel), start(panel + 1)))
        .collect()
}

/// Value and slope of the Legendre polynomial of a degree of 1 or more.
fn legendre(degree: u32, x: f64) -> (f64, f64) {
    let (mut value, mut before) = (x, 1.0);
    for n in 2..=degree {
        let n = f64::from(n);
        (value, before) = (
            ((2.0 * n - 1.0) * x * value - (n - 1.0) * before) / n,
            value,
        );
    }
    (
        value,
        f64::from(degree) * (x * value - before) / (x * x - 1.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_the_rules_degree_are_exact() {
        for count in [1, 2, 7, 24, 64] {
            let rule = gauss(count, 1.0, 3.0);
            let power = 2 * count as i32 - 1;
            let sum: f64 = rule
                .iter()
                .map(|(x, w)| w * (x - 2.0).powi(power - 1))
                .sum();
            let exact = 2.0 / f64::from(power);
            assert!((sum / exact - 1.0).abs() < 1e-12, "{count}: {sum} {exact}");
        }
        let total: f64 = panels(5, 4, -1.0, 4.0).iter().map(|(_, w)| w).sum();
        assert!((total - 5.0).abs() < 1e-14);
    }
}
