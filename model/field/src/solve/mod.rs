//! The finite-element solution.
//!
//! The unknown is w = A_φ/r, so that B_r = −r ∂w/∂x and B_x = 2w + r ∂w/∂r. These are polynomials
//! if w is one, without the 1/r that A_φ itself would bring, and the field on the axis is 2w, a
//! value and not a derivative.
//!
//! Outside of the circle of radius R the field is harmonic, and w is an axisymmetric harmonic
//! function of five dimensions: Kelvin's transform w″ = (R/ρ′)³ w, mapped to ρ′ = R²/ρ, is harmonic
//! too. The energy outside becomes ∫ |∇w″|² r³ over the half-disc plus (1/R) ∮ w² r³ on the arc. No
//! space is cut off, and a dipole's far field is mapped to a constant.

mod ac;
mod accuracy;
mod adapt;
mod assembly;
mod beyond;
mod cholesky;
mod evaluate;
mod excitation;
mod finer;
mod fixed;
mod for_figures;
mod indicator;
mod judge;
mod newton;
mod part_force;
mod pieces;
mod reference;
mod scalar;
mod sharpen;
mod small_signal;
mod space;
mod sums;
mod wanted;
mod working_point;

pub use ac::{AcCoil, AcSolved, solve_ac};
pub use accuracy::Accuracy;
pub use adapt::{SolveReport, Solved, solve};
pub use assembly::Level;
pub use beyond::BeyondTable;
pub use evaluate::{FieldAt, Locator};
pub use excitation::Excitation;
pub use for_figures::solve_for;
pub use newton::SolveError;
pub use pieces::Piece;
pub use space::Space;
pub use wanted::{Figure, Wanted};
pub use working_point::WorkingPoint;
