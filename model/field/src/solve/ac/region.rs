//! Properties of mesh regions in an alternating field. The unknowns of the equations (`system.rs`) are
//! w = A_φ/r, and for each ring of one turn u = V/(iω), with the voltage V around the ring.

use num_complex::Complex64;

use crate::design::{Design, MagneticPart};
use crate::geometry::shape::Shape;
use crate::material::{MU_0, Material};
use crate::mesh::Region;

/// Properties of a region in an alternating field.
#[derive(Clone)]
pub(super) struct AcRegion {
    pub(super) material: Material,
    /// Complex reluctivity divided by the real, static reluctivity: 1/(1 − i tan δ).
    pub(super) reluctivity_factor: Complex64,
    pub(super) conductivity_s_per_m: f64,
    pub(super) winding: Winding,
    /// Skin depth, m; infinite in insulators.
    pub(super) skin_depth_m: f64,
    /// Whether the part is so thick that all its currents are assumed to flow in its surface.
    pub(super) in_surface: bool,
}

/// Distribution of a coil's current in a region.
#[derive(Clone, Copy)]
pub(super) enum Winding {
    None,
    /// Evenly distributed current: index of the coil, and turns per area with the sign of the coil's sense, 1/m².
    Stranded {
        coil: usize,
        turns_per_m2: f64,
    },
    /// Current distributed by induction in a ring of one turn; `unknown` is the index of the ring's u among all unknowns.
    Solid {
        unknown: u32,
    },
}

/// Whether the rings of a coil are single turns, in which induction distributes the current. A ring
/// that reaches the axis does not count: any voltage would drive an infinite current there.
pub(super) fn is_solid(design: &Design, coil: usize) -> bool {
    let coil = design.coils.get(coil);
    coil.is_some_and(|coil| coil.turns == 1.0 && coil.rings.iter().all(|ring| ring.r_m[0] > 0.0))
}

/// For each coil whose rings are solid, the index of its first ring's u among all unknowns; and the
/// total number of unknowns. `count_of_w`: number of the unknowns w.
pub(super) fn ring_unknowns(design: &Design, count_of_w: usize) -> (Vec<Option<u32>>, usize) {
    let mut count = count_of_w;
    let mut first = Vec::with_capacity(design.coils.len());
    for (index, coil) in design.coils.iter().enumerate() {
        let solid = is_solid(design, index);
        first.push(u32::try_from(count).ok().filter(|_| solid));
        count += if solid { coil.rings.len() } else { 0 };
    }
    (first, count)
}

/// For each ring of one turn: index of its coil, index of its u among all unknowns, and sense of its coil.
pub(super) fn solid_rings(design: &Design, first_rings: &[Option<u32>]) -> Vec<(usize, u32, f64)> {
    let coils = design.coils.iter().zip(first_rings).enumerate();
    let rings = coils.filter_map(|(index, (coil, first))| {
        let numbers = (*first)?..;
        let rings = coil.rings.iter().zip(numbers);
        Some(rings.map(move |(_, unknown)| (index, unknown, coil.sense)))
    });
    rings.flatten().collect()
}

impl AcRegion {
    pub(super) const VACUUM: Self = Self {
        material: Material::VACUUM,
        reluctivity_factor: Complex64::ONE,
        conductivity_s_per_m: 0.0,
        winding: Winding::None,
        skin_depth_m: f64::INFINITY,
        in_surface: false,
    };

    pub(super) fn of(
        design: &Design,
        region: &Region,
        material: Material,
        first_rings: &[Option<u32>],
        omega: f64,
        coils: &[usize],
    ) -> Self {
        let part = region.part.and_then(|part| design.parts.get(part as usize));
        let carried = region.ring.and_then(|[coil, ring]| {
            let first = first_rings.get(coil as usize).copied().flatten();
            let coil_of = design.coils.get(coil as usize)?;
            let area = coil_of.rings.get(ring as usize)?.area_m2();
            Some(match first {
                Some(first) => Winding::Solid {
                    unknown: first + ring,
                },
                None => Winding::Stranded {
                    coil: coil as usize,
                    turns_per_m2: coil_of.sense * coil_of.turns / area,
                },
            })
        });
        let winding = carried.unwrap_or(Winding::None);
        let conductivity_s_per_m = match winding {
            Winding::Solid { .. } => 1.0 / design.resistivity_ohm_m,
            Winding::Stranded { .. } => 0.0,
            Winding::None => part.map_or(0.0, |part| part.conductivity_s_per_m),
        };
        let loss_tangent = part.map_or(0.0, |part| part.loss_tangent);
        let mu = MU_0 * material.initial_mu_r();
        let skin_depth_m = (2.0 / (omega * mu * conductivity_s_per_m)).sqrt();
        let thick = |part: &MagneticPart| {
            skin_depth_m < IN_SURFACE * least_extent_m(part)
                && skin_depth_m < BELOW_COILS * distance_m(design, coils, part)
        };
        Self {
            material,
            reluctivity_factor: Complex64::new(1.0, -loss_tangent).inv(),
            conductivity_s_per_m,
            winding,
            skin_depth_m,
            in_surface: matches!(winding, Winding::None) && part.is_some_and(thick),
        }
    }
}

/// If the skin depth is less than this fraction of a part's least extent, all currents are assumed
/// to flow in its surface. On plane faces the neglected terms are of second order in the ratio of
/// skin depth and distance, on edges of first order.
const IN_SURFACE: f64 = 1.0 / 200.0;
/// The skin depth must also be less than this fraction of the distance of part and coils. By Dodd
/// and Deeds' integrals with the impedance of a half-space in place of √(α² + iωμσ), the part's
/// contribution to R is then off by 1e-4 under a ring five times as wide as high, and by 3.5e-4
/// under one as wide as high; L is off by less than 1e-5.
const BELOW_COILS: f64 = 1.0 / 40.0;

/// Shorter side of the bounding rectangle of a part, m.
fn least_extent_m(part: &MagneticPart) -> f64 {
    let extent = |axis: usize| {
        let places = part
            .shape
            .extremes()
            .into_iter()
            .map(move |point| point[axis]);
        let range = places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| {
            [low.min(at), high.max(at)]
        });
        range[1] - range[0]
    };
    extent(0).min(extent(1))
}

/// Least distance of some coils from a part, m.
fn distance_m(design: &Design, coils: &[usize], part: &MagneticPart) -> f64 {
    let coils = coils.iter().filter_map(|&coil| design.coils.get(coil));
    let rings = coils.flat_map(|coil| &coil.rings);
    let distances = rings.map(|ring| Shape::rectangle(ring.r_m, ring.x_m).distance(&part.shape));
    distances.fold(f64::INFINITY, f64::min)
}
