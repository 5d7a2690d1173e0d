//! Current commanded directly by a PC.

use coil_hbridge::CurrentLine;
use palpate_model::units::Second;
use palpate_wire::code::{FaultCode, Location, Outcome};
use palpate_wire::command::DriveCoil;

use super::state::{ManualDrive, Phase};
use super::{Out, Procedure};
use crate::action::Action;
use crate::answer::{Answer, field};
use crate::event::Failure;
use crate::link::Link;
use crate::measurement::check_heat;
use crate::time::{Duration, Instant, between, in_seconds, seconds, span};

/// Longest silence of the PC while its commanded current flows; then the current ends with a fault.
const SILENCE: Duration = Duration::from_ticks(100_000);

impl Procedure {
    /// Checks that a current may be commanded at this time.
    pub(super) fn may_drive_manually(&self, line: &DriveCoil) -> Result<(), Answer> {
        let limit_a = self.board.limits.current.0;
        let limit_a = limit_a.min(self.configuration.settings.peak_current_a);
        if line.to_a.abs() > limit_a {
            let field = field!(DriveCoil, to_a);
            return Err(Answer::out_of_range(field, line.to_a, [-limit_a, limit_a]));
        }
        match self.phase {
            Phase::Manual(_) => {}
            _ => self.may_drive()?,
        }
        Ok(())
    }

    /// Drives a commanded current, starting at the present current.
    pub(super) fn drive_manually(
        &mut self,
        link: Link,
        command: &DriveCoil,
        out: &mut Out<'_>,
    ) -> Outcome {
        let over_s = in_seconds(span(command.over_s)).0;
        let line = CurrentLine::at_once(command.to_a, over_s);
        if let Err(hindrance) = self.may_take_line(&line, out.now) {
            self.end_manual(out);
            self.hindered(&hindrance, out);
            return Outcome::Accepted;
        }
        if let Phase::Manual(manual) = &mut self.phase {
            // From here on, commands must keep arriving on the link of this command.
            manual.link = link;
            manual.last_received = out.now;
        } else {
            if let Some(heat) = &mut self.heat {
                heat.start_measurement();
            }
            let manual = ManualDrive {
                began: out.now,
                link,
                last_received: out.now,
                touched: self.touched_since(),
            };
            self.go(Phase::Manual(manual), out);
        }
        if command.trace_interval_s > 0.0 {
            let interval = Second(command.trace_interval_s);
            out.push(Action::TraceCurrent { interval });
        }
        out.push(Action::Current(line));
        Outcome::Accepted
    }

    /// Records a received command of a PC; only the link that commands the current counts.
    pub(super) fn host_seen(&mut self, link: Link, now: Instant) {
        if let Phase::Manual(manual) = &mut self.phase
            && manual.link == link
        {
            manual.last_received = now;
        }
    }

    /// Checks the time limits: a silent PC, a current that lasts too long, a coil that is too hot.
    pub(super) fn watch_manual(&mut self, out: &mut Out<'_>) {
        let Phase::Manual(manual) = &self.phase else {
            return;
        };
        let silent = between(manual.last_received, out.now);
        let on_s = seconds(manual.began, out.now).0;
        let settings = &self.configuration.settings;
        let (code, location, value, limit) = if silent > SILENCE {
            let seconds_of = |of: Duration| of.as_ticks() as f32 * 1e-6;
            let (silent_s, limit_s) = (seconds_of(silent), seconds_of(SILENCE));
            (FaultCode::HostSilent, Location::Link, silent_s, limit_s)
        } else if on_s > self.board.limits.on_time_s {
            let limit_s = self.board.limits.on_time_s;
            (FaultCode::OnTime, Location::Coil, on_s, limit_s)
        } else if let Some(failure) = self
            .heat
            .as_ref()
            .and_then(|heat| check_heat(settings, heat))
        {
            return self.fail(failure, out);
        } else {
            return;
        };
        let failure = Failure {
            value: Some(value),
            limit: Some(limit),
            ..Failure::new(code, location)
        };
        self.fail(failure, out);
    }

    /// Ends the commanded current at the PC's request, without a fault or a refusal.
    pub(super) fn end_manual(&mut self, out: &mut Out<'_>) {
        if let Phase::Manual(ManualDrive { touched, .. }) = self.phase {
            self.safe(Outcome::Aborted, out);
            self.swept(touched, out);
        }
    }
}
