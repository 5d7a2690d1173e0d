//! Functions that call the tool.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use mcap::records::MessageHeader;
use palpate_emulator::firmware;
use serde_json::Value;

/// Calibration of the emulated board of seed 11.
pub(crate) const CALIBRATION: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/tests/fixture/ultrasoft-11.jsonl"
);

/// The flashed image, built once.
pub(crate) fn image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| firmware::build().unwrap_or_else(|error| panic!("{error}")))
}

/// Runs the tool in a folder.
pub(crate) fn palpate(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// Runs the tool with the emulated board, whose flash is a file in the folder.
pub(crate) fn emulated(arguments: &[&str], folder: &Path) -> Output {
    let board = ["--board", "emulated", "--state", "board.flash", "--image"];
    let image = image().to_str().unwrap();
    palpate(&[arguments, &board, &[image]].concat(), folder)
}

/// JSON output of the tool, which must have succeeded.
pub(crate) fn json(output: &Output) -> Value {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Writes a recording of the wire's fixture, which has records of every kind.
pub(crate) fn recording(file: &Path) {
    recording_of(file, &frames());
}

/// Frames of the fixture of `palpate_wire`, reduced to what a recording has: header and message.
pub(crate) fn frames() -> Vec<Value> {
    let listing = include_str!("../../../../firmware/wire/fixture/v2-records.jsonl");
    let frames = listing.lines().map(|line| {
        let mut frame: Value = serde_json::from_str(line).unwrap();
        let object = frame.as_object_mut().unwrap();
        object.retain(|name, _| name == "header" || name == "message");
        frame
    });
    frames.collect()
}

/// Writes a recording of these frames, a millisecond apart.
pub(crate) fn recording_of(file: &Path, frames: &[Value]) {
    let times = (1_700_000_000_000_000_000..).step_by(1_000_000);
    recording_with(file, |writer| recording_at(writer, times.zip(frames)));
}

/// Writer of a test recording.
pub(crate) type Writer = mcap::Writer<std::io::BufWriter<std::fs::File>>;

/// Writes a recording through the closure `write`.
pub(crate) fn recording_with(file: &Path, write: impl FnOnce(&mut Writer)) {
    let options = mcap::WriteOptions::new().profile("palpate");
    let file = std::io::BufWriter::new(std::fs::File::create(file).unwrap());
    let mut writer = options.compression(None).create(file).unwrap();
    write(&mut writer);
    writer.finish().unwrap();
}

/// Writes frames with their arrival times, ns since 1970.
pub(crate) fn recording_at<'f>(
    writer: &mut Writer,
    frames: impl Iterator<Item = (u64, &'f Value)>,
) {
    let none = std::collections::BTreeMap::new();
    for (log_time, frame) in frames {
        let kind = frame["message"].as_object().unwrap().keys().next().unwrap();
        let channel = writer.add_channel(0, &format!("/{kind}"), "json", &none);
        let header = MessageHeader {
            channel_id: channel.unwrap(),
            sequence: 0,
            log_time,
            publish_time: log_time,
        };
        let text = frame.to_string();
        writer
            .write_to_known_channel(&header, text.as_bytes())
            .unwrap();
    }
}
