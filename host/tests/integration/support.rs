//! How the tests call the tool.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use palpate_emulator::firmware;
use serde_json::Value;

/// The calibration of the emulated board of seed 11.
pub(crate) const CALIBRATION: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/tests/fixture/ultrasoft-11.jsonl"
);

/// The image that is flashed, built once.
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

/// The same with the emulated board, whose flash is a file in the folder.
pub(crate) fn emulated(arguments: &[&str], folder: &Path) -> Output {
    let board = ["--board", "emulated", "--state", "board.flash", "--image"];
    let image = image().to_str().unwrap();
    palpate(&[arguments, &board, &[image]].concat(), folder)
}

/// What the tool has printed, which has succeeded.
pub(crate) fn json(output: &Output) -> Value {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}
