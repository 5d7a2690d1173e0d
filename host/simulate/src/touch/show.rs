//! Touches beside the truth: as tables, as JSON lines, as maps.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use palpate_calibration::touch::ArrayCalibration;
use palpate_cli::failure::Failure;
use palpate_cli::touch_map::{Array, Ellipse, TouchMap, verdict};
use palpate_sim::touch::Indenter;
use palpate_wire::record::Touch;
use serde::Serialize;

use super::Touched;
use super::bench::TouchBench;
use super::instrument::Judged;
use super::path::TouchPath;

/// Rows of the table for each touch.
const ROWS: usize = 4;
/// Quantile of 95 % of a normal number.
const QUANTILE: f64 = 1.959_964;
/// A flat face counts with the root of 5/3 of its radius: of Hertz's contact with the same second moment.
const OF_A_FACE: f64 = 1.290_994;

/// A line of the JSON output.
#[derive(Serialize)]
struct Line<'t> {
    simulated: bool,
    touch: &'t str,
    time_s: f64,
    true_x_m: f64,
    true_y_m: f64,
    true_force_n: f64,
    /// Absent without one round contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    true_radius_m: Option<f64>,
    down: bool,
    #[serde(flatten)]
    found: &'t Touch,
}

/// Formats one JSON object for each scan.
pub(super) fn json(all: &[Touched<'_>]) -> Result<String, Failure> {
    let mut text = String::new();
    for touched in all {
        for scan in &touched.scans {
            let [true_x_m, true_y_m] = scan.truth.place_m;
            let line = Line {
                simulated: true,
                touch: &touched.path.name,
                time_s: scan.truth.time_s,
                true_x_m,
                true_y_m,
                true_force_n: scan.truth.force_n,
                true_radius_m: touched.radius_m(scan),
                down: touched.path.is_down(scan.truth.time_s),
                found: &scan.touch,
            };
            text.push_str(&serde_json::to_string(&line)?);
            text.push('\n');
        }
    }
    Ok(text)
}

/// Describes the simulated sensor and its calibration.
pub(super) fn title(bench: &TouchBench, calibration: &ArrayCalibration, seed: u64) -> String {
    let (reading, common) = (calibration.reading_error, calibration.common_error);
    format!(
        "Simulated sensor of {} coils, seed {seed}, all disturbances; calibrated by {} presses, {} of them left out\n\
         Errors by the calibration: of a reading {:.2} % of it and {:.2} % of the largest; common: place {:.0} um, \
         force {:.1} %, radius {:.1} %\n",
        calibration.coils().len(),
        bench.presses.len(),
        calibration.suspects.len(),
        1e2 * reading.relative,
        1e2 * reading.of_largest,
        1e6 * common.place_m,
        1e2 * common.ln_force,
        1e2 * common.ln_radius,
    )
}

/// Formats a table with some scans of each touch, and a summary of all.
pub(super) fn text(all: &[Touched<'_>]) -> String {
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header([
        "touch", "s", "place", "found", "off", "force", "found", "off", "radius", "found", "off",
    ]);
    for touched in all {
        let down: Vec<_> = touched.down().collect();
        for row in 0..ROWS.min(down.len()) {
            let index = (2 * row + 1) * down.len() / (2 * ROWS);
            if let Some(scan) = down.get(index) {
                let name = if row == 0 { &touched.path.name } else { "" };
                table.add_row(touched.cells(name, scan));
            }
        }
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let mut text = format!("\n{table}\n\n");
    for touched in all {
        text.push_str(&touched.summary());
        text.push('\n');
    }
    text.push_str(
        "\nPlaces and radii in mm, forces in N; a radius is that of Hertz's pressure. Scans while a touch is down.\n",
    );
    text
}

/// Map of a touch: its true path, and the regions of the scans while it is down.
pub(super) fn map(touched: &Touched<'_>, array: &Array) -> TouchMap {
    let centres = touched.down().map(|scan| scan.truth.place_m);
    let found: Vec<_> = touched
        .down()
        .filter_map(|scan| Ellipse::of(&scan.touch))
        .collect();
    TouchMap {
        title: format!(
            "{}: {} of {} scans claimed",
            touched.path.name,
            found.len(),
            touched.down().count()
        ),
        array: array.clone(),
        truth_m: match touched.path.indenter {
            // The true centres of both contacts.
            Indenter::TwoBalls {
                apart_m,
                toward_rad,
                ..
            } => {
                let [x, y] = touched.path.from_m;
                let (sin, cos) = toward_rad.sin_cos();
                let half_m = 0.5 * apart_m;
                vec![
                    [x - half_m * cos, y - half_m * sin],
                    [x + half_m * cos, y + half_m * sin],
                ]
            }
            _ => centres.collect(),
        },
        found,
    }
}

impl Touched<'_> {
    /// The scans while the touch is down.
    fn down(&self) -> impl Iterator<Item = &Judged> {
        let scans = self.scans.iter();
        scans.filter(|scan| self.path.is_down(scan.truth.time_s))
    }

    /// True radius of contact as the estimate counts it, m; `None` unless it is one round contact.
    fn radius_m(&self, scan: &Judged) -> Option<f64> {
        match self.path.indenter {
            Indenter::Ball { .. } => Some(scan.truth.radius_m),
            Indenter::Pin { radius_m } => Some(OF_A_FACE * radius_m),
            _ => None,
        }
    }

    fn cells(&self, name: &str, scan: &Judged) -> [String; 11] {
        let (truth, touch) = (&scan.truth, &scan.touch);
        // Without the sign of a zero.
        let mm = |of_m: f64| (1e5 * of_m).round() / 100.0 + 0.0;
        let place = |[x_m, y_m]: [f64; 2]| format!("{:.2}, {:.2}", mm(x_m), mm(y_m));
        let off = |found: f64, truth: f64| format!("{:+.1} %", 100.0 * (found / truth - 1.0));
        let time = format!("{:.2}", TouchPath::since_contact_s(truth.time_s));
        let radius_m = self.radius_m(scan);
        let ellipse = Ellipse::of(touch);
        let force_n = touch.force_n.map(f64::from);
        let found_m = touch.radius_m.map(f64::from);
        [
            name.to_owned(),
            time,
            place(truth.place_m),
            ellipse.map_or_else(|| verdict(touch.verdict), |of| place(of.centre_m)),
            ellipse.map_or_else(String::new, |of| {
                format!("{:.3}", 1e3 * distance_m(&of, scan))
            }),
            format!("{:.3}", truth.force_n),
            force_n.map_or_else(String::new, |of| format!("{of:.3}")),
            force_n.map_or_else(String::new, |of| off(of, truth.force_n)),
            radius_m.map_or_else(String::new, |of| format!("{:.2}", 1e3 * of)),
            match found_m {
                Some(of) => format!("{:.2}", 1e3 * of),
                None if ellipse.is_some() => "?".to_owned(),
                None => String::new(),
            },
            found_m
                .zip(radius_m)
                .map_or_else(String::new, |(found, truth)| off(found, truth)),
        ]
    }

    /// Errors and coverage of the scans while the touch is down.
    fn summary(&self) -> String {
        let all = self.down().count();
        let claimed = self
            .down()
            .filter_map(|scan| Some((scan, Ellipse::of(&scan.touch)?)));
        let claimed: Vec<_> = claimed.collect();
        let mut refused = BTreeMap::<String, usize>::new();
        for scan in self
            .down()
            .filter(|scan| Ellipse::of(&scan.touch).is_none())
        {
            *refused.entry(verdict(scan.touch.verdict)).or_default() += 1;
        }
        let refused: Vec<_> = refused
            .iter()
            .map(|(why, count)| format!("{count} {why}"))
            .collect();
        let mut text = format!(
            "{}: {} of {all} scans claimed",
            self.path.name,
            claimed.len()
        );
        if !refused.is_empty() {
            let _ = write!(text, " ({})", refused.join(", "));
        }
        let mut off_m: Vec<_> = claimed
            .iter()
            .map(|(scan, of)| distance_m(of, scan))
            .collect();
        off_m.sort_by(f64::total_cmp);
        let Some(median_m) = off_m.get(off_m.len() / 2) else {
            return text + ".";
        };
        let places = claimed
            .iter()
            .map(|(scan, of)| Some(of.covers(scan.truth.place_m)));
        let forces = claimed.iter().map(|(scan, _)| {
            let touch = &scan.touch;
            Some([
                touch.force_n?.into(),
                touch.force_uncertainty?.into(),
                scan.truth.force_n,
            ])
        });
        let radii = claimed.iter().map(|(scan, _)| {
            let touch = &scan.touch;
            Some([
                touch.radius_m?.into(),
                touch.radius_uncertainty?.into(),
                self.radius_m(scan)?,
            ])
        });
        let _ = write!(
            text,
            "; place off by {:.3} mm (median), in {} of the 95 % regions; force {}; radius {}.",
            1e3 * median_m,
            share(places),
            errors(forces),
            errors(radii)
        );
        text
    }
}

/// Distance of a claimed place from the truth, m.
fn distance_m(of: &Ellipse, scan: &Judged) -> f64 {
    let [[x, y], [true_x, true_y]] = [of.centre_m, scan.truth.place_m];
    (x - true_x).hypot(y - true_y)
}

/// Mean error of values with their relative uncertainties and truths, and the share of the 95 % intervals
/// that have the truth.
fn errors(of: impl Iterator<Item = Option<[f64; 3]>> + Clone) -> String {
    let ln = |[found, _, truth]: [f64; 3]| (found / truth).ln();
    let known: Vec<_> = of.flatten().collect();
    if known.is_empty() {
        return "not claimed".to_owned();
    }
    let square: f64 = known.iter().map(|of| ln(*of).powi(2)).sum();
    let covered = known
        .iter()
        .map(|of| Some(ln(*of).abs() <= QUANTILE * of[1]));
    format!(
        "off by {:.1} % (RMS), in {} of the intervals",
        100.0 * (square / known.len() as f64).sqrt(),
        share(covered)
    )
}

/// Fraction of the known values that are true.
fn share(of: impl Iterator<Item = Option<bool>>) -> String {
    let known: Vec<_> = of.flatten().collect();
    let good = known.iter().filter(|good| **good).count();
    format!("{good} of {}", known.len())
}
