//! Source of a field: one ampere, a current with saturation, or the field without a current.

use palpate_cli::failure::Failure;
use palpate_field::design::Design;
use palpate_field::solve::{Excitation, SolveError, Solved, Wanted, solve, solve_for};

use super::input::Effort;

/// Source of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Drive {
    /// One ampere, far below saturation, without background and remanence.
    PerAmpere,
    /// This current, A, in the driven coils, with saturation, background, magnets, and coils with a
    /// current of their own.
    Current(f64),
    /// No drive current: only the background, the magnets and the coils with a fixed current of
    /// their own (`own_current_a`), with saturation.
    Background,
}

impl Drive {
    /// Chooses the drive: the given current; without one, one ampere, or the background for a
    /// design without a coil.
    pub(super) fn of(design: &Design, current_a: Option<f64>) -> Result<Self, Failure> {
        match current_a {
            Some(_) if !design.is_driven() => Err(Failure::Argument(format!(
                "{}: the design has no coil for --current: add a [[coil]], or leave --current out",
                design.name
            ))),
            Some(current_a) => Ok(Self::Current(current_a)),
            None if design.is_driven() => Ok(Self::PerAmpere),
            None if design.has_standing_field() => Ok(Self::Background),
            None => Err(Failure::Argument(format!(
                "{}: there is no source of a field: add a [[coil]], a magnet (a material with \
                 remanence_T) or a [background]",
                design.name
            ))),
        }
    }

    /// Solves the field to the requested accuracy.
    pub(super) fn solve(self, design: &Design, effort: &Effort) -> Result<Solved, Failure> {
        let solved = self.attempt(design, effort)?;
        reached(design, &solved)?;
        Ok(solved)
    }

    /// Solves the field for what is wanted, to the requested accuracy.
    pub(super) fn solve_for(
        self,
        design: &Design,
        effort: &Effort,
        wanted: Wanted<'_>,
    ) -> Result<Solved, Failure> {
        let solved = self.attempt_for(design, effort, wanted)?;
        reached(design, &solved)?;
        Ok(solved)
    }

    /// Solves the field; its accuracy is not checked.
    pub(super) fn attempt(self, design: &Design, effort: &Effort) -> Result<Solved, Failure> {
        field_of(design, &self.excitation(design), effort)
    }

    /// Solves the field for what is wanted; its accuracy is not checked.
    pub(super) fn attempt_for(
        self,
        design: &Design,
        effort: &Effort,
        wanted: Wanted<'_>,
    ) -> Result<Solved, Failure> {
        field_for(design, &self.excitation(design), effort, wanted)
    }

    fn excitation(self, design: &Design) -> Excitation {
        match self {
            Self::PerAmpere => Excitation::small(design, 1.0),
            Self::Current(current_a) => Excitation::saturating(design, current_a),
            Self::Background => Excitation::saturating(design, 0.0),
        }
    }

    /// Suffix of `T` in the unit of a field.
    pub(super) const fn per(self) -> &'static str {
        match self {
            Self::PerAmpere => "/A",
            Self::Current(_) | Self::Background => "",
        }
    }

    /// The drive in words, for titles.
    pub(super) fn words(self, design: &Design) -> String {
        let field_t = design.background_t;
        let background = format!("in a background of {} mT", 1e3 * field_t);
        let standing = [
            (field_t != 0.0).then_some(background.as_str()),
            design.has_magnets().then_some("with the magnets"),
            (design.has_own_currents()).then_some("with the coils' own currents"),
        ];
        let standing: Vec<&str> = standing.into_iter().flatten().collect();
        let standing = standing.join(" and ");
        match self {
            Self::PerAmpere => "per ampere".to_owned(),
            Self::Current(current_a) if standing.is_empty() => format!("at {current_a} A"),
            Self::Current(current_a) => format!("at {current_a} A {standing}"),
            Self::Background => standing,
        }
    }
}

/// Solves the field of any excitation; its accuracy is not checked.
pub(super) fn field_of(
    design: &Design,
    excitation: &Excitation,
    effort: &Effort,
) -> Result<Solved, Failure> {
    solve(design, excitation, &effort.accuracy()).map_err(|error| refused(design, &error))
}

/// Solves the field of any excitation for what is wanted; its accuracy is not checked. In a
/// background or with magnets all figures come from the field that is accurate on the axis too: the
/// test `drawn` has no such designs.
pub(super) fn field_for(
    design: &Design,
    excitation: &Excitation,
    effort: &Effort,
    wanted: Wanted<'_>,
) -> Result<Solved, Failure> {
    match wanted {
        Wanted::Figures if design.has_standing_field() => field_of(design, excitation, effort),
        _ => solve_for(design, excitation, &effort.accuracy(), wanted)
            .map_err(|error| refused(design, &error)),
    }
}

fn refused(design: &Design, error: &SolveError) -> Failure {
    Failure::Refused(format!("{}: {error}", design.name))
}

/// Fails if the accuracy of a field was not reached.
pub(super) fn reached(design: &Design, solved: &Solved) -> Result<(), Failure> {
    if solved.report.reached {
        return Ok(());
    }
    Err(Failure::Refused(format!(
        "{}: the accuracy is not reached everywhere with {} unknowns, the relative error of centre and core mean is {:.1e}: ask for less by --accuracy, or leave out the smallest details",
        design.name,
        solved.report.unknowns,
        solved.relative_error()
    )))
}

#[cfg(test)]
mod tests {
    use palpate_field::design::builtin;
    use palpate_field::solve::Accuracy;

    use super::*;

    /// The words name every source besides the current.
    #[test]
    fn a_drive_is_named_in_words() {
        let mut design = builtin("A").unwrap();
        assert_eq!(Drive::Current(2.0).words(&design), "at 2 A");
        design.background_t = 0.01;
        assert_eq!(
            Drive::Current(2.0).words(&design),
            "at 2 A in a background of 10 mT"
        );
        design.parts[0].remanence_t = 0.1;
        assert_eq!(
            Drive::Background.words(&design),
            "in a background of 10 mT and with the magnets"
        );
        design.coils.clear();
        assert!(matches!(Drive::of(&design, None), Ok(Drive::Background)));
        design.background_t = 0.0;
        design.parts[0].remanence_t = 0.0;
        assert!(Drive::of(&design, None).is_err());
    }

    #[test]
    fn an_accuracy_that_is_not_reached_ends_the_command() {
        let design = builtin("A").unwrap();
        let solved = |most_unknowns: usize| {
            let accuracy = Accuracy {
                relative: 1e-3,
                most_unknowns,
                ..Accuracy::default()
            };
            solve(&design, &Excitation::small(&design, 1.0), &accuracy).unwrap()
        };
        assert!(reached(&design, &solved(100_000)).is_ok());
        let refused = reached(&design, &solved(3_000)).unwrap_err();
        assert!(refused.to_string().contains("not reached"), "{refused}");
    }
}
