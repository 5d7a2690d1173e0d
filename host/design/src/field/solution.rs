//! A solved design, for other programs: figures, profiles, and the field at any point.

use std::sync::OnceLock;

use clap::Parser;
use palpate_cli::failure::Failure;
use palpate_field::design::Design;
use palpate_field::geometry::Point;
use palpate_field::solve::{FieldAt, Locator, Solved, Wanted};
use serde::Serialize;

use super::drive::{Drive, reached};
use super::input::{DesignSource, Effort, current, sharpened};
use super::profile;
use super::quantities::Asked;
use super::solve::SolvedFigures;

/// A solved design.
pub struct Solution {
    design: Design,
    effort: Effort,
    drive: Drive,
    /// The field that is accurate everywhere.
    solved: Solved,
    /// The solution for the figures, once they are requested.
    for_figures: OnceLock<Solved>,
}

/// Arguments of `palpate field solve` that select a field.
#[derive(Parser)]
#[command(name = "palpate field solve")]
struct Options {
    #[command(flatten)]
    source: DesignSource,
    #[arg(long, value_parser = current)]
    current: Option<f64>,
}

impl Solution {
    /// Solves a design; the arguments are those of `palpate field solve`: the design, `--current`, `--set`,
    /// `--accuracy`, `--order`.
    ///
    /// # Errors
    /// If an argument or the design is refused, or the accuracy is not reached.
    pub fn solve(arguments: &[String]) -> Result<Self, Failure> {
        let name = "palpate".to_owned();
        let options = Options::try_parse_from(std::iter::once(&name).chain(arguments));
        let options = options.map_err(|error| Failure::Argument(error.to_string()))?;
        let design = options.source.load_silently()?;
        let drive = Drive::of(&design, options.current)?;
        let effort = options.source.effort;
        let solved = drive.solve(&design, &effort)?;
        Ok(Self {
            design,
            effort,
            drive,
            solved,
            for_figures: OnceLock::new(),
        })
    }

    /// Figures of the field with their errors, as `palpate field solve --json` prints them: of a
    /// solution of their own, which differs from the field at a point by the accuracy at most.
    ///
    /// # Errors
    /// If the accuracy is not reached, or the derivatives by the current cannot be computed.
    pub fn figures(&self) -> Result<impl Serialize + use<>, Failure> {
        let solved = match self.for_figures.get() {
            Some(solved) => solved,
            None => {
                let solved = self
                    .drive
                    .solve_for(&self.design, &self.effort, Wanted::Figures)?;
                self.for_figures.get_or_init(|| solved)
            }
        };
        SolvedFigures::of(&self.design, solved, self.drive, &Asked::default())
    }

    /// Field along a line, refined there: positions, m, and flux densities. `along` is `axis`,
    /// `radius@x=MM` or `parallel@r=MM`; the ends are in mm, by default those of the design's drawing.
    ///
    /// # Errors
    /// If the line is refused, or the field cannot be refined.
    pub fn profile(
        &self,
        along: &str,
        ends_mm: [Option<f64>; 2],
        count: u32,
    ) -> Result<Vec<(f64, FieldAt)>, Failure> {
        let line = profile::line(along).map_err(Failure::Argument)?;
        let points = line.points(line.between(&self.solved, ends_mm)?, count);
        let solved = sharpened(&self.design, self.solved.clone(), &points, &self.effort)?;
        reached(&self.design, &solved)?;
        Ok(line.sample(&solved, &points))
    }

    /// Field at points [r, x], m.
    pub fn at(&self, points: &[Point]) -> Vec<FieldAt> {
        let locator = Locator::new(&self.solved.level, &self.solved.w);
        points.iter().map(|&point| locator.at(point)).collect()
    }

    /// The design, with its changed numbers.
    pub const fn design(&self) -> &Design {
        &self.design
    }
}
