//! Designs as read from TOML: coils, boards, bodies, plates and their materials.
//!
//! Every part is a body of revolution about the axis `x`; `r` is the distance from it. In the file
//! lengths are in the unit that `length_unit` names; in these types they are in metres.

mod builtin;
mod check;
mod expression;
mod named;
mod read;
pub mod vary;

use core::fmt;

pub use builtin::{BUILTIN, WITH_MAGNETS, WITH_SENSING_COIL, builtin, builtin_names, builtin_text};
pub use named::Named;

use crate::geometry::shape::Shape;
use crate::material::Material;

/// A design: geometry, materials and currents for the solver.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// Name.
    pub name: String,
    /// Description in one sentence.
    pub about: String,
    /// The core: the disc between the boards for which mean field, homogeneity and closing force
    /// are computed.
    pub core: Core,
    /// Windings. All driven windings are in series.
    pub coils: Vec<RingCoil>,
    /// Circuit boards. They displace the cast bodies and are not magnetic.
    pub boards: Vec<CircuitBoard>,
    /// Bodies and plates.
    pub parts: Vec<MagneticPart>,
    /// Resistivity of the windings, Ω m.
    pub resistivity_ohm_m: f64,
    /// The current that the design is meant for, A.
    pub current_a: f64,
    /// Uniform background field along the axis, T.
    pub background_t: f64,
    /// Files that the design refers to.
    pub files: Vec<FileRead>,
}

/// A file that was read for a design.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileRead {
    /// Path of the file.
    pub file: String,
    /// Summary of its contents, with sizes and units.
    pub summary: String,
}

impl fmt::Display for FileRead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.file, self.summary)
    }
}

/// The disc for which the figures are computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Core {
    /// Radius, m.
    pub r_m: f64,
    /// Ends on the axis, m.
    pub x_m: [f64; 2],
}

impl Core {
    /// Position on the axis of the core's middle, m.
    #[must_use]
    pub fn middle_m(&self) -> f64 {
        0.5 * (self.x_m[0] + self.x_m[1])
    }

    /// Range in which the stack is parted for the force, m: the middle half of the core's length.
    #[must_use]
    pub fn parting_m(&self) -> [f64; 2] {
        let quarter = 0.25 * (self.x_m[1] - self.x_m[0]);
        [self.x_m[0] + quarter, self.x_m[1] - quarter]
    }
}

/// A coil of one ring, or of several rings of equal size side by side, in series.
#[derive(Clone, Debug, PartialEq)]
pub struct RingCoil {
    /// Name.
    pub name: String,
    /// Cross-sections of the rings.
    pub rings: Vec<Rectangle>,
    /// Number of turns in each ring.
    pub turns: f64,
    /// Direction of the current, +1 or −1.
    pub sense: f64,
    /// Whether the coil is in series with the others and carries the constant current; false for a
    /// sensing coil.
    pub driven: bool,
    /// Constant current of a coil that is not in series with the others, A; multiplied by its
    /// sense.
    pub own_current_a: Option<f64>,
}

/// A rectangle in the half-plane (r, x), the cross-section of a ring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Inner and outer radius, m.
    pub r_m: [f64; 2],
    /// Lower and upper end along the axis, m.
    pub x_m: [f64; 2],
}

impl Rectangle {
    /// Area of the cross-section, m².
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        (self.r_m[1] - self.r_m[0]) * (self.x_m[1] - self.x_m[0])
    }

    /// Circumference of the circle through the middle of the cross-section, m.
    #[must_use]
    pub fn circumference_m(&self) -> f64 {
        core::f64::consts::PI * (self.r_m[0] + self.r_m[1])
    }
}

/// A circuit board with its copper, which is not magnetic.
#[derive(Clone, Debug, PartialEq)]
pub struct CircuitBoard {
    /// Name.
    pub name: String,
    /// Cross-section.
    pub section: Rectangle,
}

/// A magnetic part: a body or a plate.
#[derive(Clone, Debug, PartialEq)]
pub struct MagneticPart {
    /// Name.
    pub name: String,
    /// Name of its material.
    pub material_name: String,
    /// Material; for a cut body, that of a mixture of the remaining pieces and the air between
    /// them.
    pub material: Material,
    /// Remanence B_r of a magnet along the axis, T; μ_r, in its `material`, is the recoil
    /// permeability: B = B_r + μ₀ μ_r H.
    pub remanence_t: f64,
    /// Outline.
    pub shape: Shape,
    /// Shapes cut out of the outline.
    pub minus: Vec<Shape>,
    /// Conductivity, S/m; 0 for an insulator.
    pub conductivity_s_per_m: f64,
    /// Loss tangent of the permeability, μ″/μ′, for alternating fields.
    pub loss_tangent: f64,
    /// How the body is cut so that it can expand sideways.
    pub cut: Cut,
    /// Whether the part was cast around boards, windings and plates (a body) and so leaves out
    /// their space. Otherwise it is solid (a plate), and no other part may reach into it.
    pub cast: bool,
}

/// Cuts along the axis that make a body softer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cut {
    /// No cuts.
    Whole,
    /// Cut into round pillars.
    Pillars {
        /// Number of pillars.
        count: u32,
        /// Diameter of each pillar, m.
        diameter_m: f64,
    },
    /// Divided into sectors by radial slots.
    Slots {
        /// Number of slots.
        count: u32,
        /// Width of each slot, m.
        width_m: f64,
    },
}

impl Cut {
    /// Returns the remaining area of a ring from `r[0]` to `r[1]`, m², and the length of the
    /// outlines of all its pieces, m.
    #[must_use]
    pub fn left_of(&self, r_m: [f64; 2]) -> (f64, f64) {
        use core::f64::consts::{PI, TAU};
        let [from, to] = r_m;
        let area = PI * (to * to - from * from);
        let outline = TAU * (to + from);
        match *self {
            Self::Whole => (area, outline),
            Self::Pillars { count, diameter_m } => {
                let count = f64::from(count);
                (
                    count * PI / 4.0 * diameter_m * diameter_m,
                    count * PI * diameter_m,
                )
            }
            Self::Slots { count, width_m } => {
                let count = f64::from(count);
                let width = count * width_m;
                (
                    area - width * (to - from),
                    outline - 2.0 * width + 2.0 * count * (to - from),
                )
            }
        }
    }

    /// Remaining fraction of the area of a ring from `r[0]` to `r[1]`.
    #[must_use]
    pub fn fill(&self, r_m: [f64; 2]) -> f64 {
        self.left_of(r_m).0 / Self::Whole.left_of(r_m).0
    }
}

impl MagneticPart {
    /// Whether a point lies within the outline and in none of the shapes cut out of it.
    #[must_use]
    pub fn contains(&self, point: [f64; 2]) -> bool {
        self.shape.contains(point) && !self.minus.iter().any(|hole| hole.contains(point))
    }
}

impl Design {
    /// The coils that carry the constant current.
    pub fn driven_coils(&self) -> impl Iterator<Item = &RingCoil> {
        self.coils.iter().filter(|coil| coil.driven)
    }

    /// Whether any coil carries the constant current.
    #[must_use]
    pub fn is_driven(&self) -> bool {
        self.driven_coils().next().is_some()
    }

    /// Resistance of the driven windings in series, Ω, at the temperature of the resistivity. The
    /// current flows in circles, evenly distributed over each ring, so each ring has ρ · 2π r̄
    /// turns² / area.
    #[must_use]
    pub fn resistance_ohm(&self) -> f64 {
        let coils = self.driven_coils();
        // An empty sum is -0; adding 0.0 makes it 0.
        0.0 + coils
            .map(|coil| self.coil_resistance_ohm(coil))
            .sum::<f64>()
    }

    /// Resistance of one coil, Ω, by the same formula as [`resistance_ohm`](Self::resistance_ohm).
    #[must_use]
    pub fn coil_resistance_ohm(&self, coil: &RingCoil) -> f64 {
        let ring = |ring: &Rectangle| ring.circumference_m() / ring.area_m2();
        let rings: f64 = coil.rings.iter().map(ring).sum();
        self.resistivity_ohm_m * coil.turns.powi(2) * rings
    }

    /// All corners of boards, copper, bodies and plates, m.
    fn extremes(&self) -> impl Iterator<Item = [f64; 2]> {
        let rings = self.coils.iter().flat_map(|coil| &coil.rings);
        let boards = self.boards.iter().map(|board| &board.section);
        let corner = |section: &Rectangle| section.x_m.map(|x| [section.r_m[1], x]);
        let parts = self.parts.iter().flat_map(|part| part.shape.extremes());
        rings.chain(boards).flat_map(corner).chain(parts)
    }

    /// Lower and upper end of the design along the axis, m, including the core.
    #[must_use]
    pub fn height_m(&self) -> [f64; 2] {
        let places = self.extremes().map(|[_, x]| x).chain(self.core.x_m);
        places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        })
    }

    /// Greatest distance of the design from the axis, m, including the core.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.extremes()
            .map(|[r, _]| r)
            .fold(self.core.r_m, f64::max)
    }

    /// Whether any part is a magnet.
    #[must_use]
    pub fn has_magnets(&self) -> bool {
        self.parts.iter().any(|part| part.remanence_t != 0.0)
    }

    /// Whether there is a field without the constant current: a background, magnets, or coils with
    /// currents of their own.
    #[must_use]
    pub fn has_standing_field(&self) -> bool {
        self.background_t != 0.0 || self.has_magnets() || self.has_own_currents()
    }
}

/// Error in a design.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DesignError {
    /// File name, as given to the reader.
    pub file: String,
    /// Line, counted from 1.
    pub line: usize,
    /// Key or part that contains the error; empty if the text is not TOML.
    pub place: String,
    /// Description of the error.
    pub problem: String,
    /// Allowed values; empty if the description contains them.
    pub allowed: String,
}

impl fmt::Display for DesignError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: ", self.file, self.line)?;
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.problem)?;
        if !self.allowed.is_empty() {
            write!(f, "; allowed: {}", self.allowed)?;
        }
        Ok(())
    }
}

impl core::error::Error for DesignError {}
