//! Requests to a board at the start of a recording, and after each restart of the board.

use palpate_cli::failure::Failure;
use palpate_wire::code::Part;
use palpate_wire::{Command, Frame, Message, Record};

use crate::board::configuration;
use crate::board::link::{Arrival, Link};
use crate::recording::{BOOT, Note};

/// Requests the whole configuration in force. Returns the frames received meanwhile, and whether
/// all requests were answered.
pub(super) fn inspect(link: &mut Link) -> (Vec<Arrival>, Result<(), Failure>) {
    let asked = ask_all(link);
    (link.take(), asked)
}

fn ask_all(link: &mut Link) -> Result<(), Failure> {
    for command in [Command::Identify, Command::GetSettings, Command::GetStorage] {
        link.ask(&command)?;
    }
    for question in configuration::questions() {
        configuration::read_part(link, &question)?;
    }
    // The board answers in order, so its answer to this command follows all others.
    link.ask(&Command::GetSettings)?;
    Ok(())
}

/// Note about a boot: identity of the board and configuration in force, each as the board's own
/// record.
pub(crate) fn note<'f>(boot_id: u32, frames: impl Iterator<Item = &'f Frame<Record>>) -> Note {
    let of_boot = frames.filter(|frame| frame.header.boot_id == boot_id);
    let mut note = Note::new(BOOT).with("boot_id", boot_id);
    let mut calibration = Vec::new();
    for record in of_boot.map(|frame| &frame.message) {
        // A record contains no numbers that JSON cannot express.
        let Ok(text) = serde_json::to_string(record) else {
            continue;
        };
        match record {
            Record::Hello(_) | Record::Settings(_) | Record::Storage(_) => {
                note = note.with(record.name(), text);
            }
            _ if Part::ALL.iter().any(|part| part.number() == record.kind()) => {
                calibration.push(text);
            }
            _ => {}
        }
    }
    note.with("calibration", format!("[{}]", calibration.join(",")))
}
