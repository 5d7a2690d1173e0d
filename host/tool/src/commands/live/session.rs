//! The board's thread: it alone has the link.

use std::thread::sleep;
use std::time::Duration;

use palpate_cli::failure::Failure;
use palpate_wire::code::{FaultCode, Part, RebootTarget};
use palpate_wire::command::{ClearFault, GetCalibration, Reboot};
use palpate_wire::{Command, Record};

use super::calibration::{self, Held};
use super::feed::{Feed, Request};
use super::state::Progress;
use super::view::View;
use crate::board::configuration::read_part;
use crate::board::link::Link;
use crate::interrupt::Interrupt;

/// How long is listened at once: the pages' requests wait as long.
const LOOK: Duration = Duration::from_millis(10);
/// A board that sends nothing for so long is asked who it is: one that sends no samples sends its status
/// every second as a rule.
const QUIET: Duration = Duration::from_secs(3);
/// How long a record may take that follows its command's answer, s.
const RECORD_S: f64 = 5.0;
/// Parts of the calibration by which the line of a train is drawn.
const PARTS: [Part; 3] = [Part::Springs, Part::StiffeningCurve, Part::Attraction];

/// A board with its pages.
pub(super) struct LiveSession<'a> {
    link: Link,
    arguments: &'a super::Arguments,
    view: View,
    /// The run of the board whose calibration has been read.
    read_of: Option<u32>,
    /// What a calibration found, until it is kept or discarded.
    held: Option<Held>,
    is_gone: bool,
    /// When the board last sent something, by the link.
    came: Duration,
}

impl<'a> LiveSession<'a> {
    pub(super) fn new(link: Link, arguments: &'a super::Arguments, feed: Feed) -> Self {
        let progress = calibration::ready(arguments);
        Self {
            view: View::new(feed, link.name(), progress),
            came: link.now(),
            link,
            arguments,
            read_of: None,
            held: None,
            is_gone: false,
        }
    }

    /// Goes on until the end is asked for. A board that is gone is waited for.
    ///
    /// # Errors
    /// If the emulated board cannot run on, or the page's server has ended.
    pub(super) fn run(&mut self, interrupt: &Interrupt) -> Result<(), Failure> {
        while !interrupt.is_asked() {
            match self.turn(interrupt) {
                Err(Failure::Lost(reason)) if self.link.emulated().is_none() => {
                    self.is_gone = true;
                    self.view.lost(&reason)?;
                }
                // One that answers and is no board of ours may be exchanged as well.
                Err(Failure::Unconnected(finding)) => {
                    self.is_gone = true;
                    self.view.lost(&finding.to_string())?;
                }
                Err(Failure::Refused(reason)) => self.view.answer.refuse(reason),
                turned => turned?,
            }
        }
        if self.view.feed().is_served() {
            return Ok(());
        }
        Err(Failure::Refused(
            "the page's server has ended, and so does this: a board that was armed here is disarmed. Start \
             `palpate live` again"
                .to_owned(),
        ))
    }

    fn turn(&mut self, interrupt: &Interrupt) -> Result<(), Failure> {
        if self.is_gone && self.link.is_recording() {
            sleep(LOOK);
            return Ok(());
        }
        if self.is_gone {
            self.link.reconnect(interrupt)?;
            self.is_gone = false;
            // What was asked of a board that was not there is not done now: it could be to drive its coil.
            while self.view.feed().request().is_some() {}
        }
        self.link.listen(LOOK)?;
        self.take()?;
        if self.link.is_recording() {
            self.refuse_requests();
            return self.view.show_due();
        }
        self.check_presence()?;
        if self.view.known.boot_id != self.read_of {
            self.read_of = self.view.known.boot_id;
            self.ask_for_calibration()?;
        }
        while let Some(request) = self.view.feed().request() {
            self.answer(request, interrupt)?;
        }
        self.view.show_due()
    }

    /// Whether a board that sends nothing still answers.
    fn check_presence(&mut self) -> Result<(), Failure> {
        if self.link.now() < self.came + QUIET {
            return Ok(());
        }
        if let Err(failure) = self.link.ask(&Command::Identify) {
            self.is_gone = true;
            self.view.lost(&failure.to_string())?;
        }
        self.came = self.link.now();
        Ok(())
    }

    /// Takes what has come; measures what touches a board that is armed.
    fn take(&mut self) -> Result<(), Failure> {
        for arrival in self.link.take() {
            self.came = arrival.at;
            let touches = self.view.take(&arrival)?;
            if touches && self.view.known.armed && !self.link.is_recording() {
                // What it is answered shows in what follows.
                self.link.send(&Command::Measure)?;
            }
        }
        self.view.take_link(&self.link);
        Ok(())
    }

    /// Asks for what the line of a train takes. It is among what is taken next.
    fn ask_for_calibration(&mut self) -> Result<(), Failure> {
        self.link.must(&Command::GetSettings)?;
        self.link.wait_for(RECORD_S, "settings", |record| {
            matches!(record, Record::Settings(_)).then_some(())
        })?;
        for part in PARTS {
            let question = GetCalibration {
                part,
                sensor: 0,
                channel: 0,
            };
            read_part(&mut self.link, &question)?;
        }
        Ok(())
    }

    /// A recording takes no commands.
    fn refuse_requests(&mut self) {
        while self.view.feed().request().is_some() {
            self.view
                .answer
                .refuse("This is a recording: it takes no commands.");
        }
    }

    fn answer(&mut self, request: Request, interrupt: &Interrupt) -> Result<(), Failure> {
        match request {
            Request::Arm => self.command(&Command::Arm, "Armed: the coil is driven at a contact."),
            Request::Disarm => {
                self.command(&Command::Disarm, "Disarmed: the coil gets no current.")
            }
            Request::Abort => self.command(&Command::Abort, "Stopped: the bridge is off."),
            Request::ClearFault(code) => self.clear(code),
            Request::Restart => {
                let target = RebootTarget::Firmware;
                self.command(
                    &Command::Reboot(Reboot { target }),
                    "The board starts anew.",
                )
            }
            Request::Calibrate => self.calibrate(interrupt),
            Request::KeepCalibration => self.keep(),
            Request::CloseCalibration => {
                self.held = None;
                self.view.calibration = calibration::ready(self.arguments);
                self.view.show()
            }
            // None is under way.
            Request::AbortCalibration => Ok(()),
        }
    }

    fn clear(&mut self, code: FaultCode) -> Result<(), Failure> {
        self.command(&Command::ClearFault(ClearFault { code }), "Cleared.")
    }

    /// Sends a command, and says what it was answered.
    fn command(&mut self, command: &Command, done: &str) -> Result<(), Failure> {
        match self.link.must(command) {
            Ok(_) => self.view.answer.accept(done),
            Err(Failure::Refused(reason)) => self.view.answer.refuse(reason),
            Err(other) => return Err(other),
        }
        self.view.show()
    }

    /// Calibrates on the bench. What was in force before is in force afterwards: nothing is set yet, and
    /// the board gets its power anew.
    fn calibrate(&mut self, interrupt: &Interrupt) -> Result<(), Failure> {
        let done = calibration::hold(&mut self.link, &mut self.view, self.arguments, interrupt);
        self.leave_bench()?;
        self.held = done;
        self.view.show()
    }

    fn keep(&mut self) -> Result<(), Failure> {
        let Some(held) = self.held.take() else {
            return Ok(());
        };
        self.view.calibration = Progress::Storing;
        self.view.show()?;
        let kept = held.keep(&mut self.link);
        // If it was not stored, the one before is in force again.
        self.leave_bench()?;
        match kept {
            Ok(progress) => self.view.calibration = progress,
            Err(failure) => self.view.calibration = calibration::failed(&failure),
        }
        self.view.show()
    }

    /// The board as it was plugged, with what it has stored.
    fn leave_bench(&mut self) -> Result<(), Failure> {
        if let Some(board) = self.link.emulated() {
            let emulated = &self.arguments.watched.link.emulated;
            emulated.plug_anew(board, self.arguments.watched.load)?;
            self.link.take();
            self.link.reconnect(&Interrupt::uncaught())?;
            // An emulated board draws the same boot id again: what was read before it is not of this run.
            self.read_of = None;
        }
        Ok(())
    }
}
