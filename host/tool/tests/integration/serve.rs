//! `palpate serve-emulated` with programs at its port.

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::time::{Duration, Instant};

use palpate_wire::code::{Outcome, StorageAction, StorageState};
use palpate_wire::record::{Acknowledgement, Hello};
use palpate_wire::{Message, Record, RecordDecoder, Sequencer, encode};

use crate::support::image;

/// Longest wait for an answer: a save takes seconds of the board's time, and a busy computer
/// emulates the board at a tenth of its pace or less.
const PATIENCE: Duration = Duration::from_secs(300);

/// The server; dropping it ends the process.
pub(super) struct Server {
    pub(super) child: Child,
    pub(super) address: String,
    said: BufReader<ChildStderr>,
    /// User folder of this server alone, since no two servers run the same board.
    _folder: tempfile::TempDir,
}

impl Server {
    pub(super) fn start(arguments: &[&str]) -> Self {
        Self::at("127.0.0.1:0", arguments)
    }

    /// Starts a server at a given port.
    pub(super) fn at(listen: &str, arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_palpate"))
            .env("XDG_STATE_HOME", folder.path())
            .args(["serve-emulated", "--listen", listen])
            .arg("--image")
            .arg(image())
            .args(arguments)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap());
        let address = place(&mut said, "the emulated board is at ");
        Self {
            child,
            address,
            said,
            _folder: folder,
        }
    }

    /// Address of the gauges of its bench, with `--rig`.
    pub(super) fn rig(&mut self) -> String {
        place(&mut self.said, "the gauges of its bench are at ")
    }

    fn connect(&self) -> Program {
        let stream = TcpStream::connect(&self.address).unwrap();
        let patience = Duration::from_millis(100);
        stream.set_read_timeout(Some(patience)).unwrap();
        Program {
            stream,
            decoder: RecordDecoder::new(),
            sequencer: Sequencer::new(0),
        }
    }
}

/// Text that follows `beginning` in the line that starts with it.
fn place(said: &mut BufReader<ChildStderr>, beginning: &str) -> String {
    let mut lines = said.by_ref().lines().map(Result::unwrap);
    let place = lines.find_map(|line| Some(line.strip_prefix(beginning)?.to_owned()));
    place.expect("it says where it is")
}

/// Sends bytes, and reads until the connection is closed.
fn exchange(address: &str, bytes: &[u8]) -> std::io::Result<()> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(Duration::from_secs(20)))?;
    stream.write_all(bytes)?;
    match stream.read_to_end(&mut Vec::new()) {
        // The server closed the connection with unread bytes.
        Err(error) if error.kind() == ErrorKind::ConnectionReset => Ok(()),
        read => read.map(drop),
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A connected program.
struct Program {
    stream: TcpStream,
    decoder: RecordDecoder,
    sequencer: Sequencer,
}

impl Program {
    /// Sends a command, and reads until `of` accepts a record.
    fn ask<T>(
        &mut self,
        command: &palpate_wire::Command,
        mut of: impl FnMut(&Record) -> Option<T>,
    ) -> T {
        let header = self.sequencer.stamp(0);
        let mut buffer = [0; palpate_wire::Command::MAX_FRAME];
        let frame = encode(&header, command, &mut buffer).unwrap();
        self.stream.write_all(frame).unwrap();
        let begin = Instant::now();
        let mut bytes = [0; 4096];
        while begin.elapsed() < PATIENCE {
            let count = match self.stream.read(&mut bytes) {
                Ok(0) => panic!("{command:?}: the server has closed the connection"),
                read => read.unwrap_or(0),
            };
            let frames: Vec<_> = self.decoder.frames(&bytes[..count]).collect();
            for frame in frames.into_iter().flatten() {
                self.sequencer.address(frame.header.boot_id);
                if let Some(found) = of(&frame.message) {
                    return found;
                }
            }
        }
        panic!("{command:?} is not answered");
    }

    fn hello(&mut self) -> Hello {
        self.ask(&palpate_wire::Command::Identify, |record| match record {
            Record::Hello(hello) => Some(hello.clone()),
            _ => None,
        })
    }

    fn storage(&mut self, command: &palpate_wire::Command) -> palpate_wire::record::Storage {
        self.ask(command, |record| match record {
            Record::Storage(storage) => Some(storage.clone()),
            _ => None,
        })
    }

    /// Stores the configuration in force, and waits for the result.
    fn store(&mut self) -> palpate_wire::record::Storage {
        let mut outcome = None;
        let stored = self.ask(&palpate_wire::Command::Store, |record| match record {
            Record::Acknowledgement(answer) => {
                outcome = Some(answer.outcome);
                (answer.outcome != Outcome::Accepted).then_some(None)
            }
            Record::Storage(storage) => Some(Some(storage.clone())),
            _ => None,
        });
        stored.unwrap_or_else(|| panic!("{outcome:?}"))
    }

    fn outcome(&mut self, command: &palpate_wire::Command) -> Outcome {
        self.ask(command, |record| match record {
            Record::Acknowledgement(Acknowledgement { kind, outcome, .. })
                if *kind == command.kind() =>
            {
                Some(*outcome)
            }
            _ => None,
        })
    }
}

#[test]
fn one_program_at_a_time_talks_to_the_emulated_board() {
    let server = Server::start(&[]);
    let mut first = server.connect();
    let hello = first.hello();
    assert!(hello.unit != 0 && hello.configuration_crc == 0, "{hello:?}");
    let mut second = server.connect();
    let mut said = String::new();
    // A busy machine may answer late.
    second.stream.set_read_timeout(Some(PATIENCE)).unwrap();
    second.stream.read_to_string(&mut said).unwrap();
    assert!(said.contains("another program is connected"), "{said}");
    drop(first);
    let mut third = server.connect();
    assert_eq!(third.hello().unit, hello.unit);
}

fn store(flash: &Path) -> u32 {
    let server = Server::start(&["--state", &flash.to_string_lossy()]);
    let mut program = server.connect();
    // Asks for the boot id first, since a command that sets settings has to name it.
    program.hello();
    let settings = program.ask(&palpate_wire::Command::GetSettings, |record| match record {
        Record::Settings(settings) => Some(settings.clone()),
        _ => None,
    });
    let settings = palpate_wire::command::Settings {
        rate_hz: 200.0,
        ..settings
    };
    let set = palpate_wire::Command::SetSettings(settings);
    assert_eq!(program.outcome(&set), Outcome::Accepted);
    let stored = program.store();
    assert_eq!(
        (stored.action, stored.succeeded),
        (StorageAction::Store, true)
    );
    // Waits for another answer. By then the flash is idle and the file is written.
    program.hello();
    stored.stored_crc
}

#[test]
fn what_was_stored_is_there_with_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let flash = folder.path().join("flash.bin");
    let crc = store(&flash);
    let server = Server::start(&["--state", &flash.to_string_lossy()]);
    let mut program = server.connect();
    assert_eq!(program.hello().configuration_crc, crc);
    let found = program.storage(&palpate_wire::Command::GetStorage);
    assert_eq!((found.state, found.stored_crc), (StorageState::Whole, crc));
}

#[test]
fn only_who_allows_it_listens_to_other_machines() {
    let refused = assert_cmd::Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["serve-emulated", "--listen", "0.0.0.0:0"])
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(said.contains("--allow-remote"), "{said}");
}

/// A request that a page of any site may send: a command in the body.
fn request(method: &str, body: &[u8]) -> Vec<u8> {
    let head = format!("{method} / HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: null\r\n\r\n");
    [head.as_bytes(), body].concat()
}

#[test]
fn a_request_of_a_browser_reaches_no_board() {
    let server = Server::start(&[]);
    let mut sequencer = Sequencer::new(0);
    let mut buffer = [0; palpate_wire::Command::MAX_FRAME];
    let identify = palpate_wire::Command::Identify;
    let frame = encode(&sequencer.stamp(0), &identify, &mut buffer).unwrap();
    // Starts the body with a delimiter, so that a frame begins there.
    let body = [&[0], frame].concat();
    for method in ["POST", "OPTIONS", "X"] {
        let closed = exchange(&server.address, &request(method, &body));
        assert!(closed.is_ok(), "{method}: {closed:?}");
    }
    // A program that starts with a delimiter gets an answer, and so does one whose frame arrives in
    // pieces.
    let mut program = server.connect();
    program.stream.write_all(&[0]).unwrap();
    assert!(program.hello().unit != 0);
}

#[test]
fn the_bench_goes_on_after_a_line_that_it_refuses_and_takes_no_request() {
    let mut server = Server::start(&["--rig", "127.0.0.1:0"]);
    let rig = server.rig();
    let closed = exchange(&rig, &request("POST", b"mount nothing\n"));
    assert!(closed.is_ok(), "{closed:?}");
    let mut stage = TcpStream::connect(&rig).unwrap();
    stage.set_read_timeout(Some(PATIENCE)).unwrap();
    let refused = [
        "mount spring nan",
        "mount spring -1",
        "mount spring 0",
        "mount spring inf",
        "move nan 0.001",
        "move 0.001 0",
        "move 0.001 -1",
        "move inf 0.001",
        "move 1e300 1e-300",
        "move 0.001 nan",
    ];
    writeln!(stage, "stage\n{}", refused.join("\n")).unwrap();
    let mut lines = BufReader::new(&stage).lines().map(Result::unwrap);
    for line in refused {
        let answer = lines.find(|line| line.starts_with("error") || line == "ok");
        assert!(answer.unwrap().starts_with("error "), "{line}");
    }
    writeln!(&stage, "mount spring 600").unwrap();
    let answer = lines.find(|line| line.starts_with("error") || line == "ok");
    assert_eq!(answer.unwrap(), "ok");
}
