//! What is to be solved: coils, boards, bodies, plates and their materials, as read from TOML.
//!
//! Everything is a body of revolution about the axis `x`; `r` is the distance from it. In the file
//! lengths are in the unit that `length_unit` names; in these types they are metres.

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

/// A design: everything that the solver has to know.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// Name.
    pub name: String,
    /// What it is, in a sentence.
    pub about: String,
    /// The volume that is judged: the disc between the boards, by which mean field, homogeneity
    /// and the force that closes it are defined.
    pub core: Core,
    /// Windings. Those that are driven are in series.
    pub coils: Vec<RingCoil>,
    /// Circuit boards. They displace the cast bodies and are not magnetic.
    pub boards: Vec<CircuitBoard>,
    /// Bodies and plates.
    pub parts: Vec<MagneticPart>,
    /// Resistivity of the windings, Ω m.
    pub resistivity_ohm_m: f64,
    /// The current that the design is meant for, A.
    pub current_a: f64,
    /// Uniform field along the axis in which everything stands, T.
    pub background_t: f64,
    /// The files beside it that it names.
    pub files: Vec<FileRead>,
}

/// A file beside a design.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileRead {
    /// Its path.
    pub file: String,
    /// What was read of it, with sizes and units.
    pub summary: String,
}

impl fmt::Display for FileRead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.file, self.summary)
    }
}

/// The disc that is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Core {
    /// Radius, m.
    pub r_m: f64,
    /// Ends on the axis, m.
    pub x_m: [f64; 2],
}

impl Core {
    /// The middle of its length, m.
    #[must_use]
    pub fn middle_m(&self) -> f64 {
        0.5 * (self.x_m[0] + self.x_m[1])
    }

    /// The middle half of its length, m: where the halves of the stack are parted for the force.
    #[must_use]
    pub fn parting_m(&self) -> [f64; 2] {
        let quarter = 0.25 * (self.x_m[1] - self.x_m[0]);
        [self.x_m[0] + quarter, self.x_m[1] - quarter]
    }
}

/// Rings of the same size side by side, or one ring; in series.
#[derive(Clone, Debug, PartialEq)]
pub struct RingCoil {
    /// Name.
    pub name: String,
    /// Each ring's cross-section.
    pub rings: Vec<Rectangle>,
    /// Turns in each ring's cross-section.
    pub turns: f64,
    /// +1 or −1: the sense of the current.
    pub sense: f64,
    /// Whether it is one of the coils in series that carry the constant current. A sensing coil is not.
    pub driven: bool,
    /// The constant current of a coil that is not in series with the others, A; its sense comes on top.
    pub own_current_a: Option<f64>,
}

/// A rectangle in the half-plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// From and to, m.
    pub r_m: [f64; 2],
    /// From and to, m.
    pub x_m: [f64; 2],
}

impl Rectangle {
    /// Area of the cross-section, m².
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        (self.r_m[1] - self.r_m[0]) * (self.x_m[1] - self.x_m[0])
    }

    /// Length of the circle through its middle, m.
    #[must_use]
    pub fn circumference_m(&self) -> f64 {
        core::f64::consts::PI * (self.r_m[0] + self.r_m[1])
    }
}

/// A circuit board with its copper: not magnetic.
#[derive(Clone, Debug, PartialEq)]
pub struct CircuitBoard {
    /// Name.
    pub name: String,
    /// Its cross-section.
    pub section: Rectangle,
}

/// A magnetic part.
#[derive(Clone, Debug, PartialEq)]
pub struct MagneticPart {
    /// Name.
    pub name: String,
    /// The name of its material.
    pub material_name: String,
    /// Its material; that of what is left and the air between, where the body is cut.
    pub material: Material,
    /// Remanence along the axis, T: of a magnet, whose `material` has the recoil permeability. B = B_r + μ₀ μ_r H.
    pub remanence_t: f64,
    /// Its outline.
    pub shape: Shape,
    /// What is cut out of it.
    pub minus: Vec<Shape>,
    /// Conductivity, S/m; 0 for an insulator.
    pub conductivity_s_per_m: f64,
    /// Loss tangent of its permeability, μ″/μ′, for alternating fields.
    pub loss_tangent: f64,
    /// Whether it is one piece, or cut so that it can give way to the side.
    pub cut: Cut,
    /// Whether it was cast around boards, windings and plates (a body), so that it leaves out
    /// what they take, or is solid (a plate), so that nothing may reach into it.
    pub cast: bool,
}

/// How a body is cut, along the axis, so that it is softer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cut {
    /// Not at all.
    Whole,
    /// Only round pillars are left of it.
    Pillars {
        /// How many.
        count: u32,
        /// Diameter of each, m.
        diameter_m: f64,
    },
    /// Radial slots divide it into sectors.
    Slots {
        /// How many.
        count: u32,
        /// Width of each, m.
        width_m: f64,
    },
}

impl Cut {
    /// Area that is left, and length of the outline around all pieces, of a ring from `r[0]` to
    /// `r[1]`, in m² and m.
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

    /// The share of a ring from `r[0]` to `r[1]` that is left.
    #[must_use]
    pub fn fill(&self, r_m: [f64; 2]) -> f64 {
        self.left_of(r_m).0 / Self::Whole.left_of(r_m).0
    }
}

impl MagneticPart {
    /// Whether a point lies in its outline and in nothing that is cut out.
    #[must_use]
    pub fn contains(&self, point: [f64; 2]) -> bool {
        self.shape.contains(point) && !self.minus.iter().any(|hole| hole.contains(point))
    }
}

impl Design {
    /// Reads a text. `file` is for messages, and files that the text names are read beside it.
    ///
    /// ```
    /// use palpate_field::design::{Design, builtin_text};
    ///
    /// let text = builtin_text("A").unwrap_or_default();
    /// assert_eq!(Design::parse("A.toml", text)?.coils.len(), 4);
    ///
    /// let text = text.replace("length_unit = \"mm\"", "");
    /// let error = Design::parse("mine.toml", &text).unwrap_err().to_string();
    /// assert!(error.contains("length_unit: missing; allowed: \"m\", \"cm\", \"mm\", \"um\", \"in\""), "{error}");
    /// # Ok::<(), palpate_field::design::DesignError>(())
    /// ```
    ///
    /// # Errors
    /// [`DesignError`] names line, key and what is allowed.
    pub fn parse(file: &str, text: &str) -> Result<Self, DesignError> {
        read::read(file, text)
    }

    /// The coils that carry the constant current.
    pub fn driven_coils(&self) -> impl Iterator<Item = &RingCoil> {
        self.coils.iter().filter(|coil| coil.driven)
    }

    /// Whether any coil carries the constant current.
    #[must_use]
    pub fn is_driven(&self) -> bool {
        self.driven_coils().next().is_some()
    }

    /// Resistance of the driven windings in series at the temperature of the resistivity, Ω: current
    /// runs in circles, evenly over each ring, ρ · 2π r̄ turns² / area for each.
    #[must_use]
    pub fn resistance_ohm(&self) -> f64 {
        let coils = self.driven_coils();
        // An empty sum is -0.
        0.0 + coils
            .map(|coil| self.coil_resistance_ohm(coil))
            .sum::<f64>()
    }

    /// Resistance of one coil, by the same rule, Ω.
    #[must_use]
    pub fn coil_resistance_ohm(&self, coil: &RingCoil) -> f64 {
        let ring = |ring: &Rectangle| ring.circumference_m() / ring.area_m2();
        let rings: f64 = coil.rings.iter().map(ring).sum();
        self.resistivity_ohm_m * coil.turns.powi(2) * rings
    }

    /// Every corner of boards, copper, bodies and plates, m.
    fn extremes(&self) -> impl Iterator<Item = [f64; 2]> {
        let rings = self.coils.iter().flat_map(|coil| &coil.rings);
        let boards = self.boards.iter().map(|board| &board.section);
        let corner = |section: &Rectangle| section.x_m.map(|x| [section.r_m[1], x]);
        let parts = self.parts.iter().flat_map(|part| part.shape.extremes());
        rings.chain(boards).flat_map(corner).chain(parts)
    }

    /// From where to where it reaches along the axis, m, the core included.
    #[must_use]
    pub fn height_m(&self) -> [f64; 2] {
        let places = self.extremes().map(|[_, x]| x).chain(self.core.x_m);
        places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        })
    }

    /// How far it reaches from the axis, m, the core included.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.extremes()
            .map(|[r, _]| r)
            .fold(self.core.r_m, f64::max)
    }

    /// Whether any of its parts is a magnet.
    #[must_use]
    pub fn has_magnets(&self) -> bool {
        self.parts.iter().any(|part| part.remanence_t != 0.0)
    }

    /// Whether a field stands without the constant current: a background's, magnets', or that of coils with
    /// currents of their own.
    #[must_use]
    pub fn has_standing_field(&self) -> bool {
        self.background_t != 0.0 || self.has_magnets() || self.has_own_currents()
    }

    /// Whether any of its materials saturates.
    #[must_use]
    pub fn saturates(&self) -> bool {
        self.parts.iter().any(|part| !part.material.is_linear())
    }
}

/// Why a design was refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DesignError {
    /// The file, as its reader named it.
    pub file: String,
    /// Line, counted from 1.
    pub line: usize,
    /// The key or part that it is about; empty where the text is no TOML.
    pub place: String,
    /// What is wrong.
    pub problem: String,
    /// What would be right; empty where the problem says it.
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
