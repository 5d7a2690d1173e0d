//! Charts of an instrument's records.

use crate::plot::{Axis, BLUE, Chart, Colour, GREEN, Marks, ORANGE, Series, thinned};
use palpate_wire::record::{LoadPoint, Sample};

use super::story::{Measurement, Story};
use crate::train_line::TrainLine;

/// A quantity of a sample over time.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    title: &'static str,
    label: &'static str,
    colour: Colour,
    of: fn(&Sample) -> Option<f64>,
}

/// The force.
pub const FORCE: Quantity = Quantity {
    title: "Force",
    label: "force, N",
    colour: GREEN,
    of: |sample| sample.force_n.map(f64::from),
};
/// The frequency of the first channel.
pub const FREQUENCY: Quantity = Quantity {
    title: "Frequency",
    label: "frequency, MHz",
    colour: BLUE,
    of: |sample| Some(sample.channels.first()?.frequency_hz * 1e-6),
};
const DEFORMATION: Quantity = Quantity {
    title: "Deformation",
    label: "deformation, µm",
    colour: BLUE,
    of: |sample| Some(f64::from(sample.channels.first()?.deformation_m?) * 1e6),
};
const CURRENT: Quantity = Quantity {
    title: "Coil current",
    label: "current, A",
    colour: ORANGE,
    of: |sample| sample.current_a.map(f64::from),
};

/// Function from force, N, to the true displacement of the load, m; `None` if unknown.
pub type Truth<'t> = Option<&'t dyn Fn(f64) -> f64>;

/// Charts of one measurement, or of the whole recording if `measurement` is `None`.
pub fn of_measurement(
    story: &Story,
    measurement: Option<&Measurement>,
    truth: Truth<'_>,
) -> Vec<Chart> {
    let over_time = [DEFORMATION, CURRENT].map(|of| over_time(story, of, measurement));
    let fitted = measurement.and_then(|of| of.line.as_ref());
    let curve = measurement.and_then(|of| load_curve(&of.points, truth));
    let others = [fitted.map(line), fitted.map(residuals), curve];
    over_time.into_iter().chain(others).flatten().collect()
}

/// Chart of a quantity over the whole recording or one measurement; `None` without values.
pub fn over_time(
    story: &Story,
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
        series: vec![Series::new(
            quantity.label,
            quantity.colour,
            Marks::Line(thinned(&profile)),
        )],
    })
}

/// Chart of 1/x (x: deformation) against the actuated layer's compliance, with the fitted line.
fn line(line: &TrainLine) -> Chart {
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

/// Residuals of the fitted line over time.
fn residuals(line: &TrainLine) -> Chart {
    let points = line.points.iter();
    let points = points.map(|point| (point.time_s, point.residual_m * 1e9));
    let points = Marks::Points(points.collect());
    Chart {
        title: "Residuals of the line".to_owned(),
        x: Axis::linear("time since the first ramp, s"),
        y: Axis::linear("residual of x, nm"),
        series: vec![Series::new("residual", BLUE, points)],
    }
}

/// Chart of the force against the displacement of the load. The displacement counts from the middle
/// point: its value before the ramps is unknown.
fn load_curve(points: &[LoadPoint], truth: Truth<'_>) -> Option<Chart> {
    let middle = points.get(points.len() / 2)?;
    let from_m = f64::from(middle.displacement_m);
    let bars = points.iter().map(|point| {
        let at_m = f64::from(point.displacement_m) - from_m;
        // Twice the standard uncertainty of the displacement along the load's curve.
        let wide_m = 2.0 * f64::from(point.displacement_sigma_m);
        let [low, value, high] = [at_m - wide_m, at_m, at_m + wide_m].map(|m| m * 1e6);
        (f64::from(point.force_n), low, value, high)
    });
    let measured = Series::new("measured, ± 2 s.e.", BLUE, Marks::Bars(bars.collect()));
    let true_curve = truth.map(|truly_m| {
        let true_from_m = truly_m(middle.force_n.into());
        let forces = points.iter().map(|point| f64::from(point.force_n));
        let curve = forces.map(|force_n| (force_n, (truly_m(force_n) - true_from_m) * 1e6));
        Series::new("true", GREEN, Marks::Line(curve.collect()))
    });
    Some(Chart {
        title: "The load's curve along the ramps".to_owned(),
        x: Axis::linear("force, N"),
        y: Axis::linear("displacement of the load, µm"),
        series: true_curve.into_iter().chain([measured]).collect(),
    })
}
