//! Description of the format, its sizes and its version.

use std::collections::HashSet;

use crate::support::fixture::{GREATEST, records};
use crate::support::payloads::{largest, payload_of};
use crate::support::{bytes_of, content, decode_one, framed};
use palpate_wire::code::Part;
use palpate_wire::schema::{Field, Kind, Structure, Type};
use palpate_wire::{
    Command, Frame, MAX_HEADER, MINOR_VERSION, Message, Record, SCHEMA_HASH, VERSION, frame_size,
};

/// Any change of the layout changes the hash. When this test fails, raise the version as the documentation
/// of `VERSION` and `MINOR_VERSION` says, enter the new hash here, and regenerate the fixture. If the major
/// version is new, first rename the fixture's files, and adapt the typical messages in its `.jsonl` files.
#[test]
fn the_layout_belongs_to_its_version() {
    let known = [
        (1, 0, 0xFBB1_7F98),
        (1, 1, 0xD3E8_584A),
        (2, 0, 0x3F54_E71D),
        (2, 1, 0xFC5F_F64A),
        (2, 2, 0x740E_6F99),
        (2, 3, 0x1CD7_EF6B),
        (2, 4, 0xE6F0_7A5F),
        (2, 5, 0x5E80_9B5C),
        (2, 6, 0x6539_D917),
        (2, 7, 0xD4BE_96D1),
        (2, 8, 0xC507_E8F5),
    ];
    assert!(
        known.contains(&(VERSION, MINOR_VERSION, SCHEMA_HASH)),
        "version {VERSION}.{MINOR_VERSION} has the layout 0x{SCHEMA_HASH:08x}"
    );
}

fn all_kinds() -> impl Iterator<Item = &'static Kind> {
    Record::KINDS.iter().chain(Command::KINDS)
}

fn structures(of: &'static Structure, found: &mut Vec<&'static Structure>) {
    found.push(of);
    for field in of.fields {
        if let Type::List {
            item: Type::Structure(item),
            ..
        } = field.of
        {
            structures(item, found);
        }
    }
}

fn all_fields() -> Vec<(&'static str, &'static Field)> {
    let mut found = Vec::new();
    for kind in all_kinds() {
        if let Some(payload) = kind.payload {
            structures(payload, &mut found);
        }
    }
    found
        .iter()
        .flat_map(|of| of.fields.iter().map(|field| (of.name, field)))
        .collect()
}

/// Returns the suffix of the name of a field with this unit.
fn suffix(unit: &str) -> String {
    match unit {
        "degC" => "_c".into(),
        "byte" => "_bytes".into(),
        unit => {
            let name = unit.to_lowercase().replace('^', "").replace('/', "_per_");
            format!("_{}", name.trim_start_matches("1_"))
        }
    }
}

#[test]
fn every_quantity_has_unit_and_limits_and_a_name_that_tells_the_unit() {
    for (structure, field) in all_fields() {
        let index = format!("{structure}.{}", field.name);
        let range = field.range;
        assert!(range.low < range.high, "{index}");
        let float = matches!(
            field.of,
            Type::F32 | Type::F64 | Type::Optional(Type::F32 | Type::F64)
        );
        if float {
            assert!(range.low.is_finite() && range.high.is_finite(), "{index}");
        }
        if !matches!(range.unit, "" | "1") {
            let suffix = suffix(range.unit);
            assert!(field.name.ends_with(&suffix), "{index} in {}", range.unit);
        }
        assert!(field.doc.trim().ends_with('.'), "{index}");
    }
}

#[test]
fn numbers_and_names_of_kinds_are_unique_and_tell_the_direction() {
    let mut numbers = HashSet::new();
    for kind in all_kinds() {
        assert!(numbers.insert(kind.number), "{}", kind.name);
    }
    for (kinds, commands) in [(Record::KINDS, false), (Command::KINDS, true)] {
        let mut names = HashSet::new();
        for kind in kinds {
            assert!(names.insert(kind.name), "{}", kind.name);
            assert_eq!(kind.number & 0x80 != 0, commands, "{}", kind.name);
        }
    }
}

#[test]
fn what_is_set_is_read_back_in_the_same_form() {
    let setters = 0x90..0xA0;
    for kind in Command::KINDS
        .iter()
        .filter(|kind| setters.contains(&kind.number))
    {
        let record = Record::KINDS
            .iter()
            .find(|record| record.number == kind.number & 0x7F)
            .unwrap_or_else(|| panic!("{} cannot be read back", kind.name));
        assert_eq!(format!("set_{}", record.name), kind.name);
        assert_eq!(record.payload, kind.payload);
        if record.number > 0x10 {
            assert_eq!(Part::from_number(record.number).name(), record.name);
        }
    }
}

#[test]
fn codes_are_unique_and_turn_back_into_themselves() {
    let mut tables = 0;
    for (_, field) in all_fields() {
        let Type::Code(table) = field.of else {
            continue;
        };
        tables += 1;
        let numbers: HashSet<_> = table.entries.iter().map(|entry| entry.number).collect();
        let names: HashSet<_> = table.entries.iter().map(|entry| entry.name).collect();
        assert_eq!(numbers.len(), table.entries.len(), "{}", table.name);
        assert_eq!(names.len(), table.entries.len(), "{}", table.name);
    }
    assert!(tables > 10);
    for number in 0..=u8::MAX {
        let part = Part::from_number(number);
        assert_eq!(part.number(), number);
        assert_eq!(part == Part::Unknown(number), !Part::ALL.contains(&part));
    }
    assert_eq!(Part::from_number(9).to_string(), "unknown (9)");
    assert_eq!(Part::Coil.to_string(), "coil");
    assert_eq!(Part::Coil.meaning().trim(), "The coil's data.");
}

/// Encodes the largest value of every kind and compares its size with the constants.
fn sizes<M: Message>() {
    let mut longest = 0;
    for kind in M::KINDS {
        let payload = payload_of(kind, largest);
        let max_size = kind.payload.map_or(0, Structure::max_size);
        assert_eq!(payload.len(), max_size, "{}", kind.name);
        assert!(payload.len() <= M::MAX_PAYLOAD, "{}", kind.name);

        let content = content(&GREATEST, kind.number, &payload);
        assert_eq!(content.len(), MAX_HEADER + payload.len(), "{}", kind.name);
        let frame: Frame<M> = decode_one(&framed(&content));
        let bytes = bytes_of(&frame);
        assert_eq!(bytes, framed(&content), "{}", kind.name);
        // The constant includes a byte of COBS that a frame of exactly this length may not need.
        let room = frame_size(payload.len()) - bytes.len();
        assert!(room <= 1, "{}", kind.name);
        longest = longest.max(bytes.len());
    }
    assert!(M::MAX_FRAME - longest <= 1, "{longest} of {}", M::MAX_FRAME);
}

#[test]
fn the_largest_record_and_the_largest_command_fit_exactly() {
    sizes::<Record>();
    sizes::<Command>();
}

#[test]
fn a_smaller_buffer_is_refused_at_any_length() {
    for frame in records() {
        let whole = bytes_of(&frame);
        let encode = |room: usize| {
            let mut buffer = vec![0; room];
            palpate_wire::encode(&frame.header, &frame.message, &mut buffer).map(<[u8]>::to_vec)
        };
        for room in 0..whole.len() {
            let name = frame.message.name();
            assert!(encode(room).is_err(), "{name} in {room} bytes");
        }
        assert_eq!(encode(whole.len()), Ok(whole));
    }
}

#[test]
fn a_vector_takes_what_a_buffer_takes() {
    let frame = &records()[0];
    let vector: heapless::Vec<u8, { Record::MAX_FRAME }> =
        palpate_wire::encode_vec(&frame.header, &frame.message).unwrap();
    assert_eq!(vector[..], bytes_of(frame)[..]);
    let small = palpate_wire::encode_vec::<_, 16>(&frame.header, &frame.message);
    assert!(small.is_err());
}
