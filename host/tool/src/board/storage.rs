//! What a board keeps in its flash memory, and how it is changed.

use palpate_cli::failure::Failure;
use palpate_wire::code::{StorageAction, StorageState};
use palpate_wire::record::Storage;
use palpate_wire::{Command, Record};

use crate::board::link::Link;

/// How long a save may take, s: sixteen sectors to erase, 0.4 s each at most, and their items.
const SAVE_S: f64 = 15.0;
/// How long a record may take that follows its command's answer, s.
const RECORD_S: f64 = 5.0;

/// What is stored, beside what is in force.
///
/// # Errors
/// If the board is gone or does not answer.
pub(crate) fn inspect(link: &mut Link) -> Result<Storage, Failure> {
    ended(link, &Command::GetStorage, StorageAction::Inspect, RECORD_S)
}

/// Stores what is in force, and reads back what is stored.
///
/// # Errors
/// If the board is gone, refuses it, or could not store it.
pub(crate) fn store(link: &mut Link) -> Result<Storage, Failure> {
    let stored = ended(link, &Command::Store, StorageAction::Store, SAVE_S)?;
    if stored.succeeded && stored.stored_crc == stored.in_force_crc {
        return Ok(stored);
    }
    Err(Failure::Refused(
        "the board did not store what is in force, and keeps what it stored before: docs/faults.md, \
         storage_failed, says what to do"
            .to_owned(),
    ))
}

/// Erases what is stored. What is in force stays so until the board starts anew.
///
/// # Errors
/// If the board is gone, refuses it, or could not erase it.
pub(crate) fn erase(link: &mut Link) -> Result<Storage, Failure> {
    let erased = ended(link, &Command::Erase, StorageAction::Erase, SAVE_S)?;
    if erased.succeeded {
        return Ok(erased);
    }
    Err(Failure::Refused(
        "the board did not erase what it stored: docs/faults.md, storage_failed, says what to do"
            .to_owned(),
    ))
}

/// Sends a command to the storage, and waits for the record that says how it ended.
fn ended(
    link: &mut Link,
    command: &Command,
    action: StorageAction,
    patience_s: f64,
) -> Result<Storage, Failure> {
    link.take();
    link.must(command)?;
    link.wait_for(patience_s, "record of its storage", |record| match record {
        Record::Storage(storage) if storage.action == action => Some(storage.clone()),
        _ => None,
    })
}

/// How long what is in force and not stored lasts.
pub(crate) const fn lasts(on_emulated_board: bool) -> &'static str {
    if on_emulated_board {
        "Lost with the end of this command, which switches the emulated board off: `--store` keeps it."
    } else {
        "In force until the power is off; `palpate settings store` keeps it."
    }
}

/// What is stored, in a sentence.
pub(crate) fn describe(storage: &Storage) -> String {
    match storage.state {
        StorageState::Whole => format!(
            "Stored: save {}, {} items, configuration {:08x}, which {} in force ({:08x}).",
            storage.generation,
            storage.items,
            storage.stored_crc,
            if storage.stored_crc == storage.in_force_crc {
                "is what is"
            } else {
                "is not what is"
            },
            storage.in_force_crc
        ),
        StorageState::Empty => format!(
            "Stored: nothing; in force is configuration {:08x}.",
            storage.in_force_crc
        ),
        other => format!(
            "Stored: {other}. {} In force is configuration {:08x}.",
            other.meaning().trim(),
            storage.in_force_crc
        ),
    }
}
