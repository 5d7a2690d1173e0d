//! Storage of the native board.

use palpate_procedure::configuration::DEFAULT_SETTINGS;
use palpate_sim::Time;
use palpate_sim::device::{Device, TimedRecord};
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_sim::switches::Switches;
use palpate_sim::world::Setup;
use palpate_wire::code::{FaultCode, Outcome, RebootTarget, StorageAction, StorageState};
use palpate_wire::command::{Reboot, Settings};
use palpate_wire::record::Storage;
use palpate_wire::{Command, Record};

use crate::common::{middle, world};

fn wiring() -> Wiring {
    Wiring::new(world(
        &middle("ultrasoft"),
        Switches::none(),
        Setup::default(),
    ))
}

/// Settings that differ from those after a start.
fn settings() -> Settings {
    Settings {
        rate_hz: 500.0,
        ramps: 7,
        ..DEFAULT_SETTINGS
    }
}

/// Runs for `ms` milliseconds; returns the storage reports, and all records.
fn run(board: &mut NativeBoard<'_>, ms: u64) -> (Vec<Storage>, Vec<TimedRecord>) {
    board.run_until(board.now() + Time::from_ms(ms)).unwrap();
    let records = board.take_records();
    let of_storage = records.iter().filter_map(|(_, record)| match record {
        Record::Storage(storage) => Some(storage.clone()),
        _ => None,
    });
    (of_storage.collect(), records)
}

/// Sends a command and runs for 100 ms; returns the storage reports.
fn ask(board: &mut NativeBoard<'_>, command: Command) -> Vec<Storage> {
    board.send(command).unwrap();
    run(board, 100).0
}

fn ramps_in_force(board: &mut NativeBoard<'_>) -> u8 {
    board.take_records();
    board.send(Command::GetSettings).unwrap();
    let (_, records) = run(board, 10);
    let mut settings = records.iter().filter_map(|(_, record)| match record {
        Record::Settings(settings) => Some(settings.ramps),
        _ => None,
    });
    settings.next().unwrap()
}

#[test]
fn where_nothing_is_stored_the_board_says_so_with_its_first_words() {
    let wiring = wiring();
    let mut board = NativeBoard::new(&wiring);
    let (_, records) = run(&mut board, 100);
    let [(hello_at, hello), (storage_at, storage)] = &records[..2] else {
        panic!("{records:?}");
    };
    assert!(matches!(hello, Record::Hello(_)), "{hello:?}");
    let Record::Storage(storage) = storage else {
        panic!("{storage:?}");
    };
    assert_eq!(storage.state, StorageState::Empty);
    assert_eq!(
        (storage.action, hello_at),
        (StorageAction::Load, storage_at)
    );
}

#[test]
fn what_is_stored_is_in_force_after_a_restart_and_on_the_next_board() {
    let wiring = wiring();
    let mut board = NativeBoard::new(&wiring);
    board.send(Command::SetSettings(settings())).unwrap();
    board.take_records();
    let [stored] = ask(&mut board, Command::Store).try_into().unwrap();
    assert!(stored.succeeded, "{stored:?}");
    assert_eq!((stored.state, stored.generation), (StorageState::Whole, 1));
    let target = RebootTarget::Firmware;
    board.send(Command::Reboot(Reboot { target })).unwrap();
    let (_, records) = run(&mut board, 600);
    let hello = records
        .iter()
        .any(|(_, record)| matches!(record, Record::Hello(_)));
    assert!(hello, "it has not started anew");
    assert_eq!(ramps_in_force(&mut board), settings().ramps);
    drop(board);
    let mut other = NativeBoard::new(&wiring);
    assert_eq!(ramps_in_force(&mut other), settings().ramps);
}

#[test]
fn what_was_set_since_is_replaced_by_what_is_stored_and_nothing_is_after_it_was_erased() {
    let wiring = wiring();
    let mut board = NativeBoard::new(&wiring);
    board.send(Command::SetSettings(settings())).unwrap();
    ask(&mut board, Command::Store);
    board.send(Command::SetSettings(DEFAULT_SETTINGS)).unwrap();
    board.take_records();
    let [loaded] = ask(&mut board, Command::Load).try_into().unwrap();
    assert!(loaded.succeeded, "{loaded:?}");
    assert_eq!(ramps_in_force(&mut board), settings().ramps);
    let [erased] = ask(&mut board, Command::Erase).try_into().unwrap();
    assert_eq!(
        (erased.succeeded, erased.state),
        (true, StorageState::Empty)
    );
    board.post(Command::Load);
    let (_, records) = run(&mut board, 10);
    let is_refused = |record: &Record| match record {
        Record::Acknowledgement(answer) => answer.outcome == Outcome::NothingStored,
        _ => false,
    };
    assert!(records.iter().any(|(_, record)| is_refused(record)));
}

/// One item is stored per turn; until the end, settings are refused.
#[test]
fn while_it_stores_it_is_busy() {
    let wiring = wiring();
    let mut board = NativeBoard::new(&wiring);
    board.send(Command::SetSettings(settings())).unwrap();
    board.take_records();
    board.post(Command::Store);
    board.post(Command::SetSettings(DEFAULT_SETTINGS));
    let (_, records) = run(&mut board, 100);
    let outcomes: Vec<Outcome> = records
        .iter()
        .filter_map(|(_, record)| match record {
            Record::Acknowledgement(answer) => Some(answer.outcome),
            _ => None,
        })
        .collect();
    assert_eq!(outcomes, [Outcome::Accepted, Outcome::Busy]);
    assert_eq!(ramps_in_force(&mut board), settings().ramps);
}

#[test]
fn damage_is_found_at_the_next_start_which_does_not_use_it() {
    let wiring = wiring();
    let mut board = NativeBoard::new(&wiring);
    board.send(Command::SetSettings(settings())).unwrap();
    ask(&mut board, Command::Store);
    drop(board);
    wiring.flash().with_bytes(|bytes| {
        let written = bytes.iter_mut().filter(|byte| **byte != u8::MAX);
        // Behind the marks of the area, and more bytes than the code corrects.
        written.skip(60).take(8).for_each(|byte| *byte ^= 0x10);
    });
    let mut board = NativeBoard::new(&wiring);
    let (_, records) = run(&mut board, 100);
    let is_fault = |record: &Record| match record {
        Record::Fault(fault) => fault.active && fault.code == FaultCode::StorageDamaged,
        _ => false,
    };
    assert!(
        records.iter().any(|(_, record)| is_fault(record)),
        "{records:?}"
    );
    assert_eq!(ramps_in_force(&mut board), DEFAULT_SETTINGS.ramps);
}
