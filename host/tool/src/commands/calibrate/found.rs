//! Results of a calibration, as text and JSON.

use std::io::{self, Write};

use comfy_table::Table;
use comfy_table::presets::NOTHING;
use palpate_calibration::session::Session;
use palpate_calibration::{Calibration, LOADS, Parts};
use palpate_cli::describe::stiffness;
use palpate_cli::failure::Failure;
use palpate_simulate::instrument::BenchTask;
use palpate_wire::command::CalibrationIdentity;
use serde::Serialize;

/// Results of a calibration.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct CalibrationFigures {
    pub(super) simulated: bool,
    /// Whether a load cell gave the force; otherwise springs and the stage's scale.
    pub(super) load_cell: bool,
    pub(crate) calibration_id: u32,
    pub(super) calibrated_at_s: u32,
    pub(super) calibrated_at_c: f32,
    pub(super) runs: usize,
    pub(super) sensing_n_per_m: f64,
    pub(super) actuated_n_per_m: f64,
    pub(super) peak_current_a: f32,
    /// Relative rise at the peak current.
    pub(super) rise: f64,
    pub(super) attraction_n: f64,
    /// Relative changes per kelvin; `Some` after sessions at two temperatures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) springs_per_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) rise_per_k: Option<f64>,
    /// Contacts for which intervals hold, and the relative standard uncertainty of 1/c_L at the
    /// `loads` that they add; `None` for the centred, flat contact alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) contact: Option<ContactFigures>,
    /// Relative standard uncertainty of 1/c_L at the `loads`, c_L/c_S, without the noise of a
    /// press, in a centred, flat contact.
    pub(super) uncertainty: [f64; LOADS.len()],
    /// Loads of the uncertainties, c_L/c_S.
    pub(super) loads: [f64; LOADS.len()],
    /// Contributions to the uncertainty.
    pub(super) limits: Vec<Limit>,
    pub(crate) stored: bool,
    pub(crate) configuration_crc: u32,
}

/// Contacts within a tolerance.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ContactFigures {
    pub(super) within_m: f64,
    pub(super) tilt_rad: f64,
    pub(super) uncertainty: [f64; LOADS.len()],
}

/// A cause of uncertainty.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Limit {
    pub(super) cause: &'static str,
    /// Relative standard uncertainty of 1/c_L at each load.
    pub(super) uncertainty: [f64; LOADS.len()],
}

impl CalibrationFigures {
    /// Figures of a calibration that is not stored yet.
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
            runs: session.runs.len() + session.contact.len() + 1,
            sensing_n_per_m: calibration.sensing_n_per_m,
            actuated_n_per_m: calibration.sensing_n_per_m / calibration.actuated.ratio,
            peak_current_a: task.plan.settings.peak_current_a,
            rise: calibration.actuated.rise(peak_a),
            attraction_n: calibration.actuated.attraction_n_per_a2 * peak_a * peak_a,
            springs_per_k: calibration.coefficients.map(|of| of.springs.per_k),
            rise_per_k: calibration.coefficients.map(|of| of.rise.per_k),
            contact: calibration.contact.map(|of| ContactFigures {
                within_m: of.within_m,
                tilt_rad: of.tilt_rad,
                uncertainty: of.at_loads(calibration.actuated.ratio, calibration.depth_m()),
            }),
            uncertainty: uncertainty.at,
            loads: LOADS,
            limits: limits(&uncertainty.parts),
            stored: false,
            configuration_crc: 0,
        }
    }

    /// The figures with their names.
    pub(super) fn figures(&self) -> Vec<(String, String)> {
        let mut figures = vec![
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
                format!(
                    "standard uncertainty of c_L at that temperature, without noise, at {}",
                    loads()
                ),
                percents(&self.uncertainty),
            ),
        ];
        if let Some(contact) = &self.contact {
            figures.push((
                format!(
                    "for contacts within {:.2} mm of the centre, tilted by at most {:.2} deg, also",
                    1e3 * contact.within_m,
                    contact.tilt_rad.to_degrees()
                ),
                percents(&contact.uncertainty),
            ));
        }
        if let Some((springs, rise)) = self.springs_per_k.zip(self.rise_per_k) {
            figures.push((
                "for every kelvin".to_owned(),
                format!(
                    "springs {:+.2} %, stiffening {:+.2} %",
                    1e2 * springs,
                    1e2 * rise
                ),
            ));
        }
        figures
    }
}

/// Contributions to the uncertainty, the largest first.
fn limits(parts: &Parts) -> Vec<Limit> {
    let of = |cause, uncertainty| Limit { cause, uncertainty };
    let mut limits = vec![
        of("the springs' tolerance", parts.springs),
        of("unexplained scatter of the trains", parts.trains),
        of("load cell, stage and frame", parts.bench),
    ];
    let sum = |limit: &Limit| limit.uncertainty.iter().sum::<f64>();
    limits.sort_by(|a, b| sum(b).total_cmp(&sum(a)));
    limits
}

/// Formats the loads of the uncertainties.
pub(super) fn loads() -> String {
    let [soft, like, hard] = LOADS;
    format!("{soft}, {like}, {hard} c_S")
}

/// Formats parts in percent, separated by commas.
pub(super) fn percents(parts: &[f64]) -> String {
    let parts: Vec<String> = parts.iter().map(|part| percent(*part)).collect();
    parts.join(", ")
}

/// Formats a part in percent.
pub(super) fn percent(part: f64) -> String {
    format!("{:.1} %", 1e2 * part)
}

/// Prints the results.
pub(super) fn print(found: &CalibrationFigures, json: bool) -> Result<(), Failure> {
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
        let parts = percents(&limit.uncertainty);
        table.add_row([what.to_owned(), format!("{}: {parts}", limit.cause)]);
    }
    writeln!(out, "{table}")?;
    if found.stored {
        let id = found.calibration_id;
        return Ok(writeln!(out, "Calibration {id} is active and stored.")?);
    }
    Ok(writeln!(
        out,
        "It is active, and not stored: it is lost at power-off."
    )?)
}
