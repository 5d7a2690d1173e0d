//! Tests of a link to a board after a power cycle, and to one that does not return.

use std::io::{self, ErrorKind};
use std::time::Duration;

use palpate_wire::record::Acknowledgement;
use palpate_wire::{Command, CommandDecoder, Frame, Header, Message, Record, encode};

use super::Link;
use super::transport::Transport;
use crate::commands::watch::tests::fixture;
use crate::interrupt::Interrupt;

/// State of the fake board when its port is opened again.
#[derive(Clone, Copy, PartialEq)]
enum BoardPresence {
    Powered,
    Silent,
    Nowhere,
}

/// Fake board: each power-on restarts its clock but leaves its boot id unchanged.
struct MadeBoard {
    found: BoardPresence,
    now: Duration,
    powered_at: Duration,
    /// Time from a command to its answer.
    delay: Duration,
    commands: CommandDecoder,
    answers: Vec<u8>,
    /// Ctrl-C arrives while the port is opened again.
    interrupt: Interrupt,
}

impl MadeBoard {
    fn link(found: BoardPresence, interrupt: &Interrupt) -> Link {
        let board = Self {
            found,
            now: Duration::from_secs(5),
            powered_at: Duration::ZERO,
            delay: Duration::from_millis(1),
            commands: CommandDecoder::new(),
            answers: Vec::new(),
            interrupt: interrupt.clone(),
        };
        Link::open("made".to_owned(), Box::new(board), None).unwrap()
    }

    fn answer(&mut self, command: &Frame<Command>) {
        if command.message == Command::Identify {
            self.send(&fixture("hello"));
        }
        self.send(&Record::Acknowledgement(Acknowledgement::accepted(
            &command.header,
            &command.message,
        )));
    }

    fn send(&mut self, record: &Record) {
        let on_its_way = self.delay / 2;
        let header = Header {
            boot_id: 7,
            sequence: 0,
            time_us: (self.now + on_its_way - self.powered_at).as_micros() as u64,
            dropped: 0,
        };
        let mut buffer = [0; Record::MAX_FRAME];
        let bytes = encode(&header, record, &mut buffer).unwrap();
        self.answers.extend_from_slice(bytes);
    }
}

impl Transport for MadeBoard {
    fn now(&self) -> Duration {
        self.now
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let commands: Vec<_> = self.commands.frames(bytes).map(Result::unwrap).collect();
        if self.found == BoardPresence::Powered || self.powered_at.is_zero() {
            commands.iter().for_each(|command| self.answer(command));
        }
        Ok(())
    }

    fn read(&mut self, _: Duration) -> io::Result<Vec<u8>> {
        self.now += self.delay;
        Ok(std::mem::take(&mut self.answers))
    }

    fn patience(&self) -> Duration {
        Duration::from_millis(500)
    }

    fn reopen(&mut self) -> io::Result<()> {
        self.now += Duration::from_millis(100);
        self.powered_at = self.now;
        // This answer is slower than the one before, so it would not replace the clock's offset if
        // the offset had been kept.
        self.delay = Duration::from_millis(10);
        self.interrupt.ask();
        match self.found {
            BoardPresence::Nowhere => Err(ErrorKind::NotFound.into()),
            BoardPresence::Powered | BoardPresence::Silent => Ok(()),
        }
    }
}

#[test]
fn a_board_with_new_power_and_the_same_boot_id_has_another_clock() {
    let mut link = MadeBoard::link(BoardPresence::Powered, &Interrupt::uncaught());
    link.send_accepted(&Command::GetSettings).unwrap();
    let (before_s, _) = link.clock().offset_s().unwrap();
    assert!(before_s.abs() < 2e-3, "{before_s} s");
    link.reconnect(&Interrupt::uncaught()).unwrap();
    let powered_at_s = link.now().as_secs_f64();
    link.send_accepted(&Command::GetSettings).unwrap();
    assert_eq!(link.clock().boot_id(), 7);
    let (after_s, _) = link.clock().offset_s().unwrap();
    assert!((after_s - powered_at_s).abs() < 0.02, "{after_s} s");
}

#[test]
fn a_silent_board_is_given_up_after_the_patience_of_its_transport() {
    let mut link = MadeBoard::link(BoardPresence::Silent, &Interrupt::uncaught());
    link.transport.reopen().unwrap();
    let began = link.now();
    assert!(link.greet().is_err());
    let waited = link.now() - began;
    let patience = link.transport.patience();
    assert!(
        (patience..2 * patience).contains(&waited),
        "waited {waited:?}"
    );
}

#[test]
fn ctrl_c_ends_the_wait_for_a_board_that_does_not_come_back() {
    for found in [BoardPresence::Nowhere, BoardPresence::Silent] {
        let interrupt = Interrupt::uncaught();
        let mut link = MadeBoard::link(found, &interrupt);
        let began = link.now();
        let failure = link.reconnect(&interrupt).unwrap_err().to_string();
        let waited = link.now() - began;
        assert!(waited < Duration::from_millis(500), "{waited:?}: {failure}");
    }
}
