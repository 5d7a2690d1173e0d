//! Settings and calibration: applied whole or not at all, active at once, read back as they were set,
//! and lost after a restart.

use crate::support::Rig;
use crate::support::calibration::{
    array, array_numbers, calibration, contact, settings, temperature_coefficients,
    temperature_effect, tip,
};
use crate::support::sensor::Sensor;
use palpate_procedure::Action;
use palpate_wire::code::{Outcome, Part, State};
use palpate_wire::command::{
    Creep, CurrentCorrection, GetCalibration, Settings, StiffeningCurve, StiffeningKnot, TouchArray,
};
use palpate_wire::record::Status;
use palpate_wire::{Command, Message, Record};

#[test]
fn a_slower_converter_may_be_set_faster() {
    let mut rig = Rig::calibrated(Sensor::default(), settings(|of| of.rate_hz = 5.0));
    rig.until(State::Watching, 30_000);
    rig.wait(150_000);
    rig.accepted(Command::SetSettings(settings(|_| {})));
    rig.until(State::Watching, 3_000);
    assert!(rig.faults().is_empty(), "{:?}", rig.faults());
}

#[test]
fn a_shorter_status_period_counts_at_once() {
    let mut rig = Rig::calibrated(Sensor::default(), settings(|of| of.status_period_s = 60.0));
    // The first status is sent; the next one is due after the previous, longer period.
    rig.run(1_500);
    rig.records.clear();
    rig.accepted(Command::SetSettings(settings(|of| {
        of.status_period_s = 0.1
    })));
    rig.run(1_000);
    let reports = rig.all::<Status>();
    assert!((9..=10).contains(&reports.len()), "{}", reports.len());
}

#[test]
fn a_wrong_field_is_named_and_nothing_of_the_command_taken() {
    let mut rig = Rig::started();
    let before = rig.settings().clone();
    let out_of_range = |value| (Outcome::OutOfRange, Some(value));
    let cases: [(fn(&mut Settings), _); 6] = [
        (|of| of.ramp_s = f32::NAN, (Outcome::NotFinite, None)),
        (|of| of.ramps = 65, out_of_range(65.0)),
        (|of| of.end_current_a = 10.0, (Outcome::Inconsistent, None)),
        // These values are within the protocol's limits but beyond the board's.
        (|of| of.peak_current_a = 12.1, out_of_range(12.1)),
        (|of| of.greatest_energy_j = 61.0, out_of_range(61.0)),
        (|of| of.greatest_temperature_c = 101.0, out_of_range(101.0)),
    ];
    for (change, (outcome, value)) in cases {
        let wrong = settings(change);
        let answer = rig.send(Command::SetSettings(wrong));
        assert_eq!((answer.outcome, answer.value), (outcome, value));
        if outcome == Outcome::OutOfRange {
            assert!(answer.field.is_some() && answer.low.is_some(), "{answer:?}");
            assert!(answer.high < answer.value, "{answer:?}");
        }
        assert_eq!(*rig.settings(), before);
    }
    let mut two = board_of_two_channels();
    for channels in [0b0100, 0b1000] {
        let other = settings(|of| of.channels = channels);
        assert_eq!(
            two.outcome(Command::SetSettings(other)),
            Outcome::NoSuchChannel
        );
    }
}

/// A scan of the converter covers channel 0 up to the highest: with a gap it would send a channel that
/// was not requested, and an unconnected coil would be a fault.
#[test]
fn channels_with_a_hole_are_refused_by_their_field() {
    let mut rig = Rig::started();
    for channels in [5, 6, 9, 10, 11, 12, 13, 14] {
        let holes = settings(|of| of.channels = channels);
        let answer = rig.send(Command::SetSettings(holes));
        assert_eq!(
            (answer.outcome, answer.field),
            (Outcome::Inconsistent, Some(0)),
            "{channels}"
        );
    }
    for channels in [1, 2, 4, 8, 3, 7, 15] {
        rig.accepted(Command::SetSettings(settings(|of| of.channels = channels)));
    }
}

fn board_of_two_channels() -> Rig {
    let mut board = crate::support::board();
    board.channels = [0b0011, 0];
    Rig::started_as(board)
}

#[test]
fn what_was_set_is_read_back_and_numbered() {
    let mut rig = Rig::started();
    let mut sent = calibration(&Sensor::default()).to_vec();
    sent.insert(0, Command::SetSettings(settings(|of| of.ramps = 5)));
    sent.push(temperature_effect(25.0, 0.001, 0.002));
    sent.push(Command::SetCurrentCorrection(correction([0.1, 0.0, -0.1])));
    sent.push(temperature_coefficients(-0.001, 0.002));
    sent.push(tip());
    sent.push(contact(0.004, 2e-6));
    sent.extend(array(&array_numbers()));
    sent.push(Command::SetCreep(Creep::TYPICAL));
    for part in Part::ALL {
        let get = get(*part);
        assert_eq!(rig.outcome(get), Outcome::NotSet, "{part}");
    }
    for command in &sent {
        rig.accepted(command.clone());
    }
    // Settings and calibration are volatile: a restarted device has neither.
    let crc = rig.procedure.configuration().crc();
    sent.sort_by_key(Message::kind);
    assert_eq!(crc, palpate_wire::configuration_crc(&sent));
    assert_ne!(crc, Rig::started().procedure.configuration().crc());

    rig.records.clear();
    rig.accepted(Command::GetSettings);
    for part in Part::ALL {
        let set = sent.iter().any(|of| of.kind() & 0x7F == part.number());
        let expected = if set {
            Outcome::Accepted
        } else {
            Outcome::NotSet
        };
        assert_eq!(rig.outcome(get(*part)), expected, "{part}");
        // The further chunks of a part come one per step.
        rig.run(5);
    }
    let as_command = |(_, record): &(_, Record)| match record.clone() {
        Record::Settings(of) => Some(Command::SetSettings(of)),
        Record::DeformationCurve(of) => Some(Command::SetDeformationCurve(of)),
        Record::Crosstalk(of) => Some(Command::SetCrosstalk(of)),
        Record::Springs(of) => Some(Command::SetSprings(of)),
        Record::Stiffening(of) => Some(Command::SetStiffening(of)),
        Record::Coil(of) => Some(Command::SetCoil(of)),
        Record::Attraction(of) => Some(Command::SetAttraction(of)),
        Record::TemperatureEffect(of) => Some(Command::SetTemperatureEffect(of)),
        Record::CurrentCorrection(of) => Some(Command::SetCurrentCorrection(of)),
        Record::TemperatureCoefficients(of) => Some(Command::SetTemperatureCoefficients(of)),
        Record::Tip(of) => Some(Command::SetTip(of)),
        Record::Contact(of) => Some(Command::SetContact(of)),
        Record::Creep(of) => Some(Command::SetCreep(of)),
        Record::TouchArray(of) => Some(Command::SetTouchArray(of)),
        _ => None,
    };
    let read: Vec<_> = rig.records.iter().filter_map(as_command).collect();
    assert_eq!(read, sent);
}

fn correction<const N: usize>(changes_a: [f32; N]) -> CurrentCorrection {
    CurrentCorrection {
        greatest_a: 10.0,
        changes_a: changes_a.into_iter().collect(),
    }
}

#[test]
fn a_correction_of_the_current_is_handed_on_when_it_is_sound() {
    let mut rig = Rig::started();
    let sound = correction([1.3, 0.2, 0.0, -0.2, -1.3]);
    let mut set = |of: &CurrentCorrection| {
        let command = Command::SetCurrentCorrection(of.clone());
        rig.command(command, crate::support::BOOT)
    };
    let actions = set(&sound);
    assert!(actions.contains(&Action::CorrectCurrent(sound.clone())));
    let correcting = |action: &Action| matches!(action, Action::CorrectCurrent(_));
    for bad in [correction([1.5, 0.0, 0.0]), correction([0.0, f32::NAN])] {
        assert!(!set(&bad).iter().any(correcting), "{bad:?}");
    }
    let mut armed = Rig::standing_in(State::Contact, |_| {});
    assert_eq!(
        armed.outcome(Command::SetCurrentCorrection(sound)),
        Outcome::Armed
    );
}

fn get(part: Part) -> Command {
    Command::GetCalibration(GetCalibration {
        part,
        sensor: 0,
        channel: 0,
    })
}

#[test]
fn a_curve_comes_in_order_and_counts_with_its_last_knot() {
    let knot = |of: u8| StiffeningKnot {
        current_a: f32::from(of),
        rise: 0.001 * f32::from(of).powi(2),
    };
    let chunk = |first: u8, last: u8| {
        Command::SetStiffeningCurve(StiffeningCurve {
            total: 20,
            first,
            rise_uncertainty: 0.01,
            knots: (first..=last).map(knot).collect(),
        })
    };
    let mut rig = Rig::started();
    let crc = rig.procedure.configuration().crc();
    assert_eq!(rig.outcome(chunk(8, 15)), Outcome::OutOfSequence);
    rig.accepted(chunk(0, 7));
    assert_eq!(rig.outcome(chunk(16, 19)), Outcome::OutOfSequence);
    // A chunk out of sequence abandons the curve that was being received.
    assert_eq!(rig.outcome(chunk(8, 15)), Outcome::OutOfSequence);
    rig.accepted(chunk(0, 7));
    rig.accepted(chunk(8, 15));
    assert_eq!(rig.procedure.configuration().crc(), crc);
    rig.accepted(chunk(16, 19));
    assert_ne!(rig.procedure.configuration().crc(), crc);

    // The curve is read back in the same chunks, one per step.
    rig.accepted(get(Part::StiffeningCurve));
    rig.run(5);
    let chunks = rig.all().into_iter().map(Command::SetStiffeningCurve);
    assert_eq!(
        chunks.collect::<Vec<_>>(),
        [chunk(0, 7), chunk(8, 15), chunk(16, 19)]
    );
}

/// Each case: a wrong number by its index and value, the outcome of the last chunk, and the answer's item.
#[test]
fn an_array_that_cannot_work_is_refused_and_the_one_before_stays() {
    let mut rig = Rig::started();
    let sound = array_numbers();
    array(&sound).into_iter().for_each(|of| rig.accepted(of));
    let crc = rig.procedure.configuration().crc();
    for (index, value, outcome, item) in [
        (0, 31.0, Outcome::NoSuchChannel, None),
        (0, 14.5, Outcome::NoSuchChannel, None),
        (0, 7.0, Outcome::Inconsistent, None),
        (1, 0.5, Outcome::OutOfRange, None),
        (4, 0.0, Outcome::OutOfRange, None),
        (7, 0.015, Outcome::OutOfRange, Some(7)),
        (8, -1e-3, Outcome::OutOfRange, None),
        (13, 0.0, Outcome::OutOfRange, None),
        (15, 1e-3, Outcome::OutOfRange, None),
        (16, 0.0, Outcome::OutOfRange, None),
        (50, 0.0, Outcome::OutOfRange, None),
        (51, -1e-5, Outcome::OutOfRange, None),
    ] {
        let mut numbers = sound.clone();
        numbers[index] = value;
        let mut commands = array(&numbers);
        let last = commands.pop().unwrap();
        commands.into_iter().for_each(|of| rig.accepted(of));
        let answer = rig.send(last);
        assert_eq!((answer.outcome, answer.item), (outcome, item), "{index}");
        assert_eq!(rig.procedure.configuration().crc(), crc, "{index}");
    }
    // The chunk with the number is refused where the number is infinite or the list is odd.
    for (numbers, outcome) in [
        (vec![f32::NAN, 1.0], Outcome::NotFinite),
        (vec![1.0; 3], Outcome::Inconsistent),
        (vec![], Outcome::Inconsistent),
    ] {
        let chunk = TouchArray {
            total: 64,
            first: 0,
            numbers: numbers.into_iter().collect(),
        };
        assert_eq!(rig.outcome(Command::SetTouchArray(chunk)), outcome);
    }
}

#[test]
fn a_device_starts_within_its_boards_limits() {
    let mut board = crate::support::board();
    board.channels = [0b0110, 0];
    board.limits.current.0 = 5.0;
    board.limits.rate.0 = 500.0;
    board.limits.energy_j = 10.0;
    board.limits.temperature.0 = 50.0;
    let mut rig = Rig::started_as(board);
    let started = rig.settings().clone();
    assert_eq!(started.channels, 0b0010, "the first that it has");
    assert_eq!((started.peak_current_a, started.rate_hz), (5.0, 500.0));
    assert_eq!(
        (started.greatest_energy_j, started.greatest_temperature_c),
        (10.0, 50.0)
    );
    // The reported settings can be set as they are.
    rig.accepted(Command::SetSettings(started));
}
