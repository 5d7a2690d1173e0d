//! Requests to the person at the bench, and their answers.

use std::io::{self, BufRead, IsTerminal, Write};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

use palpate_cli::failure::Failure;

/// Reads answers at the terminal while the bench receives from board and gauges.
#[derive(Default)]
pub(super) struct Person {
    answers: Option<Receiver<String>>,
}

impl Person {
    /// Prints a request.
    ///
    /// # Errors
    /// [`Failure::Argument`] where there is no terminal.
    pub(super) fn ask(&mut self, request: &str) -> Result<(), Failure> {
        if self.answers.is_none() {
            self.answers = Some(listen(request)?);
        }
        let mut out = io::stderr().lock();
        write!(out, "\r\x1b[K{request} ")?;
        Ok(out.flush()?)
    }

    /// Returns the user's answer; `None` before the user has answered.
    ///
    /// # Errors
    /// If the terminal has been closed.
    pub(super) fn answer(&mut self) -> Result<Option<String>, Failure> {
        match self.answers.as_ref().map(Receiver::try_recv) {
            Some(Ok(answer)) => Ok(Some(answer.trim().to_owned())),
            Some(Err(TryRecvError::Empty)) | None => Ok(None),
            Some(Err(TryRecvError::Disconnected)) => Err(Failure::Refused(
                "the calibration was cancelled at the terminal".to_owned(),
            )),
        }
    }
}

/// Whether there is a terminal for questions.
pub(super) fn is_there() -> bool {
    io::stdin().is_terminal()
}

/// Starts to read lines of standard input.
fn listen(request: &str) -> Result<Receiver<String>, Failure> {
    if !is_there() {
        return Err(Failure::Argument(format!(
            "standard input is not a terminal, so the tool cannot ask: {request} Run it at a terminal, \
             or name a stage's program that changes specimens (docs/calibration.md)"
        )));
    }
    let (sender, answers) = channel();
    thread::spawn(move || {
        for line in io::stdin().lock().lines().map_while(io::Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
    Ok(answers)
}
