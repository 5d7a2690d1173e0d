//! Coils, profile and what is known of their errors.

use core::fmt;

use super::profile::Profile;
use super::region::{Bounds, Region};
use crate::units::{Metre, OutOfRange, Requirement};

/// Most coils of an array: two converters of four channels.
pub const MOST_COILS: usize = 8;

/// A coil of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coil {
    /// Position of the axis.
    pub x: Metre,
    /// Position of the axis.
    pub y: Metre,
    /// Gain g.
    pub gain: f32,
    /// Standard deviation of a reading, as relative change of inductance.
    pub noise: f32,
}

/// Standard uncertainty of a predicted reading, independent from coil to coil: from the
/// calibration, by its residuals and the covariance of its coefficients.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadingError {
    /// Part relative to the coil's own reading.
    pub relative: f32,
    /// Part relative to the largest reading of the scan.
    pub of_largest: f32,
}

/// Standard uncertainty that is common to all coils, and so adds to the result.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CommonError {
    /// Uncertainty of x and of y.
    pub place: Metre,
    /// Uncertainty of ln F, from the scale of the force.
    pub ln_force: f32,
    /// Uncertainty of ln a, from the scale of the radius.
    pub ln_radius: f32,
}

/// An array of coils with its calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Array {
    coils: [Coil; MOST_COILS],
    count: usize,
    pub(super) profile: Profile,
    pub(super) reading_error: ReadingError,
    pub(super) common_error: CommonError,
    pub(super) bounds: Bounds,
}

/// Reason why coils and calibration are not an array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ArrayError {
    /// Not one to [`MOST_COILS`] coils.
    Coils {
        /// Number of coils given.
        given: usize,
    },
    /// A number of the coil at `index` is out of range.
    Coil {
        /// Index of the coil.
        index: usize,
        /// The number.
        cause: OutOfRange,
    },
    /// An uncertainty, or a length of the region, is out of range.
    Number(OutOfRange),
}

impl fmt::Display for ArrayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Coils { given } => write!(f, "{given} coils: 1 to {MOST_COILS} are possible"),
            Self::Coil { index, cause } => write!(f, "coil {index}: {cause}"),
            Self::Number(cause) => write!(f, "calibration of the array: {cause}"),
        }
    }
}

impl core::error::Error for ArrayError {}

impl Array {
    /// Creates an array. Gains and noises have to be above zero, uncertainties at least zero.
    pub fn new(
        coils: &[Coil],
        profile: Profile,
        (reading_error, common_error): (ReadingError, CommonError),
        region: Region,
    ) -> Result<Self, ArrayError> {
        let none = Coil {
            x: Metre(0.0),
            y: Metre(0.0),
            gain: 1.0,
            noise: 1.0,
        };
        let mut all = [none; MOST_COILS];
        let count = coils.len();
        if count == 0 || count > all.len() {
            return Err(ArrayError::Coils { given: count });
        }
        for (index, (to, coil)) in all.iter_mut().zip(coils).enumerate() {
            check(coil).map_err(|cause| ArrayError::Coil { index, cause })?;
            *to = *coil;
        }
        let lengths = match region {
            Region::Disc {
                centre: [x, y],
                radius,
            } => [x.0.abs(), y.0.abs(), radius.0],
            Region::Hull { margin } => [margin.0.abs(), 0.0, 0.0],
        };
        let errors = [
            reading_error.relative,
            reading_error.of_largest,
            common_error.place.0,
            common_error.ln_force,
            common_error.ln_radius,
        ];
        for value in errors.into_iter().chain(lengths) {
            OutOfRange::check(value, Requirement::NonNegative).map_err(ArrayError::Number)?;
        }
        Ok(Self {
            coils: all,
            count,
            profile,
            reading_error,
            common_error,
            bounds: Bounds::new(region, coils),
        })
    }

    /// The coils.
    // Inlined, so that a caller in memory does not call into flash (firmware/build.rs).
    #[inline(always)]
    pub fn coils(&self) -> &[Coil] {
        self.coils.get(..self.count).unwrap_or(&self.coils)
    }

    /// What is known of the errors: those of a reading, and the common ones.
    #[inline(always)]
    pub const fn errors(&self) -> (ReadingError, CommonError) {
        (self.reading_error, self.common_error)
    }

    /// Where presses are claimed.
    #[inline(always)]
    pub const fn region(&self) -> Region {
        self.bounds.region()
    }

    /// The profile of all coils.
    #[inline(always)]
    pub const fn profile(&self) -> &Profile {
        &self.profile
    }
}

fn check(coil: &Coil) -> Result<(), OutOfRange> {
    Metre::non_negative(coil.x.0.abs())?;
    Metre::non_negative(coil.y.0.abs())?;
    OutOfRange::check(coil.gain, Requirement::Positive)?;
    OutOfRange::check(coil.noise, Requirement::Positive)?;
    Ok(())
}
