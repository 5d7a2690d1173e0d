//! Damaged, truncated and foreign files: with any input the tool ends in time without a panic,
//! names the refused file, and changes only its outputs.
//!
//! The tests run a few mutants of each kind of file. The evidence uses `HOSTILE_MUTANTS` of each,
//! from seed `HOSTILE_SEED`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::mutation::{Random, mutant};
use crate::serve::Server;
use crate::support::{CALIBRATION, emulated, image, palpate};

/// Limits of a run of the tool: processor time, memory, and elapsed time for a busy machine.
const PROCESSOR_S: u64 = 10;
const MEMORY_KIB: u64 = 4_000_000;
const WALL_S: u64 = 60;

/// A kind of file that the tool reads.
struct Kind {
    name: &'static str,
    /// Name of the valid file in a folder.
    file: &'static str,
    is_text: bool,
    /// Commands that read it, in that folder. `IMAGE` stands for the firmware's image; output files
    /// and folders start with `out`.
    commands: &'static [&'static [&'static str]],
    /// Whether files of other kinds are refused.
    refuses_others: bool,
}

const BOARD: [&str; 6] = [
    "--board",
    "emulated",
    "--state",
    "out.flash",
    "--image",
    "IMAGE",
];

const SWEEP: &[&str] = &[
    "field",
    "sweep",
    "A0",
    "--vary",
    "parameters.gap=3..4:2",
    "--accuracy",
    "1e-2",
    "--out",
    "rows.csv",
];

const KINDS: &[Kind] = &[
    Kind {
        name: "recording",
        file: "press.mcap",
        is_text: false,
        commands: &[
            &["info", "press.mcap"],
            &["replay", "press.mcap"],
            &["report", "press.mcap", "--html", "out.html"],
            &["export", "press.mcap", "--csv", "out"],
            &["measure", "--board", "press.mcap", "--speed", "max"],
        ],
        refuses_others: true,
    },
    Kind {
        name: "conversion words",
        file: "words.csv",
        is_text: true,
        commands: &[&["words", "words.csv"]],
        refuses_others: true,
    },
    Kind {
        name: "switches of a converter",
        file: "switches.toml",
        is_text: true,
        commands: &[&["chip", "--frames", "3", "--switches", "switches.toml"]],
        refuses_others: true,
    },
    Kind {
        name: "scenario",
        file: "scenario.toml",
        is_text: true,
        commands: &[&["simulate", "scenario.toml"]],
        refuses_others: true,
    },
    Kind {
        name: "stack",
        file: "stack.toml",
        is_text: true,
        commands: &[&["plan", "stack.toml"]],
        refuses_others: true,
    },
    Kind {
        name: "field design",
        file: "design.toml",
        is_text: true,
        commands: &[&["field", "solve", "design.toml", "--accuracy", "1e-2"]],
        refuses_others: true,
    },
    Kind {
        name: "table of H and B",
        file: "steel.csv",
        is_text: true,
        commands: &[&["field", "solve", "drawn.toml", "--accuracy", "1e-1"]],
        refuses_others: true,
    },
    Kind {
        name: "drawing",
        file: "core.dxf",
        is_text: true,
        commands: &[&["field", "solve", "drawn.toml", "--accuracy", "1e-1"]],
        refuses_others: true,
    },
    Kind {
        name: "rows of a sweep",
        file: "rows.csv",
        is_text: true,
        commands: &[SWEEP],
        refuses_others: true,
    },
    Kind {
        name: "commands in JSON",
        file: "commands.jsonl",
        is_text: true,
        commands: &[&["encode"]],
        refuses_others: true,
    },
    Kind {
        name: "calibration in TOML",
        file: "calibration.toml",
        is_text: true,
        commands: &[&["encode", "--calibration", "calibration.toml"]],
        refuses_others: true,
    },
    Kind {
        name: "frames",
        file: "frames.bin",
        is_text: false,
        commands: &[&["decode"]],
        // The verb accepts foreign bytes, since noise on a line is normal.
        refuses_others: false,
    },
    Kind {
        name: "exported settings",
        file: "board.jsonl",
        is_text: true,
        commands: &[&["settings", "import", "board.jsonl"]],
        refuses_others: true,
    },
    Kind {
        name: "image",
        file: "image.elf",
        is_text: false,
        commands: &[
            &["log-table", "image.elf"],
            &[
                "settings",
                "get",
                "--board",
                "emulated",
                "--state",
                "out.flash",
                "--image",
                "image.elf",
            ],
        ],
        refuses_others: true,
    },
    Kind {
        name: "firmware to be flashed",
        file: "firmware.uf2",
        is_text: false,
        commands: &[&["flash", "firmware.uf2"]],
        refuses_others: true,
    },
    Kind {
        name: "table of a log",
        file: "log.json",
        is_text: true,
        commands: &[&["settings", "get", "--log=log.json"]],
        refuses_others: true,
    },
    Kind {
        name: "flash of a board",
        file: "out.flash",
        is_text: false,
        commands: &[&["settings", "get"]],
        refuses_others: true,
    },
];

impl Kind {
    /// Whether the file is also an output, whose contents are kept.
    fn is_output(&self) -> bool {
        self.commands == [SWEEP]
    }

    /// Name by which a refusal names the file.
    fn named(&self) -> &str {
        match self.commands[0] {
            ["encode"] => "standard input",
            _ => self.file,
        }
    }
}

/// Whether a command runs on the emulated board.
fn is_on_board(command: &[&str]) -> bool {
    matches!(command, ["settings" | "flash", ..]) && !command.contains(&"--image")
}

/// A design with a part of soft metal from a drawing.
const DRAWN: &str = "\
name = \"drawn\"
length_unit = \"mm\"
[background]
field_T = 1e-3
[core]
r = 5.0
x = [-5.0, 5.0]
[material.steel]
bh_table = \"steel.csv\"
[[body]]
name = \"pole\"
material = \"steel\"
shape = { outline_dxf = \"core.dxf\", layer = \"pole\" }
";
const STEEL: &str = "# H in A/m, B in T\n100,0.5\n300,1.0\n1000,1.4\n10000,1.8\n100000,2.2\n";
const SWITCHES: &str = "[switches]\ninterrupt_release = \"StatusOrData\"\nsleep_exit = \"Keeps\"\n";
const SCENARIO: &str = "\
stack = \"ultrasoft\"
disturbances = \"none\"
except = [\"creep\", \"vibration\"]
[[press]]
load = \"spring\"
stiffness_N_per_m = 3e3
";

/// A square of 8 mm beside the axis, as DXF.
fn drawing() -> String {
    let corners = [(2, 4), (10, 4), (10, 12), (2, 12)];
    let mut groups = String::from(
        "0 SECTION\n2 HEADER\n9 $INSUNITS\n70 4\n0 ENDSEC\n0 SECTION\n2 ENTITIES\n\
         0 LWPOLYLINE\n8 pole\n90 4\n70 1\n",
    );
    for (x, y) in corners {
        let _ = writeln!(groups, "10 {x}.0\n20 {y}.0");
    }
    groups += "0 ENDSEC\n0 EOF\n";
    groups
        .lines()
        .map(|group| group.replacen(' ', "\n", 1) + "\n")
        .collect()
}

/// Creates a folder with a valid file of each kind; the recording is of a press, or of one second
/// without contact.
fn sound(folder: &Path, is_pressed: bool) {
    let checkout = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let copy = |from: &str, to: &str| {
        fs::copy(checkout.join(from), folder.join(to)).unwrap();
    };
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    copy("docs/examples/words.csv", "words.csv");
    write("switches.toml", SWITCHES);
    write("scenario.toml", SCENARIO);
    copy("sim-host/stacks/ultrasoft.toml", "stack.toml");
    copy("model/field/designs/B1.toml", "design.toml");
    write("drawn.toml", DRAWN);
    write("steel.csv", STEEL);
    write("core.dxf", &drawing());
    assert!(palpate(SWEEP, folder).status.success());
    let calibration = fs::read_to_string(CALIBRATION).unwrap();
    write("board.jsonl", &calibration);
    let commands: Vec<&str> = calibration.lines().skip(1).collect();
    write("commands.jsonl", &commands.join("\n"));
    write("calibration.toml", &as_toml(&calibration));
    copy("firmware/wire/fixture/v2-records.bin", "frames.bin");
    fs::copy(image(), folder.join("image.elf")).unwrap();
    let server = Server::start(&[]);
    let board = format!("tcp:{}", server.address);
    let info = "UF2 Bootloader v3.0\nBoard-ID: RPI-RP2\n";
    write("INFO_UF2.TXT", info);
    let flash = ["flash", "image.elf", "--drive", ".", "--board", &board];
    let flashed = palpate(&flash, folder);
    assert!(flashed.status.success());
    fs::rename(folder.join("palpate.uf2"), folder.join("firmware.uf2")).unwrap();
    let table = palpate(&["log-table", "image.elf"], folder);
    fs::write(folder.join("log.json"), table.stdout).unwrap();
    let on_board = |arguments: &[&str]| {
        let output = emulated(&[arguments, &["--seed", "11"]].concat(), folder);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{said}");
    };
    if is_pressed {
        on_board(&["settings", "import", CALIBRATION, "--store"]);
        on_board(&[
            "record",
            "press.mcap",
            "--arm",
            "--load",
            "1.3",
            "--for",
            "7",
        ]);
    } else {
        on_board(&["settings", "set", "rate_hz=400", "--store"]);
        on_board(&["record", "press.mcap", "--for", "1"]);
    }
    fs::rename(folder.join("board.flash"), folder.join("out.flash")).unwrap();
}

/// Converts the commands of an export without lists to a calibration file.
fn as_toml(lines: &str) -> String {
    let mut text = String::new();
    for line in lines.lines().filter(|line| !line.contains('[')) {
        let command: BTreeMap<String, BTreeMap<String, serde_json::Value>> =
            serde_json::from_str(line).unwrap();
        for (name, fields) in command {
            let _ = writeln!(text, "[[{name}]]");
            for (field, value) in fields.iter().filter(|(_, value)| !value.is_null()) {
                let _ = writeln!(text, "{field} = {value}");
            }
        }
    }
    text
}

/// How a run of a command ended.
struct Run {
    status: ExitStatus,
    said: String,
    has_printed: bool,
    took: Duration,
}

/// Runs a command in a folder, which is also the user's home, within the limits.
fn run(command: &[&str], folder: &Path) -> Run {
    let board = if is_on_board(command) {
        &BOARD[..]
    } else {
        &[]
    };
    let arguments = command.iter().chain(board).map(|&argument| match argument {
        "IMAGE" => image().to_str().unwrap(),
        argument => argument,
    });
    let limits = format!(
        "ulimit -v {MEMORY_KIB}; ulimit -t {PROCESSOR_S}; exec timeout -s KILL {WALL_S} \"$@\""
    );
    let read = match command {
        ["encode"] => Some("commands.jsonl"),
        ["decode"] => Some("frames.bin"),
        _ => None,
    };
    let input = read.map(|file| fs::File::open(folder.join(file)).unwrap());
    let began = Instant::now();
    let output = Command::new("sh")
        .args(["-c", &limits, "sh", env!("CARGO_BIN_EXE_palpate")])
        .args(arguments)
        .current_dir(folder)
        .env("HOME", folder)
        .env("XDG_STATE_HOME", folder)
        .stdin(input.map_or_else(Stdio::null, Stdio::from))
        .output()
        .unwrap();
    Run {
        status: output.status,
        said: String::from_utf8_lossy(&output.stderr).into_owned(),
        has_printed: !output.stdout.is_empty(),
        took: began.elapsed(),
    }
}

/// Returns all files of a folder.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    let files = entries.filter(|entry| entry.metadata().unwrap().is_file());
    let named = files.map(|entry| {
        let name = entry.file_name().into_string().unwrap();
        (name, fs::read(entry.path()).unwrap())
    });
    named.collect()
}

/// Returns the defect of a run, if any.
fn defect(kind: &Kind, run: &Run, is_foreign: bool, changed: &[String]) -> Option<String> {
    let code = run.status.code();
    let last = run.said.lines().last().unwrap_or_default();
    if run.said.contains("panicked at") {
        return Some(format!(
            "panic: {}",
            run.said.lines().next().unwrap_or_default()
        ));
    }
    match code {
        Some(0) if is_foreign && kind.refuses_others => {
            Some("taken for one of its kind".to_owned())
        }
        Some(0) if !run.has_printed && !kind.is_output() => {
            Some("neither a result nor a refusal".to_owned())
        }
        Some(2) if !run.said.contains(kind.named()) => {
            Some(format!("the file is not named: {last}"))
        }
        Some(2) if !changed.is_empty() => Some(format!("refused, and changed {changed:?}")),
        Some(1) if run.said.is_empty() => Some("failed without a word".to_owned()),
        Some(0..=2) if changed.iter().any(|name| !name.starts_with("out")) && !kind.is_output() => {
            Some(format!("changed {changed:?}"))
        }
        Some(0..=2) if run.said.contains(|c: char| c.is_control() && c != '\n') => {
            Some("control characters on the terminal".to_owned())
        }
        Some(0..=2) => None,
        _ => Some(format!(
            "ended with {:?} after {:?}: {last}",
            run.status, run.took
        )),
    }
}

/// Results of many runs of a kind.
#[derive(Default)]
struct Tally {
    ended: [u32; 3],
    slowest: Duration,
    defects: Vec<String>,
}

/// Runs a command of the kind on a file in place of the valid one.
fn attempt(
    kind: &Kind,
    sound: &BTreeMap<String, Vec<u8>>,
    bytes: &[u8],
    (seed, is_foreign): (u64, bool),
    tally: &mut Tally,
) {
    let folder = tempfile::tempdir().unwrap();
    let command = kind.commands[seed as usize % kind.commands.len()];
    for (name, contents) in sound
        .iter()
        .filter(|(_, contents)| contents.len() < 300_000)
    {
        fs::write(folder.path().join(name), contents).unwrap();
    }
    fs::write(folder.path().join(kind.file), bytes).unwrap();
    let before = files(folder.path());
    let run = run(command, folder.path());
    let after = files(folder.path());
    let changed = before
        .iter()
        .filter(|(name, bytes)| after.get(*name) != Some(bytes));
    let changed: Vec<String> = changed.map(|(name, _)| name.clone()).collect();
    tally.slowest = tally.slowest.max(run.took);
    if let Some(code @ 0..=2) = run.status.code() {
        tally.ended[code as usize] += 1;
    }
    if let Some(what) = defect(kind, &run, is_foreign, &changed) {
        tally
            .defects
            .push(format!("{} {seed} ({}): {what}", kind.name, command[0]));
        if let Some(keep) = std::env::var_os("HOSTILE_KEEP") {
            fs::write(
                Path::new(&keep).join(format!("{seed}-{}", kind.file)),
                bytes,
            )
            .unwrap();
        }
    }
}

/// Foreign files, including an empty one.
fn foreign(random: &mut Random) -> Vec<Vec<u8>> {
    let mut all: Vec<Vec<u8>> = [
        &b""[..],
        b"\n",
        b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR",
        b"\x1f\x8b\x08\0\0\0\0\0",
        b"PK\x03\x04\x14\0",
        b"<!DOCTYPE html><html></html>",
        b"\x7fELF\x02\x01\x01",
    ]
    .map(<[u8]>::to_vec)
    .into();
    all.push(vec![0; 65_536]);
    all.push(random.bytes(4_096));
    all
}

fn campaign(kind: &Kind, sound: &BTreeMap<String, Vec<u8>>, mutants: u64, first: u64) -> Tally {
    let mut tally = Tally::default();
    let mut others = foreign(&mut Random(first));
    // Leaves out the empty file where the file is also the output, since a sweep may start with an
    // empty file.
    others.retain(|bytes| !bytes.is_empty() || !kind.is_output());
    let others_count = if mutants < 100 { 3 } else { others.len() };
    for (seed, bytes) in (0..).zip(others.iter().take(others_count)) {
        attempt(kind, sound, bytes, (seed, true), &mut tally);
    }
    for seed in first..first + mutants {
        let bytes = mutant(&mut Random(seed), &sound[kind.file], kind.is_text);
        attempt(kind, sound, &bytes, (seed, false), &mut tally);
    }
    tally
}

pub(crate) fn number(name: &str, usual: u64) -> u64 {
    std::env::var(name).map_or(usual, |text| text.parse().unwrap())
}

#[test]
fn files_of_every_kind_are_read_or_refused_in_order() {
    let (mutants, first) = (number("HOSTILE_MUTANTS", 2), number("HOSTILE_SEED", 1));
    let folder = tempfile::tempdir().unwrap();
    sound(folder.path(), mutants >= 100);
    for kind in KINDS {
        for command in kind.commands {
            let run = run(command, folder.path());
            assert!(
                matches!(run.status.code(), Some(0 | 1)),
                "{command:?}: {}",
                run.said
            );
        }
    }
    let sound = files(folder.path());
    let (even, odd): (Vec<_>, Vec<_>) = (0..KINDS.len()).partition(|index| index % 2 == 0);
    let half = |of: &[usize]| -> Vec<(usize, Tally)> {
        let tallies = of
            .iter()
            .map(|&at| (at, campaign(&KINDS[at], &sound, mutants, first)));
        tallies.collect()
    };
    let mut tallies = thread::scope(|scope| {
        let other = scope.spawn(|| half(&odd));
        let mut tallies = half(&even);
        tallies.extend(other.join().unwrap());
        tallies
    });
    tallies.sort_by_key(|(at, _)| *at);
    let defects: Vec<&String> = tallies
        .iter()
        .flat_map(|(_, tally)| &tally.defects)
        .collect();
    println!(
        "{}\n<!-- evidence:begin -->\n{mutants} mutants of each of {} kinds of file: {} panics, hangs and wrong ends.\n<!-- evidence:end -->",
        table(&tallies, (mutants, first)),
        tallies.len(),
        defects.len()
    );
    assert!(defects.is_empty(), "{defects:#?}");
}

fn table(tallies: &[(usize, Tally)], (mutants, first): (u64, u64)) -> String {
    let mut text = format!(
        "{mutants} mutants of each kind, seeds {first} to {}, and files of other kinds; {PROCESSOR_S} s of processor \
         time, {} GB of memory for each run.\n\n\
         | kind of file | done | failed (1) | refused (2) | slowest | panics, hangs, wrong ends |\n\
         |---|---|---|---|---|---|\n",
        first + mutants - 1,
        MEMORY_KIB / 1_000_000,
    );
    for (at, tally) in tallies {
        let [done, failed, refused] = tally.ended;
        let _ = writeln!(
            text,
            "| {} | {done} | {failed} | {refused} | {:.1} s | {} |",
            KINDS[*at].name,
            tally.slowest.as_secs_f64(),
            tally.defects.len(),
        );
    }
    text
}
