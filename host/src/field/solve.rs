//! `palpate field solve`: the figures of one design.

use std::io::{self, Write};

use clap::Args;
use palpate_field::design::Design;
use palpate_field::solve::Solved;
use serde::Serialize;

use super::input::{DesignSource, at_current, current, per_ampere};
use crate::failure::Failure;

/// Solve a design: field, homogeneity, inductance, force, resistance
#[derive(Args)]
#[command(after_help = "\
Homogeneity is std/mean of |B| by volume within the core's radius (r8), three quarters (r6) and
half of it (r4): 8, 6 and 4 mm for the built-in designs with a core of 8 mm.
Figures per ampere are those of a small current; --current adds those with saturation.")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    /// Solve with saturation at this current too, A
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The figures as they are printed, in SI units.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
pub(super) struct SolvedFigures {
    pub(super) design: String,
    pub(super) centre_T_per_A: f64,
    pub(super) core_mean_T_per_A: f64,
    pub(super) cv_r8: f64,
    pub(super) cv_r6: f64,
    pub(super) cv_r4: f64,
    pub(super) axial_pp: f64,
    pub(super) radial_pp: f64,
    pub(super) inductance_H: f64,
    pub(super) force_N_per_A2: f64,
    pub(super) resistance_ohm: f64,
    /// The greater of the relative errors of centre and core mean.
    pub(super) error_estimate: f64,
    pub(super) unknowns: usize,
    /// Estimated absolute error of each figure, in its unit.
    errors: FigureErrors,
    #[serde(flatten)]
    at_current: Option<AtCurrent>,
}

#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct FigureErrors {
    centre_T_per_A: f64,
    core_mean_T_per_A: f64,
    cv_r8: f64,
    cv_r6: f64,
    cv_r4: f64,
    axial_pp: f64,
    radial_pp: f64,
    inductance_H: f64,
    force_N_per_A2: f64,
}

#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct AtCurrent {
    current_A: f64,
    centre_T: f64,
    core_mean_T: f64,
    plate_max_T: f64,
    force_N: f64,
    power_W: f64,
    newton_iterations: usize,
    linear_solves_on_all_meshes: usize,
    error_estimate_at_current: f64,
}

pub(super) fn relative_error(solved: &Solved) -> f64 {
    let (figures, errors) = (&solved.figures, &solved.errors);
    let centre = errors.centre_t / figures.centre_t.abs();
    centre.max(errors.core_mean_t / figures.core_mean_t)
}

impl SolvedFigures {
    pub(super) fn of(design: &Design, solved: &Solved) -> Self {
        let (f, e) = (&solved.figures, &solved.errors);
        Self {
            design: design.name.clone(),
            centre_T_per_A: f.centre_t,
            core_mean_T_per_A: f.core_mean_t,
            cv_r8: f.cv[0],
            cv_r6: f.cv[1],
            cv_r4: f.cv[2],
            axial_pp: f.axial_pp,
            radial_pp: f.radial_pp,
            inductance_H: f.inductance_h,
            force_N_per_A2: f.force_n,
            resistance_ohm: design.resistance_ohm(),
            error_estimate: relative_error(solved),
            unknowns: solved.report.unknowns,
            errors: FigureErrors {
                centre_T_per_A: e.centre_t,
                core_mean_T_per_A: e.core_mean_t,
                cv_r8: e.cv[0],
                cv_r6: e.cv[1],
                cv_r4: e.cv[2],
                axial_pp: e.axial_pp,
                radial_pp: e.radial_pp,
                inductance_H: e.inductance_h,
                force_N_per_A2: e.force_n,
            },
            at_current: None,
        }
    }

    fn with_current(mut self, design: &Design, current_a: f64, solved: &Solved) -> Self {
        self.at_current = Some(AtCurrent {
            current_A: current_a,
            centre_T: solved.figures.centre_t,
            core_mean_T: solved.figures.core_mean_t,
            plate_max_T: solved.figures.plate_max_t,
            force_N: solved.figures.force_n,
            power_W: current_a * current_a * design.resistance_ohm(),
            newton_iterations: solved.report.newton_iterations,
            linear_solves_on_all_meshes: solved.report.linear_solves,
            error_estimate_at_current: relative_error(solved),
        });
        self
    }

    fn explain(&self) -> String {
        let e = &self.errors;
        let mut text = format!(
            "{}, per ampere at small currents\n\
             \x20 field in the centre      {:.3} uT  (+- {:.1e})\n\
             \x20 mean over the core       {:.3} uT  (+- {:.1e})\n\
             \x20 std/mean, r8 r6 r4       {:.3} %  {:.3} %  {:.3} %\n\
             \x20 peak to peak, axial      {:.3} %, radial {:.3} %\n\
             \x20 inductance               {:.3} uH  (+- {:.1e})\n\
             \x20 attraction of the halves {:.4} mN/A^2  (+- {:.1e})\n\
             \x20 resistance               {:.4} ohm\n\
             \x20 relative error of centre and mean {:.1e}, with {} unknowns\n",
            self.design,
            1e6 * self.centre_T_per_A,
            1e6 * e.centre_T_per_A,
            1e6 * self.core_mean_T_per_A,
            1e6 * e.core_mean_T_per_A,
            100.0 * self.cv_r8,
            100.0 * self.cv_r6,
            100.0 * self.cv_r4,
            100.0 * self.axial_pp,
            100.0 * self.radial_pp,
            1e6 * self.inductance_H,
            1e6 * e.inductance_H,
            1e3 * self.force_N_per_A2,
            1e3 * e.force_N_per_A2,
            self.resistance_ohm,
            self.error_estimate,
            self.unknowns,
        );
        if let Some(at) = &self.at_current {
            text.push_str(&format!(
                "at {} A ({:.1} W), with saturation\n\
                 \x20 field in the centre      {:.3} mT\n\
                 \x20 mean over the core       {:.3} mT\n\
                 \x20 greatest in the plates   {:.3} T\n\
                 \x20 attraction of the halves {:.2} mN\n\
                 \x20 Newton steps on the last mesh {}, relative error {:.1e}\n",
                at.current_A,
                at.power_W,
                1e3 * at.centre_T,
                1e3 * at.core_mean_T,
                at.plate_max_T,
                1e3 * at.force_N,
                at.newton_iterations,
                at.error_estimate_at_current,
            ));
        }
        text
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let design = arguments.source.load()?;
    let effort = &arguments.source.effort;
    let mut outcome = SolvedFigures::of(&design, &per_ampere(&design, effort)?);
    if let Some(current_a) = arguments.current {
        let solved = at_current(&design, current_a, effort)?;
        outcome = outcome.with_current(&design, current_a, &solved);
    }
    let mut out = io::stdout().lock();
    if arguments.json {
        serde_json::to_writer_pretty(&mut out, &outcome)?;
        writeln!(out)?;
    } else {
        write!(out, "{}", outcome.explain())?;
    }
    Ok(())
}
