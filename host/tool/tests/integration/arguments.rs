//! Numbers and names on the command line, and characters from files on the terminal.

use std::fs;
use std::process::Command;

use serde_json::Value;

use crate::support::{image, palpate, recording};

#[test]
fn durations_and_factors_that_cannot_be_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    recording(&folder.path().join("r.mcap"));
    let played = ["--board", "r.mcap"];
    let verbs: [(&[&str], &str, bool); 10] = [
        (&["measure", "--wait"], "seconds", true),
        (&["check", "--wait"], "seconds", true),
        (&["watch", "--for"], "seconds", true),
        (&["record", "--for"], "seconds", true),
        (&["serve-emulated", "--for"], "seconds", false),
        (&["measure", "--load"], "0.001 to 1000", true),
        (&["record", "--load"], "0.001 to 1000", true),
        (&["check", "--load"], "0.001 to 1000", true),
        (&["serve-emulated", "--press"], "0.001 to 1000", false),
        (&["watch", "--speed"], "0.001 to 1e6", true),
    ];
    for (verb, allowed, has_board) in verbs {
        for value in ["nan", "inf", "-1", "1e300", "1e20", "x", ""] {
            let board: &[&str] = if has_board { &played } else { &[] };
            let output = palpate(&[verb, &[value], board].concat(), folder.path());
            let said = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{verb:?} {value}: {said}");
            assert!(said.contains(allowed), "{verb:?} {value}: {said}");
        }
    }
    let still = ["watch", "--speed", "0", "--board", "r.mcap"];
    let output = palpate(&still, folder.path());
    assert_eq!(output.status.code(), Some(2), "{output:?}");
}

/// File names on Linux need not be UTF-8. Every verb prints such a name in its JSON output.
#[cfg(target_os = "linux")]
#[test]
fn a_name_that_is_no_text_is_printed_as_json_nevertheless() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let folder = tempfile::tempdir().unwrap();
    let name = OsStr::from_bytes(b"r\xff.mcap");
    recording(&folder.path().join(name));
    let run = |verb: &[&str], file: &[u8]| {
        let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
            .args(verb)
            .arg(OsStr::from_bytes(file))
            .current_dir(folder.path())
            .output();
        // A replay without anything to compare fails, but prints its result.
        serde_json::from_slice::<Value>(&output.unwrap().stdout).unwrap()
    };
    let lossy = "r\u{fffd}.mcap";
    assert_eq!(run(&["info", "--json"], name.as_bytes())["file"], lossy);
    assert_eq!(run(&["replay", "--json"], name.as_bytes())["file"], lossy);
    let report = run(&["report", "--json"], name.as_bytes());
    assert_eq!(report["file"], "r\u{fffd}.html");
    let board = [
        "--board", "emulated", "--state", "b.flash", "--json", "--image",
    ];
    let board = [&board[..], &[image().to_str().unwrap()]].concat();
    let recorded = run(
        &[&["record", "--for", "0.1"], &board[..]].concat(),
        b"n\xff.mcap",
    );
    assert_eq!(recorded["file"], "n\u{fffd}.mcap");
    let exported = run(
        &[&["settings", "export"], &board[..]].concat(),
        b"n\xff.jsonl",
    );
    assert_eq!(exported["file"], "n\u{fffd}.jsonl");
}

#[test]
fn characters_that_control_a_terminal_are_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let head = "source,fref_hz,rcount,kind,value\n";
    let row = "\"a\u{1b}[31mb\nc\",40000000,5000,word,0x1234567\n";
    fs::write(folder.join("w.csv"), format!("{head}{row}")).unwrap();
    fs::write(folder.join("e.csv"), format!("so\u{1b}[31murce,{head}")).unwrap();
    let words = palpate(&["words", "w.csv"], folder);
    let text = String::from_utf8(words.stdout).unwrap();
    assert!(text.contains("a\\u{1b}[31mb\\nc"), "{text}");
    let unknown = palpate(&["words", "e.csv"], folder);
    let text = String::from_utf8(unknown.stderr).unwrap();
    assert!(text.contains("so\\u{1b}[31murce"), "{text}");

    crate::support::recording_with(&folder.join("r.mcap"), |writer| {
        let metadata = [("board".to_owned(), "p\u{1b}[31mico\nnext".to_owned())];
        let metadata = mcap::records::Metadata {
            name: "recording".to_owned(),
            metadata: metadata.into(),
        };
        writer.write_metadata(&metadata).unwrap();
    });
    let info = palpate(&["info", "r.mcap"], folder);
    let text = String::from_utf8(info.stdout).unwrap();
    assert!(text.contains("p\\u{1b}[31mico\\nnext"), "{text}");
}

#[test]
fn noise_is_no_flash_of_a_board() {
    let folder = tempfile::tempdir().unwrap();
    let noise: Vec<u8> = (0..65_536_u32)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 19) as u8)
        .collect();
    fs::write(folder.path().join("noise"), &noise).unwrap();
    let board = ["settings", "get", "--board", "emulated", "--state", "noise"];
    let image = ["--image", image().to_str().unwrap()];
    let output = palpate(&[&board[..], &image].concat(), folder.path());
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("noise: ") && said.contains("name a file"),
        "{said}"
    );
    assert_eq!(fs::read(folder.path().join("noise")).unwrap(), noise);
}
