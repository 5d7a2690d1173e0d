//! Touches of a recording: a map and charts over time.

use std::collections::BTreeMap;

use palpate_wire::record::Touch;

use super::{Section, Story};
use crate::plot::{Axis, BLUE, Chart, GREEN, Marks, ORANGE, Series, thinned};
use crate::touch_map::{Ellipse, TouchMap, verdict};

/// Greatest number of ellipses on a map.
const ELLIPSES: usize = 400;

/// Section about the touches; `None` without any.
pub fn section(story: &Story) -> Option<Section> {
    if story.touches.is_empty() {
        return None;
    }
    let found = story
        .touches
        .iter()
        .filter_map(|(_, touch)| Ellipse::of(touch));
    let found: Vec<_> = found.collect();
    let mut counts = BTreeMap::<String, usize>::new();
    for (_, touch) in &story.touches {
        *counts.entry(verdict(touch.verdict)).or_default() += 1;
    }
    let counts: Vec<_> = counts
        .iter()
        .map(|(name, count)| format!("{count} {name}"))
        .collect();
    let every = found.len().div_ceil(ELLIPSES).max(1);
    let mut text = vec![format!("Scans: {}.", counts.join(", "))];
    if every > 1 {
        text.push(format!("The map has one of {every} of the 95 % regions."));
    }
    let charts = [
        chart(
            story,
            "Place",
            "place, mm",
            &[("x", |of| mm(of.x_m)), ("y", |of| mm(of.y_m))],
        ),
        chart(
            story,
            "Force of the touches",
            "force, N",
            &[("force", |of| of.force_n.map(f64::from))],
        ),
        chart(
            story,
            "Radius of contact",
            "radius, mm",
            &[("radius", |of| mm(of.radius_m))],
        ),
    ];
    Some(Section {
        heading: format!(
            "Touches: place and force in {} of {} scans",
            found.len(),
            story.touches.len()
        ),
        text,
        charts: charts.into_iter().flatten().collect(),
        map: Some(TouchMap {
            title: "95 % regions of the places, over the coils".to_owned(),
            array: story.array.clone().unwrap_or_default(),
            truth_m: Vec::new(),
            found: found.into_iter().step_by(every).collect(),
        }),
    })
}

fn mm(of_m: Option<f32>) -> Option<f64> {
    of_m.map(|of| 1e3 * f64::from(of))
}

/// A quantity of a touch, with its name.
type Quantity = (&'static str, fn(&Touch) -> Option<f64>);

/// Chart of quantities over time; `None` without values.
fn chart(story: &Story, title: &str, label: &'static str, of: &[Quantity]) -> Option<Chart> {
    let series = of
        .iter()
        .zip([BLUE, ORANGE, GREEN])
        .map(|((name, value), colour)| {
            let touches = story.touches.iter();
            let points = touches.filter_map(|(at_s, touch)| Some((*at_s, value(touch)?)));
            let points: Vec<_> = points.collect();
            Series::new(name, colour, Marks::Points(thinned(&points)))
        });
    let series: Vec<_> = series.collect();
    let has_points = |of: &Series| matches!(&of.marks, Marks::Points(points) if !points.is_empty());
    series.iter().any(has_points).then(|| Chart {
        title: title.to_owned(),
        x: Axis::linear("time, s"),
        y: Axis::linear(label),
        series,
    })
}

#[cfg(test)]
mod tests {
    use palpate_wire::Record;
    use palpate_wire::code::TouchVerdict;

    use super::*;

    #[test]
    fn touches_are_a_section_with_a_map_and_counts_of_the_verdicts() {
        let mut story = Story::default();
        assert!(section(&story).is_none());
        let claimed = Touch {
            verdict: TouchVerdict::RadiusNotDetermined,
            x_m: Some(1e-3),
            y_m: Some(2e-3),
            x_sigma_m: Some(1e-4),
            y_sigma_m: Some(1e-4),
            correlation: Some(0.5),
            force_n: Some(0.3),
            force_uncertainty: Some(0.02),
            radius_m: None,
            radius_uncertainty: None,
            chi_square: Some(1.0),
        };
        let refused = Touch {
            verdict: TouchVerdict::DoesNotFit,
            x_m: None,
            ..claimed.clone()
        };
        for (at_s, touch) in (0..900)
            .map(f64::from)
            .zip([&claimed, &refused].into_iter().cycle())
        {
            story.take(at_s, Record::Touch(touch.clone()));
        }
        let section = section(&story).unwrap();
        assert_eq!(
            section.heading,
            "Touches: place and force in 450 of 900 scans"
        );
        assert_eq!(
            section.text[0],
            "Scans: 450 does not fit, 450 radius not determined."
        );
        assert_eq!(section.map.unwrap().found.len(), 225);
        let titles: Vec<_> = section.charts.iter().map(|of| of.title.as_str()).collect();
        assert_eq!(titles, ["Place", "Force of the touches"]);
    }
}
