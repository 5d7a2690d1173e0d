//! Contact of a round indenter with the layer, as an integral equation.
//!
//! The transform of the pressure is p̂(k) = ∫₀ᵃ χ(t) cos kt dt, which leaves no pressure outside the
//! contact radius a. Inside, the displacement is the depth d less the indenter's face f(r):
//!
//! χ(t) + (2/π) ∫₀ᵃ χ(s) ∫₀^∞ m(k) cos kt cos ks dk ds = (2/π)(G/(1 − ν)) [d − φ(t)]
//!
//! with m from [`Layer::reduction`] and φ(t) = t ∫₀ᵗ f'(r)/√(t² − r²) dr (Lebedev and Ufliand 1958;
//! a half-space has m = 0, and this is Sneddon's solution of 1965). The force is 2π ∫ χ dt. A ball's
//! pressure vanishes at the rim, χ(a) = 0, which relates depth and radius.

use core::f64::consts::{FRAC_2_PI, TAU};

use super::layer::Layer;
use super::quadrature::{gauss, panels};

/// Nodes of χ. With 48 the force of contacts up to three times as wide as the layer is thick
/// changes by less than 1e-6.
const NODES: u32 = 32;

/// Face of a round indenter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Face {
    /// Flat end.
    Flat,
    /// Ball of this radius, m.
    Ball(f64),
}

impl Face {
    /// Height of the face above its lowest point, m.
    fn height_m(&self, r_m: f64) -> f64 {
        match *self {
            Self::Flat => 0.0,
            Self::Ball(radius) => radius - libm::sqrt((radius * radius - r_m * r_m).max(0.0)),
        }
    }

    /// φ(t), m.
    fn transformed_m(&self, t_m: f64) -> f64 {
        match *self {
            Self::Flat => 0.0,
            Self::Ball(radius) => 0.5 * t_m * libm::log((radius + t_m) / (radius - t_m)),
        }
    }
}

/// Solver for one layer.
#[derive(Clone, Debug)]
pub(super) struct RoundSolver {
    layer: Layer,
    /// Wave numbers, 1/m, with the rule's weights times m, 1/m.
    waves: Vec<(f64, f64)>,
    /// Rule on [0, 1].
    angles: Vec<(f64, f64)>,
}

/// A contact.
#[derive(Clone, Debug)]
pub(super) struct RoundContact {
    face: Face,
    /// Radius of the contact, m.
    pub(super) radius_m: f64,
    /// Depth of the indenter's lowest point below the untouched surface, m.
    pub(super) depth_m: f64,
    /// Force, N.
    pub(super) force_n: f64,
    nodes: Vec<Node>,
    /// Transform of the pressure at the solver's wave numbers, N/(2π).
    transforms: Vec<f64>,
}

/// A node of χ.
#[derive(Clone, Copy, Debug)]
struct Node {
    t_m: f64,
    /// Weight of the node in the quadrature, m.
    weight_m: f64,
    chi_pa: f64,
}

impl RoundSolver {
    pub(super) fn new(layer: Layer) -> Self {
        // m decays as e^(−2kh); the panels resolve J0(kr) up to r = 10 h.
        let waves = panels(12, 16, 0.0, 22.0 / layer.thickness_m);
        let waves = waves
            .iter()
            .map(|&(k, weight)| (k, weight * layer.reduction(k)))
            .collect();
        Self {
            layer,
            waves,
            angles: gauss(16, 0.0, 1.0),
        }
    }

    /// The layer.
    pub(super) fn layer(&self) -> &Layer {
        &self.layer
    }

    /// Wave numbers, 1/m, with weights, m/Pa/m², whose sum with the pressure's transform and J0(kr) is
    /// the displacement at a height below the surface. The response decays as e^(−k depth).
    pub(super) fn inner_rule(&self, height_m: f64) -> Vec<(f64, f64)> {
        let last = 16.0 / (self.layer.thickness_m - height_m);
        let count = (last * 10.0 * self.layer.thickness_m / 25.0).ceil() as u32;
        panels(count.min(200), 16, 0.0, last)
            .iter()
            .map(|&(k, weight)| {
                let response = self.layer.response(k, height_m);
                (k, weight * k * response.down_by_pressure)
            })
            .collect()
    }

    /// The contact of a flat end pressed to `depth_m`, m.
    pub(super) fn flat(&self, radius_m: f64, depth_m: f64) -> RoundContact {
        let system = System::new(self, radius_m);
        let chi = system.solve(|_| depth_m);
        self.finished(Face::Flat, radius_m, depth_m, &system, chi)
    }

    /// The contact of a ball of the radius `ball_m` with this radius of contact, below that of the
    /// ball.
    pub(super) fn ball(&self, ball_m: f64, radius_m: f64) -> RoundContact {
        let face = Face::Ball(ball_m);
        let system = System::new(self, radius_m);
        let even = system.solve(|_| 1.0);
        let curved = system.solve(|t_m| face.transformed_m(t_m));
        let depth_m = self.at_rim(&system, &curved, face.transformed_m(radius_m))
            / self.at_rim(&system, &even, 1.0);
        let chi = even.iter().zip(&curved);
        let chi = chi.map(|(even, curved)| depth_m * even - curved).collect();
        self.finished(face, radius_m, depth_m, &system, chi)
    }

    fn finished(
        &self,
        face: Face,
        radius_m: f64,
        depth_m: f64,
        system: &System,
        chi: Vec<f64>,
    ) -> RoundContact {
        let node = |(&(t_m, weight_m), chi_pa)| Node {
            t_m,
            weight_m,
            chi_pa,
        };
        let nodes: Vec<Node> = system.rule.iter().zip(chi).map(node).collect();
        let mut contact = RoundContact {
            face,
            radius_m,
            depth_m,
            force_n: 0.0,
            nodes,
            transforms: Vec::new(),
        };
        contact.force_n = TAU * contact.transform(0.0);
        let transforms = self.waves.iter().map(|&(k, _)| contact.transform(k));
        contact.transforms = transforms.collect();
        contact
    }

    /// χ at the rim from the integral equation, for the face that `chi` was solved for.
    fn at_rim(&self, system: &System, chi: &[f64], face_m: f64) -> f64 {
        let waves = self.waves.iter().zip(&system.cosines);
        let integral: f64 = waves
            .map(|(&(k, _), (factor, cosines))| {
                factor * libm::cos(k * system.radius_m) * system.product(chi, cosines)
            })
            .sum();
        system.scale_pa_per_m * face_m - integral
    }

    /// Downward displacement of the surface at the distance `r_m` from the axis, m.
    pub(super) fn surface_m(&self, contact: &RoundContact, r_m: f64) -> f64 {
        if r_m <= contact.radius_m {
            return contact.depth_m - contact.face.height_m(r_m);
        }
        // Half-space: ∫₀ᵃ χ(t)/√(r² − t²) dt with t = r sin θ.
        let last = libm::asin(contact.radius_m / r_m);
        let half_space: f64 = self
            .angles
            .iter()
            .map(|&(share, weight)| last * weight * contact.chi_pa(r_m * libm::sin(last * share)))
            .sum();
        let waves = self.waves.iter().zip(&contact.transforms);
        let layer: f64 = waves
            .map(|(&(k, m), transform)| m * transform * libm::j0(k * r_m))
            .sum();
        self.layer.half_space_per_pa() * (half_space + layer)
    }
}

impl RoundContact {
    /// Transform of the pressure, N/(2π).
    pub(super) fn transform(&self, k: f64) -> f64 {
        let nodes = self.nodes.iter();
        nodes
            .map(|node| node.weight_m * node.chi_pa * libm::cos(k * node.t_m))
            .sum()
    }

    /// χ between its nodes, Pa: barycentric interpolation (Wang and Xiang 2012 for the weights).
    fn chi_pa(&self, t_m: f64) -> f64 {
        let (mut above, mut below, mut sign) = (0.0, 0.0, 1.0);
        for node in &self.nodes {
            let distance_m = t_m - node.t_m;
            if distance_m == 0.0 {
                return node.chi_pa;
            }
            let square = node.t_m * (self.radius_m - node.t_m) * node.weight_m;
            let weight = sign * libm::sqrt(square) / distance_m;
            above += weight * node.chi_pa;
            below += weight;
            sign = -sign;
        }
        above / below
    }
}

/// The integral equation at the nodes of a rule.
struct System {
    radius_m: f64,
    rule: Vec<(f64, f64)>,
    /// For each wave number its factor (2/π) m, 1/m, and cos kt at each node.
    cosines: Vec<(f64, Vec<f64>)>,
    /// (2/π)(G/(1 − ν)), Pa; right-hand sides are given in m.
    scale_pa_per_m: f64,
}

impl System {
    fn new(solver: &RoundSolver, radius_m: f64) -> Self {
        let rule = gauss(NODES, 0.0, radius_m);
        let cosines = |&(k, m): &(f64, f64)| {
            let row = rule.iter().map(|&(t, _)| libm::cos(k * t)).collect();
            (FRAC_2_PI * m, row)
        };
        Self {
            radius_m,
            cosines: solver.waves.iter().map(cosines).collect(),
            scale_pa_per_m: FRAC_2_PI / solver.layer.half_space_per_pa(),
            rule,
        }
    }

    /// Solves for χ by conjugate gradients: the operator is symmetric and positive in the rule's
    /// scalar product, since the layer's compliance is positive at every wave number.
    fn solve(&self, face_m: impl Fn(f64) -> f64) -> Vec<f64> {
        let rule = self.rule.iter();
        let mut residual: Vec<f64> = rule
            .map(|&(t, _)| self.scale_pa_per_m * face_m(t))
            .collect();
        let mut solution = vec![0.0; residual.len()];
        let mut direction = residual.clone();
        let mut square = self.product(&residual, &residual);
        let enough = 1e-26 * square;
        for _ in 0..4 * NODES {
            if square <= enough {
                break;
            }
            let image = self.applied(&direction);
            let step = square / self.product(&direction, &image);
            add(&mut solution, step, &direction);
            add(&mut residual, -step, &image);
            let next = self.product(&residual, &residual);
            for (d, r) in direction.iter_mut().zip(&residual) {
                *d = r + next / square * *d;
            }
            square = next;
        }
        solution
    }

    fn applied(&self, chi: &[f64]) -> Vec<f64> {
        let mut image = chi.to_vec();
        for (factor, cosines) in &self.cosines {
            add(&mut image, factor * self.product(chi, cosines), cosines);
        }
        image
    }

    fn product(&self, one: &[f64], other: &[f64]) -> f64 {
        let pairs = one.iter().zip(other).zip(&self.rule);
        pairs.map(|((a, b), (_, weight))| a * b * weight).sum()
    }
}

fn add(sum: &mut [f64], factor: f64, to_add: &[f64]) {
    for (sum, x) in sum.iter_mut().zip(to_add) {
        *sum += factor * x;
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    fn layer(thickness_m: f64, poisson: f64) -> Layer {
        Layer {
            thickness_m,
            shear_modulus_pa: 20e3,
            poisson,
        }
    }

    #[test]
    fn a_thick_layer_is_a_half_space() {
        // E* = 2G/(1 − ν) beside a rigid indenter (Johnson 1985, sections 3.7 and 4.2).
        let solver = RoundSolver::new(layer(0.5, 0.4));
        let modulus_pa = 2.0 * 20e3 / 0.6;
        let flat = solver.flat(2e-3, 0.1e-3);
        let expected_n = 2.0 * modulus_pa * 2e-3 * 0.1e-3;
        assert!(
            (flat.force_n / expected_n - 1.0).abs() < 5e-3,
            "{}",
            flat.force_n
        );
        // Outside a flat pin the surface follows (2d/π) asin(a/r).
        for r_m in [2.1e-3, 4e-3, 9e-3] {
            let expected_m = FRAC_2_PI * 0.1e-3 * libm::asin(2e-3 / r_m);
            let error_m = solver.surface_m(&flat, r_m) - expected_m;
            assert!(error_m.abs() < 0.6e-6, "{r_m}: {error_m}");
        }
        let ball = solver.ball(0.1, 2e-3);
        let depth_m = 2e-3 * 2e-3 / 0.1;
        assert!(
            (ball.depth_m / depth_m - 1.0).abs() < 5e-3,
            "{}",
            ball.depth_m
        );
        let expected_n = 4.0 / 3.0 * modulus_pa * libm::sqrt(0.1 * depth_m) * depth_m;
        assert!(
            (ball.force_n / expected_n - 1.0).abs() < 5e-3,
            "{}",
            ball.force_n
        );
    }

    #[test]
    fn an_incompressible_layer_keeps_its_volume() {
        let solver = RoundSolver::new(layer(5e-3, 0.5));
        let contact = solver.ball(4e-3, 2e-3);
        let rule = panels(1, 16, 0.0, 2e-3);
        let mut rings = panels(24, 16, 2e-3, 50e-3);
        rings.extend(rule);
        let terms = rings
            .iter()
            .map(|&(r, weight)| TAU * r * weight * solver.surface_m(&contact, r));
        let (mut volume, mut moved) = (0.0, 0.0);
        for term in terms {
            volume += term;
            moved += term.abs();
        }
        assert!(volume.abs() < 5e-3 * moved, "{volume} {moved}");
    }

    #[test]
    fn the_force_is_the_slope_of_the_energy() {
        // W = ½ ∫ p w dA = π ∫ χ(t) [d − φ(t)] dt, and F = dW/dd.
        let solver = RoundSolver::new(layer(5e-3, 0.5));
        let energy = |radius_m: f64| {
            let contact = solver.ball(4e-3, radius_m);
            let terms = contact.nodes.iter().map(|node| {
                let face_m = contact.depth_m - contact.face.transformed_m(node.t_m);
                PI * node.weight_m * node.chi_pa * face_m
            });
            (terms.sum::<f64>(), contact)
        };
        let [(less_j, less), (more_j, more)] = [1.999e-3, 2.001e-3].map(energy);
        let force_n = (more_j - less_j) / (more.depth_m - less.depth_m);
        let expected_n = solver.ball(4e-3, 2e-3).force_n;
        assert!(
            (force_n / expected_n - 1.0).abs() < 1e-6,
            "{force_n} {expected_n}"
        );
    }
}
