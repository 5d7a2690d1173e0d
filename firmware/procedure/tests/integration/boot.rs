//! Boot cause from reset flags and any memory content: a readable crash record is reported, an
//! unreadable one is a fault.

use palpate_procedure::boot::{Boot, End, NO_RECORD, RECORD_WORDS, RecordWords, ResetFlags};
use palpate_procedure::boot::{fault, record};
use palpate_procedure::{Event, Instant, Procedure};
use palpate_wire::Record;
use palpate_wire::code::{FaultCode, ResetCause, State};
use proptest::prelude::*;

const FORCED: ResetFlags = ResetFlags {
    forced: true,
    timed_out: false,
    is_own_watchdog: true,
    debugger: false,
    pin: false,
};
const TIMED_OUT: ResetFlags = ResetFlags {
    forced: false,
    timed_out: true,
    ..FORCED
};

fn panicked(before: &RecordWords) -> RecordWords {
    let end = End::Panic {
        file: "firmware/src/tasks/sensing.rs",
        line: 77,
    };
    record(&end, before, 1_234)
}

fn faulted(before: &RecordWords) -> RecordWords {
    let end = End::HardFault {
        program_counter: 0x2000_1234,
        link_register: 0x2000_4321,
    };
    record(&end, before, 5_678)
}

#[test]
fn what_was_kept_is_reported() {
    let (boot, _) = Boot::judge(FORCED, &panicked(&NO_RECORD));
    assert_eq!((boot.cause, boot.streak), (ResetCause::Panic, 1));
    let crash = boot.crash.expect("a record");
    assert_eq!(crash.file.as_str(), "firmware/src/tasks/sensing.rs");
    assert_eq!((crash.line, crash.uptime_ms, crash.streak), (77, 1_234, 1));

    let (boot, _) = Boot::judge(FORCED, &faulted(&NO_RECORD));
    let crash = boot.crash.expect("a record");
    assert_eq!(crash.cause, ResetCause::HardFault);
    assert_eq!(
        (crash.program_counter, crash.link_register, crash.uptime_ms),
        (0x2000_1234, 0x2000_4321, 5_678)
    );
}

#[test]
fn the_end_of_a_long_name_is_kept_and_what_is_not_ascii_is_not_shown() {
    let file = format!("ü{}/model/src/ramp/mod.rs", "x".repeat(40));
    let end = End::Panic {
        file: &file,
        line: 1,
    };
    let (boot, _) = Boot::judge(FORCED, &record(&end, &NO_RECORD, 0));
    let kept = boot.crash.expect("a record").file;
    assert_eq!(kept.len(), 48);
    assert!(kept.ends_with("/model/src/ramp/mod.rs"));
    let end = End::Panic {
        file: "ü.rs",
        line: 1,
    };
    let (boot, _) = Boot::judge(FORCED, &record(&end, &NO_RECORD, 0));
    assert_eq!(boot.crash.expect("a record").file.as_str(), "??.rs");
}

#[test]
fn every_start_has_its_cause() {
    let none = ResetFlags::default();
    let debugger = ResetFlags {
        debugger: true,
        ..none
    };
    let pin = ResetFlags { pin: true, ..none };
    let boot_loader = ResetFlags {
        timed_out: true,
        ..none
    };
    for (flags, cause, latched) in [
        (none, ResetCause::PowerOn, None),
        (debugger, ResetCause::Debugger, None),
        (pin, ResetCause::Pin, None),
        (boot_loader, ResetCause::Software, None),
        (TIMED_OUT, ResetCause::Watchdog, Some(FaultCode::Watchdog)),
        (
            FORCED,
            ResetCause::Unexplained,
            Some(FaultCode::CrashUnreadable),
        ),
    ] {
        for memory in [NO_RECORD, [0xA5A5_A5A5; RECORD_WORDS]] {
            let (boot, _) = Boot::judge(flags, &memory);
            assert_eq!((boot.cause, boot.crash), (cause, None));
            assert_eq!(fault(boot.cause), latched);
        }
    }
}

#[test]
fn crashes_in_a_row_are_counted_whatever_they_are_and_a_start_without_one_ends_it() {
    let mut memory = NO_RECORD;
    for (number, flags) in (1..).zip([FORCED, TIMED_OUT, FORCED, FORCED, TIMED_OUT]) {
        if flags.forced && number != 3 {
            memory = panicked(&memory);
        }
        let (boot, keep) = Boot::judge(flags, &memory);
        assert_eq!(boot.streak, number, "{flags:?}");
        memory = keep;
    }
    let (boot, keep) = Boot::judge(ResetFlags::default(), &memory);
    assert_eq!((boot.streak, keep), (0, NO_RECORD));
}

/// If a requested restart ended a streak of crashes, a PC that restarts a repeatedly crashing device
/// would let it drive its coil.
#[test]
fn a_new_start_that_was_asked_for_keeps_the_streak_and_one_by_the_boot_loader_ends_it() {
    let mut memory = NO_RECORD;
    for _ in 0..5 {
        (_, memory) = Boot::judge(FORCED, &panicked(&memory));
    }
    for flags in [FORCED, TIMED_OUT, FORCED] {
        let (boot, keep) = Boot::judge(flags, &record(&End::Asked, &memory, 9_000));
        let found = (boot.cause, boot.crash, boot.streak);
        assert_eq!(found, (ResetCause::Software, None, 5));
        memory = keep;
    }
    let (boot, _) = Boot::judge(FORCED, &panicked(&memory));
    assert_eq!(boot.streak, 6);
    let boot_loader = ResetFlags {
        timed_out: true,
        ..ResetFlags::default()
    };
    let (boot, keep) = Boot::judge(boot_loader, &record(&End::Asked, &memory, 9_000));
    let found = (boot.cause, boot.streak, keep);
    assert_eq!(found, (ResetCause::Software, 0, NO_RECORD));
    // After a run that lasted, there is no streak to keep.
    let (boot, _) = Boot::judge(FORCED, &record(&End::Asked, &NO_RECORD, 11_000));
    assert_eq!((boot.cause, boot.streak), (ResetCause::Software, 0));
}

/// If a record were read twice, a reset without a record would be reported with the location of an
/// earlier crash.
#[test]
fn a_record_is_read_once() {
    let (_, keep) = Boot::judge(FORCED, &panicked(&NO_RECORD));
    let (boot, _) = Boot::judge(FORCED, &keep);
    assert_eq!(
        (boot.cause, boot.crash, boot.streak),
        (ResetCause::Unexplained, None, 2)
    );
}

/// Bit errors in the record at any positions, or none.
fn damage() -> impl Strategy<Value = Vec<(usize, u32)>> {
    prop::collection::vec((0..RECORD_WORDS, 1..u32::MAX), 1..RECORD_WORDS)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 20_000,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_reset_by_the_firmware_is_always_a_fault(
        words in prop::array::uniform20(any::<u32>()),
        forced in any::<bool>(),
    ) {
        let flags = if forced { FORCED } else { TIMED_OUT };
        let (boot, keep) = Boot::judge(flags, &words);
        prop_assert!(fault(boot.cause).is_some());
        prop_assert_eq!((boot.crash, boot.streak), (None, 1));
        // The content that is kept for the next run is readable: the next crash counts as the second.
        let (boot, _) = Boot::judge(flags, &keep);
        prop_assert_eq!(boot.streak, 2);
    }

    #[test]
    fn a_damaged_record_is_never_reported(damage in damage(), hard in any::<bool>()) {
        let whole = if hard { faulted(&NO_RECORD) } else { panicked(&NO_RECORD) };
        let mut words = whole;
        for (index, bits) in damage {
            words[index] ^= bits;
        }
        let (boot, _) = Boot::judge(FORCED, &words);
        if words == whole {
            prop_assert!(boot.crash.is_some());
        } else {
            prop_assert_eq!((boot.cause, boot.crash), (ResetCause::Unexplained, None));
        }
    }

    #[test]
    fn a_start_that_is_none_of_the_firmwares_reads_nothing(
        words in prop::array::uniform20(any::<u32>()),
        debugger in any::<bool>(),
        pin in any::<bool>(),
    ) {
        let flags = ResetFlags { debugger, pin, ..ResetFlags::default() };
        for memory in [words, panicked(&NO_RECORD)] {
            let (boot, keep) = Boot::judge(flags, &memory);
            prop_assert_eq!(fault(boot.cause), None);
            prop_assert_eq!((boot.crash, boot.streak, keep), (None, 0, NO_RECORD));
        }
    }
}

#[test]
fn the_procedure_begins_in_the_fault() {
    for &cause in ResetCause::ALL {
        let mut board = crate::support::board();
        board.hello.reset_cause = cause;
        let mut procedure = Procedure::new(board);
        let actions = procedure.step(Instant::from_ticks(1_000), &Event::Tick);
        let reported = actions.iter().find_map(|action| match action {
            palpate_procedure::Action::Record {
                record: Record::Fault(fault),
                ..
            } => Some(fault.code),
            _ => None,
        });
        assert_eq!(reported, fault(cause), "{cause}");
        assert_eq!(procedure.state() == State::Fault, reported.is_some());
    }
}
