//! What a field is driven by: one ampere, a current with saturation, or the background alone.

use palpate_field::design::Design;
use palpate_field::solve::{Excitation, Solved, solve};

use super::input::Effort;
use crate::failure::Failure;

/// What a field is driven by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Drive {
    /// One ampere, far below saturation and without the background.
    PerAmpere,
    /// A current in A, with saturation, in the background.
    Current(f64),
    /// The background without a current, with saturation.
    Background,
}

impl Drive {
    /// What drives a design: the current where one is given; else one ampere, or the background of a
    /// design without a coil.
    pub(super) fn of(design: &Design, current_a: Option<f64>) -> Result<Self, Failure> {
        match current_a {
            Some(_) if design.coils.is_empty() => Err(Failure::Argument(format!(
                "{}: the design has no coil for --current: add a [[coil]], or leave --current out",
                design.name
            ))),
            Some(current_a) => Ok(Self::Current(current_a)),
            None if !design.coils.is_empty() => Ok(Self::PerAmpere),
            None if design.background_t != 0.0 => Ok(Self::Background),
            None => Err(Failure::Argument(format!(
                "{}: nothing drives a field: add a [[coil]] or a [background]",
                design.name
            ))),
        }
    }

    /// The field.
    pub(super) fn solve(self, design: &Design, effort: &Effort) -> Result<Solved, Failure> {
        let excitation = match self {
            Self::PerAmpere => Excitation::small(design, 1.0),
            Self::Current(current_a) => Excitation::saturating(design, current_a),
            Self::Background => Excitation::saturating(design, 0.0),
        };
        solve(design, &excitation, &effort.accuracy())
            .map_err(|error| Failure::Refused(format!("{}: {error}", design.name)))
    }

    /// What stands behind `T` in the unit of a field.
    pub(super) const fn per(self) -> &'static str {
        match self {
            Self::PerAmpere => "/A",
            Self::Current(_) | Self::Background => "",
        }
    }

    /// The drive in words, for titles.
    pub(super) fn words(self, design: &Design) -> String {
        let background = format!("in a background of {} mT", 1e3 * design.background_t);
        match self {
            Self::PerAmpere => "per ampere".to_owned(),
            Self::Current(current_a) if design.background_t == 0.0 => format!("at {current_a} A"),
            Self::Current(current_a) => format!("at {current_a} A {background}"),
            Self::Background => background,
        }
    }
}
