//! Reading tables of H and B from files.

use toml::Spanned;

use super::Reader;
use super::beside::Beside;
use crate::design::DesignError;
use crate::material::{BhCurve, MU_0};

const COLUMNS: &str = "two columns, H in A/m and B in T; decimal commas with ; or tabs between the columns; # or % before headings and comments";
/// Largest number of points, more than any table has.
const MOST_POINTS: usize = 10_000;

impl Reader<'_> {
    /// Reads the magnetisation curve from a table in a file.
    pub(super) fn bh_table(
        &self,
        name: &Spanned<String>,
        place: &str,
    ) -> Result<BhCurve, DesignError> {
        let beside = self.beside(name, place)?;
        let mut lines = Vec::new();
        let mut points = Vec::new();
        for (line, row) in (1..).zip(beside.text.lines()) {
            let row = row.trim();
            if row.is_empty() || row.starts_with(['#', '%']) {
                continue;
            }
            if points.len() == MOST_POINTS {
                let allowed = format!("at most {MOST_POINTS}");
                return Err(beside.error(line, "too many points", &allowed));
            }
            points.push(point(&beside, line, row)?);
            lines.push(line);
        }
        let curve = BhCurve::through(&points).map_err(|error| {
            let line = lines.get(error.point).copied().unwrap_or(1);
            let allowed = format!("{}{}", error.allowed, suspicion(&points));
            beside.error(line, error.problem, &allowed)
        })?;
        self.note(&beside, summary(&points, &curve));
        Ok(curve)
    }
}

/// Reads H and B from a row, in which semicolons, tabs, blanks or commas separate the columns.
/// Between semicolons or tabs, a comma is a decimal mark.
fn point(beside: &Beside, line: usize, row: &str) -> Result<[f64; 2], DesignError> {
    let decimal_comma = row.contains([';', '\t']) && row.contains(',');
    if decimal_comma && row.contains('.') {
        let problem = "has points and commas in its numbers";
        return Err(beside.error(line, problem, "one decimal mark, and none for thousands"));
    }
    let parted = |character: char| {
        character == ';' || character.is_whitespace() || (character == ',' && !decimal_comma)
    };
    let columns: Vec<&str> = row.split(parted).filter(|text| !text.is_empty()).collect();
    let &[h, b] = columns.as_slice() else {
        let problem = format!("has {} columns", columns.len());
        return Err(beside.error(line, problem, COLUMNS));
    };
    let number = |text: &str| {
        let number = text.replace(',', ".").parse::<f64>();
        number.map_err(|_| beside.error(line, format!("{text:?} is no number"), COLUMNS))
    };
    Ok([number(h)?, number(b)?])
}

/// Converts a row whose two columns contain other quantities or units to H in A/m and B in T.
type Reading = fn([f64; 2]) -> [f64; 2];

/// One oersted, A/m.
const OERSTED: f64 = 1e3 / (4.0 * core::f64::consts::PI);
/// Other quantities and units that the two columns of programs and data sheets often contain.
const READINGS: [(&str, Reading); 9] = [
    ("B in T before H in A/m: swap the columns", |[b, h]| [h, b]),
    ("H in A/m and B in mT", |[h, b]| [h, 1e-3 * b]),
    ("H in kA/m and B in T", |[h, b]| [1e3 * h, b]),
    ("H in kA/m and B in mT", |[h, b]| [1e3 * h, 1e-3 * b]),
    ("H in Oe and B in G", |[h, b]| [OERSTED * h, 1e-4 * b]),
    ("H in Oe and B in kG", |[h, b]| [OERSTED * h, 0.1 * b]),
    ("B in G before H in Oe", |[b, h]| [OERSTED * h, 1e-4 * b]),
    ("H and J = B - mu0 H", |[h, j]| [h, j + MU_0 * h]),
    ("H and M in A/m", |[h, m]| [h, MU_0 * (m + h)]),
];

/// Quantities and units that the columns probably contain, as an addition to an error message.
fn suspicion(points: &[[f64; 2]]) -> String {
    let fits = |reading: &Reading| plausible(points.iter().map(|&point| reading(point)));
    let readings = READINGS.iter().filter(|(_, reading)| fits(reading));
    let names: Vec<&str> = readings.map(|(name, _)| *name).collect();
    if names.is_empty() || plausible(points.iter().copied()) {
        return String::new();
    }
    format!(" (the columns look like {})", names.join(", or "))
}

/// Whether points resemble those of a soft magnetic material: B rises with H, by at least four
/// fifths of its rise in vacuum, to a polarisation of 0.05 to 2.5 T; the relative permeability is 1
/// to 1e6.
fn plausible(points: impl Iterator<Item = [f64; 2]>) -> bool {
    let points: Vec<[f64; 2]> = points.filter(|[h, _]| *h != 0.0).collect();
    let rises = |[h0, b0]: &[f64; 2], [h, b]: &[f64; 2]| h > h0 && b - b0 >= 0.8 * MU_0 * (h - h0);
    let permeable = |[h, b]: &[f64; 2]| (1.0..1e6).contains(&(b / (MU_0 * h)));
    let end = points.last().map(|[h, b]| b - MU_0 * h);
    points.is_sorted_by(rises)
        && points.iter().all(permeable)
        && end.is_some_and(|j| (0.05..2.5).contains(&j))
}

/// Greatest slope at the end of a table, in multiples of vacuum's. Above it, the table ends before
/// saturation, or H is in kA/m or Oe: of the 29 curves of FEMM's library, 28 end below 14.
const UNSATURATED: f64 = 50.0;

/// Summary of the table in words.
fn summary(points: &[[f64; 2]], curve: &BhCurve) -> String {
    let [h, b] = curve.end();
    let doubt = if curve.end_mu_r() > UNSATURATED {
        " (so it ends before saturation, or H is not in A/m)"
    } else {
        ""
    };
    format!(
        "{} points to {b} T at {h} A/m, where B rises {:.1} times as steeply as in vacuum{doubt}; mu_r {:.0} at first, {:.0} at most",
        points.len(),
        curve.end_mu_r(),
        curve.initial_mu_r(),
        curve.greatest_mu_r(),
    )
}
