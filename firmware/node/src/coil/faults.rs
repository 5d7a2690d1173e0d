//! What the drive finds, in the protocol's words.

use coil_hbridge::{Fault, Limits, Refusal};
use palpate_procedure::event::Failure;
use palpate_wire::code::{FaultCode, Place};

/// The failure that a latched fault of the drive is; `supply_low_v`: the supply that was found, and
/// the one that is needed.
pub(crate) fn latched(fault: Fault, supply_low_v: Option<[f32; 2]>, limits: &Limits) -> Failure {
    match (fault, supply_low_v) {
        (Fault::SupplyLow, Some([supply_v, needed_v])) => Failure {
            limit: Some(needed_v),
            ..failure(FaultCode::SupplyLow, Some(supply_v), limits)
        },
        _ => failure(code(fault), None, limits),
    }
}

/// The failure that a refusal of the drive is: its own limits forbid what the procedure's allow.
/// Nothing for a fault that stands, which has been reported.
pub(crate) fn refused(refusal: &Refusal, limits: &Limits) -> Option<Failure> {
    let [_, highest_supply_v] = limits.supply_v;
    let (code, value) = match *refusal {
        Refusal::Latched(_) => return None,
        Refusal::Energy(energy_j) => (FaultCode::TooMuchEnergy, energy_j),
        Refusal::Duration(duration_s) => (FaultCode::OnTime, duration_s),
        Refusal::Supply(supply_v) if supply_v > highest_supply_v => {
            (FaultCode::SupplyHigh, supply_v)
        }
        Refusal::Supply(supply_v) => (FaultCode::SupplyLow, supply_v),
        Refusal::Current(current_a) => (FaultCode::OverCurrent, current_a),
        _ => (FaultCode::CoilUnknown, 0.0),
    };
    Some(failure(code, Some(value), limits))
}

/// A failure with its place and the limit that was passed.
pub(crate) const fn failure(code: FaultCode, value: Option<f32>, limits: &Limits) -> Failure {
    let [lowest_supply_v, highest_supply_v] = limits.supply_v;
    let (place, limit) = match code {
        FaultCode::Bridge | FaultCode::NoHardwareLimit => (Place::Bridge, None),
        FaultCode::SupplyLow => (Place::Supply, Some(lowest_supply_v)),
        FaultCode::SupplyHigh => (Place::Supply, Some(highest_supply_v)),
        FaultCode::OverCurrent => (Place::Coil, Some(limits.trip_a)),
        FaultCode::OnTime => (Place::Coil, Some(limits.on_time_s)),
        FaultCode::TooMuchEnergy => (Place::Coil, Some(limits.energy_j)),
        FaultCode::Overrun => (Place::Processor, None),
        _ => (Place::Coil, None),
    };
    Failure {
        code,
        place,
        value,
        limit,
    }
}

const fn code(fault: Fault) -> FaultCode {
    match fault {
        Fault::OverCurrent => FaultCode::OverCurrent,
        Fault::Bridge => FaultCode::Bridge,
        Fault::CurrentMissing => FaultCode::CurrentMissing,
        Fault::CurrentUnexplained | Fault::Short => FaultCode::CoilShort,
        Fault::NotFollowing => FaultCode::CurrentOffTarget,
        Fault::SupplyLow => FaultCode::SupplyLow,
        Fault::SupplyHigh => FaultCode::SupplyHigh,
        Fault::OnTime => FaultCode::OnTime,
        Fault::Energy => FaultCode::TooMuchEnergy,
        Fault::Unattended => FaultCode::Overrun,
        Fault::Offset | Fault::SenseReversed | Fault::SenseFrozen => FaultCode::CurrentSense,
        Fault::Open => FaultCode::CoilOpen,
        Fault::NotACoil => FaultCode::CoilUnknown,
        Fault::NoHardwareLimit => FaultCode::NoHardwareLimit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = crate::board::LIMITS;

    /// A second transcription: what docs/faults.md says of each.
    #[test]
    fn every_fault_of_the_drive_has_its_code_and_place() {
        let table = [
            (Fault::OverCurrent, FaultCode::OverCurrent, Place::Coil),
            (Fault::Bridge, FaultCode::Bridge, Place::Bridge),
            (
                Fault::CurrentMissing,
                FaultCode::CurrentMissing,
                Place::Coil,
            ),
            (Fault::CurrentUnexplained, FaultCode::CoilShort, Place::Coil),
            (Fault::Short, FaultCode::CoilShort, Place::Coil),
            (
                Fault::NotFollowing,
                FaultCode::CurrentOffTarget,
                Place::Coil,
            ),
            (Fault::SupplyLow, FaultCode::SupplyLow, Place::Supply),
            (Fault::SupplyHigh, FaultCode::SupplyHigh, Place::Supply),
            (Fault::OnTime, FaultCode::OnTime, Place::Coil),
            (Fault::Energy, FaultCode::TooMuchEnergy, Place::Coil),
            (Fault::Unattended, FaultCode::Overrun, Place::Processor),
            (Fault::Offset, FaultCode::CurrentSense, Place::Coil),
            (Fault::SenseReversed, FaultCode::CurrentSense, Place::Coil),
            (Fault::SenseFrozen, FaultCode::CurrentSense, Place::Coil),
            (Fault::Open, FaultCode::CoilOpen, Place::Coil),
            (Fault::NotACoil, FaultCode::CoilUnknown, Place::Coil),
            (
                Fault::NoHardwareLimit,
                FaultCode::NoHardwareLimit,
                Place::Bridge,
            ),
        ];
        for (fault, code, place) in table {
            let found = latched(fault, None, &LIMITS);
            assert_eq!((found.code, found.place), (code, place), "{fault:?}");
            assert_eq!(found.value, None);
        }
    }

    #[test]
    fn a_supply_that_gives_way_is_reported_with_what_was_needed() {
        let found = latched(Fault::SupplyLow, Some([5.1, 6.4]), &LIMITS);
        assert_eq!((found.value, found.limit), (Some(5.1), Some(6.4)));
    }

    #[test]
    fn a_refusal_has_its_value_and_limit() {
        let found = |refusal| refused(&refusal, &LIMITS).map(|of| (of.code, of.value, of.limit));
        let energy = Some((FaultCode::TooMuchEnergy, Some(61.0), Some(60.0)));
        assert_eq!(found(Refusal::Energy(61.0)), energy);
        let current = Some((FaultCode::OverCurrent, Some(13.0), Some(12.7)));
        assert_eq!(found(Refusal::Current(13.0)), current);
        let low = Some((FaultCode::SupplyLow, Some(4.0), Some(4.5)));
        assert_eq!(found(Refusal::Supply(4.0)), low);
        let high = Some((FaultCode::SupplyHigh, Some(15.0), Some(14.0)));
        assert_eq!(found(Refusal::Supply(15.0)), high);
        let long = Some((FaultCode::OnTime, Some(21.0), Some(20.0)));
        assert_eq!(found(Refusal::Duration(21.0)), long);
        // It has been reported when it was latched.
        assert_eq!(found(Refusal::Latched(Fault::Short)), None);
    }
}
