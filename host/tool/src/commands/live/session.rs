//! The board's thread, the only user of the link.

use std::thread::sleep;
use std::time::Duration;

use palpate_cli::failure::Failure;
use palpate_wire::code::{FaultCode, Part, RebootTarget};
use palpate_wire::command::{ClearFault, GetCalibration, Reboot};
use palpate_wire::{Command, Record};

use super::arguments::Arguments;
use super::calibration::{self, UnsavedCalibration};
use super::feed::{Feed, Request};
use super::state::Progress;
use super::view::View;
use crate::board::configuration::read_part;
use crate::board::link::Link;
use crate::interrupt::Interrupt;

/// Longest time of one receive call, which is also the delay of the pages' requests.
const POLL: Duration = Duration::from_millis(10);
/// Silence of a board after which it is asked for its identity: even without samples a board sends
/// its status every second by default.
const QUIET: Duration = Duration::from_secs(3);
/// Longest wait for a record after the answer to its command, s.
const RECORD_S: f64 = 5.0;
/// Parts of the calibration that the line of a train needs, the tip, and the coils under a touch.
const PARTS: [Part; 5] = [
    Part::Springs,
    Part::StiffeningCurve,
    Part::Attraction,
    Part::Tip,
    Part::TouchArray,
];

/// A board with its pages.
pub(super) struct LiveSession<'a> {
    link: Link,
    arguments: &'a Arguments,
    view: View,
    /// Boot whose calibration has been read.
    read_of: Option<u32>,
    /// Result of a calibration until it is kept or discarded.
    held: Option<UnsavedCalibration>,
    is_gone: bool,
    /// Last arrival from the board by the link's clock.
    came: Duration,
}

impl<'a> LiveSession<'a> {
    pub(super) fn new(link: Link, arguments: &'a Arguments, feed: Feed) -> Self {
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

    /// Runs until an interrupt. Waits for a board that is gone.
    ///
    /// # Errors
    /// If the emulated board cannot continue, or the page's server has ended.
    pub(super) fn run(&mut self, interrupt: &Interrupt) -> Result<(), Failure> {
        while !interrupt.is_asked() {
            match self.turn(interrupt) {
                Err(Failure::Lost(reason)) if self.link.emulated().is_none() => {
                    self.is_gone = true;
                    self.view.lost(&reason)?;
                }
                // A device that is not a palpate board may be exchanged for one.
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
            "the page's server has stopped, so the tool ends: a board that was armed here is disarmed. \
             Start `palpate live` again"
                .to_owned(),
        ))
    }

    fn turn(&mut self, interrupt: &Interrupt) -> Result<(), Failure> {
        if self.is_gone && self.link.is_recording() {
            sleep(POLL);
            return Ok(());
        }
        if self.is_gone {
            self.link.reconnect(interrupt)?;
            self.is_gone = false;
            // Drops requests from the time without a board: they could drive its coil.
            while self.view.feed().request().is_some() {}
        }
        self.link.listen(POLL)?;
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

    /// Checks whether a silent board still answers.
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

    /// Processes the received frames; requests a measurement at a contact of an armed board.
    fn take(&mut self) -> Result<(), Failure> {
        for arrival in self.link.take() {
            self.came = arrival.at;
            let touches = self.view.take(&arrival)?;
            if touches && self.view.known.armed && !self.link.is_recording() {
                // The following records show the answer.
                self.link.send(&Command::Measure)?;
            }
        }
        self.view.take_link(&self.link);
        Ok(())
    }

    /// Requests the calibration for the line of a train and for touches. Its records are processed with the next
    /// frames.
    fn ask_for_calibration(&mut self) -> Result<(), Failure> {
        self.link.send_accepted(&Command::GetSettings)?;
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

    /// Refuses all requests, since a recording accepts no commands.
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
                self.command(&Command::Reboot(Reboot { target }), "The board restarts.")
            }
            Request::Calibrate => self.calibrate(interrupt),
            Request::KeepCalibration => self.keep(),
            Request::CloseCalibration => {
                self.held = None;
                self.view.calibration = calibration::ready(self.arguments);
                self.view.show()
            }
            // No calibration is running.
            Request::AbortCalibration => Ok(()),
        }
    }

    fn clear(&mut self, code: FaultCode) -> Result<(), Failure> {
        self.command(&Command::ClearFault(ClearFault { code }), "Cleared.")
    }

    /// Sends a command and shows its answer.
    fn command(&mut self, command: &Command, done: &str) -> Result<(), Failure> {
        match self.link.send_accepted(command) {
            Ok(_) => self.view.answer.accept(done),
            Err(Failure::Refused(reason)) => self.view.answer.refuse(reason),
            Err(other) => return Err(other),
        }
        self.view.show()
    }

    /// Calibrates on the bench. The configuration in force does not change, since the result is not
    /// set yet and the board is powered on again.
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
        // If storing failed, this puts the previous calibration in force.
        self.leave_bench()?;
        match kept {
            Ok(progress) => self.view.calibration = progress,
            Err(failure) => self.view.calibration = calibration::failed(&failure),
        }
        self.view.show()
    }

    /// Powers the emulated board on again in its original world, with its storage.
    fn leave_bench(&mut self) -> Result<(), Failure> {
        if let Some(board) = self.link.emulated() {
            let emulated = &self.arguments.watched.link.emulated;
            emulated.plug_anew(board, self.arguments.watched.load)?;
            self.link.take();
            self.link.reconnect(&Interrupt::uncaught())?;
            // An emulated board repeats its boot id, so data read before must be dropped.
            self.read_of = None;
        }
        Ok(())
    }
}
