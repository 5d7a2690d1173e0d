//! `palpate words` as its users call it.

use std::{io::Write, path::Path};

use assert_cmd::Command;
use proptest::prelude::*;
use serde_json::Value;

const EXAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/words.csv");

fn palpate(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .output()
        .unwrap()
}

fn rows(path: &Path) -> Vec<Value> {
    let output = palpate(&["words", path.to_str().unwrap(), "--json"]);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

fn file(text: impl AsRef<[u8]>) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(text.as_ref()).unwrap();
    file
}

#[test]
fn posted_words_are_ratios_within_the_window() {
    let rows = rows(Path::new(EXAMPLE));
    assert_eq!(rows.len(), 10);
    for row in rows {
        let number = |key: &str| row[key].as_f64().unwrap_or_else(|| panic!("{key}: {row}"));
        assert!(number("residual_lsb").abs() < 0.6, "{row}");
        let gate = 32.0 * number("rcount");
        assert!((gate - 30.0..=gate - 10.0).contains(&number("n")), "{row}");
        assert_eq!(row["plausible"], true);
        // The frequency is that of the ratio m/n, within half a unit of the word.
        let of_ratio = number("fref_hz") * number("m") / number("n");
        let lsb_hz = number("fref_hz") / 268_435_456.0;
        assert!(
            (number("frequency_hz") - of_ratio).abs() <= 0.5 * lsb_hz,
            "{row}"
        );
        // The uncertainty is between the smallest and the largest quantisation of the two-gate
        // counter.
        let relative = number("sigma_hz") / number("frequency_hz") * number("rcount");
        assert!((0.0127..0.0257).contains(&relative), "{row}");
    }
}

/// The reported line is that of an editor, also with Windows line ends and blank lines.
#[test]
fn a_wrong_word_is_named_by_its_line_whatever_ends_lines() {
    let lines = "source,fref_hz,rcount,kind,value\na,40e6,65535,word,0x01234567\n\nb,40e6,65535,word,01234567\n";
    for text in [
        lines.to_owned(),
        lines.replace('\n', "\r\n"),
        format!("\u{feff}{}", lines.replace('\n', "\r\n")),
    ] {
        let file = file(&text);
        let output = palpate(&["words", file.path().to_str().unwrap()]);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(
            said.contains("line 4: value is '01234567'. Allowed: DATAx in hexadecimal behind 0x"),
            "{said}"
        );
    }
}

#[test]
fn of_random_words_three_to_seven_in_a_thousand_are_plausible() {
    let mut text = String::from("source,fref_hz,rcount,kind,value\n");
    let mut state = 1_u64;
    for _ in 0..100_000 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        text.push_str(&format!("random,12000000,1512,word,{:#x}\n", state >> 36));
    }
    let plausible = rows(file(text).path())
        .iter()
        .filter(|row| row["plausible"] == true)
        .count();
    assert!((300..=700).contains(&plausible), "{plausible}");
}

#[test]
fn columns_may_stand_in_any_order() {
    let file = file("kind,value,source,rcount,fref_hz\nword,0x4409e8b,readme,1512,12000000\n");
    assert_eq!(rows(file.path())[0]["n"], 48_364);
}

#[test]
fn words_with_flags_and_at_the_ends_of_the_range_are_named_and_not_judged() {
    // The word in DATAx, its quality, and whether its ratio of counts has a verdict.
    let words = [
        ("0x4409e8b", "above_quarter_reference", true),
        ("0x14409e8b", "above_quarter_reference", true),
        ("0x11000000", "amplitude", true),
        ("0x24409e8b", "watchdog", false),
        ("0x0", "under_range", false),
        ("0x80000000", "under_range", false),
        ("0xfffffff", "over_range", false),
        ("0x4fffffff", "over_range", false),
    ];
    let mut text = String::from("source,fref_hz,rcount,kind,value\n");
    for (word, ..) in words {
        text.push_str(&format!("board,12000000,1512,word,{word}\n"));
    }
    let rows = rows(file(text).path());
    assert_eq!(rows.len(), words.len());
    for (row, (word, quality, is_judged)) in rows.iter().zip(words) {
        assert_eq!(row["quality"], quality, "{word}");
        assert_eq!(row["plausible"].is_null(), !is_judged, "{word}");
    }
}

/// Bad input, the line of the error, and a part of the allowed values.
#[test]
fn bad_input_is_refused_with_place_and_remedy() {
    let header = "source,fref_hz,rcount,kind,value";
    let row = |fields: &str| format!("# a comment\n{header}\n{fields}\n");
    let cases = [
        (String::new(), 1, "the columns source"),
        ("\n\n".into(), 1, "the columns source"),
        (format!("{header}\n"), 2, "at least one line"),
        (
            "source,fref_hz,rcount,kind\n".into(),
            1,
            "the columns source",
        ),
        (format!("{header},gain\n"), 1, "the columns source"),
        (format!("{header},kind\n"), 1, "each once"),
        (row("a,NaN,1512,word,0x1"), 3, "Hz"),
        (row("a,inf,1512,word,0x1"), 3, "Hz"),
        (row("a,-1,1512,word,0x1"), 3, "Hz"),
        (row("a,,1512,word,0x1"), 3, "Hz"),
        (row("a,12000000,NaN,word,0x1"), 3, "65535"),
        (row("a,12000000,8,word,0x1"), 3, "65535"),
        (row("a,12000000,65536,word,0x1"), 3, "65535"),
        (row("a,12000000,1512.5,word,0x1"), 3, "65535"),
        (row("a,12000000,1512,code,0x1"), 3, "word or hz"),
        (row("a,12000000,1512,word,0xzz"), 3, "28 bits"),
        (row("a,12000000,1512,word,0x"), 3, "28 bits"),
        (row("a,12000000,1512,word,0x+1"), 3, "28 bits"),
        (row("a,12000000,1512,word,4409e8b"), 3, "28 bits"),
        (row("a,12000000,1512,word,0x100000000"), 3, "28 bits"),
        (row("a,12000000,1512,hz,NaN"), 3, "frequency"),
        (row("a,12000000,1512,hz,12000000"), 3, "frequency"),
        (row("a,12000000,1512,hz,-5"), 3, "frequency"),
        (row("a,12000000,1512,word"), 3, "5 fields"),
        (row("a,12000000,1512,word,0x1,x"), 3, "5 fields"),
    ];
    for (text, line, allowed) in cases {
        let file = file(&text);
        let output = palpate(&["words", file.path().to_str().unwrap()]);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{text:?}: {message}");
        assert!(output.stdout.is_empty(), "{text:?}");
        assert!(
            message.contains(file.path().to_str().unwrap()),
            "{text:?}: {message}"
        );
        assert!(
            message.contains(&format!("line {line}:")),
            "{text:?}: {message}"
        );
        assert!(message.contains(allowed), "{text:?}: {message}");
    }
}

#[test]
fn an_unreadable_file_is_named() {
    let output = palpate(&["words", "no/such/file.csv"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        String::from_utf8(output.stderr)
            .unwrap()
            .contains("no/such/file.csv")
    );
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let file = file(format!(
        "source,fref_hz,rcount,kind,value\n{}",
        "a,12000000,1512,word,0x4409e8b\n".repeat(20_000)
    ));
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["words", file.path().to_str().unwrap(), "--json"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Arbitrary bytes are decoded, or refused with exit code 2, but never cause a panic (101).
    #[test]
    fn any_bytes_end_in_order(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let output = palpate(&["words", file(bytes).path().to_str().unwrap()]);
        prop_assert!(matches!(output.status.code(), Some(0 | 2)));
    }

    #[test]
    fn any_fields_end_in_order(fields in "[-+0-9a-zA-Z.,# \"\n]{0,80}") {
        let text = format!("source,fref_hz,rcount,kind,value\n{fields}");
        let output = palpate(&["words", file(text).path().to_str().unwrap()]);
        prop_assert!(matches!(output.status.code(), Some(0 | 2)));
    }
}
