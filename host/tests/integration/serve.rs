//! `palpate serve-emulated` with programs at its port.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use palpate_wire::code::{Outcome, StorageAction, StorageState};
use palpate_wire::record::{Acknowledgement, Hello};
use palpate_wire::{Message, Record, RecordDecoder, Sequencer, encode};

use crate::support::image;

/// How long an answer may take: a save takes seconds of the board's time, and a busy computer emulates
/// the board at a tenth of its pace or less.
const PATIENCE: Duration = Duration::from_secs(300);

/// The server, which ends with this.
pub(super) struct Server {
    child: Child,
    pub(super) address: String,
}

impl Server {
    pub(super) fn start(arguments: &[&str]) -> Self {
        Self::at("127.0.0.1:0", arguments)
    }

    /// The same at a port of one's own.
    pub(super) fn at(listen: &str, arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_palpate"))
            .args(["serve-emulated", "--listen", listen])
            .arg("--image")
            .arg(image())
            .args(arguments)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let said = BufReader::new(child.stderr.take().unwrap());
        let address = said.lines().find_map(|line| {
            let line = line.unwrap();
            let address = line.strip_prefix("the emulated board is at ")?;
            Some(address.to_owned())
        });
        Self {
            child,
            address: address.expect("it says where it is"),
        }
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

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A program that is connected.
struct Program {
    stream: TcpStream,
    decoder: RecordDecoder,
    sequencer: Sequencer,
}

impl Program {
    /// Sends a command, and reads until a record says something.
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

    /// Asks to store what is in force, and waits for the end of it.
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
    // A busy machine has its server wait.
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
    // Settings are not for any boot.
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
    // The file is written when the flash rests.
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
