//! Correction of the current measurement, from a calibration against a reference.

use crate::fault::Refusal;
use crate::hardware::Hardware;

/// Distance of two knots of the correction in units, as a power of two: 2⁹ units are 256 counts of
/// the converter.
const PIECE: u32 = 9;
const KNOTS: usize = 17;
/// Measured current of the first knot, in units.
const FIRST: i32 = -(1 << PIECE) * (KNOTS as i32 / 2);
/// Greatest correction: the sum of this fraction of the measured current and of `GREATEST_UNITS`.
const GREATEST_PART: f32 = 0.1;
const GREATEST_UNITS: f32 = 128.0;

/// Corrections of the measured current at 17 points of the converter's range, linear between them:
/// removes gain errors and the converter's nonlinearity.
///
/// If the nonlinearity is one sine wave over the range, 2 % of its amplitude remain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Correction([i16; KNOTS]);

impl Default for Correction {
    fn default() -> Self {
        Self::NONE
    }
}

impl Correction {
    /// No correction.
    pub const NONE: Self = Self([0; KNOTS]);

    /// Creates a correction from pairs of measured and true current, A, in rising order. The
    /// correction is linear between the pairs; beyond the outermost pair it is proportional to the
    /// current.
    ///
    /// # Errors
    /// [`Refusal::Correction`]: fewer than two pairs, pairs that do not rise, values that are not
    /// finite, or a correction above the sum of a tenth of the current and 64 counts.
    pub fn new(pairs: &[[f32; 2]], hardware: &Hardware) -> Result<Self, Refusal> {
        let rises = pairs.windows(2).all(|of| match of {
            [[low, _], [high, _]] => high > low,
            _ => false,
        });
        let (Some(first), Some(last)) = (pairs.first(), pairs.last()) else {
            return Err(Refusal::Correction);
        };
        if pairs.len() < 2 || !rises {
            return Err(Refusal::Correction);
        }
        let unit_a = hardware.ampere_per_unit();
        let mut knots = [0; KNOTS];
        for (index, knot) in (0_i32..).zip(&mut knots) {
            let reported_a = (FIRST + (index << PIECE)) as f32 * unit_a;
            let change_a = if reported_a <= first[0] || reported_a >= last[0] {
                let [measured, of] = if reported_a <= first[0] {
                    *first
                } else {
                    *last
                };
                // Proportional to the current, if the currents of knot and outermost pair have the same
                // sign and the pair's current is not too close to zero.
                if (reported_a > 0.0) == (measured > 0.0) && measured.abs() > 64.0 * unit_a {
                    (of - measured) * reported_a / measured
                } else {
                    of - measured
                }
            } else {
                between(pairs, reported_a).ok_or(Refusal::Correction)?
            };
            let units = change_a / unit_a;
            let most = GREATEST_PART * (reported_a / unit_a).abs() + GREATEST_UNITS;
            if units.is_nan() || units.abs() > most {
                return Err(Refusal::Correction);
            }
            // The greatest correction is below 600 units, which fits in 16 bits.
            *knot = units as i16;
        }
        Ok(Self(knots))
    }

    /// The corrected current, A.
    #[must_use]
    pub fn corrected_a(&self, measured_a: f32, hardware: &Hardware) -> f32 {
        self.apply(hardware.units(measured_a)) as f32 * hardware.ampere_per_unit()
    }

    /// The corrected current, in units.
    #[inline]
    pub(crate) fn apply(&self, measured: i32) -> i32 {
        // Both bounds are constants, so this clamp cannot panic.
        let from = (measured - FIRST).clamp(0, ((KNOTS as i32 - 1) << PIECE) - 1);
        let index = (from >> PIECE) as usize;
        let (Some(&low), Some(&high)) = (self.0.get(index), self.0.get(index + 1)) else {
            return measured;
        };
        let part = from & ((1 << PIECE) - 1);
        let (low, high) = (i32::from(low), i32::from(high));
        measured + low + (((high - low) * part) >> PIECE)
    }
}

/// The correction at a measured current, interpolated between the two pairs that enclose it.
fn between(pairs: &[[f32; 2]], reported_a: f32) -> Option<f32> {
    pairs.windows(2).find_map(|of| match of {
        [[low, low_of], [high, high_of]] if reported_a >= *low && reported_a <= *high => {
            let part = (reported_a - low) / (high - low);
            Some((low_of - low) * (1.0 - part) + (high_of - high) * part)
        }
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hardware::EXAMPLE as HARDWARE;

    #[test]
    fn a_gain_is_taken_away_everywhere() {
        let pairs = [-10.0, -3.0, 2.0, 10.0].map(|of: f32| [of * 1.02, of]);
        let correction = Correction::new(&pairs, &HARDWARE).unwrap();
        for true_a in [-11.0_f32, -6.3, 0.0, 0.7, 5.0, 11.9] {
            let measured = (true_a * 1.02 / 0.003) as i32;
            let error = correction.apply(measured) as f32 * 0.003 - true_a;
            assert!(error.abs() < 0.012, "{true_a}: {error}");
        }
    }

    #[test]
    fn none_changes_nothing_and_nonsense_is_refused() {
        for units in [-9_000, -4_096, -1, 0, 4_095, 4_096, 9_000] {
            assert_eq!(Correction::NONE.apply(units), units);
        }
        let refused = |pairs: &[[f32; 2]]| Correction::new(pairs, &HARDWARE).is_err();
        assert!(refused(&[]));
        assert!(refused(&[[1.0, 1.0]]));
        assert!(refused(&[[2.0, 2.0], [1.0, 1.0]]));
        assert!(refused(&[[1.0, f32::NAN], [2.0, 2.0]]));
        assert!(refused(&[[1.0, 1.0], [8.0, 12.0]]));
    }
}
