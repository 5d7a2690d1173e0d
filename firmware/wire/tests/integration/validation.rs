//! Commands beyond their limits are refused, with name and limit.

use crate::support::fixture::decode_one;
use crate::support::reference::{self, Value, content_bytes, framed, payload_bytes};
use crate::support::{header, kind_of, specimens};
use palpate_wire::code::{FaultCode, Outcome};
use palpate_wire::command::{ClearFault, DeformationCurve, Settings, StiffeningCurve};
use palpate_wire::record::{Acknowledgement, Sample};
use palpate_wire::schema::{Described, Kind, Type};
use palpate_wire::{Command, Frame, Invalid, Message, Problem};

/// Returns a payload with every quantity in the middle of its range.
fn middling(of: &Type, range: (f32, f32)) -> Value {
    let middle = if range.0.is_finite() {
        (range.0 + range.1) / 2.0
    } else {
        1.0
    };
    match of {
        Type::Bool => Value::Bool(true),
        Type::Code(table) => Value::Unsigned(table.entries[0].number.into()),
        Type::U8 | Type::U16 | Type::U32 | Type::U64 => Value::Unsigned(middle as u64),
        Type::F32 => Value::F32(middle.to_bits()),
        Type::F64 => Value::F64(f64::from(middle).to_bits()),
        Type::Optional(of) => Value::Optional(Some(Box::new(middling(of, range)))),
        Type::List { item, .. } => Value::List(vec![middling(item, range)]),
        Type::Text { .. } => Value::Text(String::new()),
        Type::Structure(structure) => Value::Fields(
            structure
                .fields
                .iter()
                .map(|field| middling(&field.of, (field.range.low, field.range.high)))
                .collect(),
        ),
    }
}

fn decoded(kind: &Kind, payload: &Value) -> Command {
    let payload = payload_bytes(Some(payload), kind);
    let frame: Frame<Command> =
        decode_one(&framed(&content_bytes(&header(1), kind.number, &payload)));
    frame.message
}

/// Calls `check` for every field of every command, and of its list items: with the kind, the field's
/// location and a function that creates the command with a value there.
fn for_every_field(mut check: impl FnMut(FieldLocation<'_>, &dyn Fn(Value) -> Command)) {
    for kind in Command::KINDS {
        let Some(structure) = kind.payload else {
            continue;
        };
        let Value::Fields(whole) = middling(&Type::Structure(structure), (0.0, 0.0)) else {
            unreachable!();
        };
        for (number, field) in structure.fields.iter().enumerate() {
            let set = |value| {
                let mut whole = whole.clone();
                whole[number] = value;
                decoded(kind, &Value::Fields(whole))
            };
            if let Type::List {
                item: item @ Type::F32,
                ..
            } = field.of
            {
                let of_item = palpate_wire::schema::Field {
                    of: *item,
                    ..*field
                };
                let others = f32_value(0.5 * (field.range.low + field.range.high));
                let set_item =
                    |value| set(Value::List(vec![others.clone(), others.clone(), value]));
                check(
                    FieldLocation {
                        field: &of_item,
                        number,
                        item: Some(2),
                    },
                    &set_item,
                );
                continue;
            }
            check(
                FieldLocation {
                    field,
                    number,
                    item: None,
                },
                &set,
            );
            let Type::List {
                item: Type::Structure(item),
                ..
            } = field.of
            else {
                continue;
            };
            for (inner, field) in item.fields.iter().enumerate() {
                let set_inner = |value| {
                    let item = middling(&Type::Structure(item), (0.0, 0.0));
                    let Value::Fields(mut changed) = item.clone() else {
                        unreachable!();
                    };
                    changed[inner] = value;
                    set(Value::List(vec![
                        item.clone(),
                        item,
                        Value::Fields(changed),
                    ]))
                };
                check(
                    FieldLocation {
                        field,
                        number: inner,
                        item: Some(2),
                    },
                    &set_inner,
                );
            }
        }
    }
}

struct FieldLocation<'a> {
    field: &'a palpate_wire::schema::Field,
    number: usize,
    item: Option<u8>,
}

impl FieldLocation<'_> {
    /// Checks that the command is refused for `problem` with this field.
    fn assert_blamed(&self, command: &Command, problem: Problem) {
        let invalid = command.validate().expect_err(self.field.name);
        let named = invalid.named(command.payload()).field.expect("a field");
        assert_eq!(named.name, self.field.name);
        assert_eq!(named.range.unit, self.field.range.unit);
        assert_eq!(
            usize::from(invalid.field),
            self.number,
            "{}",
            self.field.name
        );
        assert_eq!(invalid.item, self.item, "{}", self.field.name);
        assert_eq!(invalid.problem, problem, "{}", self.field.name);
    }
}

fn f32_value(value: f32) -> Value {
    Value::F32(value.to_bits())
}

#[test]
fn infinities_and_nan_are_refused_in_every_field() {
    let mut fields = 0;
    for_every_field(|location, set| match location.field.of {
        Type::F32 => {
            fields += 1;
            for value in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                location.assert_blamed(&set(f32_value(value)), Problem::NotFinite);
            }
        }
        Type::F64 => {
            fields += 1;
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let value = Value::F64(value.to_bits());
                location.assert_blamed(&set(value), Problem::NotFinite);
            }
        }
        _ => {}
    });
    // Number of checked fields: 16 in the settings, 38 in the calibration, 3 of a directly driven
    // current, 1 of the LED.
    assert_eq!(fields, 58);
}

/// The limits themselves are allowed, the next number beyond them is not.
#[test]
fn limits_hold_to_the_last_digit() {
    let allowed = |location: &FieldLocation<'_>, command: Command| match command.validate() {
        Ok(()) => {}
        Err(invalid) => assert!(
            matches!(
                invalid.problem,
                Problem::Inconsistent { .. } | Problem::NotIncreasing { .. }
            ),
            "{}: {invalid}",
            location.field.name
        ),
    };
    let mut fields = 0;
    for_every_field(|location, set| {
        let range = location.field.range;
        if !range.low.is_finite() {
            return;
        }
        fields += 1;
        let (low, high) = (range.low, range.high);
        let refused = |value: f32| Problem::OutOfRange { value, low, high };
        match location.field.of {
            Type::F32 => {
                allowed(&location, set(f32_value(low)));
                allowed(&location, set(f32_value(high)));
                for value in [low.next_down(), high.next_up()] {
                    location.assert_blamed(&set(f32_value(value)), refused(value));
                }
            }
            Type::F64 => {
                let (low, high) = (f64::from(low), f64::from(high));
                allowed(&location, set(Value::F64(low.to_bits())));
                allowed(&location, set(Value::F64(high.to_bits())));
                for value in [low.next_down(), high.next_up()] {
                    let command = set(Value::F64(value.to_bits()));
                    location.assert_blamed(&command, refused(value as f32));
                }
            }
            Type::U8 | Type::U16 | Type::U32 => {
                allowed(&location, set(Value::Unsigned(low as u64)));
                allowed(&location, set(Value::Unsigned(high as u64)));
                let above = high as u64 + 1;
                location.assert_blamed(&set(Value::Unsigned(above)), refused(above as f32));
                if low > 0.0 {
                    let below = low as u64 - 1;
                    let command = set(Value::Unsigned(below));
                    location.assert_blamed(&command, refused(below as f32));
                }
            }
            ref of => panic!("{}: no check of {of:?} is written", location.field.name),
        }
    });
    // Number of checked fields: the 58 of the test above, and 16 integers.
    assert_eq!(fields, 74);
}

#[test]
fn unknown_numbers_are_refused() {
    let mut fields = 0;
    for_every_field(|location, set| {
        if let Type::Code(_) = location.field.of {
            fields += 1;
            let number = 0xEE;
            let command = set(Value::Unsigned(number.into()));
            location.assert_blamed(&command, Problem::UnknownCode { number });
        }
    });
    assert_eq!(fields, 5);
}

fn invalid(change: impl FnOnce(&mut Settings)) -> Invalid {
    let mut settings = specimens::settings();
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
    let mut settings = specimens::settings();
    settings.release_m = settings.least_press_m;
    assert_eq!(settings.validate(), Ok(()));
}

#[test]
fn channels_with_a_hole_between_them_are_refused_with_those_that_are_possible() {
    for channels in 1..=15 {
        let mut settings = specimens::settings();
        settings.channels = channels;
        let is_possible = [1, 2, 4, 8, 3, 7, 15].contains(&channels);
        assert_eq!(
            settings.check_channels().is_ok(),
            is_possible,
            "{channels:#06b}"
        );
        assert_eq!(settings.validate(), Ok(()), "a stored one stays readable");
    }
    let mut settings = specimens::settings();
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
    let curve = specimens::deformation_curve;
    let blamed = |change: fn(&mut DeformationCurve)| {
        let mut curve = curve();
        change(&mut curve);
        curve.validate().map_err(named::<DeformationCurve>)
    };
    let error = |text: &str| Err(text.to_owned());
    assert_eq!(blamed(|_| {}), Ok(()));
    assert_eq!(
        blamed(|curve| curve.knots.clear()),
        error("knots: a chunk has at least one knot")
    );
    assert_eq!(
        blamed(|curve| curve.first = 1),
        error("first: the knots go beyond total")
    );
    assert_eq!(
        blamed(|curve| curve.total = 2),
        error("first: the knots go beyond total")
    );
    assert_eq!(blamed(|curve| (curve.total, curve.first) = (4, 1)), Ok(()));
    assert_eq!(
        blamed(|curve| curve.knots[2].inductance_change = 0.125),
        error("inductance_change of item 2 is 0.125, not above the 0.125 before it")
    );
    let mut curve = specimens::stiffening_curve();
    assert_eq!(curve.validate(), Ok(()));
    curve.knots[1].current_a = 8.5;
    let invalid = curve.validate().unwrap_err();
    assert_eq!((invalid.field, invalid.item), (0, Some(1)));
    assert_eq!(
        named::<StiffeningCurve>(invalid),
        "current_a of item 1 is 8.5 A, not above the 9 A before it"
    );
}

#[test]
fn a_stiffening_curve_begins_at_its_origin() {
    let curve = |current_a, rise| {
        let mut curve: StiffeningCurve = specimens::stiffening_curve();
        (curve.first, curve.knots[0].current_a, curve.knots[0].rise) = (0, current_a, rise);
        curve.validate().map_err(named::<StiffeningCurve>)
    };
    assert_eq!(curve(0.0, 0.0), Ok(()));
    let error = Err("knots: the curve has to begin at 0, 0".to_owned());
    assert_eq!(curve(0.1, 0.0), error);
    assert_eq!(curve(0.0, 0.1), error);
    let mut empty = specimens::stiffening_curve();
    empty.knots.clear();
    let refused = empty.validate().map_err(named::<StiffeningCurve>);
    assert_eq!(refused, Err("knots: a chunk has at least one knot".into()));
    let mut far = specimens::stiffening_curve();
    far.first = 9;
    let refused = far.validate().map_err(named::<StiffeningCurve>);
    assert_eq!(refused, Err("first: the knots go beyond total".into()));
}

#[test]
fn a_refusal_names_field_value_and_limits() {
    let refused = invalid(|settings| settings.peak_current_a = 25.0);
    assert_eq!(
        named::<Settings>(refused),
        "peak_current_a is 25 A; allowed are 0.05 to 20 A"
    );
    let answer = Acknowledgement::invalid(&header(12), 0x90, &refused);
    assert_eq!(
        Some(palpate_wire::Record::Acknowledgement(answer.clone())),
        specimens::records()
            .into_iter()
            .find(|record| record.kind() == 0x0B)
    );
    let name = kind_of(&Command::SetSettings(specimens::settings()))
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
    let outcome = |invalid: &Invalid| Acknowledgement::invalid(&header(1), 0x90, invalid).outcome;
    let numbers = |invalid: &Invalid| {
        let answer = Acknowledgement::invalid(&header(1), 0x90, invalid);
        (answer.value, answer.low, answer.high)
    };
    let refused = invalid(|settings| settings.rise_s = f32::INFINITY);
    assert_eq!(
        (outcome(&refused), numbers(&refused)),
        (Outcome::NotFinite, (None, None, None))
    );
    let refused = invalid(|settings| settings.end_current_a = 11.0);
    assert_eq!(
        (outcome(&refused), numbers(&refused)),
        (Outcome::Inconsistent, (None, None, None))
    );
    let code = FaultCode::Unknown(99);
    let refused = ClearFault { code }.validate().unwrap_err();
    assert_eq!(
        (outcome(&refused), numbers(&refused)),
        (Outcome::UnknownCode, (Some(99.0), None, None))
    );
    let mut curve = specimens::deformation_curve();
    curve.knots[1].inductance_change = -0.5;
    let refused = curve.validate().unwrap_err();
    assert_eq!(
        (outcome(&refused), numbers(&refused)),
        (Outcome::NotIncreasing, (Some(-0.5), Some(0.0), None))
    );
    let answer = Acknowledgement::accepted(&header(3), &Command::Arm);
    assert_eq!(
        (answer.command, answer.kind, answer.outcome),
        (3, 0x82, Outcome::Accepted)
    );
}

/// The check also finds records that a defect of the device produces.
#[test]
fn records_can_be_checked_too() {
    // Kinds with which the test cannot work: their largest value, with 1.1 in each float, is within all
    // limits, those of a temperature and of standard errors.
    const WITHIN: [&str; 2] = ["calibration_identity", "uncertainty_budget"];
    let limited = |kind: &&Kind| !WITHIN.contains(&kind.name);
    for kind in palpate_wire::Record::KINDS.iter().filter(limited) {
        let value = kind
            .payload
            .map(|of| reference::largest(&Type::Structure(of)));
        let payload = payload_bytes(value.as_ref(), kind);
        let frame: Frame<palpate_wire::Record> =
            decode_one(&framed(&content_bytes(&header(1), kind.number, &payload)));
        assert!(frame.message.validate().is_err(), "{}", kind.name);
    }
}

/// Only a field of an item has the item's index; a field after the list has none.
#[test]
fn a_field_after_a_list_lies_in_no_item() {
    let invalid = |change: fn(&mut Sample)| {
        let mut sample = specimens::sample(2);
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
