//! Results of a row of presses: as a table, as JSON lines, as a sentence.

use std::io::{self, Write};

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use palpate_cli::describe::{estimated, interval, relaxation, stiffness};
use palpate_cli::failure::Failure;
use palpate_cli::modulus::{Evaluated, pressure};
use palpate_sim::mechanics::load::Load;
use palpate_sim::switches::Switches;
use palpate_wire::Record;
use palpate_wire::record::Relaxation;
use serde::Serialize;

use crate::instrument::CalibratedInstrument;
use crate::press::PressOutcome;
use crate::verdict::Verdict;

/// One press of the row.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Name of the load.
    pub load: String,
    /// The press, with the truth.
    pub pressed: PressOutcome,
    /// The instrument's result.
    pub verdict: Verdict,
}

/// A line of the JSON output.
#[derive(Serialize)]
pub struct ResultLine<'m> {
    simulated: bool,
    load: &'m str,
    /// Tangent stiffness of the load with its support; absent if infinite.
    true_n_per_m: Option<f64>,
    true_force_n: f64,
    estimate: Option<&'m palpate_wire::record::Estimate>,
    /// Whether the 95 % interval contains the truth; absent without an estimate.
    within_claim: Option<bool>,
    /// Young's modulus of an object under a tip.
    #[serde(skip_serializing_if = "Option::is_none")]
    true_young_pa: Option<f64>,
    /// The modulus from the estimate, or why there is none.
    #[serde(flatten)]
    modulus: Option<&'m Evaluated>,
    /// Reason for a missing estimate; absent otherwise.
    reason: Option<String>,
    /// Last report of the object's relaxation; absent if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    relaxation: Option<&'m Relaxation>,
}

/// Prints one JSON object for each press.
pub fn print_json(row: &[Measured]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    for measured in row {
        writeln!(out, "{}", serde_json::to_string(&measured.line())?)?;
    }
    Ok(())
}

/// Describes the simulated sensor.
pub fn title(instrument: &CalibratedInstrument, stack: &str, seed: u64) -> String {
    let plant = &instrument.plant;
    let off = Switches::NAMES
        .iter()
        .filter(|name| instrument.switches.get(name) == Some(false))
        .count();
    let disturbed = match (off, Switches::NAMES.len() - off) {
        (0, _) => "all disturbances".to_owned(),
        (_, 0) => "without disturbances".to_owned(),
        (_, on) => format!("{on} of {} disturbances", Switches::NAMES.len()),
    };
    format!(
        "Simulated sensor of the stack {stack}, seed {seed}, {disturbed}: c_S {}, c_D {}, \
         {:.1} % stiffer at {:.1} A",
        stiffness(plant.sensing.spring_n_per_m),
        stiffness(plant.actuated.spring_n_per_m),
        plant.magnetorheological.stiffening_at_peak * 100.0,
        instrument.settings.peak_current_a,
    )
}

/// Describes the calibration from the bench.
pub fn calibrated(instrument: &CalibratedInstrument) -> String {
    let calibration = &instrument.calibration;
    let peak_a = f64::from(instrument.settings.peak_current_a);
    let square_a2 = peak_a * peak_a;
    let [soft, like, hard] = calibration.uncertainty.at;
    format!(
        "Calibrated on its bench{}: c_D {} for a nominal c_S of {}, {:.1} % stiffer at {peak_a:.1} A, \
         attraction {:.0} mN, cross-talk {:.1} µm; uncertain by {:.1} % at 0.2 c_S, {:.1} % at c_S, {:.1} % at 5 c_S",
        if calibration.coefficients.is_some() {
            " at two temperatures"
        } else {
            ""
        },
        stiffness(calibration.sensing_n_per_m / calibration.actuated.ratio),
        stiffness(calibration.sensing_n_per_m),
        calibration.actuated.rise(peak_a) * 100.0,
        calibration.actuated.attraction_n_per_a2 * square_a2 * 1e3,
        calibration.crosstalk.untouched_m_per_a2 * square_a2 * 1e6,
        soft * 100.0,
        like * 100.0,
        hard * 100.0,
    )
}

/// Prints title, calibration, table and summary on the terminal.
pub fn print(
    instrument: &CalibratedInstrument,
    row: &[Measured],
    title: &str,
) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    writeln!(out, "{title}")?;
    writeln!(out, "{}", calibrated(instrument))?;
    writeln!(out, "{}", table(row))?;
    for text in row.iter().filter_map(Measured::modulus) {
        writeln!(out, "{text}")?;
    }
    for measured in row {
        if let Some(of) = measured.relaxation() {
            writeln!(out, "{}: {}", measured.load, relaxation(of))?;
        }
    }
    writeln!(out, "{}", summary(row))?;
    Ok(())
}

/// Column headings.
pub const COLUMNS: [&str; 7] = [
    "load",
    "true",
    "estimate",
    "error",
    "95 % interval",
    "covered",
    "eq. (2)",
];

fn table(row: &[Measured]) -> Table {
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header(COLUMNS);
    for measured in row {
        table.add_row(measured.cells());
    }
    for column in [1, 2, 3, 6] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

impl Measured {
    /// The press as a line of JSON.
    pub fn line(&self) -> ResultLine<'_> {
        let truth = self.pressed.true_n_per_m;
        ResultLine {
            simulated: true,
            load: &self.load,
            true_n_per_m: truth.is_finite().then_some(truth),
            true_force_n: self.pressed.true_force_n,
            estimate: self.verdict.estimate(),
            within_claim: self.verdict.holds(truth),
            true_young_pa: self.true_young_pa(),
            modulus: self.pressed.modulus.as_ref(),
            reason: self.verdict.reason(),
            relaxation: self.relaxation(),
        }
    }

    /// Last report of the object's relaxation, if it relaxes.
    pub fn relaxation(&self) -> Option<&Relaxation> {
        let records = self
            .pressed
            .records()
            .filter_map(|(_, record)| match record {
                Record::Relaxation(relaxation) => Some(relaxation),
                _ => None,
            });
        records.last()
    }

    /// Compares a press with its truth.
    pub fn new(load: String, pressed: PressOutcome) -> Self {
        let verdict = Verdict::of(&pressed);
        Self {
            load,
            pressed,
            verdict,
        }
    }

    /// True Young's modulus, Pa; `None` for a load without a tip.
    fn true_young_pa(&self) -> Option<f64> {
        match self.pressed.load {
            Load::Indented(object) => Some(object.material.young_pa),
            _ => None,
        }
    }

    /// Modulus and hardness beside the true modulus; `None` for a load without a tip.
    fn modulus(&self) -> Option<String> {
        let lines: Vec<_> = self.pressed.modulus.as_ref()?.lines().collect();
        let truly = pressure(self.true_young_pa()? as f32);
        Some(format!(
            "{}: {}; truly {truly}",
            self.load,
            lines.join("; ")
        ))
    }

    /// Half the width of the interval of 1/c_L, relative to the true 1/c_L. The error of 1/c_L is
    /// nearly normal, and its interval is finite even if that of c_L has no upper end.
    pub fn half_width(&self) -> Option<f64> {
        let estimate = self.verdict.estimate()?;
        let truth = self.pressed.true_n_per_m;
        let low = truth / f64::from(estimate.lower_n_per_m);
        let upper = estimate.upper_n_per_m;
        let high = upper.map_or(0.0, |upper| truth / f64::from(upper));
        Some(0.5 * (low - high))
    }

    /// Cells under the headings of [`COLUMNS`].
    pub fn cells(&self) -> [String; 7] {
        let truth = self.pressed.true_n_per_m;
        let [estimate, error, interval, holds, plain] = match self.verdict.estimate() {
            Some(estimate) => {
                let value = estimate.stiffness_n_per_m.map(f64::from);
                let plain = estimate.two_state_n_per_m.map(f64::from);
                let holds = self.verdict.holds(truth) == Some(true);
                [
                    estimated(estimate),
                    value.map_or(String::new(), |value| error(value, truth)),
                    interval(estimate),
                    if holds { "yes" } else { "NO" }.to_owned(),
                    plain.map_or(String::new(), stiffness),
                ]
            }
            None => [
                "refused".to_owned(),
                String::new(),
                self.verdict.reason().unwrap_or_default(),
                String::new(),
                String::new(),
            ],
        };
        [
            self.load.clone(),
            stiffness(truth),
            estimate,
            error,
            interval,
            holds,
            plain,
        ]
    }
}

/// Formats the relative error of an estimate.
fn error(value: f64, truth: f64) -> String {
    if truth.is_finite() {
        format!("{:+.1} %", (value / truth - 1.0) * 100.0)
    } else {
        String::new()
    }
}

/// Number of estimates whose interval covers the truth, and number of estimates.
pub fn covered(row: &[Measured]) -> (usize, usize) {
    let covers = row
        .iter()
        .filter_map(|measured| measured.verdict.holds(measured.pressed.true_n_per_m));
    covers.fold((0, 0), |(covered, all), covers| {
        (covered + usize::from(covers), all + 1)
    })
}

/// Summarises the coverage in a sentence.
pub fn summary(row: &[Measured]) -> String {
    let (good, all) = covered(row);
    let simulated_s: f64 = row
        .iter()
        .map(|measured| measured.pressed.simulated_s)
        .sum();
    format!(
        "{all} of {} loads estimated, {good} of {all} within their own 95 % interval; {simulated_s:.0} s simulated. \
         True: the load in series with what it stands on. Eq. (2): the plain formula for two states, uncorrected.",
        row.len()
    )
}
