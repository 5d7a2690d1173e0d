//! What is asked of a board at the beginning of a recording, and after each start of the board.

use palpate_cli::failure::Failure;
use palpate_wire::code::Part;
use palpate_wire::{Command, Message, Record};

use crate::board::configuration;
use crate::board::link::{Arrival, Link};
use crate::recording::{BOOT, Note};

/// Asks for all that is in force; returns what has come meanwhile, and whether all was answered.
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
    // What was asked for before has come by its answer.
    link.ask(&Command::GetSettings)?;
    Ok(())
}

/// The note about a boot: what the board is, and what is in force, each as the board's own record.
pub(super) fn note(boot_id: u32, arrivals: &[Arrival]) -> Note {
    let of_boot = arrivals.iter().map(|arrival| &arrival.frame);
    let of_boot = of_boot.filter(|frame| frame.header.boot_id == boot_id);
    let mut note = Note::new(BOOT).with("boot_id", boot_id);
    let mut calibration = Vec::new();
    for record in of_boot.map(|frame| &frame.message) {
        // A number that JSON does not have is in no record.
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
