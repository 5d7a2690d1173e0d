//! Recordings with many boots, and with widely separated time stamps.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::support::{frames, palpate, recording_at, recording_of, recording_with};

const START_NS: u64 = 1_700_000_000_000_000_000;

/// One sample for each of `count` boots.
fn of_boots(count: u32) -> Vec<Value> {
    let sample = frames()
        .into_iter()
        .find(|frame| frame["message"].get("sample").is_some())
        .unwrap();
    let boots = (1..=count).map(|boot_id| {
        let mut frame = sample.clone();
        frame["header"] = json!({"boot_id": boot_id, "sequence": 0, "time_us": 0, "dropped": 0});
        frame
    });
    boots.collect()
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn the_time_for_a_file_does_not_grow_with_the_square_of_its_boots() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let boots = of_boots(60_000);
    recording_of(&folder.join("many.mcap"), &boots);
    // As many records as in `many.mcap`, but of two boots only.
    let few: Vec<Value> = boots
        .iter()
        .cloned()
        .enumerate()
        .map(|(number, mut frame)| {
            frame["header"]["boot_id"] = (number / 30_000).into();
            frame["header"]["sequence"] = (number % 30_000).into();
            frame
        })
        .collect();
    recording_of(&folder.join("few.mcap"), &few);
    for verb in ["info", "report"] {
        let taken = |file: &str| {
            let began = Instant::now();
            let output = palpate(&[verb, file, "--json"], folder);
            assert!(output.status.success(), "{output:?}");
            began.elapsed()
        };
        let (few, many) = (taken("few.mcap"), taken("many.mcap"));
        assert!(many < 5 * few, "{verb}: {many:?} for many, {few:?} for few");
    }
}

#[test]
fn a_far_time_stamp_is_jumped_over_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut frames = frames();
    let estimates: Vec<Value> = frames
        .iter()
        .filter(|frame| frame["message"].get("estimate").is_some())
        .cloned()
        .collect();
    assert!(!estimates.is_empty());
    frames.extend(estimates.clone());
    let count = frames.len();
    // One record in the middle has a wrong time stamp.
    let times = (0..count as u64).map(|number| {
        let far = u64::from(number == 10) * 10_000_000_000_000_000_000;
        START_NS + number * 20_000_000 + far
    });
    recording_with(&folder.join("far.mcap"), |writer| {
        let metadata = [
            ("boot_id".to_owned(), "305419896".to_owned()),
            ("hello".to_owned(), frames[0]["message"].to_string()),
        ];
        let metadata = mcap::records::Metadata {
            name: "boot".to_owned(),
            metadata: metadata.into(),
        };
        writer.write_metadata(&metadata).unwrap();
        recording_at(writer, times.zip(&frames));
    });
    let began = Instant::now();
    for verb in [&["measure", "--json"][..], &["watch", "--json"]] {
        let output = palpate(&[verb, &["--board", "far.mcap"]].concat(), folder);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{said}");
        assert!(
            said.contains("far.mcap: ") && said.contains("years"),
            "{said}"
        );
        assert!(!output.stdout.is_empty());
    }
    assert!(began.elapsed() < Duration::from_secs(60));
}
