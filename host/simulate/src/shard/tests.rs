//! Shards of a run whose results are their own numbers as text.

use std::fs;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use proptest::prelude::*;
use proptest::sample::Index;
use serde_json::{Map, json};
use tempfile::TempDir;

use super::{Head, Run, number, program};
use serde::{Deserialize, Serialize};

/// Number of the last result of most runs here. The first is [`FIRST`].
const LAST: u64 = 31;
const FIRST: u64 = 12;

fn run(depth: f64) -> Run {
    Run {
        unit: "seed",
        arguments: |seeds| format!("--seed {}", seeds.start()),
        head: Head {
            shard_of: "campaign".to_owned(),
            program: "0.1.0 (00000000)".to_owned(),
            settings: Map::from_iter([("--depth".to_owned(), json!(depth))]),
            first: 0,
            last: 0,
        },
    }
}

fn result(number: u64) -> Result<String, f64> {
    if number.is_multiple_of(5) {
        return Err(1.0 / number as f64);
    }
    Ok(format!("result {number}\nof \"several\" lines"))
}

/// Writes a shard with these numbers, and returns its file.
fn written(folder: &TempDir, run: &Run, numbers: RangeInclusive<u64>) -> PathBuf {
    let file = folder.path().join(format!("{}.jsonl", numbers.start()));
    let shard = run.shard(&file, &numbers).unwrap();
    let results: Vec<_> = numbers.map(result).collect();
    shard.unwrap().write(&results).unwrap();
    file
}

/// Merges the files to the results of all numbers, or to the text of the failure.
fn merged(files: &[PathBuf]) -> Result<Vec<Result<String, f64>>, String> {
    let merged = run(1.0).merged(files, &(FIRST..=LAST));
    merged.map_err(|failure| failure.to_string())
}

/// Splits the run into shards: the numbers of `last` end a shard.
fn split(folder: &TempDir, last: &[u64]) -> Vec<PathBuf> {
    let mut last = [last, &[LAST]].concat();
    last.sort_unstable();
    last.dedup();
    let first = [FIRST].into_iter().chain(last.iter().map(|last| last + 1));
    let shards = first.zip(&last).map(|(first, last)| first..=*last);
    shards
        .map(|numbers| written(folder, &run(1.0), numbers))
        .collect()
}

/// Numbers at which shards end.
fn ends() -> impl Strategy<Value = Vec<u64>> {
    prop::collection::vec(FIRST..LAST, 0..6)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn any_split_in_any_order_gives_the_results_of_one_run(
        (folder, files) in ends().prop_flat_map(|ends| {
            let folder = tempfile::tempdir().unwrap();
            let files = split(&folder, &ends);
            (Just(std::rc::Rc::new(folder)), Just(files).prop_shuffle())
        })
    ) {
        let all: Vec<_> = (FIRST..=LAST).map(result).collect();
        prop_assert_eq!(merged(&files), Ok(all));
        drop(folder);
    }

    #[test]
    fn a_missing_or_doubled_shard_is_refused(ends in ends(), which: Index) {
        let folder = tempfile::tempdir().unwrap();
        let files = split(&folder, &ends);
        let which = which.index(files.len());
        let without = [&files[..which], &files[which + 1..]].concat();
        let message = merged(&without).unwrap_err();
        let first = files[which].file_stem().unwrap().to_string_lossy();
        prop_assert!(message.contains(&format!("--seed {first} --shard FILE")), "{}", message);
        let twice = [&files[..], &files[which..=which]].concat();
        let message = merged(&twice).unwrap_err();
        prop_assert!(message.contains("Name one of the two files."), "{}", message);
    }

    #[test]
    fn a_cut_or_changed_shard_is_refused_and_computed_anew(
        ends in ends(), which: Index, place: Index, change in 1..=u8::MAX, is_cut: bool,
    ) {
        let folder = tempfile::tempdir().unwrap();
        let files = split(&folder, &ends);
        let file = &files[which.index(files.len())];
        let sound = fs::read(file).unwrap();
        let mut bytes = sound.clone();
        let place = place.index(bytes.len());
        if is_cut {
            bytes.truncate(place);
        } else {
            bytes[place] ^= change;
        }
        fs::write(file, &bytes).unwrap();
        let message = merged(&files).unwrap_err();
        prop_assert!(message.contains(file.to_str().unwrap()), "{}", message);
        // Where the first line is not touched, the same call writes the shard once more.
        if place > sound.iter().position(|byte| *byte == b'\n').unwrap() {
            let first: u64 = file.file_stem().unwrap().to_str().unwrap().parse().unwrap();
            let lines = sound.iter().filter(|byte| **byte == b'\n').count() as u64;
            written(&folder, &run(1.0), first..=first + lines - 3);
            prop_assert_eq!(fs::read(file).unwrap(), sound);
        }
    }

    #[test]
    fn numbers_come_back_to_the_bit(bits: u64, other in prop::option::of(any::<f64>())) {
        let numbers = Numbers { one: f64::from_bits(bits), other };
        let text = serde_json::to_string(&numbers).unwrap();
        let again: Numbers = serde_json::from_str(&text).unwrap();
        let bits = |of: f64| if of.is_nan() { f64::NAN.to_bits() } else { of.to_bits() };
        prop_assert_eq!(bits(again.one), bits(numbers.one));
        prop_assert_eq!(again.other.map(bits), numbers.other.map(bits));
    }
}

#[derive(Serialize, Deserialize)]
struct Numbers {
    #[serde(with = "number")]
    one: f64,
    #[serde(with = "number::optional")]
    other: Option<f64>,
}

#[test]
fn infinite_numbers_come_back() {
    for value in [f64::INFINITY, f64::NEG_INFINITY, -0.0, f64::MIN_POSITIVE] {
        let numbers = Numbers {
            one: value,
            other: Some(value),
        };
        let text = serde_json::to_string(&numbers).unwrap();
        let again: Numbers = serde_json::from_str(&text).unwrap();
        assert_eq!(again.one.to_bits(), value.to_bits(), "{text}");
        assert_eq!(again.other.map(f64::to_bits), Some(value.to_bits()));
    }
}

#[test]
fn a_complete_shard_is_not_computed_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = written(&folder, &run(1.0), 3..=4);
    assert!(run(1.0).shard(&file, &(3..=4)).unwrap().is_none());
    let entries = fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(entries, 1, "lock and temporary file are gone");
    // A power cut leaves an empty file.
    fs::write(&file, "").unwrap();
    assert!(run(1.0).shard(&file, &(3..=4)).unwrap().is_some());
}

#[test]
fn the_shard_of_another_run_is_kept_and_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = written(&folder, &run(1.0), FIRST..=LAST);
    let refused = |run: &Run, numbers| run.shard(&file, &numbers).err().unwrap().to_string();
    let message = refused(&run(1.5), FIRST..=LAST);
    assert!(
        message.contains("its --depth is 1.0, and here it is 1.5. Name another file"),
        "{message}"
    );
    let message = refused(&run(1.0), FIRST..=LAST + 1);
    assert!(
        message.contains("it has the seeds 12 to 31 and not the seeds 12 to 32"),
        "{message}"
    );
    let sweep = Run::new("field sweep", "point", Map::new(), |_| String::new()).unwrap();
    let message = refused(&sweep, FIRST..=LAST);
    assert!(
        message.contains("a shard of a campaign, and this is a field sweep"),
        "{message}"
    );
    let numbers = FIRST..=LAST;
    let merged = run(1.5).merged::<Result<String, f64>>(std::slice::from_ref(&file), &numbers);
    let message = merged.unwrap_err().to_string();
    assert!(message.contains("its --depth is 1.0"), "{message}");
    fs::write(&file, "a text\n").unwrap();
    let message = refused(&run(1.0), FIRST..=LAST);
    assert!(message.contains("this is no shard"), "{message}");
    assert_eq!(fs::read(&file).unwrap(), b"a text\n");
}

#[test]
fn the_shard_of_another_program_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut other = run(1.0);
    other.head.program.push('+');
    let file = written(&folder, &other, FIRST..=LAST);
    let message = merged(&[file]).unwrap_err();
    let difference = "by the program 0.1.0 (00000000)+, and this is 0.1.0 (00000000). Leave";
    assert!(message.contains(difference), "{message}");
    assert_eq!(program().unwrap(), program().unwrap());
}

#[test]
fn what_is_outside_of_the_run_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = written(&folder, &run(1.0), FIRST..=LAST + 1);
    let message = merged(&[file]).unwrap_err();
    assert!(
        message.contains("it has the seeds 12 to 32, and the run the seeds 12 to 31"),
        "{message}"
    );
}

#[test]
fn overlapping_shards_and_all_gaps_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let several = [14..=20, 20..=25, 28..=28].map(|numbers| written(&folder, &run(1.0), numbers));
    let message = merged(&several).unwrap_err();
    assert!(message.contains("has the seed 20 too"), "{message}");
    let message = merged(&[several[0].clone(), several[2].clone()]).unwrap_err();
    let gaps = "no file has the seeds 12 to 13, the seeds 21 to 27, the seeds 29 to 31. Run";
    assert!(message.contains(gaps), "{message}");
    // The last number has no successor.
    let end = u64::MAX - 1..=u64::MAX;
    let file = written(&folder, &run(1.0), end.clone());
    let results = run(1.0).merged::<Result<String, f64>>(&[file], &end);
    assert_eq!(results.unwrap().len(), 2);
}

#[test]
fn a_second_process_waits_for_the_first_and_then_has_nothing_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("shard.jsonl");
    let first = run(1.0).shard(&file, &(1..=2)).unwrap().unwrap();
    let (sender, received) = mpsc::channel();
    let second = {
        let file = file.clone();
        thread::spawn(move || {
            let shard = run(1.0).shard(&file, &(1..=2)).unwrap();
            sender.send(shard.is_none()).unwrap();
        })
    };
    // It does not begin while the first computes.
    assert!(received.recv_timeout(Duration::from_millis(200)).is_err());
    first.write(&[result(1), result(2)]).unwrap();
    assert!(received.recv_timeout(Duration::from_secs(10)).unwrap());
    second.join().unwrap();
    // A process that ended without its shard leaves the lock's file, and no lock.
    fs::remove_file(&file).unwrap();
    drop(run(1.0).shard(&file, &(1..=2)).unwrap().unwrap());
    assert!(run(1.0).shard(&file, &(1..=2)).unwrap().is_some());
}
