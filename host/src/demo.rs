//! `palpate demo`: a row of springs, much softer to much stiffer than the sensor.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::{fs, io};

use clap::Args;
use clap::builder::PossibleValuesParser;
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use indicatif::{ProgressBar, ProgressStyle};
use palpate_sim::mechanics::load::Load;
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::Holder;
use serde::Serialize;

use crate::failure::Failure;
use crate::instrument::{Instrument, SPEED_M_PER_S, default_settings};
use crate::press::{Press, Pressed, press};
use crate::report;
use crate::verdict::Verdict;

/// Presses a row of springs upon a simulated sensor, and shows what it makes of them
///
/// The sensor is drawn from a stack and calibrated on its own simulated bench, with all that
/// disturbs both. Driver, procedure and estimator are the firmware's own.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Which sensor is drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kind of sensor
    #[arg(long, default_value = "ultrasoft", value_parser = PossibleValuesParser::new(Stack::BUILTIN))]
    stack: String,
    /// Without disturbances, noise and quantisation
    #[arg(long)]
    ideal: bool,
    /// Where the report is written
    #[arg(long, default_value = "palpate-demo.html")]
    report: PathBuf,
    /// One JSON object for each spring, and no report
    #[arg(long)]
    json: bool,
}

/// The springs, in units of the sensing layer's own.
const RATIOS: [f64; 7] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0];

/// One spring of the row.
pub(crate) struct Measured {
    /// In units of c_S; nothing for a rigid block.
    pub(crate) ratio: Option<f64>,
    pub(crate) pressed: Pressed,
    pub(crate) verdict: Verdict,
}

/// A line of the JSON output.
#[derive(Serialize)]
struct Line {
    simulated: bool,
    /// Nominal stiffness of the spring in units of c_S; absent for a rigid block.
    load_to_sensing_spring: Option<f64>,
    /// Tangent stiffness of the spring and what it stands on; absent if infinite.
    true_n_per_m: Option<f64>,
    estimate: Option<palpate_wire::record::Estimate>,
    true_force_n: f64,
    /// Whether the truth lies in the 95 % interval.
    within_claim: Option<bool>,
    reason: Option<String>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let switches = if arguments.ideal {
        Switches::none()
    } else {
        Switches::all()
    };
    let bar = progress(arguments.json);
    bar.set_message("calibrating on the bench");
    let disturbances =
        Disturbances::builtin().map_err(|error| Failure::Refused(error.to_string()))?;
    let stack =
        Stack::builtin(&arguments.stack).map_err(|error| Failure::Refused(error.to_string()))?;
    let instrument = Instrument::calibrated(
        &stack,
        &disturbances,
        arguments.seed,
        switches,
        &default_settings(),
    )?;
    bar.inc(1);
    let mut row = Vec::new();
    for ratio in RATIOS.map(Some).into_iter().chain([None]) {
        bar.set_message(match ratio {
            Some(ratio) => format!("pressing a spring of {ratio} c_S"),
            None => "pressing a rigid block".to_owned(),
        });
        row.push(measure(&instrument, ratio)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    if arguments.json {
        return print_json(&row);
    }
    println!("{}", heading(arguments, &instrument));
    println!("{}", calibrated(&instrument));
    println!("{}", table(&row));
    println!("{}", summary(&row));
    let page = report::page(&instrument, &row, &heading(arguments, &instrument));
    fs::write(&arguments.report, page)?;
    println!("Report: {}", arguments.report.display());
    Ok(())
}

fn progress(quiet: bool) -> ProgressBar {
    let steps = RATIOS.len() as u64 + 2;
    if quiet || !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(steps);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}") {
        bar.set_style(style);
    }
    bar
}

fn measure(instrument: &Instrument, ratio: Option<f64>) -> Result<Measured, Failure> {
    let sensing_n_per_m = instrument.plant.sensing.spring_n_per_m;
    let how = Press {
        load: ratio.map_or(Load::Rigid, |ratio| Load::Spring {
            n_per_m: ratio * sensing_n_per_m,
        }),
        holder: Holder::Stand,
        depth_m: instrument.plant.press.depth_m,
        speed_m_per_s: SPEED_M_PER_S,
    };
    let pressed = press(
        &instrument.plant,
        instrument.switches,
        &instrument.calibration.commands,
        &how,
    )
    .map_err(|error| Failure::Refused(error.to_string()))?;
    let verdict = Verdict::of(&pressed);
    Ok(Measured {
        ratio,
        pressed,
        verdict,
    })
}

fn heading(arguments: &Arguments, instrument: &Instrument) -> String {
    let plant = &instrument.plant;
    format!(
        "Simulated sensor of the stack {}, seed {}, {}: c_S {}, c_D {}, {:.1} % stiffer at {:.1} A",
        arguments.stack,
        arguments.seed,
        if arguments.ideal {
            "without disturbances"
        } else {
            "all disturbances"
        },
        stiffness(plant.sensing.spring_n_per_m),
        stiffness(plant.actuated.spring_n_per_m),
        plant.magnetorheological.stiffening_at_peak * 100.0,
        instrument.settings.peak_current_a,
    )
}

/// What the bench made of it.
fn calibrated(instrument: &Instrument) -> String {
    let calibration = &instrument.calibration;
    let peak_a = f64::from(instrument.settings.peak_current_a);
    let square_a2 = peak_a * peak_a;
    format!(
        "Calibrated on its bench: c_D {} for a nominal c_S of {}, {:.1} % stiffer at {peak_a:.1} A, \
         attraction {:.0} mN, cross-talk {:.1} µm; uncertain by {:.1} % of 1/c_L and {:.1} % of 1/c_S",
        stiffness(calibration.sensing_n_per_m / calibration.actuated.ratio),
        stiffness(calibration.sensing_n_per_m),
        calibration.actuated.rise(peak_a) * 100.0,
        calibration.actuated.attraction_n_per_a2 * square_a2 * 1e3,
        calibration.crosstalk.untouched_m_per_a2 * square_a2 * 1e6,
        calibration.uncertainty.scale * 100.0,
        calibration.uncertainty.constant * 100.0,
    )
}

/// A stiffness in N/mm with three digits, as people read it.
pub(crate) fn stiffness(n_per_m: f64) -> String {
    let n_per_mm = n_per_m * 1e-3;
    if !n_per_mm.is_finite() {
        return "rigid".to_owned();
    }
    let digits = (2 - n_per_mm.abs().max(1e-9).log10().floor() as i32).clamp(0, 4);
    format!("{n_per_mm:.*} N/mm", digits as usize)
}

fn table(row: &[Measured]) -> Table {
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header([
        "load",
        "true",
        "estimate",
        "error",
        "95 % interval",
        "holds",
        "eq. (2)",
    ]);
    for measured in row {
        table.add_row(cells(measured));
    }
    for column in [1, 2, 3, 6] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

fn cells(measured: &Measured) -> Vec<String> {
    let truth = measured.pressed.true_n_per_m;
    let load = measured
        .ratio
        .map_or("block".to_owned(), |ratio| format!("{ratio} c_S"));
    let mut cells = vec![load, stiffness(truth)];
    match &measured.verdict {
        Verdict::Estimate(estimate) => {
            let value = estimate.stiffness_n_per_m.map(f64::from);
            let lower = stiffness(f64::from(estimate.lower_n_per_m));
            cells.push(value.map_or("as if rigid".to_owned(), stiffness));
            cells.push(value.map_or(String::new(), |value| {
                format!("{:+.1} %", (value / truth - 1.0) * 100.0)
            }));
            cells.push(match estimate.upper_n_per_m {
                Some(upper) => format!("{lower} to {}", stiffness(f64::from(upper))),
                None => format!("{lower} or more"),
            });
            let holds = measured.verdict.holds(truth);
            cells.push(if holds == Some(true) { "yes" } else { "NO" }.to_owned());
            let plain = estimate.two_state_n_per_m.map(f64::from);
            cells.push(plain.map_or(String::new(), stiffness));
        }
        other => {
            cells.push("refused".to_owned());
            cells.push(String::new());
            cells.push(other.reason().unwrap_or_default());
        }
    }
    cells
}

fn summary(row: &[Measured]) -> String {
    let held = row
        .iter()
        .filter_map(|measured| measured.verdict.holds(measured.pressed.true_n_per_m));
    let (good, all) = held.fold((0, 0), |(good, all), holds| {
        (good + usize::from(holds), all + 1)
    });
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

fn print_json(row: &[Measured]) -> Result<(), Failure> {
    for measured in row {
        let truth = measured.pressed.true_n_per_m;
        let line = Line {
            simulated: true,
            load_to_sensing_spring: measured.ratio,
            true_n_per_m: truth.is_finite().then_some(truth),
            estimate: match &measured.verdict {
                Verdict::Estimate(estimate) => Some(estimate.as_ref().clone()),
                _ => None,
            },
            true_force_n: measured.pressed.true_force_n,
            within_claim: measured.verdict.holds(truth),
            reason: measured.verdict.reason(),
        };
        println!("{}", serde_json::to_string(&line)?);
    }
    Ok(())
}
