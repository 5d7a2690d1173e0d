//! Selection of the image: the same rule for all verbs, and for an installed tool.

use std::fs;
use std::io::{BufRead, BufReader};
#[cfg(unix)]
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use palpate_emulator::firmware;

/// Copies the tool, as an installation does.
fn installed(folder: &Path) -> PathBuf {
    let tool = folder.join("bin");
    fs::create_dir(&tool).unwrap();
    let tool = tool.join("palpate");
    fs::copy(env!("CARGO_BIN_EXE_palpate"), &tool).unwrap();
    tool
}

/// Runs the tool with a minimal environment.
fn run(tool: &Path, index: &Path, arguments: &[&str]) -> Output {
    let keep = [
        "PATH",
        "HOME",
        "CARGO_HOME",
        "RUSTUP_HOME",
        "CARGO_TARGET_DIR",
    ];
    let kept = keep
        .iter()
        .filter_map(|name| Some((name, std::env::var_os(name)?)));
    Command::new(tool)
        .args(arguments)
        .current_dir(index)
        .env_clear()
        .envs(kept)
        .output()
        .unwrap()
}

const SCENARIO: &str =
    "stack = \"ultrasoft\"\ndisturbances = \"none\"\n\n[[press]]\nload = \"rigid\"\n";

const ON_THE_EMULATED_BOARD: [&[&str]; 7] = [
    &["demo", "--engine", "image", "--json"],
    &["simulate", "scenario.toml", "--engine", "image"],
    &["bring-up", "--emulated"],
    &["coil", "--board", "emulated"],
    &["calibrate", "current", "--board", "emulated"],
    &["settings", "get", "--board", "emulated"],
    &["doctor", "--board", "emulated"],
];

#[test]
fn without_image_and_checkout_every_verb_says_where_to_get_one() {
    let folder = tempfile::tempdir().unwrap();
    let tool = installed(folder.path());
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    fs::write(empty.join("scenario.toml"), SCENARIO).unwrap();
    for arguments in ON_THE_EMULATED_BOARD {
        let output = run(&tool, &empty, arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        let place = tool
            .with_file_name("firmware/palpate-pico.elf")
            .display()
            .to_string();
        let bring_up = arguments[0] == "bring-up";
        assert!(
            bring_up || message.contains(&place),
            "{arguments:?}: {message}"
        );
        for part in ["--image FILE", "palpate checkout", "cargo "] {
            assert!(message.contains(part), "{arguments:?}: {message}");
        }
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
    let entries = fs::read_dir(&empty).unwrap().count();
    assert_eq!(entries, 1, "a refused command leaves nothing");
}

#[test]
fn an_image_that_is_none_is_refused_by_every_verb() {
    let folder = tempfile::tempdir().unwrap();
    let index = folder.path();
    fs::write(index.join("scenario.toml"), SCENARIO).unwrap();
    fs::write(index.join("text.elf"), "no image").unwrap();
    let tool = Path::new(env!("CARGO_BIN_EXE_palpate"));
    for file in ["text.elf", "missing.elf"] {
        for arguments in ON_THE_EMULATED_BOARD {
            let output = run(tool, index, &[arguments, &["--image", file]].concat());
            let message = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
            assert!(message.contains(file), "{arguments:?}: {message}");
            assert!(message.contains("with --image"), "{arguments:?}: {message}");
        }
    }
}

#[test]
fn an_image_that_would_not_be_run_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let index = folder.path();
    fs::write(index.join("scenario.toml"), SCENARIO).unwrap();
    let tool = Path::new(env!("CARGO_BIN_EXE_palpate"));
    for (arguments, instead) in [
        (vec!["demo"], "--engine image"),
        (vec!["simulate", "scenario.toml"], "--engine image"),
        (vec!["bring-up", "--connect", "localhost:1"], "--emulated"),
        (
            vec!["coil", "--board", "tcp:localhost:1"],
            "--board emulated",
        ),
    ] {
        let arguments = [&arguments[..], &["--image", "some.elf"]].concat();
        let output = run(tool, index, &arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(instead), "{arguments:?}: {message}");
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn an_installed_tool_runs_the_image_that_is_named_that_of_its_release_or_of_the_checkout() {
    let image = firmware::build().unwrap_or_else(|error| panic!("{error}"));
    let image = fs::canonicalize(image).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let tool = installed(folder.path());
    let plots = folder.path().to_str().unwrap();
    let state = folder.path().join("board.flash");
    let state = state.to_str().unwrap();
    let board = ["--board", "emulated", "--state", state];
    let coil = [&["coil", "--to", "3", "--plots", plots], &board[..]].concat();
    let named = run(
        &tool,
        folder.path(),
        &[&coil[..], &["--image", image.to_str().unwrap()]].concat(),
    );
    let message = String::from_utf8(named.stderr).unwrap();
    assert!(named.status.success(), "{message}");
    assert!(!message.contains("building"), "{message}");
    // Inside the checkout the tool takes the checkout's image.
    let workspace = firmware::workspace().unwrap();
    let found = run(&tool, &workspace.join("docs"), &coil);
    let message = String::from_utf8(found.stderr).unwrap();
    assert!(found.status.success(), "{message}");
    let said = format!("building the firmware image of {}", workspace.display());
    assert!(message.contains(&said), "{message}");
    assert_eq!(found.stdout, named.stdout);
    // Outside a checkout the tool takes the image of an unpacked release.
    let firmware = folder.path().join("bin/firmware");
    fs::create_dir(&firmware).unwrap();
    fs::copy(&image, firmware.join("palpate-pico.elf")).unwrap();
    let beside = run(&tool, folder.path(), &coil);
    let message = String::from_utf8(beside.stderr).unwrap();
    assert!(beside.status.success(), "{message}");
    assert_eq!(beside.stdout, named.stdout);
    // The tool also takes an image directly in its folder.
    fs::rename(
        firmware.join("palpate-pico.elf"),
        folder.path().join("bin/palpate-pico.elf"),
    )
    .unwrap();
    let alone = run(&tool, folder.path(), &coil);
    assert_eq!(alone.stdout, named.stdout);
}

#[test]
#[cfg(unix)]
fn a_tool_that_waits_for_another_cargo_says_so_and_ends_when_it_is_asked() {
    let target = tempfile::tempdir().unwrap();
    let profile = target.path().join("thumbv6m-none-eabi/firmware");
    fs::create_dir_all(&profile).unwrap();
    let other = fs::File::create(profile.join(".cargo-lock")).unwrap();
    other.lock().unwrap();
    let mut tool = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["record", "never.mcap", "--for", "1", "--board", "emulated"])
        .env("CARGO_TARGET_DIR", target.path())
        // Shares a process group with its cargo, so that the test can end cargo before it builds.
        .process_group(0)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let send = |signal: &str, to: &str| Command::new("kill").args([signal, "--", to]).status();
    let number = tool.id().to_string();
    let mut said = BufReader::new(tool.stderr.take().unwrap()).lines();
    let is_waiting = said.any(|line| line.unwrap().contains("Blocking waiting for file lock"));
    send("-TERM", &number).unwrap();
    let ended = tool.wait().unwrap();
    send("-KILL", &format!("-{number}")).unwrap();
    assert!(is_waiting);
    assert_eq!(ended.signal(), Some(15));
}
