//! Error of a layer without edges, by finite elements.
//!
//! A strip of the layer in plane strain, bonded to its base, with free ends, under a strip of even
//! pressure: quadratic elements with nine nodes, solved by banded Cholesky factors. It shares no
//! code with [`super::layer`], and checks that module away from the ends. An end affects a line of
//! pressure from further away than a round contact.

use super::layer::Layer;
use super::quadrature::gauss;

const LAYER: Layer = Layer {
    thickness_m: 5e-3,
    shear_modulus_pa: 20e3,
    poisson: 0.49,
};

/// Elements along the strip, of 1 mm, and over its thickness.
const ALONG: usize = 60;
const OVER: usize = 8;
const SIDE_M: f64 = 1e-3;

/// Nodes over the thickness, and half of the bandwidth.
const COLUMN: usize = 2 * OVER + 1;
const BAND: usize = 2 * (2 * COLUMN + 3);

/// Half of the pressed width, m, and the pressure, Pa.
const HALF_M: f64 = 2e-3;
const PRESSURE_PA: f64 = 1e3;

fn dof(along: usize, over: usize, component: usize) -> usize {
    2 * (along * COLUMN + over) + component
}

/// Quadratic shape functions on [-1, 1] and their slopes.
fn shapes(x: f64) -> ([f64; 3], [f64; 3]) {
    let values = [0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)];
    (values, [x - 0.5, -2.0 * x, x + 0.5])
}

/// Stiffness of an element, N/m per metre: rows and columns by node (along, over) and component.
fn element() -> [[f64; 18]; 18] {
    let (g, nu) = (LAYER.shear_modulus_pa, LAYER.poisson);
    let lame = 2.0 * g * nu / (1.0 - 2.0 * nu);
    let (half_x, half_z) = (0.5 * SIDE_M, 0.5 * LAYER.thickness_m / OVER as f64);
    let mut stiffness = [[0.0; 18]; 18];
    for &(x, weight_x) in &gauss(3, -1.0, 1.0) {
        for &(z, weight_z) in &gauss(3, -1.0, 1.0) {
            let ((along, along_slope), (over, over_slope)) = (shapes(x), shapes(z));
            // Rows: strain along x, along z, and shear, by each degree of freedom.
            let mut strain = [[0.0; 18]; 3];
            for i in 0..3 {
                for j in 0..3 {
                    let node = 2 * (3 * i + j);
                    let by_x = along_slope[i] * over[j] / half_x;
                    let by_z = along[i] * over_slope[j] / half_z;
                    strain[0][node] = by_x;
                    strain[1][node + 1] = by_z;
                    strain[2][node] = by_z;
                    strain[2][node + 1] = by_x;
                }
            }
            let weight = weight_x * weight_z * half_x * half_z;
            for a in 0..18 {
                for b in 0..18 {
                    let volume = (strain[0][a] + strain[1][a]) * (strain[0][b] + strain[1][b]);
                    let direct = strain[0][a] * strain[0][b] + strain[1][a] * strain[1][b];
                    let sheared = strain[2][a] * strain[2][b];
                    stiffness[a][b] += weight * (lame * volume + g * (2.0 * direct + sheared));
                }
            }
        }
    }
    stiffness
}

/// Lower band of the factor of the strip's stiffness, row by row, the diagonal last.
fn factor() -> Vec<[f64; BAND]> {
    let size = 2 * (2 * ALONG + 1) * COLUMN;
    let mut band = vec![[0.0; BAND]; size];
    let element = element();
    for along in 0..ALONG {
        for over in 0..OVER {
            let at = |k: usize| {
                let node = k / 2;
                (
                    2 * over + node % 3,
                    dof(2 * along + node / 3, 2 * over + node % 3, k % 2),
                )
            };
            for (a, row) in element.iter().enumerate() {
                for (b, value) in row.iter().enumerate() {
                    let ((height_a, a), (height_b, b)) = (at(a), at(b));
                    if height_a > 0 && height_b > 0 && b <= a {
                        band[a][BAND - 1 + b - a] += value;
                    }
                }
            }
        }
    }
    for row in &mut band {
        if row[BAND - 1] == 0.0 {
            row[BAND - 1] = 1.0;
        }
    }
    for i in 0..size {
        for j in (i + 1).saturating_sub(BAND)..=i {
            let mut sum = band[i][BAND - 1 + j - i];
            for k in (i + 1).saturating_sub(BAND)..j {
                if j - k < BAND {
                    sum -= band[i][BAND - 1 + k - i] * band[j][BAND - 1 + k - j];
                }
            }
            band[i][BAND - 1 + j - i] = if i == j {
                sum.sqrt()
            } else {
                sum / band[j][BAND - 1]
            };
        }
    }
    band
}

/// Downward displacement of the surface's nodes, half a side apart, m, pressed at `place` elements
/// from the end.
fn pressed(factor: &[[f64; BAND]], place: usize) -> Vec<f64> {
    let mut load = vec![0.0; factor.len()];
    let half = (HALF_M / SIDE_M).round() as usize;
    for along in place - half..place + half {
        for (node, share) in [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0].into_iter().enumerate() {
            load[dof(2 * along + node, COLUMN - 1, 1)] += share * SIDE_M * PRESSURE_PA;
        }
    }
    for i in 0..load.len() {
        for k in (i + 1).saturating_sub(BAND)..i {
            load[i] -= factor[i][BAND - 1 + k - i] * load[k];
        }
        load[i] /= factor[i][BAND - 1];
    }
    for i in (0..load.len()).rev() {
        load[i] /= factor[i][BAND - 1];
        for k in (i + 1).saturating_sub(BAND)..i {
            load[k] -= factor[i][BAND - 1 + k - i] * load[i];
        }
    }
    (0..=2 * ALONG)
        .map(|along| load[dof(along, COLUMN - 1, 1)])
        .collect()
}

/// Downward displacement of the surface of an endless layer, m, at a distance from the middle of the
/// pressure, m.
fn endless_m(x_m: f64) -> f64 {
    let waves = super::quadrature::panels(60, 16, 0.0, 2e4);
    let integral: f64 = waves
        .iter()
        .map(|&(k, weight)| {
            let pressure = 2.0 * PRESSURE_PA * libm::sin(k * HALF_M) / k;
            weight * LAYER.compliance_m_per_pa(k) * pressure * libm::cos(k * x_m)
        })
        .sum();
    integral / core::f64::consts::PI
}

/// Displacements within `reach_m` of the press, m, from one side to the other.
fn around(factor: &[[f64; BAND]], place: usize, reach: usize) -> Vec<f64> {
    let all = pressed(factor, place);
    all[2 * (place - reach)..=2 * (place + reach)].to_vec()
}

#[test]
fn away_from_the_ends_the_strip_is_the_layer() {
    let found = around(&factor(), 30, 10);
    for (node, found) in found.iter().enumerate() {
        let x_m = 0.5 * SIDE_M * node as f64 - 10e-3;
        // At the end of the pressure the slope is infinite.
        if (x_m.abs() - HALF_M).abs() > 1.1e-3 {
            let error = (found - endless_m(x_m)) / endless_m(0.0);
            assert!(error.abs() < 5e-3, "{x_m}: {error}");
        }
    }
}

#[test]
fn a_free_edge_changes_little_where_coils_are() {
    // On the square of 50 mm a press 8 mm from the centre lies 17 mm from the edge, and the outermost
    // turns of a coil 6 mm from the centre reach 5 mm beyond it.
    let factor = factor();
    let middle = around(&factor, 30, 5);
    let worst = |place: usize| {
        let pairs = around(&factor, place, 5).into_iter().zip(&middle);
        let errors = pairs.map(|(near, far)| (near - far).abs());
        errors.fold(0.0, f64::max) / endless_m(0.0)
    };
    let [far, near, close] = [17, 12, 7].map(worst);
    println!("{far:e} {near:e} {close:e}");
    assert!(far < 6e-3 && far > 1e-4, "{far}");
    assert!(near < 0.03, "{near}");
}
