//! Hostile connections to the emulated board's port, its bench and the page, and boards that send
//! invalid data. Afterwards each server accepts the next program.
//!
//! The tests make a few attacks on each. The evidence uses `HOSTILE_ATTACKS` on each, from seed
//! `HOSTILE_SEED`.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use crate::hostile_files::number;
use crate::live::{Live, UPGRADE, memory};
use crate::mutation::{Random, mutant};
use crate::serve::Server;

/// Time for which an attacker waits for an answer.
const ATTACK: Duration = Duration::from_millis(30);
/// After this many attacks on a server a well-behaved program tests it.
const BETWEEN: u64 = 25;
/// Limit of the memory, bytes, that a server may use in addition to that before the attacks.
const MEMORY_BYTES: u64 = 64_000_000;
/// Longest wait of a well-behaved program for its answer, and longest run of the tool with a board
/// that sends invalid data. A busy computer emulates slowly.
const PATIENCE: Duration = Duration::from_secs(60);

const COMMANDS: &[u8] = include_bytes!("../../../../firmware/wire/fixture/v2-commands.bin");
const RECORDS: &[u8] = include_bytes!("../../../../firmware/wire/fixture/v2-records.bin");
const BENCH: &[u8] = b"stage\nmount spring 600\nmount block\nmove 0.001 0.0005\nmove -0.001 1\n";

/// Bytes of an attacker, in some cases similar to the valid bytes `sound`.
fn payload(random: &mut Random, sound: &[u8], is_text: bool) -> Vec<u8> {
    let length = random.below(4_096);
    match random.below(6) {
        0 => random.bytes(length),
        1 => format!("POST / HTTP/1.1\r\nContent-Length: {length}\r\n\r\n").into(),
        2 => vec![random.one_of(&[0, b'a', b'\n', 0xFF]); 300_000],
        3 => Vec::new(),
        _ => mutant(random, sound, is_text),
    }
}

/// Sends the bytes in two pieces, then disconnects in one of several ways.
fn attack(address: &str, bytes: &[u8], random: &mut Random) {
    let Ok(mut stream) = TcpStream::connect(address) else {
        return;
    };
    let _ = stream.set_read_timeout(Some(ATTACK));
    let _ = stream.set_write_timeout(Some(ATTACK));
    let (first, second) = bytes.split_at(random.below(bytes.len()));
    let _ = stream.write_all(first);
    if random.below(4) == 0 {
        sleep(Duration::from_millis(2));
    }
    let _ = stream.write_all(second);
    if random.below(2) == 0 {
        let _ = stream.shutdown(Shutdown::Write);
    }
    if random.below(2) == 0 {
        let _ = stream.read(&mut [0; 4_096]);
    }
}

/// Attacks a server, and checks it after every few attacks.
fn attacks(
    (count, first): (u64, u64),
    address: &str,
    mut payload: impl FnMut(&mut Random) -> Vec<u8>,
    mut serves: impl FnMut() -> Result<(), String>,
) -> Vec<String> {
    let mut defects = Vec::new();
    for seed in first..first + count {
        let mut random = Random(seed);
        let bytes = payload(&mut random);
        attack(address, &bytes, &mut random);
        if (seed + 1 - first) % BETWEEN == 0 || seed + 1 == first + count {
            defects.extend(
                serves()
                    .err()
                    .map(|what| format!("{address} {seed}: {what}")),
            );
        }
    }
    defects
}

/// Repeats a check until it succeeds or `PATIENCE` is over.
fn in_time(mut serves: impl FnMut() -> Result<(), String>) -> Result<(), String> {
    let began = Instant::now();
    loop {
        match serves() {
            Err(what) if began.elapsed() > PATIENCE => return Err(what),
            Err(_) => sleep(Duration::from_millis(50)),
            Ok(()) => return Ok(()),
        }
    }
}

fn keeps_its_memory(server: &Child, before: u64) -> Result<(), String> {
    let more = memory(server).saturating_sub(before);
    if more < MEMORY_BYTES {
        return Ok(());
    }
    Err(format!("{more} bytes of memory more"))
}

fn on_the_board(amount: (u64, u64)) -> Vec<String> {
    let server = Server::start(&[]);
    let before = memory(&server.child);
    let board = format!("tcp:{}", server.address);
    let settings = || {
        let output = tool(&["settings", "get", "--board", &board])
            .output()
            .unwrap();
        match output.status.success() {
            true => Ok(()),
            false => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
        }
    };
    let payload = |random: &mut Random| payload(random, COMMANDS, false);
    attacks(amount, &server.address, payload, || {
        in_time(settings)?;
        keeps_its_memory(&server.child, before)
    })
}

fn on_the_bench(amount: (u64, u64)) -> Vec<String> {
    let mut server = Server::start(&["--rig", "127.0.0.1:0"]);
    let rig = server.rig();
    let before = memory(&server.child);
    let mounts = || {
        let mut stage = TcpStream::connect(&rig).map_err(|error| error.to_string())?;
        let _ = stage.set_read_timeout(Some(PATIENCE));
        let _ = stage.write_all(b"stage\nmount block\n");
        let mut lines = BufReader::new(stage).lines().map_while(Result::ok);
        match lines.any(|line| line == "ok") {
            true => Ok(()),
            false => Err("the bench does not answer".to_owned()),
        }
    };
    let payload = |random: &mut Random| payload(random, BENCH, true);
    attacks(amount, &rig, payload, || {
        in_time(mounts)?;
        keeps_its_memory(&server.child, before)
    })
}

/// Requests with and without the token, and frames of a socket.
fn request(live: &Live, random: &mut Random) -> Vec<u8> {
    let token = random.one_of(&[live.token.as_str(), "", "0", "../..", "%00"]);
    let path = random.one_of(&["", "socket", "page.js", "measurements.csv", "%2e%2e/x"]);
    let host = random.one_of(&[live.address.as_str(), "example.org", "[::1", ""]);
    let method = random.one_of(&["GET", "POST", "HEAD", "PRI *", "\0"]);
    let more = random.one_of(&[
        "",
        UPGRADE,
        "Content-Length: 99999999999\r\n",
        "A: \r\n b\r\n",
    ]);
    let head = format!("{method} /{token}/{path} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n");
    let length = random.below(400);
    let frames = random.bytes(length);
    let sound = [head.as_bytes(), &frames].concat();
    match random.below(3) {
        0 => sound,
        _ => payload(random, &sound, true),
    }
}

fn on_the_page(amount: (u64, u64)) -> Vec<String> {
    let live = Live::start(&[]);
    let before = live.memory();
    let page = || match live.ask("", "").1 {
        line if line.contains("200") => Ok(()),
        line => Err(format!("the page answers {line:?}")),
    };
    attacks(
        amount,
        &live.address,
        |random| request(&live, random),
        || {
            in_time(page)?;
            match live.memory().saturating_sub(before) {
                more if more < MEMORY_BYTES => Ok(()),
                more => Err(format!("{more} bytes of memory more")),
            }
        },
    )
}

fn tool(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// Runs the tool with a board that sends invalid data, until the tool ends or for a moment.
fn at_a_false_board(seed: u64) -> Option<String> {
    let mut random = Random(seed);
    let bytes = payload(&mut random, RECORDS, false);
    let stays = random.below(2) == 0;
    let folder = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let board = format!("tcp:{}", listener.local_addr().unwrap());
    let false_board = thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let _ = stream.write_all(&bytes);
        while stays && matches!(stream.read(&mut [0; 4_096]), Ok(1..)) {}
    });
    let verb = random.one_of(&[
        &["settings", "get"][..],
        &["doctor"],
        &["measure", "--wait", "1"],
        &["record", "r.mcap", "--for", "1"],
        &["settings", "store"],
    ]);
    let began = Instant::now();
    let mut child = tool(&[verb, &["--board", &board]].concat())
        .current_dir(folder.path())
        .spawn()
        .unwrap();
    while child.try_wait().unwrap().is_none() && began.elapsed() < PATIENCE {
        sleep(Duration::from_millis(20));
    }
    let is_late = child.try_wait().unwrap().is_none();
    let _ = child.kill();
    let output = child.wait_with_output().unwrap();
    let _ = false_board.join();
    let said = String::from_utf8_lossy(&output.stderr);
    let what = match output.status.code() {
        _ if is_late => format!("waits after {PATIENCE:?}"),
        _ if said.contains("panicked at") => said.into_owned(),
        Some(1 | 2) if said.is_empty() => "fails without a word".to_owned(),
        // Recording succeeds, since a recording may contain all data that arrived.
        Some(0) if verb[0] != "record" => "takes it for a board".to_owned(),
        Some(0..=2) => return None,
        _ => format!("{:?}: {said}", output.status),
    };
    Some(format!("{verb:?} at false board {seed}: {what}"))
}

/// Runs the tool with many false boards in parallel, since most of the time is waiting.
fn at_false_boards((count, first): (u64, u64)) -> Vec<String> {
    let of = |worker: u64| {
        (first + worker..first + count)
            .step_by(8)
            .filter_map(at_a_false_board)
    };
    thread::scope(|scope| {
        let workers: Vec<_> = (0..8)
            .map(|worker| scope.spawn(move || of(worker).collect::<Vec<_>>()))
            .collect();
        let defects = workers
            .into_iter()
            .flat_map(|worker| worker.join().unwrap());
        defects.collect()
    })
}

/// Attacks one server `count` times from a seed. Returns the defects.
type Part = fn((u64, u64)) -> Vec<String>;

#[test]
fn a_misused_connection_does_not_hinder_the_next() {
    let amount = (number("HOSTILE_ATTACKS", 8), number("HOSTILE_SEED", 1));
    let parts: [(&str, Part); 4] = [
        ("the emulated board's port", on_the_board),
        ("the port of its bench", on_the_bench),
        ("the page", on_the_page),
        ("the tool, by fake boards", at_false_boards),
    ];
    let found = thread::scope(|scope| {
        let parts = parts.map(|(name, part)| (name, scope.spawn(move || part(amount))));
        parts.map(|(name, part)| (name, part.join().unwrap()))
    });
    for (name, defects) in &found {
        println!("{name}: {} defects", defects.len());
    }
    let names = parts.map(|(name, _)| name).join("; ");
    let defects: Vec<String> = found.into_iter().flat_map(|(_, defects)| defects).collect();
    println!(
        "<!-- evidence:begin -->\n{} attacks on each ({names}), seeds {} to {}: {} panics, hangs, programs not served, or memory beyond {} \
         MB.\n<!-- evidence:end -->",
        amount.0,
        amount.1,
        amount.1 + amount.0 - 1,
        defects.len(),
        MEMORY_BYTES / 1_000_000
    );
    assert!(defects.is_empty(), "{defects:#?}");
}
