//! The charts of the report.

use palpate_cli::plot::{Axis, BLUE, Chart, Colour, GREEN, Marks, ORANGE, Series, thinned};
use palpate_wire::record::{LoadPoint, Sample};

use super::story::{Measurement, RecordingSummary};
use crate::train_line::TrainLine;

/// A quantity of a sample over time.
#[derive(Clone, Copy)]
pub(super) struct Quantity {
    title: &'static str,
    label: &'static str,
    colour: Colour,
    of: fn(&Sample) -> Option<f64>,
}

pub(super) const FORCE: Quantity = Quantity {
    title: "Force",
    label: "force, N",
    colour: GREEN,
    of: |sample| sample.force_n.map(f64::from),
};
pub(super) const FREQUENCY: Quantity = Quantity {
    title: "Frequency",
    label: "frequency, MHz",
    colour: BLUE,
    of: |sample| Some(sample.channels.first()?.frequency_hz * 1e-6),
};
pub(super) const DEFORMATION: Quantity = Quantity {
    title: "Deformation",
    label: "deformation, µm",
    colour: BLUE,
    of: |sample| Some(f64::from(sample.channels.first()?.deformation_m?) * 1e6),
};
pub(super) const CURRENT: Quantity = Quantity {
    title: "Coil current",
    label: "current, A",
    colour: ORANGE,
    of: |sample| sample.current_a.map(f64::from),
};

/// Chart of a quantity over the whole recording or one measurement; `None` without values.
pub(super) fn over_time(
    story: &RecordingSummary,
    quantity: Quantity,
    measurement: Option<&Measurement>,
) -> Option<Chart> {
    let is_shown = |time_s: f64| measurement.is_none_or(|of| of.shows(time_s));
    let samples = story.samples.iter().filter(|(time_s, _)| is_shown(*time_s));
    let profile: Vec<(f64, f64)> = samples
        .filter_map(|(time_s, sample)| Some((*time_s, (quantity.of)(sample)?)))
        .collect();
    (!profile.is_empty()).then(|| Chart {
        title: quantity.title.to_owned(),
        x: Axis::linear("time, s"),
        y: Axis::linear(quantity.label),
        series: vec![curve(quantity, thinned(&profile))],
    })
}

fn curve(quantity: Quantity, points: Vec<(f64, f64)>) -> Series {
    Series::new(quantity.label, quantity.colour, Marks::Line(points))
}

/// Chart of 1/x against the actuated layer's compliance, with the fitted line.
pub(super) fn line(line: &TrainLine) -> Chart {
    let points = line.points.iter();
    let measured = points
        .clone()
        .map(|point| (point.compliance, point.inverse_per_m * 1e-3));
    // Points are sorted by compliance, so two points draw the line.
    let ends = line.points.first().into_iter().chain(line.points.last());
    let fit = ends.map(|point| (point.compliance, point.line_per_m * 1e-3));
    Chart {
        title: format!(
            "Line of all ramps; c_S/c_L = {:.3} from its zero",
            line.load_ratio
        ),
        x: Axis::linear("g = c_S/c_D(I), attraction included"),
        y: Axis::linear("1/x without drift, 1/mm"),
        series: vec![
            Series::new("conversions", BLUE, Marks::Points(measured.collect())),
            Series::new("fit", ORANGE, Marks::Line(fit.collect())),
        ],
    }
}

/// Chart of the force against the load's displacement relative to the middle of the ramps.
pub(super) fn load_curve(points: &[LoadPoint]) -> Option<Chart> {
    let middle = points.get(points.len() / 2)?;
    let from_m = f64::from(middle.displacement_m);
    let bars = points.iter().map(|point| {
        let at_m = f64::from(point.displacement_m) - from_m;
        // Twice the standard uncertainty of the displacement along the load's curve.
        let wide_m = 2.0 * f64::from(point.displacement_sigma_m);
        let [low, value, high] = [at_m - wide_m, at_m, at_m + wide_m].map(|m| m * 1e6);
        (f64::from(point.force_n), low, value, high)
    });
    Some(Chart {
        title: "The load's curve along the ramps".to_owned(),
        x: Axis::linear("force, N"),
        y: Axis::linear("displacement of the load, µm"),
        series: vec![Series::new(
            "measured, ± 2 s.e.",
            BLUE,
            Marks::Bars(bars.collect()),
        )],
    })
}
