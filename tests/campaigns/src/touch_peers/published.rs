//! Published solutions of contacts.

use std::f64::consts::PI;

use palpate_sim::touch::Indenter;

use super::cases::Case;

/// Layers under a pin, Poisson's ratio 0.45: radius in thicknesses, and force relative to a half-space
/// (Hayes et al., J. Biomech. 5 (1972) 541). Of wider pins, up to five thicknesses, the table has 1 to 2 %
/// less than both this solver and the peer.
const PINS: [(f64, f64); 7] = [
    (0.2, 1.252),
    (0.4, 1.599),
    (0.6, 2.031),
    (0.8, 2.532),
    (1.0, 3.085),
    (1.5, 4.638),
    (2.0, 6.38),
];

/// Thickness of these layers, m.
const THIN_M: f64 = 2e-3;

/// A press with its published force and area.
pub(super) struct Published {
    pub(super) source: &'static str,
    pub(super) case: Case,
    pub(super) force_n: f64,
    /// Area of the contact, m², if the source has it.
    pub(super) area_m2: Option<f64>,
}

/// All presses with published solutions.
pub(super) fn all() -> Vec<Published> {
    let ball = |(radius_m, depth_m, poisson)| {
        let case = case(Indenter::Ball { radius_m }, None, poisson, depth_m);
        let contact_m = sphere_contact_m(radius_m, depth_m);
        Published {
            source: "ball on a half-space (Sneddon 1965)",
            case,
            force_n: sphere_n(&case, radius_m, contact_m),
            area_m2: Some(PI * contact_m * contact_m),
        }
    };
    let flat = |radius_m: f64| {
        let case = case(Indenter::Pin { radius_m }, None, 0.499, 0.1e-3);
        Published {
            source: "pin on a half-space (Boussinesq 1885)",
            case,
            force_n: case.stiffness_pa() * radius_m * 0.1e-3,
            area_m2: None,
        }
    };
    let pin = |&(ratio, factor): &(f64, f64)| {
        let radius_m = ratio * THIN_M;
        let case = case(Indenter::Pin { radius_m }, Some(THIN_M), 0.45, 0.1e-3);
        Published {
            source: "pin on a layer (Hayes et al. 1972)",
            case,
            force_n: factor * case.stiffness_pa() * radius_m * 0.1e-3,
            area_m2: None,
        }
    };
    let balls = [(3e-3, 0.3e-3, 0.499), (10e-3, 0.2e-3, 0.3)];
    let mut found: Vec<Published> = balls.into_iter().map(ball).collect();
    found.extend([1e-3, 4e-3].map(flat));
    found.extend([0.1, 0.2, 0.3].map(ball_on_layer));
    found.extend(PINS.iter().map(pin));
    found
}

fn case(indenter: Indenter, thickness_m: Option<f64>, poisson: f64, depth_m: f64) -> Case {
    Case {
        indenter,
        thickness_m,
        poisson,
        depth_m,
    }
}

/// Radius of contact of a ball on a half-space, m, from δ = (a/2) ln((R + a)/(R − a)).
fn sphere_contact_m(radius_m: f64, depth_m: f64) -> f64 {
    let (mut low, mut high) = (0.0, radius_m);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let depth = 0.5 * middle * ((radius_m + middle) / (radius_m - middle)).ln();
        if depth < depth_m {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Force of a ball on a half-space, N: E/(1 − ν²) [(R² + a²)/2 · ln((R + a)/(R − a)) − aR].
fn sphere_n(case: &Case, radius_m: f64, contact_m: f64) -> f64 {
    let logarithm = ((radius_m + contact_m) / (radius_m - contact_m)).ln();
    let square = radius_m * radius_m + contact_m * contact_m;
    0.5 * case.stiffness_pa() * (0.5 * square * logarithm - contact_m * radius_m)
}

/// A ball of 20 mm on an incompressible layer of 5 mm with √(Rδ) this share χ of the thickness
/// (Garcia and Garcia, Biophys. J. 114 (2018) 2923): a polynomial in χ, times Hertz's force.
fn ball_on_layer(chi: f64) -> Published {
    let (radius_m, thickness_m) = (20e-3, 5e-3);
    let depth_m = (chi * thickness_m) * (chi * thickness_m) / radius_m;
    let indenter = Indenter::Ball { radius_m };
    let case = case(indenter, Some(thickness_m), 0.5, depth_m);
    let hertz_n = 2.0 / 3.0 * case.stiffness_pa() * (radius_m * depth_m).sqrt() * depth_m;
    let factor = 1.0 + chi * (1.133 + chi * (1.497 + chi * (1.469 + chi * 0.755)));
    Published {
        source: "ball on a layer (Garcia and Garcia 2018)",
        case,
        force_n: factor * hertz_n,
        area_m2: None,
    }
}
