//! Settings and calibration in the image's flash.

use palpate_emulator::Time;
use palpate_wire::code::{Outcome, RebootTarget, StorageAction, StorageState};
use palpate_wire::command::Reboot;
use palpate_wire::{Command, Record, record};

use crate::common::{RecordedBoard, streaming};

fn storage(record: &Record) -> Option<record::Storage> {
    match record {
        Record::Storage(storage) => Some(storage.clone()),
        _ => None,
    }
}

/// Stores what is in force, and waits for the end of it.
fn store(bench: &mut RecordedBoard) -> record::Storage {
    assert_eq!(bench.command(&Command::Store).outcome, Outcome::Accepted);
    bench
        .wait_for(Time::from_ms(3_000), storage)
        .expect("a save ends")
}

#[test]
fn settings_outlive_a_new_start() {
    let mut bench = streaming();
    let mut settings = bench.settings();
    settings.rate_hz = 500.0;
    settings.status_period_s = 0.25;
    let set = Command::SetSettings(settings.clone());
    assert_eq!(bench.command(&set).outcome, Outcome::Accepted);
    let stored = store(&mut bench);
    println!("{stored:?}");
    assert_eq!(
        (stored.action, stored.succeeded, stored.state),
        (StorageAction::Store, true, StorageState::Whole)
    );
    let reboot = Command::Reboot(Reboot {
        target: RebootTarget::Firmware,
    });
    assert_eq!(bench.command(&reboot).outcome, Outcome::Accepted);
    bench.run(Time::from_ms(210));
    bench.restart_listening();
    bench.stream();
    let (_, found) = bench.ask(&Command::GetStorage, storage);
    println!("{found:?}");
    assert_eq!(found.stored_crc, found.in_force_crc);
    assert_eq!(bench.settings(), settings);
}
