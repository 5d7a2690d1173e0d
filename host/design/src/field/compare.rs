//! `palpate field compare`: designs side by side.

use std::io::{self, Write};

use clap::Args;
use comfy_table::{CellAlignment, Table, presets};
use palpate_cli::failure::Failure;
use palpate_cli::notice::say;
use palpate_field::design::Design;
use rayon::prelude::*;
use serde::Serialize;

use super::drive::Drive;
use super::input::{Effort, current, parse, say_files, text_of};
use super::quantities::{Asked, KeyedFigures, QUANTITIES, Quantity};
use super::solve::SolvedFigures;

/// Compare designs
#[derive(Args)]
#[command(after_help = "\
error is the estimated relative error of centre and core mean; --json has that of every figure.

Example:
  palpate field compare A C1in closed")]
pub(super) struct Arguments {
    /// Files, or names of built-in designs
    #[arg(required = true)]
    designs: Vec<String>,
    #[command(flatten)]
    effort: Effort,
    /// Compare at this current, with saturation, A
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// Print JSON; with the derivatives by the current at a current
    #[arg(long)]
    json: bool,
}

/// One of the designs with its figures.
#[derive(Serialize)]
struct ComparedDesign {
    design: String,
    resistance_ohm: f64,
    #[serde(flatten)]
    solved: SolvedFigures,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let load = |name: &String| -> Result<Design, Failure> {
        let (file, text) = text_of(name)?;
        let design = parse(&file, &text, &arguments.effort.settings)?;
        say_files(&design);
        Ok(design)
    };
    let designs: Vec<Design> = arguments
        .designs
        .iter()
        .map(load)
        .collect::<Result<_, _>>()?;
    let drive = |design: &Design| match Drive::of(design, arguments.current)? {
        Drive::Background => Err(Failure::Argument(format!(
            "{}: the design has no coil, and designs are compared per ampere: add a [[coil]]",
            design.name
        ))),
        drive => Ok(drive),
    };
    let solve = |design: &Design| {
        let solved =
            SolvedFigures::solve(design, drive(design)?, &arguments.effort, &Asked::default())?;
        Ok(ComparedDesign {
            design: design.name.clone(),
            resistance_ohm: design.resistance_ohm(),
            solved,
        })
    };
    let outcomes: Vec<ComparedDesign> = designs
        .par_iter()
        .map(solve)
        .collect::<Result<_, Failure>>()?;
    let mut out = io::stdout().lock();
    if arguments.json {
        serde_json::to_writer_pretty(&mut out, &outcomes)?;
        writeln!(out)?;
    } else {
        writeln!(out, "{}", table(&outcomes))?;
        for outcome in &outcomes {
            for beyond in &outcome.solved.beyond_tables {
                say(format!("{}: {beyond}", outcome.design));
            }
        }
    }
    Ok(())
}

/// Table of the figures in display units. Column heads are short names with the unit below, since
/// the keys are too long.
fn table(outcomes: &[ComparedDesign]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    let drive = outcomes
        .first()
        .map_or(Drive::PerAmpere, |outcome| outcome.solved.keyed.drive);
    let heads = QUANTITIES.iter().map(|quantity| {
        let ([_, head], (unit, _)) = (quantity.called(drive), quantity.shown(drive));
        format!("{head}\n{unit}")
    });
    let first = ["design".to_owned()].into_iter();
    table.set_header(first.chain(heads).chain(["error".to_owned()]));
    for outcome in outcomes {
        let KeyedFigures { drive, figures, .. } = &outcome.solved.keyed;
        let cell = |quantity: &Quantity| {
            let value = quantity.shown(*drive).1 * (quantity.value)(figures);
            if value == 0.0 {
                return String::new();
            }
            let digits = if value.abs() < 1.0 {
                4
            } else if value.abs() < 10.0 {
                3
            } else {
                2
            };
            format!("{value:.digits$}")
        };
        let first = [outcome.design.clone()].into_iter();
        let error = outcome.solved.error_estimate;
        let error = error.map_or(String::new(), |error| format!("{error:.0e}"));
        table.add_row(first.chain(QUANTITIES.iter().map(cell)).chain([error]));
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
