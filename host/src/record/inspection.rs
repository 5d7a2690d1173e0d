//! What is asked of a board at the beginning of a recording, and after each start of the board.

use std::time::Duration;

use palpate_wire::code::{Chip, Outcome, Part};
use palpate_wire::command::GetCalibration;
use palpate_wire::{Command, Message, Record};

use crate::failure::Failure;
use crate::link::{Arrival, Link};
use crate::recording::{BOOT, Note};

/// How long a part of the calibration may take after its announcement: a curve comes in four records at
/// most, one a millisecond.
const PART: Duration = Duration::from_secs(1);
/// How long is listened at once.
const LOOK: Duration = Duration::from_millis(10);
/// Channels of a converter.
const CHANNELS: u8 = 4;

/// Asks for all that is in force; returns what has come meanwhile, and whether all was answered.
pub(super) fn inspect(link: &mut Link) -> (Vec<Arrival>, Result<(), Failure>) {
    let mut arrivals = Vec::new();
    let asked = ask_all(link, &mut arrivals);
    arrivals.extend(link.take());
    (arrivals, asked)
}

fn ask_all(link: &mut Link, arrivals: &mut Vec<Arrival>) -> Result<(), Failure> {
    for command in [Command::Identify, Command::GetSettings, Command::GetStorage] {
        link.ask(&command)?;
    }
    let has_second = link
        .hello()
        .is_some_and(|hello| hello.second_chip != Chip::Absent);
    for request in requests(if has_second { 2 } else { 1 }) {
        arrivals.extend(link.take());
        let (_, outcome) = link.ask(&Command::GetCalibration(request.clone()))?;
        if outcome == Outcome::Accepted {
            await_part(link, &request, arrivals)?;
        }
    }
    // What was asked for before has come by its answer.
    link.ask(&Command::GetSettings)?;
    Ok(())
}

/// The parts of a calibration.
fn requests(sensors: u8) -> impl Iterator<Item = GetCalibration> {
    let parts = Part::ALL.iter().copied();
    parts.flat_map(move |part| {
        let (sensors, channels) = if is_of_a_channel(part) {
            (sensors, CHANNELS)
        } else {
            (1, 1)
        };
        (0..sensors).flat_map(move |sensor| {
            (0..channels).map(move |channel| GetCalibration {
                part,
                sensor,
                channel,
            })
        })
    })
}

const fn is_of_a_channel(part: Part) -> bool {
    matches!(part, Part::Tank | Part::DeformationCurve | Part::Crosstalk)
}

/// Listens until a part is there: the device sends one at a time.
fn await_part(
    link: &mut Link,
    request: &GetCalibration,
    arrivals: &mut Vec<Arrival>,
) -> Result<(), Failure> {
    let end = link.now() + PART;
    loop {
        let new = link.take();
        let mut messages = new.iter().map(|arrival| &arrival.frame.message);
        let is_there = messages.any(|record| is_end_of(record, request));
        arrivals.extend(new);
        if is_there || link.now() > end {
            return Ok(());
        }
        link.listen(LOOK)?;
    }
}

/// Whether a record is the last of a part.
fn is_end_of(record: &Record, request: &GetCalibration) -> bool {
    let is_last = |first: u8, knots: usize, total: u8| usize::from(first) + knots >= total.into();
    record.kind() == request.part.number()
        && match record {
            Record::DeformationCurve(curve) => is_last(curve.first, curve.knots.len(), curve.total),
            Record::StiffeningCurve(curve) => is_last(curve.first, curve.knots.len(), curve.total),
            _ => true,
        }
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
