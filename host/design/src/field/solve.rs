//! `palpate field solve`: the figures of one design.

use std::io::{self, Write};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::notice::printable;
use palpate_field::design::Design;
use palpate_field::figures::Figures;
use palpate_field::solve::{Figure, SolveReport, Solved};
use serde::Serialize;

use super::drive::{Drive, reached};
use super::forces::{self, PartForce};
use super::inductances::InductanceMatrix;
use super::input::{DesignSource, Effort, current};
use super::magnets::{self, Magnet};
use super::quantities::{Asked, KeyedDerivatives, KeyedFigures};
use super::tables::BeyondTable;

/// Solve a design: field, homogeneity, inductance, force, resistance
#[derive(Args)]
#[command(after_help = "\
Homogeneity is std/mean of |B| by volume within the core's radius (r8), three quarters (r6) and \
half of it (r4): 8, 6 and 4 mm for the built-in designs with a core of 8 mm. \
Figures per ampere are those of a small current without the background and without the remanence of \
magnets. --current adds those with saturation, in the background and with the magnets, each with its \
derivative by the current, for which there is no estimate of the error; that of the flux linkage is \
the differential inductance. A design without a coil is solved in its background, with its magnets.

--force is Maxwell's stress about a part by virtual work; a part that touches magnetic material has none of its \
own. On a coil Lorentz's force stands beside it. There is no estimate of either's error.

Of each magnet B and H along its magnetisation are printed: where the least B is below the knee of the \
maker's curve, demagnetisation begins. Places within 0.1 mm of corners are left out of the least.

Examples:
  palpate field solve pot --current 10
  palpate field solve backplates --current 10 --force 'upper outer'")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    #[command(flatten)]
    asked: Asked,
    /// Solve with saturation at this current too, A
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// The inductance of each coil and of each pair too
    #[arg(long)]
    matrix: bool,
    /// The force along the axis on this coil, body or plate too; may be given more than once
    #[arg(long, value_name = "NAME")]
    force: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The figures of a design under one drive, in SI units.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
pub(super) struct SolvedFigures {
    #[serde(flatten)]
    pub(super) keyed: KeyedFigures,
    /// The greater of the relative errors of centre and core mean; `None` unless both are asked
    /// for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) error_estimate: Option<f64>,
    pub(super) unknowns: usize,
    newton_iterations: usize,
    linear_solves_on_all_meshes: usize,
    /// Estimated absolute error of each figure, in its unit.
    pub(super) errors: KeyedFigures,
    /// Derivative of each figure by the current, without an error estimate; `None` unless solved at
    /// a current.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) derivatives: Option<KeyedDerivatives>,
    /// Parts where the field exceeds the table of the material.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) beyond_tables: Vec<BeyondTable>,
}

/// Computes the derivatives of all figures by the current.
fn by_current(design: &Design, solved: &Solved) -> Result<Figures, Failure> {
    let derivatives = solved.by_current(design);
    derivatives.map_err(|error| Failure::Refused(format!("{}: {error}", design.name)))
}

impl SolvedFigures {
    pub(super) fn solve(
        design: &Design,
        drive: Drive,
        effort: &Effort,
        asked: &Asked,
    ) -> Result<Self, Failure> {
        let solved = drive.solve_for(design, effort, asked.wanted())?;
        Self::of(design, &solved, drive, asked)
    }

    /// Computes the figures of a solved field.
    pub(super) fn of(
        design: &Design,
        solved: &Solved,
        drive: Drive,
        asked: &Asked,
    ) -> Result<Self, Failure> {
        let derivatives = match drive {
            Drive::Current(_) => Some(KeyedDerivatives {
                asked: asked.clone(),
                figures: by_current(design, solved)?,
            }),
            Drive::PerAmpere | Drive::Background => None,
        };
        let keyed = |figures: Figures| KeyedFigures {
            asked: asked.clone(),
            drive,
            figures,
        };
        let both = asked.has(Figure::Centre) && asked.has(Figure::CoreMean);
        let SolveReport {
            unknowns,
            newton_iterations,
            linear_solves,
            ..
        } = solved.report;
        Ok(Self {
            keyed: keyed(solved.figures),
            error_estimate: both.then(|| solved.relative_error()),
            unknowns,
            newton_iterations,
            linear_solves_on_all_meshes: linear_solves,
            errors: keyed(solved.errors),
            derivatives,
            beyond_tables: BeyondTable::all(design, solved),
        })
    }

    /// Prints one line for each figure, with its estimated error.
    fn explain(&self) -> String {
        let KeyedFigures {
            asked,
            drive,
            figures,
        } = &self.keyed;
        let mut text = String::new();
        for quantity in asked.quantities() {
            let (unit, scale) = quantity.shown(*drive);
            let [value, error] =
                [figures, &self.errors.figures].map(|of| scale * (quantity.value)(of));
            // A design without plates has no plate field.
            if value == 0.0 && error == 0.0 {
                continue;
            }
            let [label, _] = quantity.called(*drive);
            let digits = 3 + usize::from(value.abs() < 1.0);
            let slope = self
                .derivatives
                .as_ref()
                .map(|slopes| scale * (quantity.value)(&slopes.figures));
            let slope = slope.map_or(String::new(), |slope| format!("  {slope:.4} {unit}/A"));
            text.push_str(&format!(
                "  {label:<27} {value:>12.digits$} {unit:<7} (+- {error:.1e}){slope}\n"
            ));
        }
        let error = self.error_estimate;
        let error = error.map_or(String::new(), |error| {
            format!("relative error of centre and mean {error:.1e}, with ")
        });
        text.push_str(&format!(
            "  {error}{} unknowns; linear solves on the last mesh: {}\n",
            self.unknowns, self.newton_iterations
        ));
        for beyond in &self.beyond_tables {
            text.push_str(&format!("  {beyond}\n"));
        }
        text
    }
}

/// Output for a design.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct DesignFigures {
    design: String,
    /// Files that the design names, as read.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    files: Vec<String>,
    background_T: f64,
    resistance_ohm: f64,
    #[serde(flatten)]
    first: SolvedFigures,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    forces: Vec<PartForce>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    magnets: Vec<Magnet>,
    #[serde(skip_serializing_if = "Option::is_none")]
    inductances: Option<InductanceMatrix>,
    #[serde(skip_serializing_if = "Option::is_none")]
    at_current: Option<CurrentFigures>,
}

/// Figures at a current.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct CurrentFigures {
    current_A: f64,
    power_W: f64,
    #[serde(flatten)]
    solved: SolvedFigures,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    forces: Vec<PartForce>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    magnets: Vec<Magnet>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let design = arguments.source.load_silently()?;
    let (effort, asked) = (&arguments.source.effort, &arguments.asked);
    let first_drive = Drive::of(&design, None)?;
    let forced = forces::named(&design, &arguments.force)?;
    // The force on a part has no estimate, so it takes the field that is accurate everywhere.
    let attempt = |drive: Drive| match forced.is_empty() {
        true => drive.attempt_for(&design, effort, asked.wanted()),
        false => drive.attempt(&design, effort),
    };
    let current = arguments.current.map(|current_a| {
        let drive = Drive::of(&design, Some(current_a))?;
        let solved = attempt(drive)?;
        Ok::<_, Failure>((current_a, drive, solved))
    });
    let current = current.transpose()?;
    let first = attempt(first_drive)?;
    let outcome = DesignFigures {
        design: design.name.clone(),
        files: design.files.iter().map(ToString::to_string).collect(),
        background_T: design.background_t,
        resistance_ohm: design.resistance_ohm(),
        first: SolvedFigures::of(&design, &first, first_drive, asked)?,
        forces: PartForce::all(&forced, &first),
        magnets: Magnet::all(&design, &first),
        inductances: match arguments.matrix {
            false => None,
            true => Some(InductanceMatrix::of(&design, effort)?),
        },
        at_current: match &current {
            None => None,
            Some((current_a, drive, solved)) => Some(CurrentFigures {
                current_A: *current_a,
                power_W: current_a * current_a * design.resistance_ohm(),
                solved: SolvedFigures::of(&design, solved, *drive, asked)?,
                forces: PartForce::all(&forced, solved),
                magnets: Magnet::all(&design, solved),
            }),
        },
    };
    let mut out = io::stdout().lock();
    if arguments.json {
        serde_json::to_writer_pretty(&mut out, &outcome)?;
        writeln!(out)?;
    } else {
        write!(out, "{}", outcome.explain(&design))?;
    }
    // Results are printed in any case, with their errors.
    let fields = [Some(&first), current.as_ref().map(|(_, _, solved)| solved)];
    fields
        .into_iter()
        .flatten()
        .try_for_each(|solved| reached(&design, solved))
}

impl DesignFigures {
    fn explain(&self, design: &Design) -> String {
        let title = match self.first.keyed.drive {
            Drive::PerAmpere => "per ampere at small currents".to_owned(),
            drive => drive.words(design),
        };
        let mut text = format!("{}, {title}\n{}", self.design, self.first.explain());
        for file in &self.files {
            text.push_str(&format!("  read of {}\n", printable(file)));
        }
        if design.is_driven() {
            text.push_str(&format!("  resistance {:.4} ohm\n", self.resistance_ohm));
        }
        text.push_str(&forces::explain(&self.forces, self.first.keyed.drive));
        text.push_str(&magnets::explain(&self.magnets));
        if let Some(matrix) = &self.inductances {
            text.push_str(&matrix.explain());
        }
        if let Some(at) = &self.at_current {
            let (words, power) = (at.solved.keyed.drive.words(design), at.power_W);
            text.push_str(&format!(
                "{words} ({power:.1} W), with saturation; derivatives by the current\n"
            ));
            text.push_str(&at.solved.explain());
            text.push_str(&forces::explain(&at.forces, at.solved.keyed.drive));
            text.push_str(&magnets::explain(&at.magnets));
        }
        text
    }
}
