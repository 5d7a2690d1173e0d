//! Acceptance of a built board: what it measures, line by line, against what its design promises.

mod promise;
mod report;

use serde::Serialize;

pub(crate) use promise::Promise;
pub(crate) use report::{Report, ReportFile, table};

/// Verdict about a measured quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Verdict {
    AsExpected,
    Off,
    NotMeasured,
}

impl Verdict {
    const fn text(self) -> &'static str {
        match self {
            Self::AsExpected => "as expected",
            Self::Off => "OFF",
            Self::NotMeasured => "not measured",
        }
    }
}

/// A measured quantity with its expected range, in SI units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Line {
    pub(crate) quantity: String,
    pub(crate) unit: &'static str,
    pub(crate) measured: Option<f64>,
    /// Least and greatest expected value.
    pub(crate) expected: [f64; 2],
    /// Source of the expected range.
    pub(crate) because: String,
    pub(crate) verdict: Verdict,
    /// What to do, unless the quantity is as expected.
    pub(crate) action: Option<String>,
}

impl Line {
    /// Compares a quantity with its range. `action` says what to do if it is outside, or not measured.
    pub(crate) fn new(
        quantity: impl Into<String>,
        unit: &'static str,
        measured: Option<f64>,
        (expected, because): ([f64; 2], impl Into<String>),
        action: impl Into<String>,
    ) -> Self {
        let [least, greatest] = expected;
        let verdict = match measured {
            None => Verdict::NotMeasured,
            Some(value) if (least..=greatest).contains(&value) => Verdict::AsExpected,
            Some(_) => Verdict::Off,
        };
        Self {
            quantity: quantity.into(),
            unit,
            measured,
            expected,
            because: because.into(),
            verdict,
            action: (verdict != Verdict::AsExpected).then(|| action.into()),
        }
    }
}

/// A value with an SI prefix and four significant digits; a small number without a unit in millionths.
fn engineering(value: f64, unit: &str) -> String {
    const PREFIXES: [(f64, &str); 6] = [
        (1e6, "M"),
        (1e3, "k"),
        (1.0, ""),
        (1e-3, "m"),
        (1e-6, "µ"),
        (1e-9, "n"),
    ];
    if unit.is_empty() && value != 0.0 && value.abs() < 0.5e-3 {
        return format!("{:.2} ppm", 1e6 * value);
    }
    let without = ["", "ohm", "°C"].contains(&unit);
    let fits = |(scale, _): &&(f64, &str)| value.abs() >= 0.9999 * scale;
    let (scale, prefix) = match PREFIXES.iter().find(fits) {
        Some(&(scale, prefix)) if !without && value != 0.0 => (scale, prefix),
        _ => (1.0, ""),
    };
    let scaled = value / scale;
    let digits = match scaled.abs() {
        0.0 => 0,
        size if size >= 100.0 => 1,
        size if size >= 10.0 => 2,
        _ => 3,
    };
    format!("{scaled:.digits$} {prefix}{unit}")
        .trim_end()
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_has_a_prefix_that_fits() {
        assert_eq!(engineering(3.0123e6, "Hz"), "3.012 MHz");
        assert_eq!(engineering(142.3e-6, "H"), "142.3 µH");
        assert_eq!(engineering(0.3891, "ohm"), "0.389 ohm");
        assert_eq!(engineering(-0.0125, "A"), "-12.50 mA");
        assert_eq!(engineering(0.0, ""), "0");
        assert_eq!(engineering(0.0714, ""), "0.071");
        assert_eq!(engineering(1.25e-6, ""), "1.25 ppm");
    }

    #[test]
    fn a_line_is_as_expected_within_its_range_alone() {
        let verdict = |measured| Line::new("q", "A", measured, ([1.0, 2.0], "why"), "act").verdict;
        assert_eq!(verdict(Some(1.0)), Verdict::AsExpected);
        assert_eq!(verdict(Some(2.1)), Verdict::Off);
        assert_eq!(verdict(Some(f64::NAN)), Verdict::Off);
        assert_eq!(verdict(None), Verdict::NotMeasured);
    }
}
