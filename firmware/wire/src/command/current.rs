//! Calibration of the current measurement.

use heapless::Vec;

use crate::schema::Described;
use crate::validation::{Invalid, inconsistent};

/// Maximum number of points of a correction.
pub const MAX_POINTS: usize = 17;

/// Largest correction as a fraction of the current; [`GREATEST_A`] is added to it. Both are larger than
/// the errors that the parts of a working measurement cause.
const GREATEST_PART: f32 = 0.1;
/// Part of the largest correction that does not depend on the current, A.
const GREATEST_A: f32 = 0.4;

structure! {
    /// Correction of the measured current at evenly spaced points, linear between them and proportional
    /// beyond the outermost. All zero for no correction.
    ///
    /// The limit at which the bridge is switched off is not corrected.
    pub struct CurrentCorrection {
        /// Measured current of the last point; the first one has its negative.
        greatest_a: f32 ["A", 0.1, 20],
        /// Correction at each of 2 to 17 points: at most 0.4 A plus a tenth of the current at that
        /// point.
        changes_a: Vec<f32, 17> ["A", -2.4, 2.4],
    }
    also of_points
}

impl CurrentCorrection {
    /// Returns measured current and its change at each point, in rising order.
    pub fn points(&self) -> impl Iterator<Item = (f32, f32)> + '_ {
        let last = self.changes_a.len().saturating_sub(1).max(1) as f32;
        let points = self.changes_a.iter().enumerate();
        points.map(move |(index, change_a)| {
            let current_a = self.greatest_a * (2.0 * index as f32 / last - 1.0);
            (current_a, *change_a)
        })
    }
}

fn of_points(correction: &CurrentCorrection) -> Result<(), Invalid> {
    if correction.changes_a.len() < 2 {
        return inconsistent!(
            CurrentCorrection,
            "changes_a",
            "there are two points at least"
        );
    }
    let too_much = |(current_a, change_a): (f32, f32)| {
        change_a.abs() > GREATEST_PART * current_a.abs() + GREATEST_A
    };
    if correction.points().any(too_much) {
        return inconsistent!(
            CurrentCorrection,
            "changes_a",
            "a change is above 0.4 A and a tenth of its current"
        );
    }
    Ok(())
}
