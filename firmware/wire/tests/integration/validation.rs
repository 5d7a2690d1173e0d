//! Commands beyond their limits are refused, with name and limit.

use crate::support::fixture::typical;
use crate::support::payloads::{encoded, fields, largest, list, payload_of};
use crate::support::{decode_one, frame_of, header, kind_of};
use palpate_wire::code::{FaultCode, Outcome};
use palpate_wire::command::{
    ClearFault, CurrentCorrection, DeformationCurve, Settings, StiffeningCurve,
};
use palpate_wire::record::{Acknowledgement, Sample};
use palpate_wire::schema::{Described, Field, Kind, Structure, Type};
use palpate_wire::{Command, Frame, Invalid, Message, Problem, Record};

/// Returns a field with its quantity in the middle of its range.
fn middling(field: &Field) -> Vec<u8> {
    let (low, high) = (field.range.low, field.range.high);
    let middle = match low.is_finite() {
        true => (low + high) / 2.0,
        false => 1.0,
    };
    match field.of {
        Type::Bool => encoded(&true),
        Type::Code(table) => vec![table.entries[0].number],
        Type::U8 => vec![middle as u8],
        Type::U16 | Type::U32 | Type::U64 => encoded(&(middle as u64)),
        Type::F32 => encoded(&middle),
        Type::F64 => encoded(&f64::from(middle)),
        Type::Optional(of) => [vec![1], middling(&Field { of: *of, ..*field })].concat(),
        Type::List { item, .. } => list(&[middling(&Field {
            of: *item,
            ..*field
        })]),
        Type::Text { .. } => list(&[]),
        Type::Structure(structure) => fields(structure, middling),
    }
}

/// A field of a command or of an item in its list, with the command's bytes around it.
struct Place {
    kind: &'static Kind,
    field: Field,
    number: usize,
    item: Option<u8>,
    before: Vec<u8>,
    after: Vec<u8>,
}

impl Place {
    /// Returns the command with a value in this place.
    fn with(&self, value: &[u8]) -> Command {
        decoded(self.kind, &[&self.before, value, &self.after].concat()).message
    }

    /// Checks that the command with a value in this place is refused for `problem` with this field.
    fn blames(&self, value: &[u8], problem: Problem) {
        let command = self.with(value);
        let name = self.field.name;
        let invalid = command.validate().expect_err(name);
        let named = invalid.named(command.payload()).field.expect("a field");
        assert_eq!(named.name, name);
        assert_eq!(named.range.unit, self.field.range.unit);
        assert_eq!(usize::from(invalid.field), self.number, "{name}");
        assert_eq!(invalid.item, self.item, "{name}");
        assert_eq!(invalid.problem, problem, "{name}");
    }

    /// Checks that no limit refuses a value in this place; a rule on several fields may.
    fn allows(&self, value: &[u8]) {
        if let Err(invalid) = self.with(value).validate() {
            assert!(
                matches!(
                    invalid.problem,
                    Problem::Inconsistent { .. } | Problem::NotIncreasing { .. }
                ),
                "{}: {invalid}",
                self.field.name
            );
        }
    }
}

fn decoded<M: Message>(kind: &Kind, payload: &[u8]) -> Frame<M> {
    decode_one(&frame_of(&header(1), kind.number, payload))
}

/// Returns every field of every command and, in place of a list, those of its third item.
fn places() -> Vec<Place> {
    let mut places = Vec::new();
    for kind in Command::KINDS {
        let Some(structure) = kind.payload else {
            continue;
        };
        for mut place in fields_of(kind, structure) {
            let Type::List { item, .. } = place.field.of else {
                places.push(place);
                continue;
            };
            let item = Field {
                of: *item,
                ..place.field
            };
            place
                .before
                .extend([vec![3], middling(&item).repeat(2)].concat());
            let inner = match item.of {
                Type::Structure(structure) => fields_of(kind, structure),
                _ => vec![Place {
                    kind,
                    field: item,
                    number: place.number,
                    item: None,
                    before: Vec::new(),
                    after: Vec::new(),
                }],
            };
            places.extend(inner.into_iter().map(|inner| Place {
                item: Some(2),
                before: [&place.before[..], &inner.before].concat(),
                after: [&inner.after[..], &place.after].concat(),
                ..inner
            }));
        }
    }
    places
}

fn fields_of(kind: &'static Kind, structure: &Structure) -> Vec<Place> {
    let place = |(number, field): (usize, &Field)| {
        let (before, after) = structure.fields.split_at(number);
        Place {
            kind,
            field: *field,
            number,
            item: None,
            before: before.iter().flat_map(middling).collect(),
            after: after[1..].iter().flat_map(middling).collect(),
        }
    };
    structure.fields.iter().enumerate().map(place).collect()
}

#[test]
fn infinities_and_nan_are_refused_in_every_field() {
    let mut checked = 0;
    for place in places() {
        let values: Vec<Vec<u8>> = match place.field.of {
            Type::F32 => [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY]
                .map(|value| encoded(&value))
                .into(),
            Type::F64 => [f64::NAN, f64::INFINITY, f64::NEG_INFINITY]
                .map(|value| encoded(&value))
                .into(),
            _ => continue,
        };
        checked += 1;
        for value in values {
            place.blames(&value, Problem::NotFinite);
        }
    }
    // Number of checked fields: 16 in the settings, 54 in the calibration, 3 of a directly driven
    // current, 1 of the LED.
    assert_eq!(checked, 74);
}

/// The limits themselves are allowed, the next number beyond them is not.
#[test]
fn limits_hold_to_the_last_digit() {
    let mut checked = 0;
    for place in places() {
        let (low, high) = (place.field.range.low, place.field.range.high);
        if !low.is_finite() {
            continue;
        }
        checked += 1;
        let refused = |value: f32| Problem::OutOfRange { value, low, high };
        match place.field.of {
            Type::F32 => {
                [low, high]
                    .iter()
                    .for_each(|value| place.allows(&encoded(value)));
                for value in [low.next_down(), high.next_up()] {
                    place.blames(&encoded(&value), refused(value));
                }
            }
            Type::F64 => {
                let (low, high) = (f64::from(low), f64::from(high));
                [low, high]
                    .iter()
                    .for_each(|value| place.allows(&encoded(value)));
                for value in [low.next_down(), high.next_up()] {
                    place.blames(&encoded(&value), refused(value as f32));
                }
            }
            Type::U8 | Type::U16 | Type::U32 => {
                let integer = |value: f32| match place.field.of {
                    Type::U8 => vec![value as u8],
                    _ => encoded(&(value as u32)),
                };
                [low, high]
                    .iter()
                    .for_each(|value| place.allows(&integer(*value)));
                place.blames(&integer(high + 1.0), refused(high + 1.0));
                if low > 0.0 {
                    place.blames(&integer(low - 1.0), refused(low - 1.0));
                }
            }
            ref of => panic!("{}: no check of {of:?} is written", place.field.name),
        }
    }
    // Number of checked fields: the 74 of the test above, and 18 integers.
    assert_eq!(checked, 92);
}

#[test]
fn unknown_numbers_are_refused() {
    let mut places = places();
    places.retain(|place| matches!(place.field.of, Type::Code(_)));
    for place in &places {
        place.blames(&[0xEE], Problem::UnknownCode { number: 0xEE });
    }
    assert_eq!(places.len(), 6);
}

fn invalid(change: impl FnOnce(&mut Settings)) -> Invalid {
    let mut settings: Settings = typical("settings");
    change(&mut settings);
    settings.validate().unwrap_err()
}

/// Returns the error as text.
fn named<T: Described>(invalid: Invalid) -> String {
    invalid.named(T::TYPE.structure()).to_string()
}

#[test]
fn settings_that_contradict_each_other_are_refused() {
    let blamed = invalid(|settings| settings.end_current_a = settings.peak_current_a);
    assert_eq!(blamed.field, 12);
    assert_eq!(
        named::<Settings>(blamed),
        "end_current_a: has to be below peak_current_a"
    );
    let blamed = invalid(|settings| settings.release_m = settings.least_press_m * 1.01);
    assert_eq!(
        named::<Settings>(blamed),
        "release_m: may not be above least_press_m"
    );
    let mut settings: Settings = typical("settings");
    settings.release_m = settings.least_press_m;
    assert_eq!(settings.validate(), Ok(()));
}

#[test]
fn channels_with_a_hole_between_them_are_refused_with_those_that_are_possible() {
    for channels in 1..=15 {
        let mut settings: Settings = typical("settings");
        settings.channels = channels;
        let is_possible = [1, 2, 4, 8, 3, 7, 15].contains(&channels);
        assert_eq!(
            settings.check_channels().is_ok(),
            is_possible,
            "{channels:#06b}"
        );
        assert_eq!(settings.validate(), Ok(()), "a stored one stays readable");
    }
    let mut settings: Settings = typical("settings");
    settings.channels = 0b0101;
    let blamed = settings.check_channels().unwrap_err();
    assert_eq!(blamed.field, 0);
    assert_eq!(
        named::<Settings>(blamed),
        "channels: has to be one channel (1, 2, 4 or 8), or channel 0 and those that follow it \
         (3, 7 or 15)"
    );
}

#[test]
fn chunks_that_are_no_part_of_a_curve_are_refused() {
    let blamed = |change: fn(&mut DeformationCurve)| {
        let mut curve = typical("deformation_curve");
        change(&mut curve);
        curve.validate().map_err(named::<DeformationCurve>)
    };
    let error = |text: &str| Err(text.to_owned());
    assert_eq!(blamed(|_| {}), Ok(()));
    assert_eq!(
        blamed(|curve| curve.knots.clear()),
        error("knots: a chunk has at least one knot")
    );
    let beyond = error("first: the knots go beyond total");
    assert_eq!(blamed(|curve| curve.first = 1), beyond);
    assert_eq!(blamed(|curve| curve.total = 2), beyond);
    assert_eq!(blamed(|curve| (curve.total, curve.first) = (4, 1)), Ok(()));
    assert_eq!(
        blamed(|curve| curve.knots[2].inductance_change = 0.125),
        error("inductance_change of item 2 is 0.125, not above the 0.125 before it")
    );
}

#[test]
fn a_stiffening_curve_begins_at_its_origin_and_rises() {
    let blamed = |change: fn(&mut StiffeningCurve)| {
        let mut curve = typical("stiffening_curve");
        change(&mut curve);
        curve.validate().map_err(named::<StiffeningCurve>)
    };
    let error = |text: &str| Err(text.to_owned());
    assert_eq!(blamed(|_| {}), Ok(()));
    assert_eq!(
        blamed(|curve| curve.knots.clear()),
        error("knots: a chunk has at least one knot")
    );
    assert_eq!(
        blamed(|curve| curve.first = 9),
        error("first: the knots go beyond total")
    );
    assert_eq!(
        blamed(|curve| curve.knots[1].current_a = 8.5),
        error("current_a of item 1 is 8.5 A, not above the 9 A before it")
    );
    let begun = |current_a, rise| {
        let mut curve: StiffeningCurve = typical("stiffening_curve");
        (curve.first, curve.knots[0].current_a, curve.knots[0].rise) = (0, current_a, rise);
        curve.validate().map_err(named::<StiffeningCurve>)
    };
    assert_eq!(begun(0.0, 0.0), Ok(()));
    let origin = error("knots: the curve has to begin at 0, 0");
    assert_eq!(begun(0.1, 0.0), origin);
    assert_eq!(begun(0.0, 0.1), origin);
}

#[test]
fn a_correction_of_the_current_has_two_points_and_stays_small() {
    let blamed = |changes_a: &[f32]| {
        let correction = CurrentCorrection {
            greatest_a: 10.0,
            changes_a: changes_a.iter().copied().collect(),
        };
        correction.validate().map_err(named::<CurrentCorrection>)
    };
    let error = |text: &str| Err(format!("changes_a: {text}"));
    assert_eq!(blamed(&[0.1]), error("there are two points at least"));
    assert_eq!(blamed(&[1.39, 0.39, -1.39]), Ok(()));
    let too_much = error("a change is above 0.4 A and a tenth of its current");
    for changes_a in [[1.41, 0.0, 0.0], [0.0, -0.41, 0.0], [0.0, 0.0, 1.41]] {
        assert_eq!(blamed(&changes_a), too_much);
    }
}

#[test]
fn a_refusal_names_field_value_and_limits() {
    let refused = invalid(|settings| settings.peak_current_a = 25.0);
    assert_eq!(
        named::<Settings>(refused),
        "peak_current_a is 25 A; allowed are 0.05 to 20 A"
    );
    let answer = Acknowledgement::invalid(&header(12), 0x90, &refused);
    assert_eq!(answer, typical("acknowledgement"));
    let name = kind_of(&Command::SetSettings(typical::<Settings>("settings")))
        .payload
        .and_then(|settings| settings.fields.get(usize::from(answer.field?)))
        .map(|field| field.name);
    assert_eq!(name, Some("peak_current_a"));

    let refused = invalid(|settings| settings.ramps = 0);
    assert_eq!(
        named::<Settings>(refused),
        "ramps is 0; allowed are 1 to 64"
    );
    let refused = invalid(|settings| settings.rise_s = f32::NAN);
    assert_eq!(
        named::<Settings>(refused),
        "rise_s is infinite or not a number"
    );
    let code = FaultCode::Unknown(99);
    let refused = ClearFault { code }.validate().unwrap_err();
    assert_eq!(
        named::<ClearFault>(refused),
        "code has the unknown number 99"
    );
}

#[test]
fn every_problem_has_an_outcome() {
    let answer = |invalid: Invalid| {
        let answer = Acknowledgement::invalid(&header(1), 0x90, &invalid);
        let place = (answer.field, answer.item);
        assert_eq!(place, (Some(invalid.field), invalid.item));
        (answer.outcome, answer.value, answer.low, answer.high)
    };
    let refused = invalid(|settings| settings.rise_s = f32::INFINITY);
    assert_eq!(answer(refused), (Outcome::NotFinite, None, None, None));
    let refused = invalid(|settings| settings.end_current_a = 11.0);
    assert_eq!(answer(refused), (Outcome::Inconsistent, None, None, None));
    let code = FaultCode::Unknown(99);
    let refused = ClearFault { code }.validate().unwrap_err();
    let unknown = (Outcome::UnknownCode, Some(99.0), None, None);
    assert_eq!(answer(refused), unknown);
    let mut curve: DeformationCurve = typical("deformation_curve");
    curve.knots[1].inductance_change = -0.5;
    let refused = curve.validate().unwrap_err();
    let falling = (Outcome::NotIncreasing, Some(-0.5), Some(0.0), None);
    assert_eq!(answer(refused), falling);
    let answer = Acknowledgement::accepted(&header(3), &Command::Arm);
    assert_eq!(
        (answer.command, answer.kind, answer.outcome),
        (3, 0x82, Outcome::Accepted)
    );
}

/// The check also finds records that a defect of the device produces.
#[test]
fn records_can_be_checked_too() {
    // Kinds that the test cannot use: their largest value, with 1.1 in each float, is within all limits,
    // which are those of a temperature and of standard errors.
    const WITHIN: [&str; 3] = ["calibration_identity", "uncertainty_budget", "relaxation"];
    let limited = |kind: &&Kind| !WITHIN.contains(&kind.name);
    for kind in Record::KINDS.iter().filter(limited) {
        let frame: Frame<Record> = decoded(kind, &payload_of(kind, largest));
        assert!(frame.message.validate().is_err(), "{}", kind.name);
    }
}

/// Only a field of an item has the item's index; a field after the list has none.
#[test]
fn a_field_after_a_list_lies_in_no_item() {
    let invalid = |change: fn(&mut Sample)| {
        let mut sample: Sample = typical("sample");
        sample.channels = [0, 1].iter().map(|_| sample.channels[0].clone()).collect();
        change(&mut sample);
        let invalid = sample.validate().unwrap_err();
        (invalid.field, invalid.item)
    };
    assert_eq!(
        invalid(|sample| sample.channels[1].channel = 9),
        (0, Some(1))
    );
    assert_eq!(invalid(|sample| sample.force_n = Some(1e6)), (5, None));
}
