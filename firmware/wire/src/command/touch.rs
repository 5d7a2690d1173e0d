//! Calibration of an array of sensing coils, sent in chunks.

use heapless::Vec;

use crate::schema::Described;
use crate::validation::{Invalid, inconsistent};

/// Numbers of an array's calibration before those of its coils.
pub const ARRAY_NUMBERS: usize = 48;

/// Numbers of each coil.
pub const COIL_NUMBERS: usize = 4;

/// Numbers in each chunk but the last.
pub const NUMBERS_PER_CHUNK: usize = 16;

structure! {
    /// Calibration of an array of coils under one layer, chunk by chunk; each chunk but the last has 16
    /// numbers. It takes effect with its last chunk. The numbers are those of `palpate_model::touch`, in
    /// this order:
    ///
    /// - 0: the array's channels, as a sum of 1, 2, 4, 8 of the first and 16, 32, 64, 128 of the second
    ///   converter;
    /// - 1 to 4, the indenter: 1 if it is declared, else 0; radius of the contact at 1 N, m; exponent of
    ///   the force; relative standard uncertainty of the radius;
    /// - 5 to 7, the disc within which presses are claimed: x, y and radius, m;
    /// - 8 to 12, standard uncertainties: of a reading relative to itself, and to the largest one; common
    ///   ones of place (m), ln F and ln a;
    /// - 13 to 47, the profile: spacing of its knots, least and greatest contact radius, m; greatest force, N;
    ///   nine coefficients, five linear and five quadratic ones, 1/N; four, four linear and four quadratic
    ///   ones of the square of the force, 1/N^2;
    /// - from 48 on, for each coil from the lowest channel: x and y, m; gain; noise of a reading.
    pub struct TouchArray {
        /// Number of all numbers: 48 and 4 for each coil.
        total: u8 ["1", 52, 80],
        /// Index of the first number in this chunk.
        first: u8 ["", 0, 78],
        /// The numbers of this chunk, two at least and an even number of them.
        numbers: Vec<f32, 17> ["1", -1e6, 1e6],
    }
    also of_numbers
}

fn of_numbers(array: &TouchArray) -> Result<(), Invalid> {
    let count = array.numbers.len();
    if count == 0 || count % 2 == 1 {
        return inconsistent!(TouchArray, "numbers", "numbers come in pairs");
    }
    if usize::from(array.first) + count > usize::from(array.total) {
        return inconsistent!(TouchArray, "first", "the numbers go beyond total");
    }
    Ok(())
}
