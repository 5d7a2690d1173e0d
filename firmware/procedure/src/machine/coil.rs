//! State of the coil's test, and the queue of commands that need the coil.
//!
//! The coil is driven only after the test of bridge, coil and current measurement, which usually takes
//! 65 ms. A command that needs the coil during the test waits for its end and is answered then. The
//! queue holds one command: a second one is answered `busy`. Any safe state ends the test and empties
//! the queue, with an answer.

use palpate_wire::Header;
use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Location, Outcome};
use palpate_wire::record::{Acknowledgement, CoilTest};

use super::state::{CoilCommand, CoilTestState, Phase, Waiting};
use super::{Out, Procedure};
use crate::action::Action;
use crate::answer::Answer;
use crate::event::Failure;
use crate::link::Link;
use crate::time::{Duration, between, in_seconds};

/// Longest duration of a coil test, twice that of a test that finds no coil: such a test raises its
/// voltage for 0.21 s, 13 000 periods of the bridge (`Regulated::test` in sim-host).
const LONGEST_TEST: Duration = Duration::from_ticks(450_000);

impl Procedure {
    /// Executes a command that needs the coil, or lets it wait if the coil must be tested first; a
    /// waiting command has no answer yet. A command that is not allowed at this time is refused at once.
    pub(super) fn with_coil(
        &mut self,
        link: Link,
        header: &Header,
        kind: u8,
        command: CoilCommand,
        out: &mut Out<'_>,
    ) -> Option<Answer> {
        if let Err(answer) = self.may(&command) {
            return Some(answer);
        }
        match self.coil {
            CoilTestState::Tested => return Some(self.begin(link, &command, out).into()),
            CoilTestState::None if command == CoilCommand::Test => {
                return Some(self.begin(link, &command, out).into());
            }
            CoilTestState::None => self.begin_test(out),
            CoilTestState::Testing(_) if self.waiting.is_some() => {
                return Some(Outcome::Busy.into());
            }
            CoilTestState::Testing(_) => {}
        }
        self.waiting = Some(Waiting {
            link,
            header: *header,
            kind,
            command,
        });
        None
    }

    fn may(&self, command: &CoilCommand) -> Result<(), Answer> {
        match command {
            CoilCommand::Measure => self.may_measure().map(drop)?,
            CoilCommand::Sweep | CoilCommand::Test => self.may_drive()?,
            CoilCommand::Drive(line) => self.may_drive_manually(line)?,
        }
        Ok(())
    }

    fn begin(&mut self, link: Link, command: &CoilCommand, out: &mut Out<'_>) -> Outcome {
        match command {
            CoilCommand::Measure => self.begin_asked(out),
            CoilCommand::Sweep => self.begin_sweep(out),
            CoilCommand::Drive(line) => self.drive_manually(link, line, out),
            CoilCommand::Test => {
                self.begin_test(out);
                Outcome::Accepted
            }
        }
    }

    /// Checks that a train, a test or a commanded current may start.
    pub(super) fn may_drive(&self) -> Result<(), Outcome> {
        self.phase.activity().ensure_free()?;
        // A command may wait for the coil's test even during the sensor's self-test, which ends before
        // the coil's test.
        let is_testing = matches!(self.coil, CoilTestState::Testing(_));
        if matches!(self.phase, Phase::SelfTest { .. }) && !is_testing {
            return Err(Outcome::Busy);
        }
        if self.armed {
            Ok(())
        } else {
            Err(Outcome::NotArmed)
        }
    }

    pub(super) fn begin_test(&mut self, out: &mut Out<'_>) {
        self.coil = CoilTestState::Testing(out.now);
        out.push(Action::TestCoil);
    }

    /// Returns whether the coil may be driven at this time; starts its test if it was not tested.
    pub(super) fn coil_is_tested(&mut self, out: &mut Out<'_>) -> bool {
        if self.coil == CoilTestState::None {
            self.begin_test(out);
        }
        self.coil == CoilTestState::Tested
    }

    /// Ends the test: the waiting command starts if it is still allowed.
    #[inline(never)]
    pub(super) fn coil_tested(&mut self, found: &CoilTest, out: &mut Out<'_>) {
        let CoilTestState::Testing(begun) = self.coil else {
            // This is the result of a test that was stopped, so it is ignored.
            return;
        };
        self.coil = CoilTestState::Tested;
        if let Phase::Settling(settling) = &mut self.phase {
            // The time limit for settling counts from the end of the coil's test, since settling could
            // not end before.
            settling.began = out.now;
        }
        self.take_load(found, begun);
        out.record(Record::CoilTest(found.clone()));
        if let Some(Waiting {
            link,
            header,
            kind,
            command,
        }) = self.waiting.take()
        {
            let answer = match self.may(&command) {
                Ok(()) => self.begin(link, &command, out).into(),
                Err(answer) => answer,
            };
            self.answer(Some(link), answer.acknowledge(&header, kind), out);
        }
    }

    /// Switches the bridge off first. Ends a coil test, and answers the waiting command with `outcome`.
    pub(super) fn safe(&mut self, outcome: Outcome, out: &mut Out<'_>) {
        out.safe();
        if matches!(self.coil, CoilTestState::Testing(_)) {
            self.coil = CoilTestState::None;
        }
        if let Some(Waiting {
            link, header, kind, ..
        }) = self.waiting.take()
        {
            self.answer(
                Some(link),
                Acknowledgement::new(&header, kind, outcome),
                out,
            );
        }
    }

    /// Raises a fault if a test neither ends nor fails.
    pub(super) fn watch_test(&mut self, out: &mut Out<'_>) {
        let CoilTestState::Testing(since) = self.coil else {
            return;
        };
        let takes = between(since, out.now);
        if takes > LONGEST_TEST {
            let failure = Failure {
                value: Some(in_seconds(takes).0),
                limit: Some(in_seconds(LONGEST_TEST).0),
                ..Failure::new(FaultCode::Overrun, Location::Coil)
            };
            self.fail(failure, out);
        }
    }
}
