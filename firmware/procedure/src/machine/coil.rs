//! Whether the coil is known, and the queue of commands that need it.
//!
//! The coil is driven only after its test: of bridge, coil and current measurement, 65 ms as a
//! rule. A command that needs the coil and comes meanwhile waits for the test's end, and is answered
//! then. The queue holds one: a second is answered `busy`. Whatever switches the bridge off ends the
//! test and empties the queue, with an answer.

use palpate_wire::Header;
use palpate_wire::code::{FaultCode, Location, Outcome};
use palpate_wire::command::DriveCoil;
use palpate_wire::record::{Acknowledgement, CoilTest};
use palpate_wire::{Command, Record};

use super::phases::Phase;
use super::{Out, Procedure};
use crate::action::Action;
use crate::answer::Answer;
use crate::event::Failure;
use crate::link::Link;
use crate::time::{Duration, Instant, between, in_seconds};

/// The longest test: one that finds no coil raises its voltage for 0.21 s, 13 000 periods of the
/// bridge (`Regulated::test` in sim-host); with a margin of two.
const LONGEST_TEST: Duration = Duration::from_ticks(450_000);

/// What is known of the coil.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Knowledge {
    /// Nothing: not tested since it was armed, or its test was stopped.
    None,
    /// It is being tested, since then.
    Testing(Instant),
    /// It may be driven.
    Tested,
}

/// A command that needs the coil.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum CoilCommand {
    Measure,
    Sweep,
    Test,
    Drive(DriveCoil),
}

/// A command that waits for the end of the coil's test.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Waiting {
    link: Link,
    header: Header,
    kind: u8,
    command: CoilCommand,
}

impl CoilCommand {
    pub(super) fn of(command: &Command) -> Option<Self> {
        Some(match command {
            Command::Measure => Self::Measure,
            Command::Sweep => Self::Sweep,
            Command::TestCoil => Self::Test,
            Command::DriveCoil(line) => Self::Drive(line.clone()),
            _ => return None,
        })
    }
}

impl Procedure {
    /// Carries out a command that needs the coil, or lets it wait, where the coil has to be tested
    /// first: then there is no answer yet. What may not be done now is refused now.
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
            Knowledge::Tested => return Some(self.begin(link, &command, out).into()),
            Knowledge::None if command == CoilCommand::Test => {
                return Some(self.begin(link, &command, out).into());
            }
            Knowledge::None => self.begin_test(out),
            Knowledge::Testing(_) if self.waiting.is_some() => return Some(Outcome::Busy.into()),
            Knowledge::Testing(_) => {}
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

    /// Whether a train, a test or a commanded current may begin.
    pub(super) fn may_drive(&self) -> Result<(), Outcome> {
        self.phase.activity().ensure_free()?;
        // The sensor's self-test is over before the coil's.
        let is_testing = matches!(self.coil, Knowledge::Testing(_));
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
        self.coil = Knowledge::Testing(out.now);
        out.push(Action::TestCoil);
    }

    /// Whether the coil may be driven now. If nothing is known of it, its test begins.
    pub(super) fn coil_is_tested(&mut self, out: &mut Out<'_>) -> bool {
        if self.coil == Knowledge::None {
            self.begin_test(out);
        }
        self.coil == Knowledge::Tested
    }

    /// The test is over: what waited for it begins, if it still may.
    pub(super) fn coil_tested(&mut self, found: &CoilTest, out: &mut Out<'_>) {
        let Knowledge::Testing(begun) = self.coil else {
            // Of a test that was stopped.
            return;
        };
        self.coil = Knowledge::Tested;
        if let Phase::Settling(settling) = &mut self.phase {
            // Its time counts from when it may end.
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

    /// Bridge off, before all else. A test of the coil ends with it, and what waits for that is
    /// answered.
    pub(super) fn safe(&mut self, outcome: Outcome, out: &mut Out<'_>) {
        out.safe();
        if matches!(self.coil, Knowledge::Testing(_)) {
            self.coil = Knowledge::None;
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

    /// A test that neither ends nor fails.
    pub(super) fn watch_test(&mut self, out: &mut Out<'_>) {
        let Knowledge::Testing(since) = self.coil else {
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
