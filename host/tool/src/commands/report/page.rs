//! The HTML page.

use palpate_cli::describe;
use palpate_cli::failure::Failure;
use palpate_cli::report::{Measurement, Report, Row, Section, Story, charts, of_touches};

use super::story::RecordingSummary;
use crate::recording::date;

const COLUMNS: [&str; 6] = [
    "measurement",
    "time",
    "stiffness",
    "95 % interval",
    "force",
    "temperature",
];

pub(super) fn page(recording: &RecordingSummary) -> Result<String, Failure> {
    let story = &recording.story;
    let boots = recording.contents.boots();
    let boots = boots.iter().map(|boot| format!("Of {}.", boot.sentence()));
    let none = "There is no measurement in it: `palpate record --arm` records them.";
    let none = story.measurements.is_empty().then(|| none.to_owned());
    let whole = [charts::FORCE, charts::FREQUENCY];
    let whole = whole.map(|of| charts::over_time(story, of, None));
    Report {
        title: format!("palpate: {}", recording.file),
        about: [title(recording)].into_iter().chain(boots).collect(),
        columns: &COLUMNS,
        rows: story.measurements.iter().map(row).collect(),
        summary: none,
        charts: whole.into_iter().flatten().collect(),
        sections: of_touches(story)
            .into_iter()
            .chain(story.measurements.iter().map(|of| section(story, of)))
            .collect(),
    }
    .page()
}

fn title(recording: &RecordingSummary) -> String {
    let began = recording.contents.began_ns().map(date::text);
    format!(
        "Recording {} of {}, from {}, {:.1} s.",
        recording.file,
        recording.board,
        began.unwrap_or_default(),
        recording.contents.duration_s()
    )
}

fn row(measurement: &Measurement) -> Row {
    let at = format!("{:.2} s", measurement.at_s);
    let cells: [String; COLUMNS.len()] = match &measurement.result {
        Ok(estimate) => [
            estimate.measurement.to_string(),
            at,
            describe::estimated(estimate),
            describe::interval(estimate),
            format!("{:.3} N", estimate.force_n),
            estimate
                .temperature_c
                .map_or(String::new(), |of| format!("{of:.1} °C")),
        ],
        Err(refusal) => [
            String::new(),
            at,
            "refused".to_owned(),
            describe::refusal(refusal),
            String::new(),
            String::new(),
        ],
    };
    Row {
        cells: cells.into(),
        missed: false,
    }
}

fn section(story: &Story, measurement: &Measurement) -> Section {
    Section {
        heading: match &measurement.result {
            Ok(estimate) => format!(
                "Measurement {}: {}, with 95 % in {}",
                estimate.measurement,
                describe::estimated(estimate),
                describe::interval(estimate)
            ),
            Err(refusal) => format!(
                "At {:.2} s: refused. {}",
                measurement.at_s,
                describe::refusal(refusal)
            ),
        },
        text: measurement.text(),
        charts: charts::of_measurement(story, Some(measurement), None),
        map: None,
    }
}
