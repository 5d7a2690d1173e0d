//! A small part of the campaign `hostile-bytes`.

use system_tests::hostile::campaign;

#[test]
fn whatever_comes_over_the_links_is_answered_and_drives_nothing_beyond_its_limits() {
    let summary = campaign(1_000_000, 20_000);
    assert!(summary.defects.is_empty(), "{:#?}", summary.defects);
    // Each of these states must have been observed, armed (`true`) or not.
    for seen in [
        ("baseline", false),
        ("baseline", true),
        ("watching", false),
        ("watching", true),
        ("contact", false),
        ("contact", true),
        ("settling", true),
        ("peak", true),
        ("ramps", true),
        ("release", true),
        ("manual", true),
        ("fault", false),
    ] {
        assert!(summary.states.contains_key(&seen), "{seen:?}: {summary:#?}");
    }
    for outcome in [
        "accepted",
        "unknown_command",
        "malformed",
        "other_boot",
        "not_finite",
        "out_of_range",
        "busy",
        "aborted",
    ] {
        assert!(
            summary.outcomes.contains_key(outcome),
            "{outcome}: {summary:#?}"
        );
    }
    for report in ["refusal", "fault", "coil test", "save", "load", "erasure"] {
        assert!(
            summary.reports.contains_key(report),
            "{report}: {summary:#?}"
        );
    }
    assert!(summary.refused > 5_000, "{summary:#?}");
    assert!(summary.greatest_a > 9.0, "{summary:#?}");
}
