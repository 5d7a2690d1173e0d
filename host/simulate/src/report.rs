//! Report on a row of presses.

use palpate_cli::failure::Failure;
use palpate_cli::plot::{Axis, BLUE, Chart, GREY, Marks, ORANGE, Series};
use palpate_cli::report::{Measurement, Report, Row, Section, Story, charts};
use palpate_wire::{Command, Record};

use crate::instrument::CalibratedInstrument;
use crate::results::{self, COLUMNS, Measured};

/// Builds the page for a row of presses.
pub(crate) fn page(
    instrument: &CalibratedInstrument,
    row: &[Measured],
    title: &str,
) -> Result<String, Failure> {
    let in_force = in_force(instrument);
    Report {
        title: format!("palpate: {title}"),
        about: [title, &results::calibrated(instrument)]
            .map(|text| format!("{text}."))
            .into(),
        columns: &COLUMNS,
        rows: row.iter().map(table_row).collect(),
        summary: Some(results::summary(row)),
        charts: vec![claims(row)],
        sections: row
            .iter()
            .map(|measured| section(&in_force, measured))
            .collect(),
    }
    .page()
}

/// Settings and calibration as records, which the line of a train needs.
fn in_force(instrument: &CalibratedInstrument) -> Vec<Record> {
    let commands = instrument.calibration.commands.iter().cloned();
    let records = commands.filter_map(|command| match command {
        Command::SetSettings(of) => Some(Record::Settings(of)),
        Command::SetSprings(of) => Some(Record::Springs(of)),
        Command::SetStiffeningCurve(of) => Some(Record::StiffeningCurve(of)),
        Command::SetAttraction(of) => Some(Record::Attraction(of)),
        _ => None,
    });
    records.collect()
}

fn table_row(measured: &Measured) -> Row {
    Row {
        cells: measured.cells().into(),
        missed: measured.verdict.holds(measured.pressed.true_n_per_m) == Some(false),
    }
}

fn section(in_force: &[Record], measured: &Measured) -> Section {
    let mut story = Story::default();
    let tip = measured.pressed.tip.clone().map(Record::Tip);
    let in_force: Vec<_> = in_force.iter().cloned().chain(tip).collect();
    story.boot(&in_force);
    for (time_s, record) in measured.pressed.records() {
        story.take(time_s, record.clone());
    }
    let measurement = story.measurements.first();
    let truth = |force_n| measured.pressed.displacement_m(force_n);
    Section {
        heading: format!("{}: {}", measured.load, sentence(measured)),
        text: measurement.map_or(Vec::new(), Measurement::text),
        charts: charts::of_measurement(&story, measurement, Some(&truth)),
        map: None,
    }
}

/// Describes the outcome of a press.
fn sentence(measured: &Measured) -> String {
    let [_, truth, estimate, _, interval, _, _] = measured.cells();
    match measured.verdict.estimate() {
        Some(_) => format!("{estimate}, with 95 % in {interval}; true {truth}"),
        None => format!("refused. {interval}"),
    }
}

/// Chart of the estimates with their intervals against the truth, for all loads.
fn claims(row: &[Measured]) -> Chart {
    let estimates = || {
        row.iter().filter_map(|measured| {
            let truth = measured.pressed.true_n_per_m * 1e-3;
            let estimate = measured.verdict.estimate()?;
            truth.is_finite().then_some((truth, estimate))
        })
    };
    let per_mm = |n_per_m: f32| f64::from(n_per_m) * 1e-3;
    let highest = estimates()
        .filter_map(|(truth, estimate)| Some(truth.max(per_mm(estimate.upper_n_per_m?))))
        .fold(0.0, f64::max);
    let bars = estimates().map(|(truth, estimate)| {
        let low = per_mm(estimate.lower_n_per_m);
        // An interval without an upper end extends beyond the top of the chart.
        let high = estimate.upper_n_per_m.map_or(highest * 3.0, per_mm);
        let value = estimate.stiffness_n_per_m.map_or(high, per_mm);
        (truth, low, value, high)
    });
    let plain = estimates().filter_map(|(truth, estimate)| {
        let plain = estimate.two_state_n_per_m.map(per_mm)?;
        (plain > 0.0).then_some((truth, plain))
    });
    let truths = estimates().map(|(truth, _)| (truth, truth));
    Chart {
        title: "Claims against truth".to_owned(),
        x: Axis::logarithmic("true stiffness of the load, N/mm"),
        y: Axis::logarithmic("claimed, N/mm"),
        series: vec![
            Series::new("truth", GREY, Marks::Line(truths.collect())),
            Series::new("estimate, 95 % interval", BLUE, Marks::Bars(bars.collect())),
            Series::new("plain eq. (2)", ORANGE, Marks::Crosses(plain.collect())),
        ],
    }
}
