//! The report: one HTML page with everything in it, charts as SVG.

pub(crate) mod charts;
mod evaluation;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::failure::Failure;
use crate::instrument::CalibratedInstrument;
use crate::results::{self, COLUMNS, Measured};
use evaluation::Evaluation;

/// Readable on a screen and on A4: two charts beside each other, a load never torn apart.
const STYLE: &str = "
:root { color-scheme: light; background: #fff }
body { font: 15px/1.4 sans-serif; max-width: 1100px; margin: 1.5em auto; padding: 0 1em; color: #111 }
h1 { font-size: 1.5em } h2 { font-size: 1.15em; margin: 1.6em 0 .3em }
table { border-collapse: collapse; margin: 1em 0 } th, td { padding: .2em .9em; text-align: right }
th { border-bottom: 1px solid #111 } th:first-child, td:first-child { text-align: left }
tr.missed td { color: #b00; font-weight: bold }
section { break-inside: avoid } .charts { display: grid; grid-template-columns: 1fr 1fr; gap: .6em }
svg { width: 100%; height: auto } .wide { max-width: 760px }
@media print { body { max-width: none; margin: 0; font-size: 11px } }
";

/// A page that stands alone.
pub(crate) fn document(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { (body) }
        }
    };
    page.into_string()
}

/// The page of a row of presses.
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
            h1 { "How stiff is what presses?" }
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
        .map(crate::plot::Chart::svg)
        .collect::<Result<Vec<String>, Failure>>()?;
    Ok(html! {
        section {
            h2 { (measured.load) ": " (sentence(measured)) }
            div.charts { @for drawing in &drawings { (PreEscaped(drawing)) } }
        }
    })
}

/// What came of a press.
fn sentence(measured: &Measured) -> String {
    let [_, truth, estimate, _, interval, _, _] = measured.cells();
    match measured.verdict.estimate() {
        Some(_) => format!("{estimate}, with 95 % in {interval}; true {truth}"),
        None => format!("refused. {interval}"),
    }
}
