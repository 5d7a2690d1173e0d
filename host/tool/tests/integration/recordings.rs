//! `palpate record`, `info` and `export`, as their users call them.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::serve::Server;

use crate::support::{emulated, json, palpate};

/// Longest wait on a busy computer.
const PATIENCE: Duration = Duration::from_secs(300);

/// Starts a recording of a server, which runs until it is ended.
fn record(server: &Server, folder: &Path, file: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["record", file, "--json", "--board"])
        .arg(format!("tcp:{}", server.address))
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Waits for a condition.
fn wait_until(what: &str, mut is_true: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !is_true() {
        assert!(begin.elapsed() < PATIENCE, "{what}");
        sleep(Duration::from_millis(100));
    }
}

/// Output of `palpate info` for a file, if it exists.
fn info(folder: &Path, file: &str) -> Option<Value> {
    let output = palpate(&["info", file, "--json"], folder);
    output.status.success().then(|| json(&output))
}

/// Number of samples in a file so far.
fn samples(folder: &Path, file: &str) -> u64 {
    let info = info(folder, file);
    let samples = info
        .as_ref()
        .and_then(|info| info["records"]["sample"].as_u64());
    samples.unwrap_or(0)
}

/// All rows of all tables in a folder, by sequence number.
fn exported(folder: &Path, file: &str) -> BTreeMap<u32, BTreeMap<String, String>> {
    let output = palpate(&["export", file, "--csv", "tables"], folder);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    let mut rows = BTreeMap::new();
    for table in fs::read_dir(folder.join("tables")).unwrap() {
        let mut reader = csv::Reader::from_path(table.unwrap().path()).unwrap();
        for row in reader.deserialize() {
            let row: BTreeMap<String, String> = row.unwrap();
            let before = rows.insert(row["sequence"].parse().unwrap(), row);
            assert!(before.is_none(), "a frame stands in two rows");
        }
    }
    rows
}

fn in_folder(folder: &Path, file: &str) -> String {
    folder.join(file).to_string_lossy().into_owned()
}

#[test]
fn what_an_emulated_board_sends_is_in_the_tables_without_a_gap() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["record", "r.mcap", "--for", "2", "--json"];
    let recorded = json(&emulated(&arguments, folder.path()));
    assert_eq!(recorded["not_written"], 0);
    assert_eq!(recorded["unreadable"], 0);
    assert_eq!(recorded["boots"][0]["missing"], 0, "{recorded}");
    let about = info(folder.path(), "r.mcap").unwrap();
    assert_eq!(about["damage"], Value::Null);
    assert_eq!(about["boots"], recorded["boots"]);
    let in_force = &about["in_force"][0];
    assert_eq!(in_force["settings"]["settings"]["rate_hz"], 1000.0);
    assert_eq!(in_force["hello"]["hello"]["board"], "pico");
    let rows = exported(folder.path(), "r.mcap");
    assert_eq!(rows.len() as u64, recorded["records"].as_u64().unwrap());
    let (first, last) = (rows.keys().next().unwrap(), rows.keys().last().unwrap());
    assert_eq!(
        (last - first) as usize + 1,
        rows.len(),
        "a number is missing"
    );
    let samples: Vec<_> = rows
        .values()
        .filter(|row| row.contains_key("contact"))
        .collect();
    assert!(samples.len() > 1_900, "{}", samples.len());
    let mut before_s = None;
    for row in samples {
        let of = |name: &str| row[name].parse::<f64>().unwrap();
        let frequency_hz = of("channels_0_frequency_hz");
        assert!((1e6..10e6).contains(&frequency_hz), "{frequency_hz}");
        // Samples arrive in packets, yet `device_time_s` keeps a constant offset from `time_us`. A
        // date as a float is accurate to a quarter of a microsecond.
        let behind_s = of("device_time_s") - 1e-6 * of("time_us");
        let step_s = behind_s - before_s.replace(behind_s).unwrap_or(behind_s);
        assert!(step_s.abs() < 1e-6, "{step_s} s");
        // Conversion, sending and reception take 1 or 2 ms. The comparison of the clocks is
        // accurate to a poll of the port.
        let late_s = of("host_time_s") - of("device_time_s");
        assert!((-0.005..0.02).contains(&late_s), "{late_s} s");
    }
}

#[test]
fn a_recording_that_is_killed_keeps_what_was_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let flash = in_folder(folder.path(), "b.flash");
    let server = Server::start(&["--state", &flash]);
    for (number, after_ms) in [130, 570].into_iter().enumerate() {
        let file = format!("{number}.mcap");
        let partial = format!("{file}.partial");
        let mut program = record(&server, folder.path(), &file);
        wait_until("the board is recorded", || {
            samples(folder.path(), &partial) > 0
        });
        sleep(Duration::from_millis(after_ms));
        let before = samples(folder.path(), &partial);
        program.kill().unwrap();
        program.wait().unwrap();
        assert!(!folder.path().join(file).exists());
        assert!(samples(folder.path(), &partial) >= before);
        let rows = exported(folder.path(), &partial);
        let (first, last) = (rows.keys().next().unwrap(), rows.keys().last().unwrap());
        assert_eq!(
            (last - first) as usize + 1,
            rows.len(),
            "a number is missing"
        );
        fs::remove_dir_all(folder.path().join("tables")).unwrap();
    }
}

#[test]
fn a_recording_goes_on_with_the_next_boot_and_ends_with_ctrl_c() {
    let folder = tempfile::tempdir().unwrap();
    let flash = in_folder(folder.path(), "b.flash");
    let first = Server::start(&["--state", &flash]);
    let address = first.address.clone();
    let program = record(&first, folder.path(), "r.mcap");
    wait_until("the first boot is recorded", || {
        samples(folder.path(), "r.mcap.partial") > 0
    });
    drop(first);
    // Another seed, since the same board would repeat its random numbers and so its boot id.
    let _second = Server::at(&address, &["--seed", "2", "--state", &flash]);
    wait_until("the second boot is recorded", || {
        info(folder.path(), "r.mcap.partial").is_some_and(|info| {
            let boots = info["boots"].as_array();
            boots.is_some_and(|boots| boots.len() == 2)
        })
    });
    let interrupted = Command::new("kill")
        .args(["-INT", &program.id().to_string()])
        .status();
    assert!(interrupted.unwrap().success());
    let recorded = json(&program.wait_with_output().unwrap());
    let boots = recorded["boots"].as_array().unwrap();
    assert_eq!(boots.len(), 2, "{recorded}");
    assert!(boots.iter().all(|boot| boot["missing"] == 0), "{recorded}");
    let about = info(folder.path(), "r.mcap").unwrap();
    assert_eq!(about["damage"], Value::Null);
    assert_eq!(about["in_force"].as_array().unwrap().len(), 2);
}

#[test]
fn a_file_that_appears_while_a_recording_is_written_stays() {
    let folder = tempfile::tempdir().unwrap();
    let flash = in_folder(folder.path(), "b.flash");
    let server = Server::start(&["--state", &flash]);
    let program = record(&server, folder.path(), "r.mcap");
    wait_until("the board is recorded", || {
        samples(folder.path(), "r.mcap.partial") > 0
    });
    fs::write(folder.path().join("r.mcap"), "precious").unwrap();
    let interrupted = Command::new("kill")
        .args(["-INT", &program.id().to_string()])
        .status();
    assert!(interrupted.unwrap().success());
    let output = program.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("r.mcap.partial"), "{said}");
    let precious = fs::read_to_string(folder.path().join("r.mcap")).unwrap();
    assert_eq!(precious, "precious");
    let whole = info(folder.path(), "r.mcap.partial").unwrap();
    assert_eq!(whole["damage"], Value::Null);
}

#[test]
fn what_is_no_recording_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("r.mcap"), "this is no recording at all").unwrap();
    let export = palpate(&["export", "r.mcap", "--csv", "tables"], folder.path());
    let inform = palpate(&["info", "r.mcap"], folder.path());
    for output in [export, inform] {
        assert_eq!(output.status.code(), Some(2));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains("not an MCAP file"), "{said}");
    }
}
