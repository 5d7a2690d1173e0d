//! Sample times depend neither on logs nor on the readers of the channels: a PC that reads, a PC
//! that has stopped reading, or none.

use crate::common::{RecordedBoard, image, origin_us, recording};
use ldc161x_sim::{Settings, TrueConversion};
use palpate_emulator::{EmulatedBoard, Image, LOGS, Still, Time, firmware};

/// Allowed change of a sample's time, us.
const ALLOWED_US: f64 = 2.0;
/// Time in which the records fill the larger channel: 8 KiB, at a hundred bytes per millisecond.
const FILLED: Time = Time::from_ms(150);
const SAMPLES: usize = 40;

fn load(built: Result<std::path::PathBuf, firmware::BuildError>) -> Image {
    Image::load(&built.unwrap_or_else(|error| panic!("{error}"))).unwrap()
}

/// A bench whose sensors drift so fast that no two words are equal.
fn bench(image: &Image) -> RecordedBoard {
    let mut plant = Still::new(crate::common::FREQUENCIES_HZ);
    plant.drift_hz_per_s = 300e3;
    let mut bench = RecordedBoard::of(EmulatedBoard::new(
        image,
        plant,
        Settings::default(),
        recording(),
    ));
    bench.stream();
    // In this time the firmware learns the period of the samples.
    bench.run(Time::from_ms(100));
    bench
}

/// Error of a sample's time relative to the middle of its conversion, us.
fn error_us(time_us: u64, word: u32, fetched: &[TrueConversion], origin_us: f64) -> Option<f64> {
    let truth = fetched.iter().find(|it| it.word == word)?;
    let middle_s = (truth.start.as_secs_f64() + truth.end.as_secs_f64()) / 2.0;
    Some(time_us as f64 + origin_us - middle_s * 1e6)
}

/// Errors of all samples since the frames were last cleared, us.
fn errors_us(bench: &RecordedBoard) -> Vec<f64> {
    let fetched = &bench.board.wire_log().unwrap().fetched;
    let origin_us = origin_us(&bench.board);
    bench
        .samples()
        .filter_map(|(time_us, sample)| {
            error_us(time_us, sample.channels[0].word, fetched, origin_us)
        })
        .collect()
}

/// Errors with a PC that reads records and logs every millisecond.
fn attached(image: &Image) -> Vec<f64> {
    let mut bench = bench(image);
    bench.frames.clear();
    let mut log = 0;
    for _ in 0..SAMPLES {
        bench.run(Time::from_ms(1));
        log += bench.board.read_channel(LOGS).len();
    }
    println!("{log} bytes of log");
    errors_us(&bench)
}

/// Errors with full channels. Samples stamped while a channel is full are dropped, so each is
/// evaluated on a copy of the board whose channel is emptied between the sample's stamp and its
/// record.
fn unread(mut bench: RecordedBoard) -> Vec<f64> {
    bench.board.run_for(FILLED).unwrap();
    let mut errors = Vec::new();
    for _ in 0..SAMPLES {
        let edges = |board: &EmulatedBoard<Still>| board.wire_log().unwrap().edges.len();
        let before = edges(&bench.board);
        bench
            .board
            .run_until(Time::from_ms(3), |board| edges(board) > before)
            .unwrap();
        bench.board.run_for(Time::from_us(60)).unwrap();
        let mut copy = bench.clone();
        let waiting = copy.board.read_channel(crate::common::DATA).len();
        // All of the 8191 bytes are used, except a rest too small for another record.
        assert!(waiting > 7_800, "the channel is not full: {waiting}");
        copy.restart_listening();
        copy.run(Time::from_ms(3));
        errors.extend(errors_us(&copy).first());
    }
    errors
}

fn absent(image: &Image) -> Vec<f64> {
    let mut plant = Still::new(crate::common::FREQUENCIES_HZ);
    plant.drift_hz_per_s = 300e3;
    let board = EmulatedBoard::new(image, plant, Settings::default(), recording());
    let mut bench = RecordedBoard::of(board);
    bench.board.run_for(Time::from_ms(150)).unwrap();
    unread(bench)
}

fn stalled(image: &Image) -> Vec<f64> {
    unread(bench(image))
}

/// Whether the errors differ from each other, and from zero, by less than is allowed.
fn is_right(lowest: f64, highest: f64) -> bool {
    highest - lowest < ALLOWED_US && lowest > -ALLOWED_US && highest < ALLOWED_US
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn sample_times_move_by_less_than_two_microseconds_with_any_reader() {
    let silent = load(firmware::build_with_logs("off"));
    let chatty = load(firmware::build_with_logs("debug"));
    let shipped = image();
    let cases = [
        ("logs off, attached", attached(&silent)),
        ("as shipped, attached", attached(shipped)),
        ("logs on, attached", attached(&chatty)),
        ("logs off, absent", absent(&silent)),
        ("as shipped, absent", absent(shipped)),
        ("logs on, absent", absent(&chatty)),
        ("as shipped, stalled", stalled(shipped)),
        ("logs on, stalled", stalled(&chatty)),
    ];
    let mut all = Vec::new();
    for (name, errors) in cases {
        let range = |errors: &[f64]| {
            let lowest = errors.iter().copied().fold(f64::MAX, f64::min);
            (lowest, errors.iter().copied().fold(f64::MIN, f64::max))
        };
        println!(
            "{name}: {:.2?} us, {} samples",
            range(&errors),
            errors.len()
        );
        assert!(errors.len() >= SAMPLES - 5, "{name}: {}", errors.len());
        all.extend(errors);
        let (lowest, highest) = range(&all);
        assert!(
            highest - lowest < ALLOWED_US,
            "{name}: {lowest} to {highest} us"
        );
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn an_image_that_stamps_in_its_task_is_caught() {
    let late = load(firmware::build_with_defect("late_stamp"));
    let errors = attached(&late);
    let lowest = errors.iter().copied().fold(f64::MAX, f64::min);
    let highest = errors.iter().copied().fold(f64::MIN, f64::max);
    assert!(!errors.is_empty());
    assert!(!is_right(lowest, highest), "{lowest} to {highest} us");
}
