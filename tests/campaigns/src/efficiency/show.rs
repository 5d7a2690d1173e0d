//! Output of the results beside their bounds: figures, tables, JSON.

use std::io::{self, Write};

use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::failure::Failure;
use serde::Serialize;

use super::arguments::Arguments;
use super::judged_press::JudgedPress;

/// Results of one load, as rms of ln, and efficiencies: variance of a bound over the measured
/// variance.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Efficiency {
    pub(super) ratio: f64,
    pub(super) presses: usize,
    pub(super) measured_rms_ln: f64,
    pub(super) planned_rms_ln: f64,
    /// Bound from all readings.
    pub(super) bound_rms_ln: f64,
    /// Bound for an exactly known sensor.
    pub(super) sensor_known_rms_ln: f64,
    /// Bound from the falls alone.
    pub(super) falls_rms_ln: f64,
    /// Bound from the falls, with presses that may drift.
    pub(super) drifting_rms_ln: f64,
    /// Bound from the falls, with presses that may drift, without information from the coil's own
    /// heat.
    pub(super) without_own_heat_rms_ln: f64,
    /// Efficiency of the whole chain.
    pub(super) efficiency: f64,
    /// Standard error of that efficiency, from the number of presses.
    pub(super) efficiency_standard_error: f64,
    /// Efficiency relative to the information that the chain uses.
    pub(super) efficiency_without_own_heat: f64,
}

impl Efficiency {
    pub(super) fn of(ratio: f64, presses: &[JudgedPress]) -> Option<Self> {
        let of_load: Vec<&JudgedPress> = presses
            .iter()
            .filter(|press| press.ratio == ratio)
            .collect();
        let count = of_load.len() as f64;
        let mean = |of: &dyn Fn(&JudgedPress) -> f64| {
            of_load.iter().map(|press| of(press)).sum::<f64>() / count
        };
        let measured = mean(&|press| press.error_ln.powi(2));
        // Uncertainty of the mean of the squares, from their scatter.
        let of_square = mean(&|press| (press.error_ln.powi(2) - measured).powi(2));
        let relative = (of_square / (count - 1.0)).sqrt() / measured;
        let [sensor_known, whole, falls, drifting, without_own_heat] =
            core::array::from_fn(|rung| {
                mean(&|press| press.bounds.get(rung).copied().unwrap_or(0.0))
            });
        (count > 1.0).then(|| Self {
            ratio,
            presses: of_load.len(),
            measured_rms_ln: measured.sqrt(),
            planned_rms_ln: mean(&|press| press.planned).sqrt(),
            bound_rms_ln: whole.sqrt(),
            sensor_known_rms_ln: sensor_known.sqrt(),
            falls_rms_ln: falls.sqrt(),
            drifting_rms_ln: drifting.sqrt(),
            without_own_heat_rms_ln: without_own_heat.sqrt(),
            efficiency: whole / measured,
            efficiency_standard_error: whole / measured * relative,
            efficiency_without_own_heat: without_own_heat / measured,
        })
    }
}

pub(super) fn print(
    arguments: &Arguments,
    stack: &str,
    loads: &[Efficiency],
    left_out: usize,
) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if arguments.json {
        for load in loads {
            writeln!(out, "{}", serde_json::to_string(load)?)?;
        }
        return Ok(());
    }
    let percent = |part: f64| format!("{:.2} %", part * 100.0);
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header([
        "load",
        "presses",
        "sensor known",
        "all that is read",
        "falls alone",
        "presses may drift",
        "own heat unused",
        "planned",
        "measured",
        "efficiency: of all that is read",
        "of what the chain uses",
    ]);
    for load in loads {
        let errors = [
            load.sensor_known_rms_ln,
            load.bound_rms_ln,
            load.falls_rms_ln,
            load.drifting_rms_ln,
            load.without_own_heat_rms_ln,
            load.planned_rms_ln,
            load.measured_rms_ln,
        ];
        let start = [format!("{} c_S", load.ratio), load.presses.to_string()];
        let efficiencies = [
            format!(
                "{:.3} ± {:.3}",
                load.efficiency, load.efficiency_standard_error
            ),
            format!("{:.2}", load.efficiency_without_own_heat),
        ];
        let errors = errors.map(percent).into_iter();
        table.add_row(start.into_iter().chain(errors).chain(efficiencies));
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let of_loads = |of: &dyn Fn(&Efficiency) -> String| -> String {
        loads.iter().map(of).collect::<Vec<_>>().join(", ")
    };
    writeln!(
        out,
        "{BEGIN}\nAt {} the RMS error (ln) is {} where `palpate plan` expects {}. Bound over measured variance: {} for the data that \
         the chain uses, {} for everything that bench and press read.\n\n\
         {} sensors of the stack {stack} from seed {}, all disturbances, each calibrated on its own simulated bench{}. \
         {left_out} presses without an estimate are left out.\n\n\
         Root mean squares of ln(estimate/truth). From left to right, less is known or used: bounds where everything of the sensor \
         is known; of all that bench and press read; of the falls alone; where a press may drift, so that creep says nothing of the \
         load; and where what the coil's own heat shows of the temperature's coefficients is not used. Then what `palpate plan` \
         expects of these sensors at their temperatures, and what was measured. Efficiency: variance of a bound over the variance \
         that was measured, of all that is read, with the standard error that so many presses \
         leave, and of the last of the bounds.\n\n{table}\n{END}",
        of_loads(&|load| format!("{} c_S", load.ratio)),
        of_loads(&|load| percent(load.measured_rms_ln)),
        of_loads(&|load| percent(load.planned_rms_ln)),
        of_loads(&|load| format!("{:.2}", load.efficiency_without_own_heat)),
        of_loads(&|load| format!("{:.3}", load.efficiency)),
        arguments.plants,
        arguments.seed,
        if arguments.bench_temperature {
            " and pressed at its temperature"
        } else {
            ""
        },
    )?;
    Ok(())
}
