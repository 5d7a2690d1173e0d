//! The board's storage in flash, and its commands.

use palpate_cli::failure::Failure;
use palpate_wire::code::{StorageAction, StorageState};
use palpate_wire::record::Storage;
use palpate_wire::{Command, Record};

use crate::board::link::Link;

/// Longest duration of a save, s: sixteen sectors are erased, in 0.4 s each at most, and written.
const SAVE_S: f64 = 15.0;
/// Longest wait for a record after the answer to its command, s.
const RECORD_S: f64 = 5.0;

/// Returns the state of the storage and of the configuration in force.
///
/// # Errors
/// If the board is gone or does not answer.
pub(crate) fn inspect(link: &mut Link) -> Result<Storage, Failure> {
    ended(link, &Command::GetStorage, StorageAction::Inspect, RECORD_S)
}

/// Stores the configuration in force and verifies it.
///
/// # Errors
/// If the board is gone, refuses it, or could not store it.
pub(crate) fn store(link: &mut Link) -> Result<Storage, Failure> {
    let stored = ended(link, &Command::Store, StorageAction::Store, SAVE_S)?;
    if stored.succeeded && stored.stored_crc == stored.in_force_crc {
        return Ok(stored);
    }
    Err(Failure::Refused(
        "the board did not store the active configuration, and keeps the one stored before: \
         docs/faults.md, storage_failed, says what to do"
            .to_owned(),
    ))
}

/// Stores the configuration in force if `asked`. Returns the state of the storage.
///
/// # Errors
/// If the board is gone, refuses it, or could not store it.
pub(crate) fn store_if(asked: bool, link: &mut Link) -> Result<Storage, Failure> {
    if asked { store(link) } else { inspect(link) }
}

/// Erases the storage. The configuration in force stays until the board restarts.
///
/// # Errors
/// If the board is gone, refuses it, or could not erase it.
pub(crate) fn erase(link: &mut Link) -> Result<Storage, Failure> {
    let erased = ended(link, &Command::Erase, StorageAction::Erase, SAVE_S)?;
    if erased.succeeded {
        return Ok(erased);
    }
    Err(Failure::Refused(
        "the board did not erase the stored configuration: docs/faults.md, storage_failed, says what \
         to do"
            .to_owned(),
    ))
}

/// Sends a storage command and waits for the record of its result.
fn ended(
    link: &mut Link,
    command: &Command,
    action: StorageAction,
    patience_s: f64,
) -> Result<Storage, Failure> {
    link.take();
    link.send_accepted(command)?;
    link.wait_for(patience_s, "record of its storage", |record| match record {
        Record::Storage(storage) if storage.action == action => Some(storage.clone()),
        _ => None,
    })
}

/// Sentence about the lifetime of a configuration that is in force but not stored.
pub(crate) const fn lasts(on_emulated_board: bool) -> &'static str {
    if on_emulated_board {
        "Lost at the end of this command, which switches the emulated board off: `--store` keeps it."
    } else {
        "Active until power-off; `palpate settings store` keeps it."
    }
}

/// Describes the storage in a sentence.
pub(crate) fn describe(storage: &Storage) -> String {
    match storage.state {
        StorageState::Whole => format!(
            "Stored: save {}, {} items, configuration {:08x}, which is {} ({:08x}).",
            storage.generation,
            storage.items,
            storage.stored_crc,
            if storage.stored_crc == storage.in_force_crc {
                "the active one"
            } else {
                "not the active one"
            },
            storage.in_force_crc
        ),
        StorageState::Empty => format!(
            "Stored: nothing; the active configuration is {:08x}.",
            storage.in_force_crc
        ),
        other => format!(
            "Stored: {other}. {} The active configuration is {:08x}.",
            other.meaning().trim(),
            storage.in_force_crc
        ),
    }
}
