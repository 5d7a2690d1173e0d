//! `cargo campaign modulus`: Young's modulus from stiffness, force and tip, against that of the simulated
//! object.
//!
//! Each sensor presses pins and balls on thick objects and on layers. Radius, thickness, Poisson's ratio
//! and stand of the object are declared with errors that are drawn from their stated uncertainties.

use std::io::{self, Write};
use std::path::Path;

use clap::Args;
use comfy_table::Table;
use comfy_table::presets::ASCII_MARKDOWN;
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::failure::Failure;
use palpate_cli::in_order::in_order;
use palpate_cli::modulus::{Evaluated, pressure};
use palpate_cli::progress::Progress;
use palpate_sim::mechanics::contact::Contact;
use palpate_sim::mechanics::indented::{Indented, Material, Tip};
use palpate_sim::mechanics::load::Load;
use palpate_sim::random::Stream;
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::Holder;
use palpate_simulate::campaign::coverage::Coverage;
use palpate_simulate::engine::{self, Native};
use palpate_simulate::instrument::{CalibratedInstrument, SPEED_M_PER_S, default_settings};
use palpate_simulate::press::{CLEARANCE_M, Press, PressOutcome, modulus};
use palpate_simulate::verdict::Verdict;
use palpate_wire::command;
use serde::Serialize;

use crate::drawn::DrawnSensors;

/// Young's moduli, Pa: soft gel to firm rubber.
const MODULI_PA: [f64; 5] = [40e3, 100e3, 300e3, 800e3, 2e6];
/// Radii of a set of tips, m. The smallest within the limits of the formulas is used.
const RADII_M: [f64; 6] = [2e-3, 4e-3, 8e-3, 16e-3, 32e-3, 64e-3];
/// Greatest depth of a pin over its radius and of a ball's contact radius over that of the ball, by which
/// a tip is selected: three quarters of the limits.
const PIN_DEPTH: f64 = 0.15;
const BALL_CONTACT: f64 = 0.3;
/// Thickness of a layer over the radius of the contact on a thick object.
const LAYER: [(Tip, f64); 2] = [(Tip::Pin, 2.0), (Tip::Ball, 4.0)];
/// Stated standard uncertainties: relative for radius, thickness and stand, absolute for Poisson's ratio.
const RADIUS: f64 = 0.01;
const THICKNESS: f64 = 0.02;
const SUPPORT: f64 = 0.05;
const POISSON: f64 = 0.01;
/// Declared Poisson's ratio, and range of the true one.
const DECLARED_POISSON: f64 = 0.485;
const TRUE_POISSON: (f64, f64) = (0.47, 0.5);

/// Press pins and balls on elastic objects, and compare their moduli with the true ones
#[derive(Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    drawn: DrawnSensors,
    /// Declare tip, object and stand as they are
    #[arg(long)]
    exact: bool,
}

/// Errors of a declaration.
#[derive(Clone, Copy)]
enum Errors {
    /// Drawn from the stated uncertainties.
    Drawn,
    /// No errors, and no stated uncertainties.
    None,
}

/// An object to be pressed.
struct ObjectPlan {
    young_pa: f64,
    tip: Tip,
    is_thick: bool,
}

/// One press.
#[derive(Clone, Debug, Serialize)]
struct Row {
    seed: u64,
    kind: &'static str,
    young_pa: f64,
    radius_m: f64,
    /// ln of the estimate over the truth, of modulus and of stiffness; absent without a result.
    modulus_error: Option<f64>,
    stiffness_error: Option<f64>,
    /// Half of the interval of ln E.
    half_width: Option<f64>,
    covered: Option<bool>,
    /// Why there is no modulus.
    reason: Option<String>,
}

pub(crate) fn run(Arguments { drawn, exact }: &Arguments) -> Result<(), Failure> {
    let stack = &Stack::named(&drawn.stack, Path::new(""))?;
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let progress = Progress::new(drawn.plants as usize);
    let seed_of = |index: usize| drawn.seed.saturating_add(index as u64);
    let errors = if *exact { Errors::None } else { Errors::Drawn };
    let of = |index| {
        let (seed, all) = (seed_of(index), Switches::all());
        let instrument = calibrated(stack, &disturbances, seed, all)?;
        of_sensor(&instrument, &MODULI_PA, errors)
    };
    let mut sensors: Vec<Vec<Row>> = Vec::new();
    in_order(drawn.plants as usize, of, |index, rows| {
        progress.step();
        match rows {
            Ok(rows) => sensors.push(rows),
            Err(reason) => {
                palpate_cli::notice::say(format_args!("seed {}: {reason}", seed_of(index)));
            }
        }
        Ok(())
    })?;
    progress.finish();
    print(&sensors, drawn.json)
}

fn calibrated(
    stack: &Stack,
    disturbances: &Disturbances,
    seed: u64,
    switches: Switches,
) -> Result<CalibratedInstrument, Failure> {
    CalibratedInstrument::calibrated(stack, disturbances, seed, switches, &default_settings())
}

/// Presses each tip on objects of these moduli, thick ones and layers.
fn of_sensor(
    instrument: &CalibratedInstrument,
    moduli_pa: &[f64],
    errors: Errors,
) -> Result<Vec<Row>, Failure> {
    let mut chance = Stream::named(instrument.plant.seed, "campaign.modulus");
    let mut rows = Vec::new();
    for &young_pa in moduli_pa {
        for (tip, is_thick) in [
            (Tip::Pin, true),
            (Tip::Pin, false),
            (Tip::Ball, true),
            (Tip::Ball, false),
        ] {
            let plan = ObjectPlan {
                young_pa,
                tip,
                is_thick,
            };
            rows.push(of_object(instrument, &plan, errors, &mut chance)?);
        }
    }
    Ok(rows)
}

fn of_object(
    instrument: &CalibratedInstrument,
    plan: &ObjectPlan,
    errors: Errors,
    chance: &mut Stream,
) -> Result<Row, Failure> {
    let &ObjectPlan {
        young_pa,
        tip,
        is_thick,
    } = plan;
    let (low, high) = TRUE_POISSON;
    let mut material = Material {
        young_pa,
        poisson_ratio: chance.between(low, high),
        thickness_m: None,
    };
    let force_n = instrument.plant.sensing.spring_n_per_m * instrument.depth_m;
    let (radius_m, contact_m) = selected(tip, &material, force_n);
    if !is_thick {
        let of_layer = LAYER.iter().find(|(of, _)| *of == tip);
        material.thickness_m = of_layer.map(|(_, ratio)| ratio * contact_m);
    }
    let load = Load::Indented(Indented::new(tip, radius_m, material));
    let how = Press {
        name: "object".to_owned(),
        load,
        holder: Holder::Stand,
        contact: Contact::default(),
        clearance_m: CLEARANCE_M,
        depth_m: instrument.depth_m,
        speed_m_per_s: SPEED_M_PER_S,
    };
    let pressed = engine::press(instrument, &how, &Native)?;
    let kind = match (tip, is_thick) {
        (Tip::Pin, true) => "pin",
        (Tip::Ball, true) => "ball",
        (Tip::Pin, false) => "pin on a layer",
        (Tip::Ball, false) => "ball on a layer",
    };
    Ok(Row {
        seed: instrument.plant.seed,
        kind,
        young_pa,
        radius_m,
        ..judged(instrument, &pressed, young_pa, errors, chance)
    })
}

/// Smallest radius of the set within the limits, with the contact's radius on a thick object.
fn selected(tip: Tip, material: &Material, force_n: f64) -> (f64, f64) {
    let reduced_pa = material.young_pa / (1.0 - material.poisson_ratio.powi(2));
    let of = |radius_m: f64| match tip {
        Tip::Pin => (
            radius_m,
            force_n / (2.0 * radius_m * reduced_pa) / radius_m / PIN_DEPTH,
        ),
        Tip::Ball => {
            let contact_m = (0.75 * force_n * radius_m / reduced_pa).cbrt();
            (contact_m, contact_m / radius_m / BALL_CONTACT)
        }
    };
    let [.., largest_m] = RADII_M;
    let radius_m = RADII_M.into_iter().find(|radius_m| of(*radius_m).1 <= 1.0);
    let radius_m = radius_m.unwrap_or(largest_m);
    (radius_m, of(radius_m).0)
}

/// Evaluates a press with the tip as it is declared.
fn judged(
    instrument: &CalibratedInstrument,
    pressed: &PressOutcome,
    young_pa: f64,
    errors: Errors,
    chance: &mut Stream,
) -> Row {
    let declared = pressed.tip.clone().map(|tip| match errors {
        Errors::Drawn => with_errors(tip, chance),
        Errors::None => tip,
    });
    let evaluated = declared.and_then(|tip| modulus(instrument, tip, &pressed.frames));
    let verdict = Verdict::of(pressed);
    let stiffness = verdict.estimate().and_then(|of| of.stiffness_n_per_m);
    let mut row = Row {
        seed: 0,
        kind: "",
        young_pa,
        radius_m: 0.0,
        modulus_error: None,
        stiffness_error: stiffness.map(|of| (f64::from(of) / pressed.true_n_per_m).ln()),
        half_width: None,
        covered: None,
        reason: verdict.reason(),
    };
    match evaluated {
        Some(Evaluated::Modulus(of)) => {
            let lower_pa = f64::from(of.lower_pa);
            let upper_pa = of.upper_pa.map_or(f64::INFINITY, f64::from);
            row.modulus_error = of.young_pa.map(|of| (f64::from(of) / young_pa).ln());
            row.half_width = Some(0.5 * (upper_pa / lower_pa).ln());
            row.covered = Some((lower_pa..=upper_pa).contains(&young_pa));
        }
        Some(Evaluated::NoModulus(reason)) => row.reason = Some(reason),
        None => {}
    }
    row
}

/// Adds drawn errors to a declaration, and states their uncertainties.
fn with_errors(tip: command::Tip, chance: &mut Stream) -> command::Tip {
    let mut off = |uncertainty: f64| (1.0 + uncertainty * chance.normal()) as f32;
    command::Tip {
        radius_m: tip.radius_m * off(RADIUS),
        radius_uncertainty: RADIUS as f32,
        thickness_m: tip.thickness_m * off(THICKNESS),
        thickness_uncertainty: THICKNESS as f32,
        poisson_ratio: DECLARED_POISSON as f32,
        poisson_uncertainty: POISSON as f32,
        support_m_per_n: tip.support_m_per_n * off(SUPPORT),
        support_uncertainty: SUPPORT as f32,
        ..tip
    }
}

fn print(sensors: &[Vec<Row>], json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let rows = || sensors.iter().flatten();
    if json {
        for row in rows() {
            writeln!(out, "{}", serde_json::to_string(row)?)?;
        }
        return Ok(());
    }
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header([
        "tip",
        "modulus",
        "presses",
        "without a modulus",
        "hold",
        "RMS error of ln E",
        "of ln c_L",
        "median half width",
    ]);
    for kind in ["pin", "ball", "pin on a layer", "ball on a layer"] {
        for young_pa in MODULI_PA {
            let of: Vec<&Row> = rows()
                .filter(|row| row.kind == kind && row.young_pa == young_pa)
                .collect();
            table.add_row(cells(kind, young_pa, &of));
        }
    }
    let coverage = Coverage::of(sensors.iter().map(|rows| {
        let covered: Vec<bool> = rows.iter().filter_map(|row| row.covered).collect();
        (covered.iter().filter(|of| **of).count(), covered.len())
    }));
    writeln!(out, "{BEGIN}")?;
    writeln!(
        out,
        "{} of {} intervals of the modulus contain the truth: {:.1} %, 95 % bounds {:.1} to {:.1} %, on {} \
         sensors.\n",
        coverage.covered,
        coverage.intervals,
        100.0 * coverage.covered as f64 / coverage.intervals.max(1) as f64,
        100.0 * coverage.lower,
        100.0 * coverage.upper,
        sensors.len()
    )?;
    writeln!(out, "{table}")?;
    writeln!(out, "{END}")?;
    coverage.required("modulus")
}

fn cells(kind: &str, young_pa: f64, rows: &[&Row]) -> [String; 8] {
    let rms = |of: fn(&Row) -> Option<f64>| {
        let errors: Vec<f64> = rows.iter().filter_map(|row| of(row)).collect();
        let square = errors.iter().map(|of| of * of).sum::<f64>() / errors.len().max(1) as f64;
        format!("{:.1} %", 100.0 * square.sqrt())
    };
    let mut widths: Vec<f64> = rows.iter().filter_map(|row| row.half_width).collect();
    widths.sort_by(f64::total_cmp);
    let median = widths.get(widths.len() / 2).copied().unwrap_or_default();
    let covered: Vec<bool> = rows.iter().filter_map(|row| row.covered).collect();
    [
        kind.to_owned(),
        pressure(young_pa as f32),
        rows.len().to_string(),
        (rows.len() - covered.len()).to_string(),
        format!(
            "{} of {}",
            covered.iter().filter(|of| **of).count(),
            covered.len()
        ),
        rms(|row| row.modulus_error),
        rms(|row| row.stiffness_error.filter(|_| row.covered.is_some())),
        format!("{:.1} %", 100.0 * median),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without disturbances and without errors of the declaration, only errors of the calibration are left.
    #[test]
    fn the_modulus_of_an_undisturbed_press_is_the_true_one() {
        let stack = Stack::builtin("ultrasoft").unwrap();
        let disturbances = Disturbances::builtin().unwrap();
        let instrument = calibrated(&stack, &disturbances, 3, Switches::none()).unwrap();
        let rows = of_sensor(&instrument, &[300e3], Errors::None).unwrap();
        assert_eq!(rows.len(), 4);
        for row in rows {
            println!("{row:?}");
            let error = row.modulus_error.expect("a modulus");
            assert!(error.abs() < 0.004, "{row:?}");
            assert_eq!(row.covered, Some(true), "{row:?}");
        }
    }
}
