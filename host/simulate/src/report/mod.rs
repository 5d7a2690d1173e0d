//! Report: a self-contained HTML page with charts as SVG.

mod charts;
mod evaluation;

use evaluation::Evaluation;
use maud::{Markup, PreEscaped, html};
use palpate_cli::failure::Failure;
use palpate_cli::page::document;

use crate::instrument::CalibratedInstrument;
use crate::results::{self, COLUMNS, Measured};

/// Builds the page for a row of presses.
pub(crate) fn page(
    instrument: &CalibratedInstrument,
    row: &[Measured],
    title: &str,
) -> Result<String, Failure> {
    let claims = charts::claims(row).svg()?;
    let sections = row
        .iter()
        .map(|measured| section(instrument, measured))
        .collect::<Result<Vec<Markup>, Failure>>()?;
    Ok(document(
        &format!("palpate: {title}"),
        &html! {
            h1 { "Stiffness of the pressed objects" }
            p { (title) "." }
            p { (results::calibrated(instrument)) "." }
            (table(row))
            p { (results::summary(row)) }
            div.wide { (PreEscaped(claims)) }
            @for section in &sections { (section) }
        },
    ))
}

fn table(row: &[Measured]) -> Markup {
    html! {
        table {
            thead { tr { @for column in COLUMNS { th { (column) } } } }
            tbody {
                @for measured in row {
                    @let missed = measured.verdict.holds(measured.pressed.true_n_per_m) == Some(false);
                    tr.missed[missed] { @for cell in measured.cells() { td { (cell) } } }
                }
            }
        }
    }
}

fn section(instrument: &CalibratedInstrument, measured: &Measured) -> Result<Markup, Failure> {
    let mut drawings = vec![charts::deformation(measured), charts::current(measured)];
    if let Some(evaluation) = Evaluation::of(instrument, measured) {
        drawings.push(charts::line(&evaluation));
        drawings.push(charts::residuals(&evaluation));
    }
    drawings.extend(charts::load_curve(measured));
    let drawings = drawings
        .iter()
        .map(palpate_cli::plot::Chart::svg)
        .collect::<Result<Vec<String>, Failure>>()?;
    Ok(html! {
        section {
            h2 { (measured.load) ": " (sentence(measured)) }
            div.charts { @for drawing in &drawings { (PreEscaped(drawing)) } }
        }
    })
}

/// Describes the outcome of a press.
fn sentence(measured: &Measured) -> String {
    let [_, truth, estimate, _, interval, _, _] = measured.cells();
    match measured.verdict.estimate() {
        Some(_) => format!("{estimate}, with 95 % in {interval}; true {truth}"),
        None => format!("refused. {interval}"),
    }
}
