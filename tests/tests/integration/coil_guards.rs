//! A small part of the campaign `coil-guards`.

use coil_hbridge::Fault;
use system_tests::coil::campaign;

#[test]
fn no_limit_is_exceeded_whatever_happens() {
    let summary = campaign(1_000_000, 300);
    assert!(summary.defects.is_empty(), "{:?}", summary.defects);
    assert!(summary.begun > 1_000);
    // The test is only valid if faults occurred.
    let latched = |fault| {
        let index = Fault::ALL.iter().position(|of| *of == fault);
        index.and_then(|index| summary.faults.get(index)).copied()
    };
    for fault in [
        Fault::OverCurrent,
        Fault::Bridge,
        Fault::CurrentMissing,
        Fault::SupplyLow,
        Fault::OnTime,
        Fault::Unattended,
        Fault::Open,
    ] {
        assert!(latched(fault) > Some(0), "{fault:?}");
    }
}
