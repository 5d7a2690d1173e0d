//! The cases, written independently from the paper's table and text, not from the design files of
//! palpate-field, so that an error in those shows as well. Lengths in mm.

use serde_json::{Value, json};

/// Start and end of a range, mm.
pub(super) type Span = [f64; 2];

/// A rectangle in the half-plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Section {
    pub(super) r: Span,
    pub(super) x: Span,
}

/// Outline of the elastomer.
#[derive(Debug, Clone, Copy)]
pub(super) enum Body {
    None,
    Cylinder(Section),
    /// A spheroid about the mid-plane, by its semi-axes across and along the axis.
    Spheroid(Span),
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Case {
    pub(super) name: &'static str,
    pub(super) body: Body,
    pub(super) plates: &'static [Section],
    /// Radius of the circle that encloses everything.
    pub(super) radius: f64,
    /// Whether the materials saturate: the plates, and the elastomer as well. The current is then
    /// 10 A instead of 1 A.
    pub(super) saturates: bool,
}

/// Axial position of the mid-plane and of all circles' centres, mm.
pub(super) const MIDDLE: f64 = 4.14;
pub(super) const CORE: Section = Section {
    r: [0.0, 8.0],
    x: [1.64, 6.64],
};
pub(super) const BOARDS: [Section; 2] = [
    Section {
        r: [8.0, 28.0],
        x: [0.0, 1.64],
    },
    Section {
        r: [8.0, 28.0],
        x: [6.64, 8.28],
    },
];
/// Cross-section of a ring, mm².
pub(super) const RING_AREA: f64 = 2.0 * 0.07;
pub(super) const MSE_MU: f64 = 3.7;
pub(super) const PLATE_MU: f64 = 1e5;
/// Saturation field of plates and elastomer, T.
pub(super) const KNEE_T: f64 = 1.25;
pub(super) const EXPONENT: f64 = 12.0;
pub(super) const SATURATION_A_PER_M: f64 = 510e3;

const INNER_DISCS: &[Section] = &[
    Section {
        r: [0.0, 8.0],
        x: [6.64, 6.94],
    },
    Section {
        r: [0.0, 8.0],
        x: [1.34, 1.64],
    },
];
const OUTER_DISCS: &[Section] = &[
    Section {
        r: [0.0, 8.0],
        x: [8.28, 8.58],
    },
    Section {
        r: [0.0, 8.0],
        x: [-0.3, 0.0],
    },
];
const BACK_PLATES: &[Section] = &[
    Section {
        r: [0.0, 30.0],
        x: [8.28, 8.58],
    },
    Section {
        r: [0.0, 30.0],
        x: [-0.3, 0.0],
    },
];
const BOX: &[Section] = &[
    Section {
        r: [0.0, 31.0],
        x: [8.28, 9.28],
    },
    Section {
        r: [0.0, 31.0],
        x: [-1.0, 0.0],
    },
    Section {
        r: [30.0, 31.0],
        x: [0.0, 8.28],
    },
];

const fn cylinder(r: f64, from: f64, to: f64) -> Body {
    Body::Cylinder(Section {
        r: [0.0, r],
        x: [from, to],
    })
}

const fn case(name: &'static str, body: Body, plates: &'static [Section]) -> Case {
    Case {
        name,
        body,
        plates,
        radius: 45.0,
        saturates: false,
    }
}

pub(super) const CASES: [Case; 13] = [
    case("air", Body::None, &[]),
    case("A", cylinder(30.0, -2.0, 10.28), &[]),
    case("A0", cylinder(30.0, 0.0, 8.28), &[]),
    Case {
        radius: 55.0,
        ..case("A10", cylinder(38.0, -10.0, 18.28), &[])
    },
    case("B1", Body::Spheroid([14.0, 8.28]), &[]),
    case("B2", Body::Spheroid([24.0, 8.28]), &[]),
    case("B3", Body::Spheroid([14.0, 12.0]), &[]),
    case("C1in", Body::Spheroid([14.0, 8.28]), INNER_DISCS),
    case("C1out", Body::Spheroid([14.0, 8.28]), OUTER_DISCS),
    case("C3in", Body::Spheroid([14.0, 12.0]), INNER_DISCS),
    case("CAin", cylinder(30.0, -2.0, 10.28), INNER_DISCS),
    Case {
        saturates: true,
        ..case("backplates", cylinder(30.0, -0.3, 8.58), BACK_PLATES)
    },
    Case {
        saturates: true,
        ..case("pot", cylinder(30.0, 0.0, 8.28), BOX)
    },
];

impl Case {
    /// Current of all rings, A.
    pub(super) fn current_a(&self) -> f64 {
        if self.saturates { 10.0 } else { 1.0 }
    }

    /// Factor by which triangles at corners are smaller than elsewhere. The field at corners of
    /// plates is far more singular: with a factor of 20, NGSolve ends 1.4e-4 off on C1in, however
    /// fine the rest of the mesh.
    pub(super) fn corner_grading(&self) -> f64 {
        if self.plates.is_empty() { 20.0 } else { 400.0 }
    }

    /// All rings: seven on each face of both boards.
    pub(super) fn rings() -> Vec<Section> {
        let layers = [[0.0, 0.07], [1.57, 1.64], [6.64, 6.71], [8.21, 8.28]];
        let ring = |k: u32| [8.0 + 3.0 * f64::from(k), 10.0 + 3.0 * f64::from(k)];
        let layer = |x: Span| (0..7).map(move |k| Section { r: ring(k), x });
        layers.into_iter().flat_map(layer).collect()
    }

    /// The case for the NGSolve script, to be solved with these triangle sizes.
    pub(super) fn json(&self, sizes: &[f64]) -> Value {
        let section = |s: &Section| json!({ "r": s.r, "x": s.x });
        let sections = |all: &[Section]| all.iter().map(section).collect::<Vec<_>>();
        let bodies = match self.body {
            Body::None => vec![],
            Body::Cylinder(outline) => vec![section(&outline)],
            Body::Spheroid(semi) => vec![json!({ "semi": semi, "centre": MIDDLE })],
        };
        json!({
            "radius": self.radius, "centre": MIDDLE, "middle": MIDDLE,
            "ring_area": RING_AREA, "current": self.current_a(),
            "rings": sections(&Self::rings()), "boards": sections(&BOARDS),
            "plates": sections(self.plates), "bodies": bodies, "core": [CORE.r, CORE.x],
            "mse": { "mu": MSE_MU, "saturates": u8::from(self.saturates), "saturation": SATURATION_A_PER_M },
            "plate": { "mu": PLATE_MU, "knee": KNEE_T, "exponent": EXPONENT },
            "saturates": self.saturates, "sizes": sizes, "grading": 0.7, "corner_grading": self.corner_grading(),
        })
    }
}
