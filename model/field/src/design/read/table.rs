//! Tables of H and B.

use toml::Spanned;

use super::Reader;
use super::beside::Beside;
use crate::design::DesignError;
use crate::material::BhCurve;

const COLUMNS: &str = "two columns, H in A/m and B in T; lines that begin with # are comments";
/// More points than any table has.
const MOST_POINTS: usize = 10_000;

impl Reader<'_> {
    /// The curve of a table in a file.
    pub(super) fn bh_table(
        &self,
        name: &Spanned<String>,
        place: &str,
    ) -> Result<BhCurve, DesignError> {
        let beside = self.beside(name, place)?;
        let mut lines = Vec::new();
        let mut points = Vec::new();
        for (line, row) in (1..).zip(beside.text.lines()) {
            let row = row.trim_start_matches('\u{feff}').trim();
            if row.is_empty() || row.starts_with('#') {
                continue;
            }
            if points.len() == MOST_POINTS {
                let allowed = format!("at most {MOST_POINTS}");
                return Err(beside.error(line, "too many points", &allowed));
            }
            points.push(point(&beside, line, row)?);
            lines.push(line);
        }
        BhCurve::through(&points).map_err(|error| {
            let line = lines.get(error.point).copied().unwrap_or(1);
            beside.error(line, error.problem, error.allowed)
        })
    }
}

/// H and B of a row, parted by a comma, a semicolon or blanks.
fn point(beside: &Beside, line: usize, row: &str) -> Result<[f64; 2], DesignError> {
    let parted = |character: char| matches!(character, ',' | ';') || character.is_whitespace();
    let columns: Vec<&str> = row.split(parted).filter(|text| !text.is_empty()).collect();
    let &[h, b] = columns.as_slice() else {
        let problem = format!("has {} columns", columns.len());
        return Err(beside.error(line, problem, COLUMNS));
    };
    let number = |text: &str| {
        let number = text.parse::<f64>();
        number.map_err(|_| beside.error(line, format!("{text:?} is no number"), COLUMNS))
    };
    Ok([number(h)?, number(b)?])
}
