//! Maps faults and refusals of the drive to failures of the protocol.

use coil_hbridge::{Fault, Limits, Refusal};
use palpate_procedure::event::Failure;
use palpate_wire::code::{FaultCode, Location};

/// Returns the failure for a latched fault of the drive, with the measured value and its limit.
pub(crate) fn latched(fault: Fault, value_and_limit: Option<[f32; 2]>, limits: &Limits) -> Failure {
    let found = failure(code(fault), None, limits);
    match value_and_limit {
        Some([value, limit]) => Failure {
            value: Some(value),
            limit: Some(limit),
            ..found
        },
        None => found,
    }
}

/// Returns the failure for a refusal of the drive: its own limits forbid a request that the procedure's
/// limits allow. `None` for a latched fault, which has been reported.
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

/// Returns a failure with its location and the exceeded limit.
pub(crate) const fn failure(code: FaultCode, value: Option<f32>, limits: &Limits) -> Failure {
    let [lowest_supply_v, highest_supply_v] = limits.supply_v;
    let (location, limit) = match code {
        FaultCode::Bridge | FaultCode::NoHardwareLimit => (Location::Bridge, None),
        FaultCode::SupplyLow => (Location::Supply, Some(lowest_supply_v)),
        FaultCode::SupplyHigh => (Location::Supply, Some(highest_supply_v)),
        FaultCode::OverCurrent => (Location::Coil, Some(limits.trip_a)),
        FaultCode::OnTime => (Location::Coil, Some(limits.on_time_s)),
        FaultCode::TooMuchEnergy => (Location::Coil, Some(limits.energy_j)),
        FaultCode::Overrun => (Location::Processor, None),
        _ => (Location::Coil, None),
    };
    Failure {
        code,
        location,
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
        Fault::Offset | Fault::SenseReversed | Fault::SenseFrozen | Fault::SamplesLost => {
            FaultCode::CurrentSense
        }
        Fault::Open => FaultCode::CoilOpen,
        Fault::NotACoil => FaultCode::CoilUnknown,
        Fault::NoHardwareLimit => FaultCode::NoHardwareLimit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = crate::board::DRIVE_LIMITS;

    /// The table repeats the entries of docs/faults.md.
    #[test]
    fn every_fault_of_the_drive_has_its_code_and_place() {
        let table = [
            (Fault::OverCurrent, FaultCode::OverCurrent, Location::Coil),
            (Fault::Bridge, FaultCode::Bridge, Location::Bridge),
            (
                Fault::CurrentMissing,
                FaultCode::CurrentMissing,
                Location::Coil,
            ),
            (
                Fault::CurrentUnexplained,
                FaultCode::CoilShort,
                Location::Coil,
            ),
            (Fault::Short, FaultCode::CoilShort, Location::Coil),
            (
                Fault::NotFollowing,
                FaultCode::CurrentOffTarget,
                Location::Coil,
            ),
            (Fault::SupplyLow, FaultCode::SupplyLow, Location::Supply),
            (Fault::SupplyHigh, FaultCode::SupplyHigh, Location::Supply),
            (Fault::OnTime, FaultCode::OnTime, Location::Coil),
            (Fault::Energy, FaultCode::TooMuchEnergy, Location::Coil),
            (Fault::Unattended, FaultCode::Overrun, Location::Processor),
            (Fault::Offset, FaultCode::CurrentSense, Location::Coil),
            (
                Fault::SenseReversed,
                FaultCode::CurrentSense,
                Location::Coil,
            ),
            (Fault::SenseFrozen, FaultCode::CurrentSense, Location::Coil),
            (Fault::SamplesLost, FaultCode::CurrentSense, Location::Coil),
            (Fault::Open, FaultCode::CoilOpen, Location::Coil),
            (Fault::NotACoil, FaultCode::CoilUnknown, Location::Coil),
            (
                Fault::NoHardwareLimit,
                FaultCode::NoHardwareLimit,
                Location::Bridge,
            ),
        ];
        for (fault, code, location) in table {
            let found = latched(fault, None, &LIMITS);
            assert_eq!((found.code, found.location), (code, location), "{fault:?}");
            assert_eq!(found.value, None);
        }
    }

    #[test]
    fn a_latched_fault_is_reported_with_what_was_found_and_what_is_allowed() {
        for fault in [Fault::SupplyLow, Fault::SupplyHigh, Fault::OverCurrent] {
            let found = latched(fault, Some([5.1, 6.4]), &LIMITS);
            assert_eq!((found.value, found.limit), (Some(5.1), Some(6.4)));
        }
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
        // The drive's latched fault was reported when it was latched.
        assert_eq!(found(Refusal::Latched(Fault::Short)), None);
    }
}
