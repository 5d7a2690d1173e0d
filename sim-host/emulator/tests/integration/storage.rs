//! Settings and calibration in the image's flash.
//!
//! Short form; the campaign `image-storage` covers every operation and more bits.

use std::collections::BTreeSet;

use palpate_emulator::{FlashOperationKind, FlashTimes, Time};
use palpate_wire::code::{FaultCode, Outcome, RebootTarget, ResetCause, StorageState};
use palpate_wire::command::{ClearFault, Locate};
use palpate_wire::{Command, configuration_crc};

use crate::common::during_save::CONTROL;
use crate::common::stored::{
    AREA, Amount, BitFlip, LONGEST_SAVE, ThirdSave, Which, configuration, flip, reboot, spread,
    storage, streaming_with,
};
use crate::common::{Crash, EXCEPTIONS, RecordedBoard, image, reset_without_a_record};

/// A board that has stored a configuration, with that configuration.
fn saved() -> (RecordedBoard, Vec<Command>) {
    let mut bench = streaming_with(FlashTimes::Typical, 1);
    let commands = configuration(1, Amount::Usual);
    bench.save(&commands);
    (bench, commands)
}

// ---- power ----

#[test]
fn settings_and_calibration_outlive_a_reboot_and_a_loss_of_power() {
    let (mut bench, commands) = saved();
    let found = bench.reboot();
    assert!(found.is(&commands), "{found:?}");
    let found = bench.cycle_power();
    assert!(found.is(&commands), "{found:?}");
}

#[test]
fn a_power_cut_in_a_save_leaves_all_of_the_old_or_all_of_the_new() {
    let save = ThirdSave::prepared(Amount::Usual, FlashTimes::Typical, 1);
    let mut which = BTreeSet::new();
    let count = save.operations.len() as u64;
    // Operations across the whole save, and all of the last ones: a save ends with its seal.
    let operations = spread(4, count).into_iter().chain(count - 8..count - 1);
    for operation in operations {
        let (of, recovered, found) = save.cut(operation);
        assert_ne!(of, Which::Neither, "operation {operation}: {found:?}");
        which.insert(of);
        // A start writes nothing to the flash: only the next save repairs it.
        let (begun, end) = (recovered.board.flash().operations(), operation as usize + 1);
        assert_eq!(begun.len(), save.before + end, "operation {operation}");
        if operation % 2 == 1 {
            let again = save.cut_again(&recovered, of, operation / 2);
            let (of, found) = again.expect("the next save has that operation");
            assert_ne!(
                of,
                Which::Neither,
                "{operation}, then half of it: {found:?}"
            );
        }
    }
    assert!(which.contains(&Which::Old) && which.contains(&Which::New));
}

#[test]
fn a_flipped_bit_of_what_is_stored_is_found_or_does_no_harm() {
    let (bench, old) = saved();
    let written = bench.written();
    let mut found = BTreeSet::new();
    for index in 0..12_usize {
        let address = written[index * (written.len() - 1) / 11];
        let of = flip(&bench, &old, address, (index % 8) as u8);
        assert_ne!(of, BitFlip::Silent, "{address:#x}, bit {}", index % 8);
        found.insert(of);
    }
    assert!(found.contains(&BitFlip::Found), "{found:?}");
}

/// The ring oscillator, which this reset spares, determines how long the boot ROM waits for the
/// flash.
#[test]
fn a_watchdog_reset_in_the_longest_erase_ends_in_the_firmware() {
    let mut bench = ThirdSave::prepared(Amount::Usual, FlashTimes::Longest, 1).bench;
    bench.send(&Command::Store);
    bench
        .board
        .run_until(Time::from_ms(2_000), |board| {
            let last = board.flash().operations().last();
            board.flash().is_busy()
                && last.is_some_and(|of| of.kind == FlashOperationKind::EraseSector)
        })
        .expect("a sector is erased");
    reset_without_a_record(&mut bench);
    let before = bench.board.resets();
    bench
        .board
        .run_until(Time::from_ms(1), |board| board.resets() != before)
        .unwrap();
    assert!(!bench.board.flash().is_busy(), "the boot ROM has waited");
    assert!(!bench.board.is_in_boot_loader());
    bench.restart_listening();
    bench.stream();
}

// ---- together with other activity ----

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_save_with_the_longest_erases_holds_nothing_up() {
    let mut save = ThirdSave::prepared(Amount::Usual, FlashTimes::Longest, 1);
    save.bench.plug();
    let during = save.bench.store_beside_everything();
    assert!(during.erases > 0 && during.took > Time::from_ms(400));
    assert!(during.probe.samples > 400 && during.usb.samples > 400);
    assert!(during.answered > 50);
    assert!(during.holds(), "{during:#?}");
}

#[test]
fn flash_is_changed_only_after_the_bridge_rests() {
    let mut save = ThirdSave::prepared(Amount::Usual, FlashTimes::Typical, 1);
    for command in [Command::Arm, Command::Sweep] {
        save.bench.accepted(&command);
    }
    save.bench.run(Time::from_ms(60));
    assert!(save.bench.board.current_a() > 2.0);
    assert_eq!(save.bench.command(&Command::Store).outcome, Outcome::Armed);
    for order in [Command::Store, Command::Erase] {
        let mut bench = save.bench.clone();
        let before = bench.board.flash().operations().len();
        bench.send(&Command::Disarm);
        bench.send(&order);
        let (mut awake, mut control) = (Time::ZERO, Time::ZERO);
        let limit = Time::from_ms(500);
        let begins = bench.board.run_until(limit, |board| {
            if board.bridge().awake {
                awake = board.now();
            }
            if board.exception() == CONTROL {
                control = board.now();
            }
            board.flash().operations().len() > before
        });
        begins.expect("the save begins");
        let begun = bench.board.flash().operations()[before].begun;
        assert!(awake > Time::ZERO && begun - awake >= Time::from_ms(190));
        assert!(begun > control);
        let received = bench.frames.len();
        let mut woke = false;
        let end = bench.board.now() + LONGEST_SAVE;
        while !bench.frames[received..]
            .iter()
            .any(|of| storage(&of.message).is_some())
        {
            woke |= bench.run_seeing_the_bridge();
            assert!(bench.board.now() < end, "{order:?} does not end");
        }
        assert!(!woke, "the bridge woke up while flash was written");
    }
}

// ---- restarts ----

#[test]
fn a_reboot_is_answered_first_and_finds_the_bridge_off() {
    let (mut bench, commands) = saved();
    for command in [Command::Arm, Command::Sweep] {
        bench.accepted(&command);
    }
    bench.run(Time::from_ms(60));
    assert!(bench.board.bridge().awake);
    bench.accepted(&reboot(RebootTarget::Firmware));
    assert!(!bench.board.bridge().awake && bench.board.resets().watchdog == 0);
    let anew = bench.board.run_until(Time::from_ms(300), |board| {
        board.resets().watchdog == 1 || board.bridge().awake
    });
    anew.expect("it starts anew within 0.3 s");
    assert!(!bench.board.bridge().awake);
    let found = bench.started();
    assert_eq!(found.hello.reset_cause, ResetCause::Software);
    assert!(found.is(&commands), "{found:?}");
}

#[test]
fn an_update_keeps_settings_and_calibration() {
    let (bench, commands) = saved();
    let mut by_boot_loader = bench.clone();
    by_boot_loader.accepted(&reboot(RebootTarget::BootLoader));
    by_boot_loader.board.run_for(Time::from_ms(300)).unwrap();
    assert!(by_boot_loader.board.is_in_boot_loader());
    by_boot_loader.board.write_uf2(&image().to_uf2()).unwrap();
    let found = by_boot_loader.started();
    assert_eq!(found.hello.reset_cause, ResetCause::Software);
    assert!(found.is(&commands), "{found:?}");

    // A probe writes the image's sectors, and then restarts the board.
    assert!(image().flash_bytes() <= AREA.start);
    let mut by_probe = bench;
    let area = by_probe
        .board
        .flash()
        .bytes(AREA.start, AREA.end - AREA.start);
    let mut contents = RecordedBoard::new().board.flash().export();
    contents[AREA.start as usize..].copy_from_slice(&area);
    by_probe.board.flash_mut().import(&contents);
    let found = by_probe.cycle_power();
    assert!(found.is(&commands), "{found:?}");
}

/// A board that has stored a configuration and then crashed five times in a row, with that
/// configuration.
fn crashed_five_times() -> (RecordedBoard, Vec<Command>) {
    let (mut bench, commands) = saved();
    for _ in 0..5 {
        Crash::HardFault.in_exception(&mut bench, EXCEPTIONS[0]);
        bench.stream();
    }
    (bench, commands)
}

#[test]
fn five_crashes_in_a_row_lead_to_a_mode_that_talks_and_does_not_drive() {
    let (mut bench, commands) = crashed_five_times();
    assert!(is_in_safe_mode(&mut bench, &commands));
    let clear = Command::ClearFault(ClearFault {
        code: FaultCode::CrashStreak,
    });
    assert_eq!(bench.command(&clear).outcome, Outcome::FaultPersists);
    // A restart soon afterwards does not end safe mode.
    let found = bench.reboot();
    assert_eq!(found.hello.reset_cause, ResetCause::Software);
    assert!(is_in_safe_mode(&mut bench, &commands));
    let erased = bench.with_storage(&Command::Erase);
    assert_eq!(erased.state, StorageState::Empty);
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn ten_seconds_without_a_crash_and_a_reboot_end_the_safe_mode() {
    let (mut bench, commands) = crashed_five_times();
    bench.run(Time::from_ms(10_100));
    let found = bench.reboot();
    assert!(found.is(&commands), "{found:?}");
    assert_eq!(bench.command(&Command::Arm).outcome, Outcome::Accepted);
}

/// Whether the board reports safe mode, uses no stored data, and refuses to drive.
fn is_in_safe_mode(bench: &mut RecordedBoard, stored: &[Command]) -> bool {
    let faults = bench.faults();
    let is_said = faults
        .iter()
        .any(|of| of.active && of.code == FaultCode::CrashStreak);
    let found = bench.stored();
    let is_kept = found.stored_crc == configuration_crc(stored);
    let coil = Command::SetCoil(crate::common::coil());
    bench.accepted(&coil);
    let orders = [
        Command::Arm,
        Command::Measure,
        crate::common::driven::drive(1.0, 0.0),
    ];
    let mut refuses = |order| bench.command(order).outcome != Outcome::Accepted;
    let is_refused = orders.iter().all(&mut refuses);
    let woke = (0..50).any(|_| bench.run_seeing_the_bridge());
    is_said && is_kept && found.in_force_crc != found.stored_crc && is_refused && !woke
}

#[test]
fn a_board_flickers_for_as_long_as_it_is_to_be_found() {
    let mut bench = streaming_with(FlashTimes::Typical, 1);
    bench.accepted(&Command::Locate(Locate { duration_s: 1.0 }));
    let flickering = led_changes(&mut bench, Time::from_ms(1_000));
    let afterwards = led_changes(&mut bench, Time::from_ms(2_000));
    assert!((18..=20).contains(&flickering.len()), "{flickering:?}");
    let steady = flickering.windows(2).map(|of| of[1] - of[0]);
    assert!(
        steady
            .clone()
            .all(|it| it >= Time::from_ms(49) && it <= Time::from_ms(52))
    );
    assert!((3..=4).contains(&afterwards.len()), "{afterwards:?}");
    // A duration of zero ends the blinking early.
    bench.accepted(&Command::Locate(Locate { duration_s: 60.0 }));
    assert!(led_changes(&mut bench, Time::from_ms(500)).len() >= 9);
    bench.accepted(&Command::Locate(Locate { duration_s: 0.0 }));
    assert!(led_changes(&mut bench, Time::from_ms(1_000)).len() <= 2);
}

/// Times at which the LED goes on or off.
fn led_changes(bench: &mut RecordedBoard, time: Time) -> Vec<Time> {
    let end = bench.board.now() + time;
    let mut changes = Vec::new();
    while bench.board.now() < end {
        let was_on = bench.board.led_is_on();
        bench.run(Time::from_ms(1));
        if bench.board.led_is_on() != was_on {
            changes.push(bench.board.now());
        }
    }
    changes
}
