//! Images with a planted defect: a panic that the firmware survives, and defects that the other
//! tests must detect.

use crate::common::{Crash, EXCEPTIONS, RecordedBoard, ramping};
use ldc161x_sim::Time;
use palpate_emulator::{Image, firmware};
use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Outcome, ResetCause};
use palpate_wire::command::Command;

fn planted(defect: &str) -> Image {
    let path = firmware::build_with_defect(defect).unwrap_or_else(|error| panic!("{error}"));
    Image::load(&path).unwrap()
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn an_image_without_its_safe_state_is_caught() {
    let mut bench = ramping(&planted("no_safe_state"));
    assert_eq!(
        Crash::HardFault
            .in_exception(&mut bench, EXCEPTIONS[0])
            .filter(|took| *took <= Time::from_ms(1)),
        None
    );
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn an_image_whose_watchdog_is_fed_by_whom_it_should_not_is_caught() {
    let snapshot = ramping(&planted("fed_by_idle"));
    // The coil's task stops, while the supervisor continues.
    let mut bench = snapshot.clone();
    let stalled = bench.board.image().symbol("PLANTED_STALL").unwrap();
    bench.board.poke(stalled, 1);
    bench.run(Time::from_ms(100));
    assert_eq!(bench.board.resets().watchdog, 0, "it is fed all the same");
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn an_image_that_drops_a_write_or_swaps_the_words_is_caught() {
    for defect in ["write_dropped", "words_swapped"] {
        let image = planted(defect);
        let mut bench = RecordedBoard::of(crate::common::board(&image));
        bench.run(Time::from_ms(300));
        let right = bench
            .samples()
            .filter(|(_, it)| (it.channels[0].frequency_hz / 3.1e6 - 1.0).abs() < 1e-3);
        assert_eq!(right.count(), 0, "{defect}");
    }
}

/// DMA reads the ADC's FIFO even while it is empty; by the datasheet such a board measures nothing.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn an_image_whose_dma_is_asked_for_results_that_are_not_there_is_caught() {
    let image = planted("asks_always");
    let mut bench = RecordedBoard::of(crate::common::board(&image));
    bench.stream();
    let coil = Command::SetCoil(crate::common::coil());
    assert_eq!(bench.command(&coil).outcome, Outcome::Accepted);
    bench.command(&Command::Arm);
    bench.run(Time::from_ms(100));
    let codes: Vec<FaultCode> = bench.faults().iter().map(|fault| fault.code).collect();
    // Zeros look like a missing current and like a low supply; either may be detected first.
    let is_expected =
        |code: &FaultCode| matches!(code, FaultCode::CurrentSense | FaultCode::SupplyLow);
    assert!(codes.iter().any(is_expected), "{codes:?}");
    assert_eq!(bench.board.current_a(), 0.0);
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_panic_in_any_task_switches_the_bridge_off_within_a_millisecond() {
    let snapshot = ramping(&planted("panic"));
    for task in 0..crate::common::TASKS {
        let mut bench = snapshot.clone();
        let took = crate::common::panic_in(&mut bench, task);
        assert!(took.unwrap() <= Time::from_ms(1), "task {task}");
        let crash = bench.frames.iter().find_map(|frame| match &frame.message {
            Record::Crash(crash) => Some(crash.clone()),
            _ => None,
        });
        let crash = crash.expect("the panic is reported");
        assert_eq!(crash.cause, ResetCause::Panic);
        // Location of the planted panic in the list of defects.
        assert!(crash.file.ends_with("src/main.rs"), "{}", crash.file);
    }
}
