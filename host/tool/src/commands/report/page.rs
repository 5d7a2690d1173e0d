//! The HTML page.

use maud::{Markup, PreEscaped, html};
use palpate_cli::describe;
use palpate_cli::describe::stiffness;
use palpate_cli::failure::Failure;
use palpate_cli::page::document;
use palpate_cli::plot::Chart;
use palpate_wire::record::Estimate;

use super::charts;
use super::story::{Measurement, RecordingSummary};
use crate::recording::date;

const COLUMNS: [&str; 6] = [
    "measurement",
    "time",
    "stiffness",
    "95 % interval",
    "force",
    "temperature",
];

pub(super) fn page(story: &RecordingSummary) -> Result<String, Failure> {
    let whole = [charts::FORCE, charts::FREQUENCY];
    let whole = drawn(whole.map(|of| charts::over_time(story, of, None)))?;
    let sections = story.measurements.iter().map(|of| section(story, of));
    let sections = sections.collect::<Result<Vec<Markup>, Failure>>()?;
    Ok(document(
        &format!("palpate: {}", story.file),
        &html! {
            h1 { "Stiffness of the pressed objects" }
            p { (title(story)) }
            @for boot in story.contents.boots() { p { "Of " (boot.sentence()) "." } }
            @if story.measurements.is_empty() {
                p { "There is no measurement in it: `palpate record --arm` records them." }
            } @else { (table(story)) }
            div.charts { @for drawing in &whole { (PreEscaped(drawing)) } }
            @for section in &sections { (section) }
        },
    ))
}

fn title(story: &RecordingSummary) -> String {
    let began = story.contents.began_ns().map(date::text);
    format!(
        "Recording {} of {}, from {}, {:.1} s.",
        story.file,
        story.board,
        began.unwrap_or_default(),
        story.contents.duration_s()
    )
}

fn table(story: &RecordingSummary) -> Markup {
    html! {
        table {
            thead { tr { @for column in COLUMNS { th { (column) } } } }
            tbody {
                @for measurement in &story.measurements {
                    tr { @for cell in cells(measurement) { td { (cell) } } }
                }
            }
        }
    }
}

fn cells(measurement: &Measurement) -> [String; COLUMNS.len()] {
    let at = format!("{:.2} s", measurement.at_s);
    match &measurement.result {
        Ok(estimate) => [
            estimate.measurement.to_string(),
            at,
            value(estimate),
            interval(estimate),
            format!("{:.3} N", estimate.force_n),
            estimate
                .temperature_c
                .map_or(String::new(), |of| format!("{of:.1} °C")),
        ],
        Err(refusal) => [
            String::new(),
            at,
            "refused".to_owned(),
            describe::refusal(refusal),
            String::new(),
            String::new(),
        ],
    }
}

fn value(estimate: &Estimate) -> String {
    let value = estimate.stiffness_n_per_m.map(f64::from);
    value.map_or("as if rigid".to_owned(), stiffness)
}

fn interval(estimate: &Estimate) -> String {
    let lower = stiffness(estimate.lower_n_per_m.into());
    match estimate.upper_n_per_m {
        Some(upper) => format!("{lower} to {}", stiffness(upper.into())),
        None => format!("{lower} or more"),
    }
}

fn section(story: &RecordingSummary, measurement: &Measurement) -> Result<Markup, Failure> {
    let over_time = [charts::DEFORMATION, charts::CURRENT];
    let over_time = over_time.map(|of| charts::over_time(story, of, Some(measurement)));
    let line = measurement.line.as_ref().map(charts::line);
    let curve = charts::load_curve(&measurement.points);
    let drawings = drawn(over_time.into_iter().chain([line, curve]))?;
    let sentence = match &measurement.result {
        Ok(estimate) => format!(
            "Measurement {}: {}, with 95 % in {}",
            estimate.measurement,
            value(estimate),
            interval(estimate)
        ),
        Err(refusal) => format!(
            "At {:.2} s: refused. {}",
            measurement.at_s,
            describe::refusal(refusal)
        ),
    };
    Ok(html! {
        section {
            h2 { (sentence) }
            @if let Some(text) = &measurement.limited_by { p { (text) } }
            div.charts { @for drawing in &drawings { (PreEscaped(drawing)) } }
        }
    })
}

fn drawn(charts: impl IntoIterator<Item = Option<Chart>>) -> Result<Vec<String>, Failure> {
    charts
        .into_iter()
        .flatten()
        .map(|chart| chart.svg())
        .collect()
}
