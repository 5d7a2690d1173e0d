//! `cargo campaign budget`: each part of the claimed uncertainty against the error that it stands for.
//!
//! Every load is pressed three times on the same sensor, in the same world: first with all disturbances,
//! then without vibration and noise, and last at the bench's temperature as well. The difference of two
//! such presses is the error of one cause; the error of the last one is that of the calibration.

use std::io::{self, Write};
use std::path::Path;

use clap::Args;
use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};
use palpate_cli::describe;
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::failure::Failure;
use palpate_cli::in_order::in_order;
use palpate_cli::progress::Progress;
use palpate_sim::mechanics::contact::Contact;
use palpate_sim::mechanics::load::Load;
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::Holder;
use palpate_simulate::campaign::press::load_name;
use palpate_simulate::engine::{self, Native};
use palpate_simulate::instrument::{CalibratedInstrument, SPEED_M_PER_S, default_settings};
use palpate_simulate::press::{CLEARANCE_M, Press};
use palpate_simulate::verdict::Verdict;
use palpate_wire::record::UncertaintyBudget;
use serde::Serialize;

use crate::drawn::DrawnSensors;

/// Compare each part of the claimed uncertainty with the scatter of the error that it stands for
#[derive(Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    drawn: DrawnSensors,
    /// At how many temperatures each sensor is calibrated
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    temperatures: u8,
}

/// Causes of an error.
const CAUSES: [&str; 4] = ["press", "temperature", "calibration", "all"];

/// Error of c_S/c_L by a cause, with its claimed standard uncertainty, both relative to 1 + c_S/c_L.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Part {
    error: f64,
    claimed: f64,
}

/// Parts of one press, in the order of [`CAUSES`].
#[derive(Clone, Copy, Debug)]
struct Parts {
    ratio: f64,
    of: [Part; CAUSES.len()],
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let drawn = &arguments.drawn;
    let stack = &Stack::named(&drawn.stack, Path::new(""))?;
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let progress = Progress::new(drawn.plants as usize);
    let seed_of = |index: usize| drawn.seed.saturating_add(index as u64);
    let sensor = |index| {
        let parts = of_sensor(arguments, stack, &disturbances, seed_of(index));
        parts.map_err(|failure| failure.to_string())
    };
    let mut presses: Vec<Parts> = Vec::new();
    in_order(drawn.plants as usize, sensor, |index, of_sensor| {
        progress.step();
        match of_sensor {
            Ok(parts) => presses.extend(parts),
            Err(reason) => {
                palpate_cli::notice::say(format_args!("seed {}: {reason}", seed_of(index)));
            }
        }
        Ok(())
    })?;
    progress.finish();
    if presses.is_empty() {
        return Err(Failure::Refused(
            "no press came to an estimate, so that there is nothing to compare".to_owned(),
        ));
    }
    print(arguments, &stack.name, &presses)
}

/// Presses all loads on one sensor; a load that is refused in one of the three worlds is left out.
fn of_sensor(
    arguments: &Arguments,
    stack: &Stack,
    disturbances: &Disturbances,
    seed: u64,
) -> Result<Vec<Parts>, Failure> {
    let calibrate = if arguments.temperatures > 1 {
        CalibratedInstrument::at_two_temperatures
    } else {
        CalibratedInstrument::calibrated
    };
    let all = Switches::all();
    let instrument = calibrate(stack, disturbances, seed, all, &default_settings())?;
    let mut parts = Vec::new();
    for ratio in &arguments.drawn.loads {
        parts.extend(of_load(&instrument, *ratio)?);
    }
    Ok(parts)
}

fn of_load(instrument: &CalibratedInstrument, ratio: f64) -> Result<Option<Parts>, Failure> {
    let all = Switches::all();
    let quiet = Switches {
        vibration: false,
        ldc_noise: false,
        ldc_quantisation: false,
        adc_noise: false,
        ..all
    };
    let on_the_bench = Switches {
        ambient_change: false,
        ..quiet
    };
    let mut pressed = Vec::new();
    for switches in [all, quiet, on_the_bench] {
        pressed.extend(measured(instrument, switches, ratio)?);
    }
    let [as_it_is, quiet, on_the_bench] = pressed.as_slice() else {
        return Ok(None);
    };
    let budget = &as_it_is.budget;
    let square = |part: f32| f64::from(part) * f64::from(part);
    let calibration = [budget.springs, budget.stiffening, budget.zero, budget.bend];
    let whole = 1.0 + as_it_is.true_kappa;
    let part = |error: f64, claimed: f64| Part {
        error: error / whole,
        claimed: claimed / whole,
    };
    Ok(Some(Parts {
        ratio,
        of: [
            part(as_it_is.error - quiet.error, budget.noise.into()),
            part(quiet.error - on_the_bench.error, budget.temperature.into()),
            part(
                on_the_bench.error,
                calibration.map(square).iter().sum::<f64>().sqrt(),
            ),
            part(as_it_is.error, as_it_is.standard_error),
        ],
    }))
}

/// A measured load.
#[derive(Debug)]
struct Measured {
    /// True c_S/c_L, with the c_S that the instrument had at its temperature.
    true_kappa: f64,
    /// Error of c_S/c_L.
    error: f64,
    standard_error: f64,
    budget: UncertaintyBudget,
}

/// Presses a load with these disturbances; `None` if there is no estimate.
fn measured(
    calibrated: &CalibratedInstrument,
    switches: Switches,
    ratio: f64,
) -> Result<Option<Measured>, Failure> {
    let instrument = CalibratedInstrument {
        switches,
        ..calibrated.clone()
    };
    let n_per_m = ratio * instrument.plant.sensing.spring_n_per_m;
    let how = Press {
        name: load_name(ratio),
        load: Load::Spring { n_per_m },
        contact: Contact::default(),
        holder: Holder::Stand,
        clearance_m: CLEARANCE_M,
        depth_m: instrument.depth_m,
        speed_m_per_s: SPEED_M_PER_S,
    };
    let pressed = engine::press(&instrument, &how, &Native)?;
    let verdict = Verdict::of(&pressed);
    let Some(estimate) = verdict.estimate() else {
        return Ok(None);
    };
    let records = pressed.records().map(|(_, record)| record);
    let budget = describe::budget_of(records, estimate.measurement);
    let kappa = f64::from(estimate.load_ratio);
    let true_kappa = estimate
        .stiffness_n_per_m
        .map(|of| kappa * f64::from(of) / pressed.true_n_per_m);
    Ok(budget.zip(true_kappa).map(|(budget, true_kappa)| Measured {
        true_kappa,
        error: kappa - true_kappa,
        standard_error: estimate.load_ratio_standard_error.into(),
        budget: budget.clone(),
    }))
}

fn print(arguments: &Arguments, stack: &str, presses: &[Parts]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if arguments.drawn.json {
        for (load, cause, ratio) in rows(&arguments.drawn.loads, presses) {
            let row = serde_json::json!({ "load": load, "cause": cause, "of": ratio });
            writeln!(out, "{row}")?;
        }
        return Ok(());
    }
    let figure = CAUSES.iter().enumerate().map(|(cause, name)| {
        let parts = presses.iter().filter_map(|press| press.of.get(cause));
        format!("{:.2} ({name})", Ratio::of(parts).standardised)
    });
    writeln!(
        out,
        "{BEGIN}\nThe root mean square of error over claimed standard error is {}.\n\n{} sensors of the stack {stack} from seed {}, \
         all disturbances, each calibrated on its own bench{}. In each cell: root mean square of the error, of its claimed standard \
         uncertainty, both in per cent of 1 + c_S/c_L, and of the error over what is claimed.\n\n{}\n{END}",
        figure.collect::<Vec<_>>().join(", "),
        arguments.drawn.plants,
        arguments.drawn.seed,
        if arguments.temperatures > 1 {
            " at two temperatures"
        } else {
            ""
        },
        table(&arguments.drawn.loads, presses)
    )?;
    Ok(())
}

/// Each cause at each load.
fn rows<'p>(
    loads: &'p [f64],
    presses: &'p [Parts],
) -> impl Iterator<Item = (String, &'static str, Ratio)> {
    loads.iter().flat_map(move |ratio| {
        CAUSES.iter().enumerate().map(move |(index, cause)| {
            let of_load = presses.iter().filter(|press| press.ratio == *ratio);
            let parts = of_load.filter_map(|press| press.of.get(index));
            (load_name(*ratio), *cause, Ratio::of(parts))
        })
    })
}

fn table(loads: &[f64], presses: &[Parts]) -> Table {
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header(["load"].into_iter().chain(CAUSES));
    let rows: Vec<_> = rows(loads, presses).collect();
    for of_load in rows.chunks(CAUSES.len()) {
        let load = of_load.first().map(|(load, ..)| load.clone());
        let cells = of_load.iter().map(|(.., ratio)| {
            format!(
                "{:.3}; {:.3}; {:.2}",
                ratio.error * 100.0,
                ratio.claimed * 100.0,
                ratio.standardised
            )
        });
        table.add_row(load.into_iter().chain(cells));
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Root mean squares of parts.
#[derive(Debug, Serialize)]
struct Ratio {
    error: f64,
    claimed: f64,
    standardised: f64,
}

impl Ratio {
    fn of<'p>(parts: impl Iterator<Item = &'p Part>) -> Self {
        let parts: Vec<&Part> = parts.collect();
        let root_mean_square = |of: fn(&Part) -> f64| {
            let squares = parts.iter().map(|part| of(part).powi(2));
            (squares.sum::<f64>() / parts.len() as f64).sqrt()
        };
        Self {
            error: root_mean_square(|part| part.error),
            claimed: root_mean_square(|part| part.claimed),
            standardised: root_mean_square(|part| part.error / part.claimed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small version of the campaign: the parts of an error add up to the error, and the squares
    /// of the claimed parts to the square of the claim.
    #[test]
    fn the_parts_add_up() {
        let arguments = Arguments {
            drawn: DrawnSensors {
                plants: 1,
                seed: 1,
                stack: "ultrasoft".to_owned(),
                loads: vec![1.0],
                json: false,
            },
            temperatures: 1,
        };
        let stack = Stack::builtin("ultrasoft").unwrap();
        let presses = of_sensor(&arguments, &stack, &Disturbances::builtin().unwrap(), 1).unwrap();
        let [Parts { of, .. }] = presses.as_slice() else {
            panic!("one press of one load: {presses:?}");
        };
        let [press, temperature, calibration, all] = of;
        let errors = press.error + temperature.error + calibration.error;
        assert!((errors - all.error).abs() < 1e-12, "{of:?}");
        let squares = [press, temperature, calibration].map(|part| part.claimed.powi(2));
        let claimed = squares.iter().sum::<f64>().sqrt();
        assert!((claimed / all.claimed - 1.0).abs() < 1e-5, "{of:?}");
        assert!(press.error != 0.0 && temperature.error != 0.0 && calibration.error != 0.0);
    }
}
