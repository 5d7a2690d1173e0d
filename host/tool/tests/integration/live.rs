//! `palpate live` with programs that misuse its port.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::image;

/// Limit of the tool's file handles: half of what any system allows.
const HANDLES: usize = 128;
/// Longest wait for an answer; a busy computer answers slowly.
const PATIENCE: Duration = Duration::from_secs(120);

/// The page's server; dropping it ends the process.
pub(super) struct Live {
    child: Child,
    pub(super) address: String,
    pub(super) token: String,
    folder: tempfile::TempDir,
}

impl Live {
    pub(super) fn start(arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut child = command(folder.path(), arguments).spawn().unwrap();
        let mut line = String::new();
        let mut said = BufReader::new(child.stdout.take().unwrap());
        said.read_line(&mut line).unwrap();
        let served: Value = serde_json::from_str(&line).unwrap();
        let url = served["url"].as_str().unwrap();
        let (address, token) = url["http://".len()..].split_once('/').unwrap();
        Self {
            child,
            address: address.to_owned(),
            token: token.trim_end_matches('/').to_owned(),
            folder,
        }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_write_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Sends a request with the token. Returns the connection, and the first line of the answer or how
    /// the connection ended without one.
    pub(super) fn ask(&self, path: &str, headers: &str) -> (TcpStream, String) {
        let asked = Instant::now();
        let (mut stream, host) = (self.connect(), &self.address);
        let request = format!("GET /{}/{path} HTTP/1.1\r\nHost: {host}\r\n", self.token);
        write!(stream, "{request}{headers}\r\n").unwrap();
        let mut line = String::new();
        while !line.ends_with('\n') {
            let mut byte = [0];
            match stream.read(&mut byte) {
                Ok(1..) => line.push(byte[0].into()),
                ended => {
                    line = format!("{line:?}, then {ended:?} after {:?}", asked.elapsed());
                    break;
                }
            }
        }
        (stream, line)
    }

    /// Number of open file handles.
    fn handles(&self) -> usize {
        fs::read_dir(format!("/proc/{}/fd", self.child.id()))
            .unwrap()
            .count()
    }

    /// Memory in use, bytes.
    pub(super) fn memory(&self) -> u64 {
        memory(&self.child)
    }
}

/// Memory of a program, bytes.
pub(super) fn memory(of: &Child) -> u64 {
    let status = fs::read_to_string(format!("/proc/{}/status", of.id())).unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    let number = line.unwrap().split_whitespace().nth(1).unwrap();
    number.parse::<u64>().unwrap() * 1024
}

impl Drop for Live {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The tool with few file handles, and with its own user folder.
fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new("sh");
    command
        .args(["-c", &format!("ulimit -n {HANDLES}; exec \"$0\" \"$@\"")])
        .arg(env!("CARGO_BIN_EXE_palpate"))
        .args(["live", "--json", "--port", "0", "--board", "emulated"])
        .arg("--image")
        .arg(image())
        .args(arguments)
        .env("XDG_STATE_HOME", folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

pub(super) const UPGRADE: &str = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
    Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n";

#[test]
fn more_silent_connections_than_file_handles_do_not_end_the_page() {
    let live = Live::start(&[]);
    let silent: Vec<_> = (0..HANDLES + 10).map(|_| live.connect()).collect();
    sleep(Duration::from_secs(2));
    // The tool needs further handles, for example to save the emulated board's flash.
    let handles = live.handles();
    assert!((64..HANDLES - 20).contains(&handles), "{handles}");
    let (_, answer) = live.ask("", "");
    assert!(answer.contains("200"), "{answer:?}");
    drop(silent);
}

#[test]
fn pages_that_send_long_frames_take_no_memory() {
    let live = Live::start(&[]);
    let before = live.memory();
    // Start of a text of 15 MB, masked with zeros: less than the usual limit of a frame.
    let mut frame = vec![0x81, 0x80 | 127];
    frame.extend(15_000_000u64.to_be_bytes());
    frame.resize(8_000_000, 0);
    let pages: Vec<_> = (0..8)
        .map(|_| {
            let (mut socket, answer) = live.ask("socket", UPGRADE);
            assert!(answer.contains("101"), "{answer:?}");
            // The server may close the socket before all bytes are sent.
            let _ = socket.write_all(&frame);
            socket
        })
        .collect();
    sleep(Duration::from_secs(2));
    let more = live.memory().saturating_sub(before);
    assert!(more < 16_000_000, "{more} bytes more");
    drop(pages);
}

#[test]
fn the_browser_is_started_without_the_token_in_its_arguments() {
    let folder = tempfile::tempdir().unwrap();
    let (opener, opened) = (folder.path().join("xdg-open"), folder.path().join("opened"));
    let script = format!("#!/bin/sh\necho \"$@\" >> {}\n", opened.display());
    fs::write(&opener, script).unwrap();
    fs::set_permissions(&opener, fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!(
        "{}:{}",
        folder.path().display(),
        std::env::var("PATH").unwrap()
    );
    let state = tempfile::tempdir().unwrap();
    let mut child = command(state.path(), &["--open"]).env("PATH", path).spawn();
    let child = child.as_mut().unwrap();
    let began = Instant::now();
    while !opened.exists() && began.elapsed() < PATIENCE {
        sleep(Duration::from_millis(50));
    }
    sleep(Duration::from_millis(200));
    let _ = child.kill();
    let _ = child.wait();
    let token = fs::read_to_string(state.path().join("palpate/live-token")).unwrap();
    let arguments = fs::read_to_string(&opened).unwrap();
    assert!(!arguments.contains(&token), "{arguments}");
    let page = arguments.trim();
    assert!(fs::read_to_string(page).unwrap().contains(&token));
    let mode = fs::metadata(page).unwrap().permissions().mode();
    assert_eq!(mode & 0o077, 0, "{mode:o}");
}

#[test]
fn a_token_that_other_users_can_read_is_refused() {
    let live = Live::start(&[]);
    let token = live.folder.path().join("palpate/live-token");
    fs::set_permissions(&token, fs::Permissions::from_mode(0o666)).unwrap();
    let mut child = command(live.folder.path(), &[]).spawn().unwrap();
    let began = Instant::now();
    while child.try_wait().unwrap().is_none() && began.elapsed() < Duration::from_secs(20) {
        sleep(Duration::from_millis(50));
    }
    let _ = child.kill();
    let refused = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(
        said.contains("live-token") && said.contains("delete it"),
        "{said}"
    );
}
