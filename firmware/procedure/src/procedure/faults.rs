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
    /// does not take its place.
    pub(super) fn fail(&mut self, failure: Failure, out: &mut Out) {
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
        if !matches!(self.phase, Phase::Fault(_)) {
            self.go(Phase::Fault(failure), out);
        }
    }

    /// The cause of a failure has gone. A fault of sensor or bus ends by that: it does no harm to
    /// sense again, disarmed as the device is now. Any other waits for its user.
    pub(super) fn recovered(&mut self, code: FaultCode, out: &mut Out) {
        if let Phase::Fault(standing) = &self.phase
            && standing.code == code
            && matches!(
                standing.place,
                Place::Sensor | Place::SecondSensor | Place::Bus
            )
        {
            self.clear(out);
        }
    }

    /// Ends the fault that stands and starts anew, disarmed.
    pub(super) fn clear(&mut self, out: &mut Out) {
        let Phase::Fault(standing) = self.phase.clone() else {
            return;
        };
        out.record(fault(&standing, false));
        self.mode = Mode::SensingOnly;
        self.heard = Some(out.now);
        self.begin_baseline();
        out.push(self.sensors());
        self.go(Phase::SelfTest { good: 0 }, out);
    }
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
