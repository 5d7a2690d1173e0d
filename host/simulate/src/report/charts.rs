//! The charts of the report.

use palpate_cli::plot::{Axis, BLUE, Chart, Colour, GREEN, GREY, Marks, ORANGE, Series, thinned};
use palpate_wire::Record;
use palpate_wire::record::{LoadPoint, Sample};

use super::evaluation::Evaluation;
use crate::results::Measured;

/// Claims against truth, all loads.
pub(super) fn claims(row: &[Measured]) -> Chart {
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

/// Deformation over time.
pub(super) fn deformation(measured: &Measured) -> Chart {
    let micrometres = |sample: &Sample| {
        let deformation_m = sample.channels.first()?.deformation_m?;
        Some(f64::from(deformation_m) * 1e6)
    };
    over_time(
        measured,
        "Deformation",
        "deformation, µm",
        BLUE,
        micrometres,
    )
}

/// Current over time.
pub(super) fn current(measured: &Measured) -> Chart {
    let ampere = |sample: &Sample| sample.current_a.map(f64::from);
    over_time(measured, "Coil current", "current, A", ORANGE, ampere)
}

fn over_time(
    measured: &Measured,
    title: &str,
    label: &'static str,
    colour: Colour,
    value: impl Fn(&Sample) -> Option<f64>,
) -> Chart {
    let records = measured.pressed.records();
    let profile: Vec<(f64, f64)> = records
        .filter_map(|(time_s, record)| match record {
            Record::Sample(sample) => Some((time_s, value(sample)?)),
            _ => None,
        })
        .collect();
    Chart {
        title: title.to_owned(),
        x: Axis::linear("time, s"),
        y: Axis::linear(label),
        series: vec![Series::new(label, colour, Marks::Line(thinned(&profile)))],
    }
}

/// 1/x against the actuated layer's compliance, with the fitted line.
pub(super) fn line(evaluation: &Evaluation) -> Chart {
    let points = evaluation
        .points
        .iter()
        .map(|point| (point.compliance, point.inverse_per_m * 1e-3));
    let compliances = || evaluation.points.iter().map(|point| point.compliance);
    let ends = [
        compliances().fold(f64::INFINITY, f64::min),
        compliances().fold(f64::NEG_INFINITY, f64::max),
    ];
    let fit = ends.map(|g| (g, evaluation.line.inverse_per_m(g) * 1e-3));
    Chart {
        title: format!(
            "Line of all ramps; c_S/c_L = {:.3} from its zero",
            evaluation.line.kappa
        ),
        x: Axis::linear("g = c_S/c_D(I), attraction included"),
        y: Axis::linear("1/x without drift, 1/mm"),
        series: vec![
            Series::new("conversions", BLUE, Marks::Points(points.collect())),
            Series::new("fit", ORANGE, Marks::Line(fit.to_vec())),
        ],
    }
}

/// Residuals of the line over time.
pub(super) fn residuals(evaluation: &Evaluation) -> Chart {
    let points = evaluation
        .points
        .iter()
        .map(|point| (point.time_s, point.residual_m * 1e9));
    Chart {
        title: "Residuals of the line".to_owned(),
        x: Axis::linear("time since the first rise, s"),
        y: Axis::linear("residual of x, nm"),
        series: vec![Series::new(
            "residual",
            BLUE,
            Marks::Points(points.collect()),
        )],
    }
}

/// Chart of the force against the displacement of the load. The displacement is relative to the
/// middle of the ramps, since the ramps do not show what it was before.
pub(super) fn load_curve(measured: &Measured) -> Option<Chart> {
    let records = measured.pressed.records();
    let points: Vec<&LoadPoint> = records
        .filter_map(|(_, record)| match record {
            Record::LoadPoint(point) => Some(point),
            _ => None,
        })
        .collect();
    let middle = points.get(points.len() / 2)?;
    let from_m = f64::from(middle.displacement_m);
    let displacement_um = |m: f64| (m - from_m) * 1e6;
    let pressed = &measured.pressed;
    let truly_m = |force_n: f64| pressed.displacement_m(force_n);
    let true_from_m = truly_m(middle.force_n.into());
    let truth = points.iter().map(|point| {
        let force_n = f64::from(point.force_n);
        (force_n, (truly_m(force_n) - true_from_m) * 1e6)
    });
    let bars = points.iter().map(|point| {
        let at_m = f64::from(point.displacement_m);
        // Twice the standard uncertainty of the displacement along the load's curve.
        let wide_m = 2.0 * f64::from(point.displacement_sigma_m);
        (
            f64::from(point.force_n),
            displacement_um(at_m - wide_m),
            displacement_um(at_m),
            displacement_um(at_m + wide_m),
        )
    });
    Some(Chart {
        title: "The load's curve along the ramps".to_owned(),
        x: Axis::linear("force, N"),
        y: Axis::linear("displacement of the load, µm"),
        series: vec![
            Series::new("true", GREEN, Marks::Line(truth.collect())),
            Series::new("measured, ± 2 s.e.", BLUE, Marks::Bars(bars.collect())),
        ],
    })
}
