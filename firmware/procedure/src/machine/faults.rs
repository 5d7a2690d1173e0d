//! Faults: latching and clearing.

use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Location, Mode, Outcome, RefusalReason};
use palpate_wire::record::Fault;

use super::state::{CoilTestState, Phase};
use super::{CHECK, Out, Procedure};
use crate::configuration::ITEMS;
use crate::event::Failure;
use crate::measurement::Reason;
use crate::time::after;

impl Procedure {
    /// Handles a failure: switches the bridge off, disarms and reports it.
    ///
    /// The first fault stands until it is cleared. A further fault is reported and queued behind it, and
    /// ends with its own cause or with the standing fault. If only the further fault must be cleared by
    /// the user, it becomes the standing one, and the first fault is queued.
    pub(super) fn fail(&mut self, failure: Failure, out: &mut Out<'_>) {
        self.safe(Outcome::Faulted, out);
        // The coil must be tested again, since it may be the failed part.
        self.coil = CoilTestState::None;
        if self.phase.activity().measures() {
            let code = failure.code.number();
            self.refuse(
                Reason::new(RefusalReason::Faulted, Some(code.into()), None),
                out,
            );
        }
        self.armed = false;
        out.record(fault(&failure, true));
        match &mut self.phase {
            Phase::Fault(standing) => {
                let is_first = ends_with_its_cause(standing) && !ends_with_its_cause(&failure);
                let behind = if is_first {
                    core::mem::replace(standing, failure)
                } else {
                    failure
                };
                self.stand_behind(behind);
            }
            _ => self.go(Phase::Fault(failure), out),
        }
    }

    /// Queues a fault behind the standing one, if it is not already there.
    fn stand_behind(&mut self, failure: Failure) {
        let is_same = |of: &Failure| (of.code, of.location) == (failure.code, failure.location);
        let stands = matches!(&self.phase, Phase::Fault(standing) if is_same(standing));
        if !stands && !self.behind.iter().any(is_same) {
            // There is space for the faults of all other sources, and for one more.
            let _ = self.behind.push(failure);
        }
    }

    /// Ends the queued faults for which `ends` is true.
    fn end_behind(&mut self, ends: impl Fn(&Failure) -> bool, out: &mut Out<'_>) {
        for ended in self.behind.iter().filter(|of| ends(of)) {
            out.record(fault(ended, false));
        }
        self.behind.retain(|of| !ends(of));
    }

    /// Raises a fault after the clock was set back, which invalidates all pending deadlines.
    pub(super) fn clock_set_back(&mut self, out: &mut Out<'_>) {
        self.last_seen = Some(out.now);
        self.next_check.1 = out.now;
        self.next_status = self.status_after(out.now);
        self.fail(Failure::new(FaultCode::Clock, Location::Clock), out);
    }

    /// Checks one item of the configuration when it is due.
    pub(super) fn check_next(&mut self, out: &mut Out<'_>) {
        let (number, due) = self.next_check;
        if out.now < due || matches!(self.phase, Phase::Fault(_)) {
            return;
        }
        self.next_check = ((number + 1) % ITEMS, after(out.now, CHECK));
        if let Some(kind) = self.configuration.damaged(number) {
            self.configuration_is_damaged(kind, out);
        }
    }

    /// Checks the whole configuration; returns whether it is intact.
    pub(super) fn check_all(&mut self, out: &mut Out<'_>) -> bool {
        let damaged = self.configuration.any_damaged();
        if let Some(kind) = damaged {
            self.configuration_is_damaged(kind, out);
        }
        damaged.is_none()
    }

    fn configuration_is_damaged(&mut self, kind: u8, out: &mut Out<'_>) {
        let failure = Failure {
            value: Some(kind.into()),
            ..Failure::new(FaultCode::ConfigurationDamaged, Location::Configuration)
        };
        self.fail(failure, out);
    }

    /// Handles the end of a failure's cause: ends the faults that end with it.
    pub(super) fn recovered(&mut self, code: FaultCode, out: &mut Out<'_>) {
        let ends = |of: &Failure| of.code == code && ends_with_its_cause(of);
        self.end_behind(ends, out);
        if matches!(&self.phase, Phase::Fault(standing) if ends(standing)) {
            self.clear(out);
        }
    }

    /// Ends the standing fault and the queued ones, and restarts the self-test, disarmed. The self-test
    /// finds a persistent cause again.
    pub(super) fn clear(&mut self, out: &mut Out<'_>) {
        let Phase::Fault(standing) = self.phase.clone() else {
            return;
        };
        out.record(fault(&standing, false));
        self.end_behind(|_| true, out);
        self.mode = Mode::SensingOnly;
        self.resume_baseline();
        self.configure_sensors(out);
        self.go(Phase::SelfTest { good: 0 }, out);
    }
}

/// Returns whether a fault ends with its cause. Faults of sensor and bus do, since sensing again,
/// disarmed, does no harm. Any other fault must be cleared by the user.
const fn ends_with_its_cause(failure: &Failure) -> bool {
    matches!(
        failure.location,
        Location::Sensor | Location::SecondSensor | Location::Bus
    )
}

fn fault(failure: &Failure, active: bool) -> Record {
    Record::Fault(Fault {
        code: failure.code,
        location: failure.location,
        active,
        value: failure.value,
        limit: failure.limit,
    })
}

#[cfg(test)]
mod tests {
    use palpate_wire::code::{Outcome, State};
    use palpate_wire::command::ClearFault;
    use palpate_wire::{Command, Frame, Header};

    use crate::action::{Action, Actions};
    use crate::board::tests::BOARD;
    use crate::configuration::tests::COIL;
    use crate::event::Event;
    use crate::link::Link;
    use crate::time::Instant;

    use super::*;

    const CODE: FaultCode = FaultCode::ConfigurationDamaged;

    struct Rig {
        procedure: Procedure,
        now_us: u64,
    }

    impl Rig {
        fn step(&mut self, event: &Event<'_>) -> Actions {
            self.now_us += 1_000;
            self.procedure.step(Instant::from_ticks(self.now_us), event)
        }

        fn outcome(&mut self, message: Command) -> Outcome {
            let header = Header {
                boot_id: 7,
                sequence: 0,
                time_us: 0,
                dropped: 0,
            };
            let actions = self.step(&Event::Command(Link::Probe, &Frame { header, message }));
            let answer = actions.iter().find_map(|action| match action {
                Action::Record {
                    record: Record::Acknowledgement(answer),
                    ..
                } => Some(answer.outcome),
                _ => None,
            });
            answer.expect("an answer")
        }

        /// Returns the time until a fault in milliseconds, and the fault's value. Suppresses the fault
        /// of a silent converter.
        fn fault(&mut self, within_ms: u32) -> Option<(u32, f32)> {
            (1..=within_ms).find_map(|ms| {
                // Keeps the converter from counting as silent.
                self.procedure.last_seen = Some(Instant::from_ticks(self.now_us));
                let actions = self.step(&Event::Tick);
                let fault = actions.iter().find_map(|action| match action {
                    Action::Record {
                        record: Record::Fault(fault),
                        ..
                    } => Some(fault.clone()),
                    _ => None,
                })?;
                assert_eq!((fault.code, fault.active), (CODE, true));
                assert_eq!(actions.first(), Some(&Action::SafeState));
                Some((ms, fault.value?))
            })
        }
    }

    #[test]
    fn an_upset_of_the_configuration_is_found_within_a_second_and_before_it_arms() {
        let mut rig = Rig {
            procedure: Procedure::new(BOARD),
            now_us: 0,
        };
        assert_eq!(rig.outcome(Command::SetCoil(COIL)), Outcome::Accepted);
        assert_eq!(rig.fault(3_000), None);
        let coil = |rig: &mut Rig| {
            let coil = rig.procedure.configuration.coil_mut().expect("a coil");
            coil.resistance_ohm = f32::from_bits(coil.resistance_ohm.to_bits() ^ 1 << 22);
        };
        coil(&mut rig);
        let (took_ms, kind) = rig.fault(3_000).expect("a fault");
        // 37 items, in steps of a millisecond.
        assert!(took_ms <= 37 * 28, "{took_ms} ms");
        assert_eq!(kind, f32::from(palpate_wire::code::Part::Coil.number()));
        assert_eq!(rig.procedure.state(), State::Fault);
        // As long as the damaged item is not set again, the fault is raised again after it is cleared.
        let clear = Command::ClearFault(ClearFault { code: CODE });
        assert_eq!(rig.outcome(clear.clone()), Outcome::Accepted);
        assert!(rig.fault(37 * 28).is_some());
        assert_eq!(rig.outcome(Command::SetCoil(COIL)), Outcome::Accepted);
        assert_eq!(rig.outcome(clear.clone()), Outcome::Accepted);
        assert_eq!(rig.fault(3_000), None);
        // The device cannot be armed with a damaged item, even before the check has found it.
        coil(&mut rig);
        assert_eq!(rig.outcome(Command::Arm), Outcome::Faulted);
        assert!(!rig.procedure.is_armed());
        assert_eq!(rig.procedure.state(), State::Fault);
    }
}
