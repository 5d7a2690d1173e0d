//! A board's configuration as the commands that set it.

use std::time::Duration;

use palpate_cli::failure::Failure;
use palpate_cli::modulus::DeclaredTip;
use palpate_wire::code::{Outcome, Part};
use palpate_wire::command::{GetCalibration, Settings};
use palpate_wire::{Command, Message, Record, configuration_crc};

use crate::board::link::Link;
use crate::board::storage;

/// Longest wait for a record after the answer to its command, s.
const RECORD_S: f64 = 5.0;
/// Longest wait for a part after the answer to its command: a curve comes in four records, one step
/// of the board's procedure apart.
const PART: Duration = Duration::from_secs(5);
/// Longest time of one receive call.
const POLL: Duration = Duration::from_millis(10);
/// Greatest numbers of converters, and of channels of a converter, that a board may have.
const SENSORS: u8 = 2;
const CHANNELS: u8 = 4;

/// Reads the settings in force.
///
/// # Errors
/// If the board is gone or does not answer.
pub(crate) fn settings(link: &mut Link) -> Result<Settings, Failure> {
    link.take();
    link.send_accepted(&Command::GetSettings)?;
    link.wait_for(RECORD_S, "settings", |record| match record {
        Record::Settings(settings) => Some(settings.clone()),
        _ => None,
    })
}

/// Reads the configuration in force, without settings that were never set, as in the board's CRC.
///
/// # Errors
/// If the board is gone, or its records do not match its CRC.
pub(crate) fn read(link: &mut Link) -> Result<Vec<Command>, Failure> {
    let settings = Command::SetSettings(settings(link)?);
    let mut parts = Vec::new();
    for question in questions() {
        parts.extend(read_part(link, &question)?.into_iter().filter_map(setting));
        link.take();
    }
    let in_force_crc = storage::inspect(link)?.in_force_crc;
    if configuration_crc(&parts) == in_force_crc {
        return Ok(parts);
    }
    let commands: Vec<_> = std::iter::once(settings).chain(parts).collect();
    if configuration_crc(&commands) == in_force_crc {
        return Ok(commands);
    }
    Err(Failure::Refused(format!(
        "the received configuration is not the board's {in_force_crc:08x}: a part was lost in transit \
         or changed meanwhile. Close other programs that use the board, and try again"
    )))
}

/// Requests for all parts of a calibration, in the order of its CRC.
pub(crate) fn questions() -> Vec<GetCalibration> {
    let mut parts = Part::ALL.to_vec();
    parts.sort_by_key(|part| (*part == Part::CalibrationIdentity, part.number()));
    parts.into_iter().flat_map(questions_for).collect()
}

/// Requests for one part, for each channel if the part has channels.
fn questions_for(part: Part) -> Vec<GetCalibration> {
    let (sensors, channels) = match part {
        Part::Tank | Part::DeformationCurve | Part::Crosstalk => (SENSORS, CHANNELS),
        _ => (1, 1),
    };
    let sensors = 0..sensors;
    let places = sensors.flat_map(|sensor| (0..channels).map(move |channel| (sensor, channel)));
    let questions = places.map(|(sensor, channel)| GetCalibration {
        part,
        sensor,
        channel,
    });
    questions.collect()
}

/// Reads the records of a part in force; empty if the part is not set. The link also keeps these
/// records among its received frames.
///
/// # Errors
/// If the board is gone, refuses, or sends the part incompletely.
pub(crate) fn read_part(
    link: &mut Link,
    question: &GetCalibration,
) -> Result<Vec<Record>, Failure> {
    let before = link.received().len();
    let command = Command::GetCalibration(question.clone());
    match link.ask(&command)? {
        (_, Outcome::NotSet) => return Ok(Vec::new()),
        (_, Outcome::Accepted) => {}
        (_, other) => return Err(link.refusal(&command, other)),
    }
    let end = link.now() + PART;
    loop {
        let new = link.received().get(before..).into_iter().flatten();
        let new = new.map(|arrival| &arrival.frame.message);
        let of_part = new.filter(|record| record.kind() == question.part.number());
        let records: Vec<Record> = of_part.cloned().collect();
        if is_whole(&records) {
            return Ok(records);
        }
        if link.now() > end {
            return Err(Failure::Refused(format!(
                "the board did not send all of {}: records were lost in transit. `palpate doctor` \
                 checks the link",
                question.part
            )));
        }
        link.listen(POLL)?;
    }
}

/// Reads the tip of a board, with the springs that a modulus needs.
///
/// # Errors
/// As of [`read_part`].
pub(crate) fn declared_tip(link: &mut Link) -> Result<DeclaredTip, Failure> {
    let mut declared = DeclaredTip::default();
    for part in [Part::Tip, Part::Springs] {
        for question in questions_for(part) {
            let records = read_part(link, &question)?;
            records.iter().for_each(|record| declared.take(record));
        }
    }
    Ok(declared)
}

/// Whether all records of a part have arrived; a curve ends with its last knot.
fn is_whole(records: &[Record]) -> bool {
    let knots: usize = records
        .iter()
        .map(|record| match record {
            Record::DeformationCurve(chunk) => chunk.knots.len(),
            Record::StiffeningCurve(chunk) => chunk.knots.len(),
            Record::TouchArray(chunk) => chunk.numbers.len(),
            _ => 0,
        })
        .sum();
    match records.last() {
        Some(Record::DeformationCurve(chunk)) => knots == usize::from(chunk.total),
        Some(Record::StiffeningCurve(chunk)) => knots == usize::from(chunk.total),
        Some(Record::TouchArray(chunk)) => knots == usize::from(chunk.total),
        last => last.is_some(),
    }
}

/// Returns the command that sets a record's content; `None` for a record outside of the
/// configuration.
pub(crate) fn setting(record: Record) -> Option<Command> {
    Some(match record {
        Record::Settings(of) => Command::SetSettings(of),
        Record::Tank(of) => Command::SetTank(of),
        Record::DeformationCurve(of) => Command::SetDeformationCurve(of),
        Record::Crosstalk(of) => Command::SetCrosstalk(of),
        Record::Springs(of) => Command::SetSprings(of),
        Record::Stiffening(of) => Command::SetStiffening(of),
        Record::StiffeningCurve(of) => Command::SetStiffeningCurve(of),
        Record::Coil(of) => Command::SetCoil(of),
        Record::Attraction(of) => Command::SetAttraction(of),
        Record::TemperatureEffect(of) => Command::SetTemperatureEffect(of),
        Record::CurrentCorrection(of) => Command::SetCurrentCorrection(of),
        Record::TemperatureCoefficients(of) => Command::SetTemperatureCoefficients(of),
        Record::Tip(of) => Command::SetTip(of),
        Record::Contact(of) => Command::SetContact(of),
        Record::Creep(of) => Command::SetCreep(of),
        Record::TouchArray(of) => Command::SetTouchArray(of),
        Record::CalibrationIdentity(of) => Command::SetCalibrationIdentity(of),
        _ => return None,
    })
}

/// Order of a command in a configuration: kind, sensor, channel, first knot. `None` for a command
/// that sets no part.
pub(crate) fn place(command: &Command) -> Option<(u8, u8, u8, u8)> {
    let kind = command.kind();
    Some(match command {
        Command::SetTank(of) => (kind, of.sensor, of.channel, 0),
        Command::SetDeformationCurve(of) => (kind, of.sensor, of.channel, of.first),
        Command::SetCrosstalk(of) => (kind, of.sensor, of.channel, 0),
        Command::SetStiffeningCurve(of) => (kind, 0, 0, of.first),
        Command::SetTouchArray(of) => (kind, 0, 0, of.first),
        Command::SetSettings(_)
        | Command::SetSprings(_)
        | Command::SetStiffening(_)
        | Command::SetCoil(_)
        | Command::SetAttraction(_)
        | Command::SetTemperatureEffect(_)
        | Command::SetCurrentCorrection(_)
        | Command::SetTemperatureCoefficients(_)
        | Command::SetTip(_)
        | Command::SetContact(_)
        | Command::SetCreep(_) => (kind, 0, 0, 0),
        // Comes last, since the device compares the identity with all other parts.
        Command::SetCalibrationIdentity(_) => (u8::MAX, 0, 0, 0),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use palpate_wire::command::{DeformationCurve, DeformationKnot};

    use super::*;

    fn chunk(first: u8, knots: u8) -> Record {
        let knot = DeformationKnot {
            inductance_change: 0.0,
            deformation_m: 0.0,
        };
        Record::DeformationCurve(DeformationCurve {
            sensor: 0,
            channel: 0,
            total: 10,
            first,
            knots: (0..knots).map(|_| knot.clone()).collect(),
        })
    }

    #[test]
    fn a_curve_is_whole_with_all_its_knots() {
        assert!(!is_whole(&[]));
        assert!(!is_whole(&[chunk(0, 8)]));
        // The first of the curve's two chunks was lost.
        assert!(!is_whole(&[chunk(8, 2)]));
        assert!(is_whole(&[chunk(0, 8), chunk(8, 2)]));
    }

    #[test]
    fn every_command_that_sets_has_a_place_and_every_part_a_command() {
        let sets = |kind: &&palpate_wire::schema::Kind| kind.name.starts_with("set_");
        let kinds = Command::KINDS.iter().filter(sets).count();
        // Every command that sets something sets a part, except the one for the settings.
        assert_eq!(kinds, Part::ALL.len() + 1);
        let places = [chunk(0, 8), chunk(8, 2)].map(|record| place(&setting(record).unwrap()));
        assert!(places.is_sorted() && places[0] != places[1]);
        assert_eq!(place(&Command::Arm), None);
    }

    #[test]
    fn parts_are_asked_for_in_the_order_of_the_devices_crc() {
        let parts: Vec<Part> = questions().into_iter().map(|of| of.part).collect();
        let (identity, others) = parts.split_last().unwrap();
        assert_eq!(*identity, Part::CalibrationIdentity);
        let numbers: Vec<u8> = others.iter().map(|part| part.number()).collect();
        assert!(numbers.is_sorted() && !others.contains(identity));
    }

    #[test]
    fn parts_of_a_channel_are_asked_for_each_channel() {
        assert_eq!(questions_for(Part::Springs).len(), 1);
        let tanks = questions_for(Part::Tank);
        let places: Vec<_> = tanks.iter().map(|of| (of.sensor, of.channel)).collect();
        assert!(places.is_sorted() && places.len() == 8);
    }
}
