//! Integrals over the triangles.

use super::excitation::Excitation;
use super::space::Space;
use crate::design::Design;
use crate::element::basis::BasisValues;
use crate::element::quadrature;
use crate::element::shape::Placed;
use crate::geometry::{Point, length};
use crate::material::{MU_0, Material};
use crate::mesh::{Region, ascending};

/// The problem on one mesh: the space, the materials of its regions and the currents in them.
#[derive(Clone, Debug)]
pub struct Level {
    /// The mesh with its unknowns.
    pub space: Space,
    /// Material of each region.
    pub materials: Vec<Material>,
    /// Remanence of each region along the axis, T; 0 for all but magnets.
    pub remanences_t: Vec<f64>,
    /// Current density of each region, A/m²: turns per area times the coil's current.
    pub currents_a_per_m2: Vec<f64>,
    /// Uniform background field, T.
    pub background_t: f64,
}

/// Contribution of a triangle to the residual and to the tangent. The tangent is stored as its
/// lower half, row by row; empty if it is not requested.
pub(super) struct Local {
    pub(super) residual: Vec<f64>,
    pub(super) tangent: Vec<f64>,
    /// The two components of a vector for each unknown: its field, or its gradient outside. They
    /// are stored apart, so that the processor computes several unknowns at once.
    vectors: [Vec<f64>; 2],
}

impl Local {
    /// Creates the contribution of a triangle with `size` unknowns.
    pub(super) fn new(size: usize, tangent: bool) -> Self {
        Self {
            residual: vec![0.0; size],
            tangent: vec![0.0; if tangent { size * (size + 1) / 2 } else { 0 }],
            vectors: [const { Vec::new() }; 2],
        }
    }

    fn set_vectors(&mut self, vectors: impl Iterator<Item = [f64; 2]>) {
        let [first, second] = &mut self.vectors;
        first.clear();
        second.clear();
        for [a, b] in vectors {
            first.push(a);
            second.push(b);
        }
    }

    /// Adds scale · vᵢᵀ h to the residual and scale · vᵢᵀ D vⱼ to the lower half of the tangent.
    fn add(&mut self, scale: f64, law: [[f64; 2]; 2], h: [f64; 2]) {
        let [first, second] = &self.vectors;
        let mut start = 0;
        for (i, ((&a, &b), residual)) in
            first.iter().zip(second).zip(&mut self.residual).enumerate()
        {
            *residual += scale * (a * h[0] + b * h[1]);
            let Some(row) = self.tangent.get_mut(start..=start + i) else {
                continue;
            };
            start += i + 1;
            let c = scale * (law[0][0] * a + law[0][1] * b);
            let d = scale * (law[1][0] * a + law[1][1] * b);
            for ((entry, u), v) in row.iter_mut().zip(first).zip(second) {
                *entry += c * u + d * v;
            }
        }
    }
}

/// Adds the product of a tangent and `w` to a residual.
pub(super) fn add_product(tangent: &[f64], unknowns: &[u32], w: &[f64], residual: &mut [f64]) {
    let value = |&unknown: &u32| w.get(unknown as usize).copied().unwrap_or(0.0);
    let mut tangent = tangent.iter();
    for (i, row) in unknowns.iter().map(value).enumerate() {
        for (j, column) in unknowns.iter().map(value).enumerate().take(i + 1) {
            let entry = tangent.next().copied().unwrap_or(0.0);
            if let Some(residual) = residual.get_mut(i) {
                *residual += entry * column;
            }
            if j < i
                && let Some(residual) = residual.get_mut(j)
            {
                *residual += entry * row;
            }
        }
    }
}

/// Field at a point of integration, with the point's weight.
pub struct At<'p> {
    /// Position.
    pub point: Point,
    /// Weight of the point for an integral over the area dr dx; multiply by 2π r for the volume.
    pub weight: f64,
    /// B_r and B_x, T.
    pub b: [f64; 2],
    /// A_φ/r without that of the background field, T.
    pub w: f64,
    /// Region of the point.
    pub region: &'p Region,
    /// Index of the region.
    pub index: usize,
    /// Index of the triangle.
    pub triangle: usize,
}

impl Level {
    /// Collects the materials and currents of a design for a mesh.
    #[must_use]
    pub fn new(design: &Design, space: Space, excitation: &Excitation) -> Self {
        let material = |region: &Region| {
            let part = region.part.and_then(|part| design.parts.get(part as usize));
            match part {
                Some(part) if excitation.saturating => part.material.clone(),
                Some(part) => part.material.initially(),
                None => Material::VACUUM,
            }
        };
        let remanence = |region: &Region| {
            let part = region.part.and_then(|part| design.parts.get(part as usize));
            let part = part.filter(|_| excitation.magnetised);
            part.map_or(0.0, |part| part.remanence_t)
        };
        let current = |region: &Region| {
            let [coil, ring] = region.ring?;
            let coil_current = excitation.currents_a.get(coil as usize)?;
            let coil = design.coils.get(coil as usize)?;
            let ring = coil.rings.get(ring as usize)?;
            Some(coil_current * coil.sense * coil.turns / ring.area_m2())
        };
        let regions = &space.mesh.regions;
        Self {
            materials: regions.iter().map(material).collect(),
            remanences_t: regions.iter().map(remanence).collect(),
            currents_a_per_m2: regions.iter().map(|r| current(r).unwrap_or(0.0)).collect(),
            background_t: excitation.background_t,
            space,
        }
    }

    /// The material of a region, and its field in excess of the remanence, T: since H = ν (B −
    /// B_r), the material's law applies to this difference.
    pub(crate) fn law_at(&self, region: usize, b: [f64; 2]) -> (&Material, [f64; 2]) {
        let material = self.materials.get(region).unwrap_or(&Material::VACUUM);
        let remanence_t = self.remanences_t.get(region).copied().unwrap_or(0.0);
        (material, [b[0], b[1] - remanence_t])
    }

    /// Reluctivity of a region of linear material without remanence or background field; `None` for
    /// other regions.
    fn nu_without_field(&self, region: usize) -> Option<f64> {
        let (material, excess) = self.law_at(region, [0.0, self.background_t]);
        (material.is_linear() && excess == [0.0; 2]).then(|| material.reluctivity(0.0).nu)
    }

    /// Calls `visit` at every point of integration inside the circle.
    pub fn visit(&self, w: &[f64], visit: impl FnMut(&At<'_>)) {
        self.visit_where(w, |_| true, visit);
    }

    /// Calls `visit` at every point of integration of some regions inside the circle.
    pub(crate) fn visit_where(
        &self,
        w: &[f64],
        counts: impl Fn(&Region) -> bool,
        mut visit: impl FnMut(&At<'_>),
    ) {
        let mut placed = Placed::new(&self.space.basis);
        for (index, triangle) in self.space.mesh.triangles.iter().enumerate() {
            let region = self.space.mesh.region(triangle);
            let Some(unknowns) = self.space.unknowns.get(index) else {
                continue;
            };
            if region.exterior || !counts(&region) {
                continue;
            }
            for (sample, weight) in &self.space.samples {
                self.space.place(index, sample, &mut placed);
                let (value, slope) = combine(w, unknowns, sample, &placed);
                let r = placed.point[0];
                visit(&At {
                    point: placed.point,
                    weight: 0.5 * placed.jacobian * weight,
                    b: [
                        -r * slope[1],
                        2.0 * value + r * slope[0] + self.background_t,
                    ],
                    w: value,
                    region: &region,
                    index: triangle.region as usize,
                    triangle: index,
                });
            }
        }
    }

    /// Computes residual and tangent of one triangle at the state `w`.
    pub(super) fn local(&self, index: usize, w: &[f64], placed: &mut Placed, out: &mut Local) {
        let space = &self.space;
        let (Some(triangle), Some(unknowns)) =
            (space.mesh.triangles.get(index), space.unknowns.get(index))
        else {
            return;
        };
        out.residual.fill(0.0);
        let exterior = space.mesh.region(triangle).exterior;
        let region = triangle.region as usize;
        let current = self.currents_a_per_m2.get(region).copied().unwrap_or(0.0);
        if !out.tangent.is_empty()
            && space.is_straight(index)
            && let Some(nu) = self.nu_without_field(region)
        {
            let corners = space.mesh.corners_of(triangle);
            let tangent = &mut out.tangent;
            (space.reference).tangent(corners, nu, exterior, tangent);
            if current != 0.0 {
                (space.reference).subtract_current(corners, current, &mut out.residual);
            }
            add_product(tangent, unknowns, w, &mut out.residual);
            return;
        }
        out.tangent.fill(0.0);
        for (sample, weight) in &space.samples {
            space.place(index, sample, placed);
            let r = placed.point[0];
            let area = 0.5 * placed.jacobian.abs() * weight;
            let (value, slope) = combine(w, unknowns, sample, placed);
            if exterior {
                let scale = area * r * r * r / MU_0;
                out.set_vectors(placed.gradients.iter().copied());
                out.add(scale, [[1.0, 0.0], [0.0, 1.0]], slope);
                continue;
            }
            let curls = placed.gradients.iter().zip(&sample.values);
            out.set_vectors(
                curls.map(|(gradient, phi)| [-r * gradient[1], 2.0 * phi + r * gradient[0]]),
            );
            let b = [
                -r * slope[1],
                2.0 * value + r * slope[0] + self.background_t,
            ];
            let (material, excess) = self.law_at(region, b);
            let law = material.reluctivity(length(excess));
            // The background is itself a curl-free field, so only the excess of H over ν₀B₀
            // contributes.
            let h = [
                law.nu * excess[0],
                law.nu * excess[1] - self.background_t / MU_0,
            ];
            out.add(area * r, law.differential(excess), h);
            if current != 0.0 {
                for (residual, phi) in out.residual.iter_mut().zip(&sample.values) {
                    *residual -= area * r * r * current * phi;
                }
            }
        }
    }

    /// For each edge of the arc, its triangle and the full matrix of the integral (1/R) ∮ w v r³
    /// ds.
    pub(super) fn arc(&self) -> Vec<(usize, Vec<f64>)> {
        let mesh = &self.space.mesh;
        let radius = mesh.circle.radius;
        let order = self.space.basis.order() as usize;
        let mut edges = Vec::new();
        let rule = quadrature::gauss(order + 2, 0.0);
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            if !mesh.region(triangle).exterior {
                continue;
            }
            let (Some(nodes), Some(unknowns)) =
                (self.space.nodes.get(index), self.space.unknowns.get(index))
            else {
                continue;
            };
            for (side, edge) in triangle.edges().into_iter().enumerate() {
                if !mesh.arc.contains(&ascending(edge)) {
                    continue;
                }
                let mut matrix = vec![0.0; unknowns.len() * unknowns.len()];
                for &(t, weight) in &rule {
                    let sample = self.space.basis.sample(on_side(side, t));
                    let (point, [dr, dx]) = along(nodes, &sample, side);
                    let speed = dr.hypot(dx);
                    let scale = weight * speed * point[0].powi(3) / (radius * MU_0);
                    for (i, a) in sample.values.iter().enumerate() {
                        for (j, b) in sample.values.iter().enumerate() {
                            if let Some(entry) = matrix.get_mut(i * unknowns.len() + j) {
                                *entry += scale * a * b;
                            }
                        }
                    }
                }
                edges.push((index, matrix));
            }
        }
        edges
    }
}

/// Barycentric coordinates of the point at the fraction `t` of a side.
pub(super) fn on_side(side: usize, t: f64) -> [f64; 3] {
    let mut at = [0.0; 3];
    at[side] = 1.0 - t;
    at[(side + 1) % 3] = t;
    at
}

/// Position on a side, and its derivative with respect to the fraction of the side.
pub(super) fn along(nodes: &[Point], sample: &BasisValues, side: usize) -> (Point, [f64; 2]) {
    // Changes of the second and third barycentric coordinates along the three sides.
    let by = [[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]][side];
    let mut point = [0.0; 2];
    let mut tangent = [0.0; 2];
    for ((node, value), slope) in nodes.iter().zip(&sample.values).zip(&sample.slopes) {
        for axis in 0..2 {
            point[axis] += value * node[axis];
            tangent[axis] += (slope[0] * by[0] + slope[1] * by[1]) * node[axis];
        }
    }
    (point, tangent)
}

/// Value and gradient at a point of the function with the coefficients `w`.
pub(super) fn combine(
    w: &[f64],
    unknowns: &[u32],
    sample: &BasisValues,
    placed: &Placed,
) -> (f64, [f64; 2]) {
    let mut value = 0.0;
    let mut slope = [0.0; 2];
    for ((unknown, phi), gradient) in unknowns.iter().zip(&sample.values).zip(&placed.gradients) {
        let w = w.get(*unknown as usize).copied().unwrap_or(0.0);
        value += w * phi;
        slope[0] += w * gradient[0];
        slope[1] += w * gradient[1];
    }
    (value, slope)
}
