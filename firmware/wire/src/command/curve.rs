//! Calibration curves, sent in chunks.
//!
//! A curve is a list of knots with rising arguments. The chunks are sent in order, the first one with
//! `first` 0. The device applies the curve when it has received the last knot, and uses the old one
//! until then.

use heapless::Vec;

use crate::schema::Described;
use crate::validation::{Invalid, Problem, inconsistent};

/// Maximum number of knots in a chunk.
pub const KNOTS_PER_CHUNK: usize = 8;

/// Maximum number of knots in a curve.
pub const MAX_KNOTS: u8 = 32;

structure! {
    /// Deformation of a channel as a function of the relative change of its inductance.
    pub struct DeformationCurve {
        /// Converter: 0 first, 1 second.
        sensor: u8 ["", 0, 1],
        /// Channel.
        channel: u8 ["", 0, 3],
        /// Number of knots of the whole curve.
        total: u8 ["1", 2, 32],
        /// Index in the curve of the first knot in this chunk.
        first: u8 ["", 0, 31],
        /// The knots of this chunk, at least one.
        knots: Vec<DeformationKnot, 8>,
    }
    also of_deformation
}

structure! {
    /// A knot of a deformation curve.
    pub struct DeformationKnot {
        /// Argument: L/L0 - 1, where L0 is the inductance of the untouched sensor.
        inductance_change: f32 ["1", -1, 10],
        /// Deformation.
        deformation_m: f32 ["m", -0.01, 0.1],
    }
}

structure! {
    /// Relative rise of the actuated spring as a function of the coil's current. The first knot is 0, 0.
    pub struct StiffeningCurve {
        /// Number of knots of the whole curve.
        total: u8 ["1", 2, 32],
        /// Index in the curve of the first knot in this chunk.
        first: u8 ["", 0, 31],
        /// Relative standard uncertainty of the rise.
        rise_uncertainty: f32 ["1", 0, 1],
        /// The knots of this chunk, at least one.
        knots: Vec<StiffeningKnot, 8>,
    }
    also of_stiffening
}

structure! {
    /// A knot of the stiffening curve.
    pub struct StiffeningKnot {
        /// Argument: magnitude of the current.
        current_a: f32 ["A", 0, 20],
        /// c_D/c_D0 - 1.
        rise: f32 ["1", 0, 100],
    }
}

fn of_deformation(curve: &DeformationCurve) -> Result<(), Invalid> {
    if curve.knots.is_empty() {
        return inconsistent!(DeformationCurve, "knots", "a chunk has at least one knot");
    }
    if exceeds(curve.total, curve.first, curve.knots.len()) {
        return inconsistent!(DeformationCurve, "first", "the knots go beyond total");
    }
    rising(curve.knots.iter().map(|knot| knot.inductance_change))
}

fn of_stiffening(curve: &StiffeningCurve) -> Result<(), Invalid> {
    let Some(start) = curve.knots.first() else {
        return inconsistent!(StiffeningCurve, "knots", "a chunk has at least one knot");
    };
    if exceeds(curve.total, curve.first, curve.knots.len()) {
        return inconsistent!(StiffeningCurve, "first", "the knots go beyond total");
    }
    if curve.first == 0 && (start.current_a != 0.0 || start.rise != 0.0) {
        return inconsistent!(StiffeningCurve, "knots", "the curve has to begin at 0, 0");
    }
    rising(curve.knots.iter().map(|knot| knot.current_a))
}

fn exceeds(total: u8, first: u8, knots: usize) -> bool {
    usize::from(first) + knots > usize::from(total)
}

/// Refuses arguments that do not rise; an argument is the first field of a knot.
fn rising(arguments: impl Iterator<Item = f32>) -> Result<(), Invalid> {
    let mut previous = f32::NEG_INFINITY;
    for (item, value) in arguments.enumerate() {
        if value <= previous {
            let problem = Problem::NotIncreasing { value, previous };
            return Err(Invalid {
                item: u8::try_from(item).ok(),
                ..Invalid::new(0, problem)
            });
        }
        previous = value;
    }
    Ok(())
}
