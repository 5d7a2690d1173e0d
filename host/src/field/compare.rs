//! `palpate field compare`: designs side by side.

use std::io::{self, Write};

use clap::Args;
use comfy_table::{CellAlignment, Table, presets};
use palpate_field::design::Design;
use rayon::prelude::*;

use super::input::{Effort, parse, per_ampere, text_of};
use super::solve::SolvedFigures;
use crate::failure::Failure;

/// Compare designs
#[derive(Args)]
pub(super) struct Arguments {
    /// Files, or names of built-in designs
    #[arg(required = true)]
    designs: Vec<String>,
    #[command(flatten)]
    effort: Effort,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let load = |name: &String| -> Result<Design, Failure> {
        let (file, text) = text_of(name)?;
        parse(&file, &text, &arguments.effort.settings)
    };
    let designs: Vec<Design> = arguments
        .designs
        .iter()
        .map(load)
        .collect::<Result<_, _>>()?;
    let solve = |design: &Design| {
        Ok(SolvedFigures::of(
            design,
            &per_ampere(design, &arguments.effort)?,
        ))
    };
    let outcomes: Vec<SolvedFigures> = designs
        .par_iter()
        .map(solve)
        .collect::<Result<_, Failure>>()?;
    let mut out = io::stdout().lock();
    if arguments.json {
        serde_json::to_writer_pretty(&mut out, &outcomes)?;
        writeln!(out)?;
    } else {
        writeln!(out, "{}", table(&outcomes))?;
    }
    Ok(())
}

fn table(outcomes: &[SolvedFigures]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header([
        "design",
        "centre\nuT/A",
        "core mean\nuT/A",
        "cv r8\n%",
        "cv r6\n%",
        "cv r4\n%",
        "axial pp\n%",
        "radial pp\n%",
        "L\nuH",
        "force\nmN/A^2",
        "error",
    ]);
    for o in outcomes {
        table.add_row([
            o.design.clone(),
            format!("{:.2}", 1e6 * o.centre_T_per_A),
            format!("{:.2}", 1e6 * o.core_mean_T_per_A),
            format!("{:.2}", 100.0 * o.cv_r8),
            format!("{:.3}", 100.0 * o.cv_r6),
            format!("{:.3}", 100.0 * o.cv_r4),
            format!("{:.3}", 100.0 * o.axial_pp),
            format!("{:.2}", 100.0 * o.radial_pp),
            format!("{:.2}", 1e6 * o.inductance_H),
            format!("{:.4}", 1e3 * o.force_N_per_A2),
            format!("{:.0e}", o.error_estimate),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
