//! Report of a calibration: one HTML page with its figures and charts.

use maud::{PreEscaped, html};
use palpate_calibration::{Basis, Calibration};
use palpate_cli::failure::Failure;
use palpate_cli::page::document;
use palpate_cli::plot::{Axis, BLUE, Chart, GREY, Marks, Series};

use super::found::{CalibrationFigures, loads, percent};

/// Builds the page.
pub(super) fn page(
    found: &CalibrationFigures,
    calibration: &Calibration,
) -> Result<String, Failure> {
    let peak_a = f64::from(found.peak_current_a);
    let basis = &calibration.basis;
    let mut charts = vec![force(basis)];
    if !basis.presses.is_empty() {
        charts.push(beside(basis));
    }
    charts.extend([stiffening(calibration, peak_a), trains(basis)]);
    if !basis.springs.is_empty() {
        charts.push(springs(basis));
    }
    let drawings = charts.iter().map(Chart::svg);
    let drawings = drawings.collect::<Result<Vec<String>, Failure>>()?;
    let id = found.calibration_id;
    let bench = if found.simulated { "simulated" } else { "real" };
    Ok(document(
        &format!("palpate: calibration {id}"),
        &html! {
            h1 { "Calibration " (id) }
            p { (found.runs) " runs on a " (bench) " bench, at " (format!("{:.1}", found.calibrated_at_c)) " °C." }
            table { tbody {
                @for (what, value) in found.figures() { tr { td { (what) } td { (value) } } }
            } }
            h2 { "What limits it" }
            p { "Relative standard uncertainties of a load of " (loads()) ", by cause. The noise of a press comes \
                 on top." }
            table {
                thead { tr {
                    th { "cause" }
                    @for load in found.loads { th { "at " (load) " c_S" } }
                } }
                tbody {
                    @for limit in &found.limits {
                        tr {
                            td { (limit.cause) }
                            @for part in limit.uncertainty { td { (percent(part)) } }
                        }
                    }
                }
            }
            div.charts { @for drawing in &drawings { (PreEscaped(drawing)) } }
        },
    ))
}

/// Chart of the force against the change of inductance.
fn force(basis: &Basis) -> Chart {
    let curve = basis.curve.iter();
    let curve = curve.map(|(change, n)| (1e2 * change, *n));
    Chart {
        title: "Force of the sensing layer".to_owned(),
        x: Axis::linear("change of inductance, %"),
        y: Axis::linear("force, N"),
        series: vec![Series::new("curve", BLUE, Marks::Line(curve.collect()))],
    }
}

/// Chart of the load cell's deviation from the curve of `force`.
fn beside(basis: &Basis) -> Chart {
    let points = basis.presses.iter();
    let points = points.map(|(change, n)| (1e2 * change, 1e3 * n));
    Chart {
        title: "Load cell against that curve, presses on the block".to_owned(),
        x: Axis::linear("change of inductance, %"),
        y: Axis::linear("load cell less curve, mN"),
        series: vec![Series::new(
            "load cell",
            BLUE,
            Marks::Points(points.collect()),
        )],
    }
}

/// Chart of the rise of the actuated layer's stiffness over the current.
fn stiffening(calibration: &Calibration, peak_a: f64) -> Chart {
    let currents = (0..=60).map(|step| peak_a * f64::from(step) / 60.0);
    let rise = currents.map(|current_a| (current_a, 1e2 * calibration.actuated.rise(current_a)));
    Chart {
        title: "The actuated layer grows stiffer".to_owned(),
        x: Axis::linear("current, A"),
        y: Axis::linear("rise of the stiffness, %"),
        series: vec![Series::new("rise", BLUE, Marks::Line(rise.collect()))],
    }
}

/// Chart of the deviation of each train's own line from its load.
fn trains(basis: &Basis) -> Chart {
    // A rigid block has no position on the logarithmic axis.
    let pressed = basis.trains.iter().filter(|(kappa, _)| *kappa > 0.0);
    let misses: Vec<(f64, f64)> = pressed
        .map(|(kappa, miss)| (*kappa, 1e2 * miss / (1.0 + kappa)))
        .collect();
    let ends = misses.iter().map(|(kappa, _)| (*kappa, 0.0));
    Chart {
        title: "Residual of each train".to_owned(),
        x: Axis::logarithmic("c_S/c_L as pressed"),
        y: Axis::linear("residual of c_S/c_L, % of 1 + c_S/c_L"),
        series: vec![
            Series::new("no miss", GREY, Marks::Line(ends.collect())),
            Series::new("trains", BLUE, Marks::Crosses(misses)),
        ],
    }
}

/// Chart of the springs' stiffness by the gauges against their nominal stiffness.
fn springs(basis: &Basis) -> Chart {
    let per_mm = |(written, found): &(f64, f64)| (written * 1e-3, found * 1e-3);
    let equal = |(written, _): &(f64, f64)| (written * 1e-3, written * 1e-3);
    let all = || basis.springs.iter().filter(|(_, found)| *found > 0.0);
    Chart {
        title: "Springs by stage and force".to_owned(),
        x: Axis::logarithmic("nominal, N/mm"),
        y: Axis::logarithmic("by the gauges, N/mm"),
        series: vec![
            Series::new("equal", GREY, Marks::Line(all().map(equal).collect())),
            Series::new("springs", BLUE, Marks::Crosses(all().map(per_mm).collect())),
        ],
    }
}
