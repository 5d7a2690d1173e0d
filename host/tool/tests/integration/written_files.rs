//! No verb empties or replaces a file that is not its output.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::support::{emulated, image, palpate, recording};

/// Runs a verb with the emulated board's flash in a file of this name.
fn with_state(arguments: &[&str], state: &str, folder: &Path) -> Output {
    let board = ["--board", "emulated", "--state", state, "--image"];
    let image = image().to_str().unwrap();
    palpate(&[arguments, &board, &[image]].concat(), folder)
}

fn refused(output: &Output, code: i32, with: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    for part in with {
        assert!(said.contains(part), "no '{part}' in: {said}");
    }
}

#[test]
fn a_state_that_is_no_flash_is_refused_and_leaves_every_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let files = ["Cargo.toml", "Cargo.lock", "Cargo.partial"];
    for file in files {
        fs::write(folder.join(file), "precious").unwrap();
    }
    fs::create_dir(folder.join("folder")).unwrap();
    for (state, cause) in [
        ("Cargo.toml", "8 bytes"),
        ("folder", "a folder"),
        ("/dev/zero", "not a file"),
    ] {
        let output = with_state(&["settings", "get"], state, folder);
        for file in files {
            let text = fs::read_to_string(folder.join(file)).unwrap();
            assert_eq!(text, "precious", "{state}: {file}");
        }
        assert_eq!(fs::read_dir(folder).unwrap().count(), 4, "{state}");
        refused(&output, 2, &[state, cause, "name a file"]);
    }
}

#[cfg(unix)]
#[test]
fn links_beside_a_state_keep_what_they_lead_to() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("precious"), "precious").unwrap();
    for link in ["board.lock", "board.partial", "board.flash.lock"] {
        std::os::unix::fs::symlink("precious", folder.join(link)).unwrap();
    }
    let store = ["settings", "set", "rate_hz=500", "--store"];
    let output = emulated(&store, folder);
    assert!(output.status.success(), "{output:?}");
    let precious = fs::read_to_string(folder.join("precious")).unwrap();
    assert_eq!(precious, "precious");
    assert_eq!(fs::read(folder.join("board.flash")).unwrap().len(), 65_536);
}

/// A limit on the size of files makes writing fail as on a full disk.
#[cfg(unix)]
#[test]
fn a_state_that_cannot_be_written_is_named_with_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$@\""])
        .arg(env!("CARGO_BIN_EXE_palpate"))
        .args(["settings", "set", "rate_hz=500", "--store"])
        .args(["--board", "emulated", "--state", "board.flash", "--image"])
        .arg(image())
        .current_dir(folder.path())
        .output()
        .unwrap();
    refused(&output, 1, &["--state board.flash: ", "make room"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!said.contains("cable"), "{said}");
    assert!(!folder.path().join("board.flash").exists());
}

#[test]
fn a_recording_is_not_replaced_by_what_is_made_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording(&folder.join("r.mcap"));
    fs::create_dir(folder.join("tables")).unwrap();
    recording(&folder.join("tables/hello.csv"));
    let whole = fs::read(folder.join("r.mcap")).unwrap();
    let report = palpate(&["report", "r.mcap", "--html", "./r.mcap"], folder);
    refused(&report, 2, &["--html ./r.mcap", "is read", "another"]);
    let tables = ["export", "tables/hello.csv", "--csv", "tables"];
    let export = palpate(&tables, folder);
    refused(&export, 2, &["--csv tables/hello.csv", "is read"]);
    for file in ["r.mcap", "tables/hello.csv"] {
        assert_eq!(fs::read(folder.join(file)).unwrap(), whole, "{file}");
    }
}

#[test]
fn outputs_are_neither_inputs_nor_one_another() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scenario = "stack = \"ultrasoft\"\ndisturbances = \"none\"\n\n[[press]]\nload = \"spring\"\n\
                    stiffness_N_per_m = 2e3\ndepth_m = 0.05e-3\n";
    fs::write(folder.join("s.toml"), scenario).unwrap();
    let simulate = |arguments: &[&str]| {
        let verb = ["simulate", "s.toml"];
        palpate(&[&verb, arguments].concat(), folder)
    };
    refused(&simulate(&["--report", "s.toml"]), 2, &["is read"]);
    let both = ["--report", "out", "--records", "./out"];
    refused(
        &simulate(&both),
        2,
        &["--report", "--records", "the same file"],
    );
    let before = fs::read_to_string(folder.join("s.toml")).unwrap();
    assert_eq!(before, scenario);
    assert!(!folder.join("out").exists());
}

#[test]
fn rows_of_a_sweep_do_not_replace_a_text_without_a_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("notes");
    fs::write(&file, "precious").unwrap();
    let vary = "parameters.gap=3..7:2";
    let sweep = [
        "field",
        "sweep",
        "B1",
        "--accuracy",
        "1e-2",
        "--vary",
        vary,
        "--out",
        "notes",
    ];
    refused(
        &palpate(&sweep, folder.path()),
        2,
        &["notes", "no rows of this sweep"],
    );
    assert_eq!(fs::read_to_string(&file).unwrap(), "precious");
}
