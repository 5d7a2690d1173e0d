//! A plan as tables, as JSON and as a chart.

use std::fmt::Write as _;

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use palpate_cli::describe::stiffness;
use palpate_cli::plot::{Axis, BLUE, Chart, GREEN, GREY, Marks, ORANGE, Series};
use serde::Serialize;
use serde_json::{Map, Value};

use super::causes::{Cause, Quantity};
use super::expected::{ASSUMED_FROM, ExpectedError};
use super::result::Plan;
use super::search::{COMPARED, ComparedTrain};

/// Formats the plan for the terminal.
pub(super) fn text(plan: &Plan) -> String {
    let mut text = String::new();
    let sensor = &plan.sensor;
    let peak_a = f64::from(sensor.settings.peak_current_a);
    // Writing to a `String` cannot fail.
    let _ = writeln!(
        text,
        "Stack {}: c_S {}, c_D {}, {:.1} % stiffer at {peak_a:.1} A; pressed to {:.2} mm, {:.1} K from the bench's temperature",
        plan.stack,
        stiffness(sensor.plant.sensing.spring_n_per_m),
        stiffness(sensor.plant.actuated.spring_n_per_m),
        sensor.rise(peak_a) * 100.0,
        plan.press.depth * sensor.depth_m * 1e3,
        plan.press.away_k,
    );
    let _ = writeln!(
        text,
        "\nStandard error of ln(c_L) of one press, and what it comes from:\n{}\n{}",
        errors(&plan.errors),
        assumed(plan)
    );
    let _ = writeln!(
        text,
        "\nThe part of it that would vanish if the bench gave one quantity exactly:\n{}",
        quantities(&plan.errors)
    );
    let _ = writeln!(
        text,
        "\nTrains within {:.0} J, {:.0} °C and {:.1} s of contact; each needs a calibration of its own:\n{}",
        sensor.settings.greatest_energy_j,
        sensor.settings.greatest_temperature_c,
        plan.contact_s,
        trains(&plan.trains)
    );
    text
}

/// States the origin of the causes that are not computed.
fn assumed(plan: &Plan) -> String {
    let found =
        format!("Creep and model were found with simulated sensors of the stack {ASSUMED_FROM}");
    if plan.is_assumed {
        format!(
            "{found}; for this one they are assumed. In a checkout, `cargo campaign efficiency --bench-temperature --stack FILE.toml` counts errors of sensors of it."
        )
    } else {
        format!("{found}.")
    }
}

fn percent(part: f64) -> String {
    format!("{:.2} %", part * 100.0)
}

fn table(header: Vec<String>, rows: Vec<Vec<String>>, left: &[usize]) -> Table {
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header(header);
    table.add_rows(rows);
    for (index, column) in table.column_iter_mut().enumerate() {
        if !left.contains(&index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

fn load(error: &ExpectedError) -> String {
    format!("{} c_S", error.load)
}

fn errors(errors: &[ExpectedError]) -> Table {
    let causes = Cause::ALL.map(|cause| words(cause.name()));
    let mut header: Vec<String> = ["load", "error", "95 % within"].map(str::to_owned).to_vec();
    header.extend(causes);
    header.push("limited by".to_owned());
    let last = header.len() - 1;
    let row = |error: &ExpectedError| {
        let half = error
            .half_width_ln
            .map_or("no upper end".to_owned(), |half| {
                format!("± {}", percent(half))
            });
        let mut row = vec![load(error), percent(error.standard_error_ln), half];
        row.extend(error.causes_ln.map(percent));
        row.push(match error.refusal {
            Some(refusal) => format!("refused: {}", words(refusal)),
            None => words(error.limit().name()),
        });
        row
    };
    table(header, errors.iter().map(row).collect(), &[0, last])
}

fn quantities(errors: &[ExpectedError]) -> Table {
    let names = Quantity::ALL.map(|quantity| words(quantity.name()));
    let header = core::iter::once("load".to_owned()).chain(names).collect();
    let row = |error: &ExpectedError| {
        let values = error.quantities_ln.map(percent);
        core::iter::once(load(error)).chain(values).collect()
    };
    table(header, errors.iter().map(row).collect(), &[0])
}

fn trains(trains: &[ComparedTrain]) -> Table {
    let mut header: Vec<String> = [
        "best of", "ramps", "fall", "rate", "RCOUNT", "peak", "energy", "lasts",
    ]
    .map(str::to_owned)
    .to_vec();
    header.extend(COMPARED.map(|load| format!("at {load} c_S")));
    header.extend(["gain", "limited by"].map(str::to_owned));
    let last = header.len() - 1;
    let row = |compared: &ComparedTrain| {
        let train = &compared.train;
        let mut row = vec![
            compared.change.to_owned(),
            train.choice.ramps.to_string(),
            format!("{:.0} ms", train.choice.fall_s * 1e3),
            format!("{} Hz", train.choice.rate_hz),
            train.rcount.to_string(),
            format!("{:.1} A", train.choice.peak_a),
            format!("{:.1} J", train.heat.energy_j),
            format!("{:.2} s", train.heat.lasts_s),
        ];
        row.extend(train.errors_ln.map(percent));
        row.push(format!("{:.1} %", gain(trains, compared) * 100.0));
        row.push(
            compared
                .limit
                .map_or(String::new(), |limit| words(limit.name())),
        );
        row
    };
    table(header, trains.iter().map(row).collect(), &[0, last])
}

/// Relative reduction of the errors compared with the first train, as the geometric mean over the
/// loads.
fn gain(trains: &[ComparedTrain], compared: &ComparedTrain) -> f64 {
    let first = trains.first().map_or(0.0, |first| first.train.score());
    1.0 - (compared.train.score() - first).exp()
}

/// Formats a key as words.
fn words(key: &str) -> String {
    match key {
        "c_D0" => key.to_owned(),
        "crosstalk" => "cross-talk".to_owned(),
        "crosstalk_growth" => "its growth".to_owned(),
        key => key.replace('_', " "),
    }
}

/// Causes whose size is taken from [`ASSUMED_FROM`].
const NOT_COMPUTED: [&str; 2] = [Cause::Creep.name(), Cause::Model.name()];

/// The plan as JSON.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct PlanDocument<'p> {
    stack: &'p str,
    depth_m: f64,
    temperature_away_K: f64,
    contact_s: f64,
    /// Causes determined with another design and assumed for this one.
    assumed_causes: &'static [&'static str],
    loads: Vec<LoadEntry>,
    trains: Vec<TrainEntry>,
}

#[derive(Serialize)]
struct LoadEntry {
    ratio: f64,
    standard_error_ln: f64,
    half_width_ln: Option<f64>,
    refusal: Option<&'static str>,
    limit: &'static str,
    causes_ln: Map<String, Value>,
    quantities_ln: Map<String, Value>,
}

#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct TrainEntry {
    change: &'static str,
    ramps: u8,
    fall_s: f32,
    rate_Hz: u16,
    rcount: u16,
    peak_A: f32,
    energy_J: f64,
    hottest_degC: f64,
    duration_s: f64,
    ratios: [f64; COMPARED.len()],
    standard_errors_ln: [f64; COMPARED.len()],
    gain: f64,
    limit: Option<&'static str>,
}

/// Formats the plan as one JSON object.
pub(super) fn json(plan: &Plan) -> serde_json::Result<String> {
    let named = |names: &[&str], values: &[f64]| {
        let pairs = names.iter().zip(values);
        pairs
            .map(|(name, value)| ((*name).to_owned(), Value::from(*value)))
            .collect()
    };
    let loads = plan.errors.iter().map(|error| LoadEntry {
        ratio: error.load,
        standard_error_ln: error.standard_error_ln,
        half_width_ln: error.half_width_ln,
        refusal: error.refusal,
        limit: error.limit().name(),
        causes_ln: named(&Cause::ALL.map(Cause::name), &error.causes_ln),
        quantities_ln: named(&Quantity::ALL.map(Quantity::name), &error.quantities_ln),
    });
    let trains = plan.trains.iter().map(|compared| TrainEntry {
        change: compared.change,
        ramps: compared.train.choice.ramps,
        fall_s: compared.train.choice.fall_s,
        rate_Hz: compared.train.choice.rate_hz,
        rcount: compared.train.rcount,
        peak_A: compared.train.choice.peak_a,
        energy_J: compared.train.heat.energy_j,
        hottest_degC: compared.train.heat.hottest_c,
        duration_s: compared.train.heat.lasts_s,
        ratios: COMPARED,
        standard_errors_ln: compared.train.errors_ln,
        gain: gain(&plan.trains, compared),
        limit: compared.limit.map(super::search::TrainLimit::name),
    });
    serde_json::to_string(&PlanDocument {
        stack: &plan.stack,
        depth_m: plan.press.depth * plan.sensor.depth_m,
        temperature_away_K: plan.press.away_k,
        contact_s: plan.contact_s,
        assumed_causes: if plan.is_assumed { &NOT_COMPUTED } else { &[] },
        loads: loads.collect(),
        trains: trains.collect(),
    })
}

/// Chart of the errors against the load, with the main causes.
pub(super) fn chart(plan: &Plan, errors: &[ExpectedError]) -> Chart {
    let line = |name: &str, colour, of: &dyn Fn(&ExpectedError) -> f64| Series {
        name: name.to_owned(),
        colour,
        marks: Marks::Line(
            errors
                .iter()
                .map(|error| (error.load, of(error) * 100.0))
                .collect(),
        ),
    };
    let cause = |cause: Cause, colour| {
        line(&words(cause.name()), colour, &move |error| {
            let causes = Cause::ALL.into_iter().zip(error.causes_ln);
            causes
                .filter(|(of, _)| *of == cause)
                .map(|(_, value)| value)
                .sum()
        })
    };
    Chart {
        title: format!("Expected error of a press, stack {}", plan.stack),
        x: Axis::logarithmic("c_L/c_S"),
        y: Axis::logarithmic("standard error of ln(c_L), %"),
        series: vec![
            line("all", BLUE, &|error| error.standard_error_ln),
            cause(Cause::Temperature, ORANGE),
            cause(Cause::Model, palpate_cli::plot::BLACK),
            cause(Cause::Springs, GREEN),
            cause(Cause::Creep, GREY),
            cause(Cause::Conversions, palpate_cli::plot::PURPLE),
            cause(Cause::Vibration, palpate_cli::plot::YELLOW),
        ],
    }
}
