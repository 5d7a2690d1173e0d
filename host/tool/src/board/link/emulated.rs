//! The emulated board on this computer's USB. Its time passes during waits, as fast as possible or
//! at the pace of real time.

use std::io;
use std::thread::sleep;
use std::time::Duration;

use palpate_cli::failure::Failure;
use palpate_sim::Time;

use super::transport::Transport;
use crate::board::emulated::{Pace, PluggedBoard};
use crate::interrupt;

/// Emulated time between two polls of the port.
const SLICE: Time = Time::from_us(250);

/// Longest emulated time from the first question to the identity: from power-on 190 ms pass until
/// the image answers (`palpate settings get --board emulated`), and emulating half a second takes
/// up to 5 s of processor time.
const PATIENCE: Duration = Duration::from_millis(500);

/// Connection to the emulated board.
pub(super) struct Emulated {
    board: PluggedBoard,
    pace: Option<Pace>,
}

impl Emulated {
    pub(super) fn new(board: PluggedBoard, keeps_pace: bool) -> Self {
        Self {
            board,
            pace: keeps_pace.then(Pace::new),
        }
    }

    fn pass(&mut self, time: Time) -> io::Result<()> {
        let failed = |failure: Failure| io::Error::other(failure.to_string());
        interrupt::go_on().map_err(failed)?;
        self.board.advance(time).map_err(failed)?;
        if let Some(pace) = &mut self.pace {
            sleep(pace.ahead(self.board.now()));
        }
        Ok(())
    }
}

impl Transport for Emulated {
    fn now(&self) -> Duration {
        Duration::from_secs_f64(self.board.now().as_secs_f64())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.board.write(bytes);
        Ok(())
    }

    fn read(&mut self, wait: Duration) -> io::Result<Vec<u8>> {
        let end = self.now() + wait;
        loop {
            self.board.set_open(true);
            // Sends bytes that waited for the port to open.
            self.board.write(&[]);
            let bytes = self.board.read();
            if !bytes.is_empty() || self.now() >= end {
                return Ok(bytes);
            }
            self.pass(SLICE)?;
        }
    }

    fn take_log(&mut self) -> Vec<u8> {
        self.board.read_log()
    }

    fn reopen(&mut self) -> io::Result<()> {
        Ok(())
    }

    fn patience(&self) -> Duration {
        PATIENCE
    }

    fn emulated(&mut self) -> Option<&mut PluggedBoard> {
        Some(&mut self.board)
    }
}
