//! Faults of bus and converter, each from a snapshot of a running stream, and the safe state.
//!
//! Short form; the campaign `image-faults` sweeps over every bit and byte.

use crate::common::{
    Crash, DATA, EXCEPTIONS, RecordedBoard, image, ramping, streaming, time_to_off,
};
use ldc161x_sim::{ChipFault, FaultEvent, Lost, Time};
use palpate_emulator::{LineFault, ResetCount, firmware};
use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Outcome, ResetCause};
use palpate_wire::command::Command;

/// Longest time from the end of a fault to the next sample.
const RECOVERY: Time = Time::from_ms(50);

/// Asserts that the stream is back, that its first sample is marked as after a gap, and that there
/// was no reset.
fn assert_recovers(bench: &mut RecordedBoard, what: &str) {
    bench.frames.clear();
    bench.run(RECOVERY);
    let good = |bench: &RecordedBoard| {
        bench
            .samples()
            .filter(|(_, sample)| sample.missed == 0)
            .count()
    };
    let before = good(bench);
    bench.run(Time::from_ms(20));
    assert!(good(bench) >= before + 15, "{what}: the stream is not back");
    assert_eq!(bench.board.resets().watchdog, 0, "{what}");
    let flagged = bench.words().iter().any(|word| word >> 28 != 0);
    assert!(!flagged, "{what}: a word with an error flag");
}

#[test]
fn sda_held_low_at_some_bits_is_survived() {
    let snapshot = streaming();
    for bit in [0, 1, 5, 8, 9, 14, 18, 30, 60, 94] {
        let mut bench = snapshot.clone();
        bench.board.disturb(LineFault::SdaLow {
            bit,
            lasting: None,
            clocks: Some(1 + bit % 9),
        });
        bench.run(Time::from_ms(10));
        assert!(
            !bench.board.is_disturbed(),
            "bit {bit}: SDA was not freed by clocks"
        );
        assert_recovers(&mut bench, &format!("SDA low at bit {bit}"));
    }
}

#[test]
fn scl_held_for_a_while_is_survived_and_for_ever_is_reported() {
    let snapshot = streaming();
    for (bit, held_us) in [(3, 1_000), (40, 4_900), (40, 5_100), (60, 30_000)] {
        let mut bench = snapshot.clone();
        bench.board.disturb(LineFault::SclHeld {
            bit,
            lasting: Some(Time::from_us(held_us)),
        });
        bench.run(Time::from_us(held_us + 2_000));
        assert_recovers(&mut bench, &format!("SCL held {held_us} us"));
    }
    let mut bench = snapshot.clone();
    bench.board.disturb(LineFault::SclHeld {
        bit: 40,
        lasting: None,
    });
    bench.run(Time::from_ms(200));
    let faults = bench.faults();
    assert!(
        faults
            .iter()
            .any(|fault| fault.active && fault.code == FaultCode::BusClockStuck),
        "{faults:?}"
    );
    bench.board.release();
    assert_recovers(&mut bench, "SCL held for 200 ms");
    let ended = bench.faults();
    assert!(
        ended.iter().any(|fault| !fault.active),
        "the fault ends: {ended:?}"
    );
}

#[test]
fn a_byte_that_is_not_acknowledged_is_survived() {
    let snapshot = streaming();
    for after_bytes in 0..6 {
        let mut bench = snapshot.clone();
        let next = bench.board.chip().traffic().transactions;
        let fault = ChipFault::Nack { after_bytes };
        bench
            .board
            .chip_mut()
            .schedule(FaultEvent::in_transactions(next, 1, fault))
            .unwrap();
        bench.run(Time::from_ms(2));
        assert_recovers(&mut bench, &format!("NACK after {after_bytes} bytes"));
    }
}

#[test]
fn a_converter_that_loses_everything_is_started_anew() {
    let snapshot = streaming();
    for after_us in [0, 210, 430, 650, 870] {
        let mut bench = snapshot.clone();
        let at = bench.board.now() + Time::from_us(after_us);
        let fault = ChipFault::BrownOut(Lost::Everything);
        bench
            .board
            .chip_mut()
            .schedule(FaultEvent::at(at, fault, Time::ZERO))
            .unwrap();
        bench.run(Time::from_ms(20));
        assert_recovers(&mut bench, &format!("reset after {after_us} us"));
    }
}

#[test]
fn an_interrupt_line_that_is_stuck_is_survived() {
    let snapshot = streaming();
    for low in [false, true] {
        let mut bench = snapshot.clone();
        let fault = FaultEvent::at(
            bench.board.now(),
            ChipFault::IntbStuck { low },
            Time::from_ms(60),
        );
        let before = bench.faults().len();
        bench.board.chip_mut().schedule(fault).unwrap();
        bench.run(Time::from_ms(60));
        // The fault is reported by its own code, with the line's level.
        let faults = bench.faults();
        let raised = faults.get(before).expect("a fault");
        assert_eq!(raised.code, FaultCode::InterruptStuck, "low: {low}");
        assert_eq!(raised.value, Some(if low { 0.0 } else { 1.0 }));
        assert_recovers(&mut bench, &format!("INTB stuck, low: {low}"));
    }
}

// ---- the coil and the safe state ----

#[test]
fn a_command_switches_the_bridge_off() {
    let snapshot = ramping(image());
    for command in [Command::Disarm, Command::Abort, Command::SensingOnly] {
        let mut bench = snapshot.clone();
        assert_eq!(bench.command(&command).outcome, Outcome::Accepted);
        assert_eq!(bench.board.current_a(), 0.0, "{command:?}");
        assert!(time_to_off(&mut bench).is_some());
    }
}

#[test]
fn a_fault_anywhere_switches_the_bridge_off_within_a_millisecond() {
    let snapshot = ramping(image());
    for exception in EXCEPTIONS {
        let mut bench = snapshot.clone();
        let took = Crash::HardFault.in_exception(&mut bench, exception);
        assert!(took.unwrap() <= Time::from_ms(1), "exception {exception}");
        assert_eq!(bench.board.resets().watchdog, 1);
        let crash = bench.frames.iter().find_map(|frame| match &frame.message {
            Record::Crash(crash) => Some(crash.clone()),
            _ => None,
        });
        let crash = crash.expect("the crash is reported");
        assert_eq!(crash.cause, ResetCause::HardFault);
        assert_eq!(crash.program_counter, crate::common::SPARE);
        let faults = bench.faults();
        assert!(
            faults
                .iter()
                .any(|fault| fault.code == FaultCode::HardFault),
            "{faults:?}"
        );
        assert_eq!(bench.command(&Command::Arm).outcome, Outcome::Faulted);
    }
}

#[test]
fn an_endless_loop_anywhere_switches_the_bridge_off_within_60_ms() {
    let snapshot = ramping(image());
    for exception in EXCEPTIONS {
        let mut bench = snapshot.clone();
        let took = Crash::Loop.in_exception(&mut bench, exception);
        assert!(took.unwrap() <= Time::from_ms(60), "exception {exception}");
        let faults = bench.faults();
        assert!(
            faults.iter().any(|fault| fault.code == FaultCode::Watchdog),
            "{faults:?}"
        );
        bench.stream();
    }
}

#[test]
fn a_snapshot_runs_on_like_its_original() {
    let mut one = ramping(image());
    let mut other = one.clone();
    one.run(Time::from_ms(50));
    other.run(Time::from_ms(50));
    assert_eq!(one.frames, other.frames);
    assert_eq!(one.board.instructions(), other.board.instructions());
    assert_eq!(one.board.now(), other.board.now());
}

#[test]
fn the_image_fits_its_budget() {
    assert!(image().flash_bytes() <= 228 * 1024);
    assert_eq!(firmware::TARGET, "thumbv6m-none-eabi");
}

/// A 64-bit random generator (xorshift).
fn random(state: &mut u64) -> u32 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 32) as u32
}

/// Random words overwrite the record of a crash, between the reset and the start that reads it.
/// Such a start must latch a fault, not report the cause `software`.
#[test]
fn a_crash_whose_record_cannot_be_read_is_a_fault() {
    let record = image().symbol("CRASH_RECORD").unwrap();
    let mut snapshot = ramping(image());
    snapshot
        .board
        .poke(crate::common::SPARE, crate::common::UNDEFINED);
    snapshot.board.set_pc(crate::common::SPARE);
    snapshot
        .board
        .run_until(Time::from_ms(10), |board| board.resets().watchdog == 1)
        .unwrap();
    let mut state = 0x5EED;
    for words in [20, 20, 1, 1, 1, 0] {
        let mut bench = snapshot.clone();
        for word in 0..words {
            let index = if words == 1 {
                random(&mut state) % 20
            } else {
                word
            };
            bench.board.poke(record + 4 * index, random(&mut state));
        }
        bench.restart_listening();
        bench.run(Time::from_ms(100));
        let hello = bench.frames.iter().find_map(|frame| match &frame.message {
            Record::Hello(hello) => Some(hello.clone()),
            _ => None,
        });
        let is_reported = bench
            .frames
            .iter()
            .any(|frame| matches!(frame.message, Record::Crash(_)));
        let (cause, code) = if words == 0 {
            (ResetCause::HardFault, FaultCode::HardFault)
        } else {
            (ResetCause::Unexplained, FaultCode::CrashUnreadable)
        };
        assert_eq!(hello.unwrap().reset_cause, cause, "{words}");
        assert_eq!(is_reported, words == 0);
        let faults: Vec<_> = bench.faults().iter().map(|fault| fault.code).collect();
        assert_eq!(faults, [code], "{words} words");
        assert_eq!(bench.command(&Command::Arm).outcome, Outcome::Faulted);
        // Once the fault is cleared, the board works as before.
        bench.stream();
    }
}

/// A reset that the firmware did not request: overwritten memory made the processor write the
/// watchdog's trigger.
#[test]
fn a_reset_without_a_record_is_a_fault() {
    let mut bench = ramping(image());
    crate::common::reset_without_a_record(&mut bench);
    let took = time_to_off(&mut bench);
    // The reset also switches the outputs off; the emulator's step includes the boot, 4 ms with the
    // ring oscillator at the firmware's setting.
    assert!(took.unwrap() <= Time::from_ms(5), "{took:?}");
    assert_eq!(bench.board.resets().watchdog, 1);
    let faults = bench.faults();
    assert!(
        faults
            .iter()
            .any(|fault| fault.code == FaultCode::CrashUnreadable),
        "{faults:?}"
    );
}

#[test]
fn a_core_voltage_that_falls_restarts_the_chip() {
    let mut bench = streaming();
    // 200 MHz need 1.15 V; the regulator may be 3 % lower.
    bench.board.dip_core_voltage(1.12);
    bench.run(Time::from_ms(10));
    assert_eq!(bench.board.resets(), ResetCount::default());
    bench.board.dip_core_voltage(1.0);
    assert_eq!(bench.board.resets().power, 1);
    bench.restart_listening();
    bench.stream();
}

/// `probe-rs run` sets the log's channel to wait for space; with the probe unplugged it stays full.
#[test]
fn a_channel_that_a_pc_has_set_to_wait_holds_nothing_up() {
    const WAIT_FOR_ROOM: u32 = 2;
    let snapshot = streaming();
    for channel in [0, DATA] {
        let mut bench = snapshot.clone();
        // Fields of a channel's descriptor after its name and its buffer (SEGGER RTT): size, two
        // positions, flags.
        let block = bench.board.image().symbol("_SEGGER_RTT").unwrap();
        let [size, written, read, flags] = [8, 12, 16, 20].map(|at| block + 24 + 24 * channel + at);
        let full = (bench.board.peek(written) + 1) % bench.board.peek(size);
        bench.board.poke(read, full);
        bench.board.poke(flags, WAIT_FOR_ROOM);
        // A frame that fails to be read is logged.
        bench.board.disturb(LineFault::SdaLow {
            bit: 12,
            lasting: Some(Time::from_ms(2)),
            clocks: None,
        });
        bench.board.run_for(Time::from_ms(200)).unwrap();
        assert_eq!(bench.board.resets().watchdog, 0, "channel {channel}");
        bench.restart_listening();
        bench.run(Time::from_ms(100));
        let samples = bench.samples().count();
        assert!(samples > 80, "channel {channel}: {samples}");
    }
}
