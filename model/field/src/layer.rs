//! From the field to springs: the effect of the elastomer between the boards on the sensor.
//!
//! A layer bonded between rigid plates cannot bulge (Gent and Lindley, 1959): its stiffness is
//! E A (1 + 2S²)/h with the shape factor S = loaded area / free area. The modulus rises with the
//! field: E(B) = E₀ [1 + R B²/(B² + B_c²)].

use core::f64::consts::TAU;

use crate::design::{Cut, Design, MagneticPart};
use crate::material::MU_0;
use crate::solve::Solved;

/// Field-dependent stiffness of an elastomer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elastomer {
    /// Young's modulus without field E₀, Pa.
    pub modulus_pa: f64,
    /// Greatest relative rise of the modulus, R.
    pub rise: f64,
    /// Flux density at which the modulus has half of its greatest rise, B_c, T.
    pub half_t: f64,
}

impl Elastomer {
    /// Ordinary soft elastomer. The values are assumed, without a source, and to be replaced by a
    /// calibration.
    pub const SOFT: Self = Self {
        modulus_pa: 0.1e6,
        rise: 3.0,
        half_t: 0.30,
    };
    /// Very soft elastomer: a modulus in the middle of 30 to 60 kPa, assumed without a source.
    pub const ULTRASOFT: Self = Self {
        modulus_pa: 45e3,
        rise: 15.0,
        half_t: 0.25,
    };

    /// Fraction of the greatest rise of the modulus that a field causes.
    #[must_use]
    pub fn share(&self, b_t: f64) -> f64 {
        b_t * b_t / (b_t * b_t + self.half_t * self.half_t)
    }
}

/// The layer between the boards, at one current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Loaded area of the layer, m².
    pub area_m2: f64,
    /// Shape factor: loaded area divided by free surface area.
    pub shape_factor: f64,
    /// Spring constant without field, c_D0, N/m.
    pub spring_n_per_m: f64,
    /// Relative rise of the spring constant due to the field.
    pub stiffening: f64,
    /// Uniform field that would cause the same rise of the spring constant, T.
    pub field_t: f64,
}

impl Layer {
    /// Computes the layer of a design in a solved field. The cast bodies between the boards carry
    /// the load in parallel; the modulus at each point is weighted by volume.
    ///
    /// Returns `None` if there is no elastomer between the boards.
    #[must_use]
    pub fn of(design: &Design, solved: &Solved, elastomer: &Elastomer) -> Option<Self> {
        let [from, to] = design.core.x_m;
        let height = to - from;
        let (mut area_m2, mut free_m2, mut spring) = (0.0, 0.0, 0.0);
        for part in design.parts.iter().filter(|part| part.cast) {
            let Some(r_m) = extent_in_plane(part, design.core.middle_m()) else {
                continue;
            };
            let (area, outline) = part.cut.left_of(r_m);
            // The inner rim of a ring is a free surface; a body that reaches the axis has none
            // there.
            let shape_factor = area / (outline * height);
            spring += elastomer.modulus_pa * area * (1.0 + 2.0 * shape_factor.powi(2)) / height;
            area_m2 += area;
            free_m2 += outline * height;
        }
        if area_m2 <= 0.0 {
            return None;
        }
        let (mut volume, mut share) = (0.0, 0.0);
        solved.visit(|at| {
            let part = at
                .region
                .part
                .and_then(|part| design.parts.get(part as usize));
            if let Some(part) = part.filter(|part| part.cast)
                && (from..to).contains(&at.point[1])
            {
                let weight = TAU * at.weight * at.point[0];
                volume += weight;
                share += weight * elastomer.share(in_the_pieces(part, design, at.b));
            }
        });
        let share = share / volume;
        Some(Self {
            area_m2,
            shape_factor: area_m2 / free_m2,
            spring_n_per_m: spring,
            stiffening: elastomer.rise * share,
            field_t: elastomer.half_t * (share / (1.0 - share)).sqrt(),
        })
    }
}

/// Flux density in the remaining pieces of a cut body, T: H in the pieces equals H in the mixture.
fn in_the_pieces(part: &MagneticPart, design: &Design, b: [f64; 2]) -> f64 {
    let size = b[0].hypot(b[1]);
    let fill = match (part.cut, extent_in_plane(part, design.core.middle_m())) {
        (Cut::Whole, _) | (_, None) => return size,
        (cut, Some(r_m)) => cut.fill(r_m),
    };
    let h = part.material.reluctivity(size).nu * size;
    let magnetisation = (size / MU_0 - h) / fill;
    MU_0 * (h + magnetisation)
}

/// Inner and outer radius of a body where a plane across the axis cuts it. The outline is sampled
/// at 2,000 radii, which gives the area within 0.1 %.
fn extent_in_plane(part: &MagneticPart, x: f64) -> Option<[f64; 2]> {
    const STEPS: u32 = 2_000;
    let reach = part
        .shape
        .extremes()
        .iter()
        .map(|point| point[0])
        .fold(0.0, f64::max);
    let at = |step: u32| (f64::from(step) + 0.5) / f64::from(STEPS) * reach;
    let mut inside = (0..STEPS).filter(|&step| part.contains([at(step), x]));
    let first = inside.next()?;
    let last = inside.next_back().unwrap_or(first);
    let half = 0.5 * reach / f64::from(STEPS);
    Some([
        if first == 0 { 0.0 } else { at(first) - half },
        at(last) + half,
    ])
}

/// Spring constant of the sensing layer, a pad of elastomer on a rigid base, N/m.
#[must_use]
pub fn pad_spring_n_per_m(elastomer: &Elastomer, radius_m: f64, height_m: f64) -> f64 {
    let shape_factor = radius_m / (2.0 * height_m);
    let area = core::f64::consts::PI * radius_m * radius_m;
    elastomer.modulus_pa * area * (1.0 + 2.0 * shape_factor * shape_factor) / height_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::builtin;
    use crate::solve::{Accuracy, Excitation, solve};

    /// The paper's layer: 1,070 N/mm bonded, and 1.4 % at 10 A for soft elastomer.
    #[test]
    fn the_paper_s_layer() {
        let design = builtin("A").expect("built in");
        let excitation = Excitation::saturating(&design, 10.0);
        let solved = solve(&design, &excitation, &Accuracy::default()).expect("a field");
        let layer = Layer::of(&design, &solved, &Elastomer::SOFT).expect("a layer");
        assert!(
            (layer.spring_n_per_m / 1.070e6 - 1.0).abs() < 0.01,
            "{layer:?}"
        );
        // The core's 20.4 mT would give 1.4 %, but most of the layer lies outside of the core,
        // between the boards, where the field is weaker.
        assert!((Elastomer::SOFT.rise * Elastomer::SOFT.share(0.0204) - 0.0138).abs() < 1e-4);
        assert!((0.002..0.006).contains(&layer.stiffening), "{layer:?}");
        assert!((pad_spring_n_per_m(&Elastomer::SOFT, 7e-3, 2e-3) / 54.8e3 - 1.0).abs() < 0.01);
    }

    #[test]
    fn cutting_makes_softer() {
        let whole = Cut::Whole.left_of([0.0, 8e-3]);
        assert!((whole.0 / whole.1 - 4e-3).abs() < 1e-12, "S h = r/2");
        let pillars = Cut::Pillars {
            count: 4,
            diameter_m: 2e-3,
        };
        assert!((pillars.fill([0.0, 8e-3]) - 4.0 / 64.0).abs() < 1e-12);
        let slots = Cut::Slots {
            count: 4,
            width_m: 0.5e-3,
        };
        let (area, outline) = slots.left_of([0.0, 8e-3]);
        assert!(area < whole.0 && outline > whole.1);
    }
}
