//! What stops the instrument, and what starts it again.

use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Mode, Place, RefusalReason};
use palpate_wire::record::Fault;

use super::states::Phase;
use super::{Out, Procedure};
use crate::event::Failure;

impl Procedure {
    /// Something has failed: bridge off, disarmed, and said so.
    ///
    /// The first fault stands until it is cleared; one that comes while it stands is told, and
    /// takes its place only if it waits for its user and the first does not.
    pub(super) fn fail(&mut self, failure: Failure, out: &mut Out<'_>) {
        out.safe();
        if matches!(
            self.phase,
            Phase::Driving(_) | Phase::Settling(_) | Phase::Sweeping { .. }
        ) {
            let code = failure.code.number();
            self.refuse((RefusalReason::Faulted, Some(code.into()), None), out);
        }
        self.armed = false;
        out.record(fault(&failure, true));
        let stands = match &self.phase {
            Phase::Fault(standing) => {
                ends_with_its_cause(standing) && !ends_with_its_cause(&failure)
            }
            _ => true,
        };
        if stands {
            self.go(Phase::Fault(failure), out);
        }
    }

    /// The clock was set back: nothing that was to end by it would.
    pub(super) fn clock_set_back(&mut self, out: &mut Out<'_>) {
        self.heard = Some(out.now);
        self.next_status = self.status_after(out.now);
        self.fail(Failure::new(FaultCode::Clock, Place::Clock), out);
    }

    /// The cause of a failure has gone. A fault that ends by that does.
    pub(super) fn recovered(&mut self, code: FaultCode, out: &mut Out<'_>) {
        if let Phase::Fault(standing) = &self.phase
            && standing.code == code
            && ends_with_its_cause(standing)
        {
            self.clear(out);
        }
    }

    /// Ends the fault that stands and starts anew, disarmed.
    pub(super) fn clear(&mut self, out: &mut Out<'_>) {
        let Phase::Fault(standing) = self.phase.clone() else {
            return;
        };
        out.record(fault(&standing, false));
        self.mode = Mode::SensingOnly;
        self.begin_baseline();
        self.configure_sensors(out);
        self.go(Phase::SelfTest { good: 0 }, out);
    }
}

/// Whether a fault is one of sensor or bus, which ends when its cause does: it does no harm to
/// sense again, disarmed as the device is now. Any other waits for its user.
const fn ends_with_its_cause(failure: &Failure) -> bool {
    matches!(
        failure.place,
        Place::Sensor | Place::SecondSensor | Place::Bus
    )
}

fn fault(failure: &Failure, active: bool) -> Record {
    Record::Fault(Fault {
        code: failure.code,
        place: failure.place,
        active,
        value: failure.value,
        limit: failure.limit,
    })
}
