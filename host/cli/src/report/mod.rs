//! Report on measurements, from a recording or a simulation: a self-contained page with charts.

pub mod charts;
mod story;
mod touches;

use maud::{Markup, PreEscaped, html};
pub use story::{Measurement, Story};
pub use touches::section as of_touches;

use crate::failure::Failure;
use crate::page::document;
use crate::plot::Chart;
use crate::touch_map::{self, TouchMap};

/// Content of a report.
#[derive(Debug)]
pub struct Report {
    /// Title of the page.
    pub title: String,
    /// Description of the measurements, one string per paragraph.
    pub about: Vec<String>,
    /// Column headings of the table.
    pub columns: &'static [&'static str],
    /// Rows of the table, one per measurement.
    pub rows: Vec<Row>,
    /// Result of all measurements in words.
    pub summary: Option<String>,
    /// Charts of all measurements together.
    pub charts: Vec<Chart>,
    /// Sections, one per measurement.
    pub sections: Vec<Section>,
}

/// A row of the table.
#[derive(Debug)]
pub struct Row {
    /// Text under each heading.
    pub cells: Vec<String>,
    /// Whether the interval misses the truth.
    pub missed: bool,
}

/// Section about one measurement.
#[derive(Debug)]
pub struct Section {
    /// Name and result.
    pub heading: String,
    /// Modulus and hardness, and what limits the result: a paragraph each.
    pub text: Vec<String>,
    /// Its charts.
    pub charts: Vec<Chart>,
    /// Map beside the charts.
    pub map: Option<TouchMap>,
}

impl Report {
    /// Builds the page.
    pub fn page(&self) -> Result<String, Failure> {
        let charts = drawn(&self.charts)?;
        let sections = self.sections.iter().map(section);
        let sections = sections.collect::<Result<Vec<Markup>, Failure>>()?;
        Ok(document(
            &self.title,
            &html! {
                h1 { "Stiffness of the pressed objects" }
                @for text in &self.about { p { (text) } }
                @if !self.rows.is_empty() { (self.table()) }
                @if let Some(text) = &self.summary { p { (text) } }
                div.wide[self.charts.len() == 1].charts[self.charts.len() > 1] { (charts) }
                @for section in &sections { (section) }
            },
        ))
    }

    fn table(&self) -> Markup {
        html! {
            table {
                thead { tr { @for column in self.columns { th { (column) } } } }
                tbody {
                    @for row in &self.rows {
                        tr.missed[row.missed] { @for cell in &row.cells { td { (cell) } } }
                    }
                }
            }
        }
    }
}

fn section(section: &Section) -> Result<Markup, Failure> {
    let charts = drawn(&section.charts)?;
    let map = section.map.as_ref();
    let map = map.map(|map| PreEscaped(touch_map::svg(std::slice::from_ref(map))));
    Ok(html! {
        section {
            h2 { (section.heading) }
            @for text in &section.text { p { (text) } }
            div.charts { @if let Some(map) = &map { (map) } (charts) }
        }
    })
}

fn drawn(charts: &[Chart]) -> Result<Markup, Failure> {
    let drawings = charts.iter().map(Chart::svg);
    Ok(PreEscaped(drawings.collect::<Result<String, Failure>>()?))
}
