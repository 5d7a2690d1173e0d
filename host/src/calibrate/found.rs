//! What a calibration found, as people and programs read it.

use std::io::{self, Write};

use comfy_table::Table;
use comfy_table::presets::NOTHING;
use palpate_calibration::session::Session;
use palpate_calibration::{Calibration, Part, Parts};
use palpate_wire::command::CalibrationIdentity;
use serde::Serialize;

use crate::failure::Failure;
use crate::instrument::BenchTask;
use crate::results::stiffness;

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Found {
    pub(super) simulated: bool,
    /// Whether a load cell gave the force; otherwise springs and the stage's scale did.
    pub(super) load_cell: bool,
    pub(crate) calibration_id: u32,
    pub(super) calibrated_at_s: u32,
    pub(super) calibrated_at_c: f32,
    pub(super) runs: usize,
    pub(super) sensing_n_per_m: f64,
    pub(super) actuated_n_per_m: f64,
    pub(super) peak_current_a: f32,
    /// Relative, at the peak current.
    pub(super) rise: f64,
    pub(super) attraction_n: f64,
    /// Relative standard uncertainties of 1/c_L and 1/c_S.
    pub(super) scale_uncertainty: f64,
    pub(super) constant_uncertainty: f64,
    /// What these consist of, each as relative standard uncertainties of 1/c_L and 1/c_S.
    pub(super) limits: Vec<Limit>,
    pub(crate) stored: bool,
    pub(crate) configuration_crc: u32,
}

/// A cause of uncertainty.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Limit {
    pub(super) cause: &'static str,
    pub(super) scale: f64,
    pub(super) constant: f64,
}

impl Found {
    /// What is said of a calibration that is not stored yet.
    pub(crate) fn of(
        session: &Session,
        task: &BenchTask,
        calibration: &Calibration,
        identity: &CalibrationIdentity,
        simulated: bool,
    ) -> Self {
        let peak_a = f64::from(task.plan.settings.peak_current_a);
        let uncertainty = &calibration.uncertainty;
        Self {
            simulated,
            load_cell: task.known.load_cell_gain.is_some(),
            calibration_id: identity.id,
            calibrated_at_s: identity.calibrated_at_s,
            calibrated_at_c: identity.calibrated_at_c,
            runs: session.runs.len() + 1,
            sensing_n_per_m: calibration.sensing_n_per_m,
            actuated_n_per_m: calibration.sensing_n_per_m / calibration.actuated.ratio,
            peak_current_a: task.plan.settings.peak_current_a,
            rise: calibration.actuated.rise(peak_a),
            attraction_n: calibration.actuated.attraction_n_per_a2 * peak_a * peak_a,
            scale_uncertainty: uncertainty.scale,
            constant_uncertainty: uncertainty.constant,
            limits: limits(&uncertainty.parts),
            stored: false,
            configuration_crc: 0,
        }
    }

    /// The figures, each with its name.
    pub(super) fn figures(&self) -> [(String, String); 7] {
        [
            (
                "force from".to_owned(),
                if self.load_cell {
                    "load cell"
                } else {
                    "springs and the stage's scale"
                }
                .to_owned(),
            ),
            (
                "actuated layer".to_owned(),
                stiffness(self.actuated_n_per_m),
            ),
            (
                "for a sensing layer of".to_owned(),
                stiffness(self.sensing_n_per_m),
            ),
            (
                format!("stiffer at {:.1} A by", self.peak_current_a),
                percent(self.rise),
            ),
            (
                "attraction then".to_owned(),
                format!("{:.0} mN", 1e3 * self.attraction_n),
            ),
            (
                "uncertainty of 1/c_L".to_owned(),
                percent(self.scale_uncertainty),
            ),
            (
                "and of 1/c_S besides".to_owned(),
                percent(self.constant_uncertainty),
            ),
        ]
    }
}

/// What limits a calibration, the greatest cause first.
fn limits(parts: &Parts) -> Vec<Limit> {
    let of = |cause, part: Part| Limit {
        cause,
        scale: part.scale,
        constant: part.constant,
    };
    let mut limits = vec![
        of("the springs' tolerance", parts.springs),
        of("noise of the samples", parts.noise),
        of("what the trains leave unexplained", parts.trains),
        of("load cell, stage and frame", parts.bench),
    ];
    limits.sort_by(|a, b| (b.scale + b.constant).total_cmp(&(a.scale + a.constant)));
    limits
}

/// A part in percent.
pub(super) fn percent(part: f64) -> String {
    format!("{:.1} %", 1e2 * part)
}

/// Prints what was found.
pub(super) fn print(found: &Found, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(found)?)?);
    }
    let mut table = Table::new();
    table.load_style(NOTHING);
    for (what, value) in found.figures() {
        table.add_row([what, value]);
    }
    for (index, limit) in found.limits.iter().enumerate() {
        let what = if index == 0 { "limited by" } else { "" };
        let parts = [percent(limit.scale), percent(limit.constant)];
        table.add_row([
            what.to_owned(),
            format!("{}: {} and {}", limit.cause, parts[0], parts[1]),
        ]);
    }
    writeln!(out, "{table}")?;
    if found.stored {
        let id = found.calibration_id;
        return Ok(writeln!(out, "Calibration {id} is in force, and stored.")?);
    }
    Ok(writeln!(
        out,
        "It is in force, and not stored: it is lost with the power."
    )?)
}
