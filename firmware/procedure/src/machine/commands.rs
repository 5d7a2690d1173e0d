//! Commands and their answers.

use palpate_model::units::Second;
use palpate_wire::code::{FaultCode, Mode, Outcome, RebootTarget, RefusalReason, StorageAction};
use palpate_wire::record::Acknowledgement;
use palpate_wire::{Command, Frame, FrameError, Invalid, Message, Record};

use super::state::{CoilCommand, CoilTestState, Phase};
use super::{Out, Procedure, Readback};
use crate::action::Action;
use crate::answer::Answer;
use crate::board::MOST_CRASHES;
use crate::link::Link;
use crate::measurement::Reason;
use crate::time::span;
use crate::touch::Touching;

/// Checks a command independent of the procedure's state.
fn checked(message: &Command) -> Result<(), Invalid> {
    message.validate()?;
    match message {
        Command::SetSettings(settings) => settings.check_channels(),
        _ => Ok(()),
    }
}

impl Procedure {
    /// Handles a whole command: checks, executes and answers it once. A command that waits for the
    /// coil's test is answered after the test.
    pub(super) fn command(&mut self, link: Link, frame: &Frame<Command>, out: &mut Out<'_>) {
        let Frame { header, message } = frame;
        let answer = if !message.is_for(self.board.boot_id, header.boot_id) {
            Acknowledgement::new(header, message.kind(), Outcome::OtherBoot)
        } else if let Err(invalid) = checked(message) {
            Acknowledgement::invalid(header, message.kind(), &invalid)
        } else {
            self.host_seen(link, out.now);
            let answer = match CoilCommand::of(message) {
                Some(command) => self.with_coil(link, header, message.kind(), command, out),
                None => Some(self.execute(message, out)),
            };
            let Some(answer) = answer else {
                return;
            };
            answer.acknowledge(header, message.kind())
        };
        self.answer(out.asker, answer, out);
    }

    /// Handles an undecodable frame.
    pub(super) fn not_understood(&mut self, error: &FrameError, out: &mut Out<'_>) {
        match Acknowledgement::not_understood(error) {
            Some(answer) => self.answer(out.asker, answer, out),
            None => {
                let damaged = &mut self.counters.commands_damaged;
                *damaged = damaged.wrapping_add(1);
                // A frame of another major version is answered with a `hello`.
                if matches!(error, FrameError::Version { .. }) {
                    out.answer(Record::Hello(self.hello()));
                }
            }
        }
    }

    /// Answers a command on its link.
    pub(super) fn answer(&mut self, to: Option<Link>, answer: Acknowledgement, out: &mut Out<'_>) {
        if answer.outcome != Outcome::Accepted {
            let refused = &mut self.counters.commands_refused;
            *refused = refused.wrapping_add(1);
        }
        out.record_to(to, Record::Acknowledgement(answer));
    }

    /// Executes a command that does not need the coil.
    fn execute(&mut self, command: &Command, out: &mut Out<'_>) -> Answer {
        let outcome = match command {
            Command::Identify => {
                out.answer(Record::Hello(self.hello()));
                out.answer(Record::Status(self.status()));
                Outcome::Accepted
            }
            Command::Arm => self.arm(out),
            Command::Disarm => self.disarm(self.mode, out),
            Command::SensingOnly => self.disarm(Mode::SensingOnly, out),
            Command::Abort => {
                self.abort(out);
                Outcome::Accepted
            }
            Command::ClearFault(of) => match &self.phase {
                // A device that crashes repeatedly must not drive a coil. Only a start that follows no
                // crash ends this fault.
                Phase::Fault(standing)
                    if standing.code == of.code
                        && standing.code == FaultCode::CrashStreak
                        && self.board.crashes >= MOST_CRASHES =>
                {
                    Outcome::FaultPersists
                }
                Phase::Fault(standing) if standing.code == of.code => {
                    self.clear(out);
                    Outcome::Accepted
                }
                _ => Outcome::OtherFault,
            },
            Command::GetSettings => {
                let settings = self.configuration.settings.clone();
                out.answer(Record::Settings(settings));
                Outcome::Accepted
            }
            Command::GetCalibration(of) => {
                let readback = Readback {
                    to: out.asker,
                    part: of.part,
                    sensor: of.sensor,
                    channel: of.channel,
                    chunk: 0,
                };
                let (sensor, channel) = (of.sensor, of.channel);
                if self
                    .configuration
                    .record(of.part, sensor, channel, 0)
                    .is_none()
                {
                    return Outcome::NotSet.into();
                }
                self.readback = Some(readback);
                Outcome::Accepted
            }
            Command::Store => self.store(out),
            Command::Load => self.load(out),
            Command::Erase => self.erase(out),
            Command::GetStorage => {
                let record = self.storage_record(StorageAction::Inspect, true, Second(0.0));
                out.answer(Record::Storage(record));
                Outcome::Accepted
            }
            Command::Reboot(reboot) => self.restart(reboot.target, out),
            Command::Locate(locate) => {
                out.push(Action::Locate(span(locate.duration_s)));
                Outcome::Accepted
            }
            setting => return self.set(setting, out),
        };
        outcome.into()
    }

    fn arm(&mut self, out: &mut Out<'_>) -> Outcome {
        if matches!(self.phase, Phase::Fault(_)) {
            return Outcome::Faulted;
        }
        if self.is_occupied() || !self.can_read_flash() {
            return Outcome::Busy;
        }
        if !self.board.coil {
            return Outcome::NoCoil;
        }
        // Without the coil's calibration its temperature cannot be computed and limited.
        if self.heat.is_none() {
            return Outcome::NotCalibrated;
        }
        if !self.check_all(out) {
            return Outcome::Faulted;
        }
        let changed = !self.armed || self.mode != Mode::Stiffness;
        if !self.armed {
            // The coil test measures load and current zero, which must be known before driving.
            self.begin_test(out);
        }
        self.armed = true;
        self.mode = Mode::Stiffness;
        if changed {
            self.announce(self.state(), out);
        }
        Outcome::Accepted
    }

    fn disarm(&mut self, mode: Mode, out: &mut Out<'_>) -> Outcome {
        let changed = self.armed || self.mode != mode;
        self.armed = false;
        self.mode = mode;
        self.abort(out);
        // The coil must be tested again before it is driven.
        self.coil = CoilTestState::None;
        if changed {
            self.announce(self.state(), out);
        }
        Outcome::Accepted
    }

    /// Switches the bridge off in every state; ends a measurement, a coil test or a commanded current,
    /// and drops the waiting command.
    fn abort(&mut self, out: &mut Out<'_>) {
        self.safe(Outcome::Aborted, out);
        if self.phase.activity().measures() {
            self.refuse(Reason::new(RefusalReason::Aborted, None, None), out);
        }
        self.end_manual(out);
    }

    fn set(&mut self, command: &Command, out: &mut Out<'_>) -> Answer {
        if self.armed {
            return Outcome::Armed.into();
        }
        if self.is_occupied() || !self.can_read_flash() {
            return Outcome::Busy.into();
        }
        self.change(command, out)
    }

    #[inline(never)]
    fn change(&mut self, command: &Command, out: &mut Out<'_>) -> Answer {
        let Some(answer) = self.configuration.set(command, &self.board) else {
            return Outcome::UnknownCommand.into();
        };
        if answer != Outcome::Accepted.into() {
            return answer;
        }
        match command {
            Command::SetSettings(_) => {
                self.configure_sensors(out);
                self.next_status = self.status_after(out.now);
                self.resume_baseline();
                self.sense_anew(out);
            }
            Command::SetDeformationCurve(_) | Command::SetCrosstalk(_) | Command::SetTank(_) => {
                self.begin_baseline();
                self.sense_anew(out);
            }
            Command::SetTouchArray(_) => self.touching = Touching::default(),
            Command::SetCoil(_) => self.follow_heat(),
            Command::SetCurrentCorrection(correction) => {
                out.push(Action::CorrectCurrent(correction.clone()));
            }
            _ => {}
        }
        answer
    }

    /// Switches the bridge off and disarms; the device then restarts.
    pub(super) fn restart(&mut self, target: RebootTarget, out: &mut Out<'_>) -> Outcome {
        if self.is_occupied() {
            return Outcome::Busy;
        }
        self.disarm(self.mode, out);
        self.restarting = true;
        out.push(Action::Restart(target));
        Outcome::Accepted
    }

    /// Returns whether settings and drive are refused because the storage is busy or the device restarts.
    pub(super) const fn is_occupied(&self) -> bool {
        self.storage.is_at_work() || self.restarting
    }

    /// Discards the learnt baseline.
    pub(super) fn sense_anew(&mut self, out: &mut Out<'_>) {
        match &mut self.phase {
            Phase::Fault(_) | Phase::SelfTest { .. } => {}
            // The remaining points of the load's curve, whose number was announced, are sent first.
            Phase::Reporting { touched, .. } => *touched = None,
            _ => self.go(Phase::Baseline, out),
        }
    }
}
