//! Ten thousand random fault schedules under random positions of every switch; the full campaign is
//! `cargo xtask evidence fault-schedules`.

use system_tests::faults::{campaign, run};

#[test]
fn schedules_end_in_a_documented_error_or_in_recovery() {
    let summary = campaign(1_000_000, 10_000, run);
    assert!(summary.defects.is_empty(), "{:?}", summary.defects.first());
    // The schedules are not trivial, and readings remain possible.
    assert!(summary.trusted > 100_000, "{summary:?}");
    assert!(summary.recoveries > 2_000, "{summary:?}");
    assert!(summary.measuring > 7_000, "{summary:?}");
    for name in [
        "bus",
        "wrong identity",
        "read-back",
        "registers lost",
        "no interrupt",
    ] {
        assert!(summary.errors.contains_key(name), "{name}: {summary:?}");
    }
}

#[test]
fn a_schedule_is_the_same_twice() {
    for seed in 0..20 {
        let (first, second) = (run(seed), run(seed));
        assert_eq!(format!("{first:?}"), format!("{second:?}"));
    }
}
