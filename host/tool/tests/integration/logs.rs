//! The firmware's log beside the data, decoded by the image's ELF file and by its table.

use std::fs;

use crate::support::{emulated, image, palpate};

#[test]
fn every_verb_shows_the_log_by_the_image_or_by_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let table = palpate(&["log-table", image().to_str().unwrap()], folder);
    assert!(table.status.success());
    assert!(table.stdout.len() < 100_000, "no code is in it");
    fs::write(folder.join("log.json"), &table.stdout).unwrap();
    let shown = ["--log", "--log=log.json"].map(|log| {
        let output = emulated(&["settings", "get", log], folder);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    });
    assert!(shown[0].contains("converter up"), "{}", shown[0]);
    assert_eq!(shown[0], shown[1]);
}

#[test]
fn a_log_that_could_not_come_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, said) in [
        (
            &["settings", "get", "--board", "tcp:localhost:1", "--log"][..],
            "debug probe",
        ),
        (
            &[
                "settings",
                "get",
                "--board",
                "probe:localhost:1,localhost:2",
                "--log",
            ],
            "--log=palpate",
        ),
        (&["demo", "--log"], "--engine image"),
    ] {
        let output = palpate(arguments, folder.path());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(said), "{message}");
    }
}
