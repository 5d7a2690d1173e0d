//! Parts of docs/protocol.md that are generated from the code.

use std::fmt::Write as _;
use std::path::PathBuf;

use palpate_wire::record::{Conversion, Raw, Sample};
use palpate_wire::schema::{CodeTable, Described, Field, Kind, Range, Structure, Type};
use palpate_wire::{
    Command, Frame, Header, MAX_HEADER, MINOR_VERSION, Message, Record, SCHEMA_HASH, VERSION,
    frame_size,
};

use super::fixture::{self, typical};
use super::{bytes_of, header as header_of, unstuffed};

/// Returns the path of the document.
pub(crate) fn path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs/protocol.md")
}

/// Returns the document with every part between markers regenerated.
pub(crate) fn renewed(text: &str) -> String {
    let mut renewed = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("<!-- begin ") {
        let (name, after) = after.split_once(" -->\n").expect("a marker ends with -->");
        let end = format!("<!-- end {name} -->");
        let (_, after) = after.split_once(&end).expect("a part has an end marker");
        let _ = write!(
            renewed,
            "{before}<!-- begin {name} -->\n{}{end}",
            part(name)
        );
        rest = after;
    }
    renewed + rest
}

fn part(name: &str) -> String {
    match name {
        "versions" => format!(
            "This is version {VERSION}.{MINOR_VERSION}; schema hash `0x{SCHEMA_HASH:08x}`.\n"
        ),
        "header" => header(),
        "sizes" => sizes(),
        "rates" => rates(),
        "records" => kinds(Record::KINDS, "record"),
        "commands" => kinds(Command::KINDS, "command"),
        "codes" => codes(),
        "example" => example(),
        name => panic!("no part is named `{name}`"),
    }
}

fn header() -> String {
    let Type::Structure(structure) = Header::TYPE else {
        panic!("the header is a structure");
    };
    let mut text =
        String::from("| field | type | unit | range | meaning |\n|---|---|---|---|---|\n");
    let _ = writeln!(
        text,
        "| `version` | u8 | | {VERSION} | Major version of the protocol. |"
    );
    let _ = writeln!(text, "| `kind` | u8 | | | Kind of the message. |");
    for field in structure.fields {
        let _ = writeln!(text, "| {} |", cells(field));
    }
    text
}

fn sizes() -> String {
    format!(
        "| bytes at most | records | commands |\n|---|---|---|\n\
         | version, kind and header | {MAX_HEADER} | {MAX_HEADER} |\n\
         | payload | {} | {} |\n\
         | whole frame | {} | {} |\n",
        Record::MAX_PAYLOAD,
        Command::MAX_PAYLOAD,
        Record::MAX_FRAME,
        Command::MAX_FRAME,
    )
}

/// Returns the table of frame sizes and data rates, for frames as they are after an hour of operation.
fn rates() -> String {
    let mut text = String::from("| record | bytes | per second | kB/s |\n|---|---|---|---|\n");
    let mut row = |what: &str, message: Record, per_second: f64| {
        let header = Header {
            sequence: 3_600_000,
            time_us: 3_600_000_000,
            ..header_of(0)
        };
        let bytes = bytes_of(&Frame { header, message }).len();
        let rate = bytes as f64 * per_second / 1e3;
        let _ = writeln!(text, "| {what} | {bytes} | {per_second:.0} | {rate:.0} |");
    };
    row("`sample`, one channel", sample(1), 1_000.0);
    row("`sample`, four channels", sample(4), 1_000.0);
    row("`raw`, one channel", raw(1), 4_040.0 / 32.0);
    row("`raw`, four channels", raw(4), 1_050.0 / 8.0);
    text
}

/// Returns a sample of up to four channels.
fn sample(channels: u8) -> Record {
    let sample: Sample = typical("sample");
    let conversion = |channel| Conversion {
        channel,
        offset_us: u16::from(channel) * 240,
        ..sample.channels[0].clone()
    };
    Record::Sample(Sample {
        channels: (0..channels).map(conversion).collect(),
        ..sample
    })
}

/// Returns a full record of up to four channels.
fn raw(channels: u8) -> Record {
    Record::Raw(Raw {
        missed: 0,
        channels: (1 << channels) - 1,
        words: (0x0440_9E8B..).take(32).collect(),
        ..typical("raw")
    })
}

fn kinds(kinds: &[Kind], what: &str) -> String {
    let mut kinds = kinds.to_vec();
    kinds.sort_by_key(|kind| kind.number);
    let mut text = String::new();
    let mut shown: Vec<&str> = Vec::new();
    for kind in kinds {
        let Kind { number, name, .. } = kind;
        let _ = write!(
            text,
            "\n### `{name}`, {what} 0x{number:02x}\n\n{}\n",
            prose(kind.doc)
        );
        let Some(payload) = kind.payload else {
            let _ = writeln!(
                text,
                "\nNo payload. Frame of at most {} bytes.",
                frame_size(0)
            );
            continue;
        };
        let at_most = frame_size(payload.max_size());
        if let Some(record) = Record::KINDS
            .iter()
            .find(|record| what == "command" && record.payload == Some(payload))
        {
            let record = record.name;
            let _ = writeln!(
                text,
                "\nPayload as of the record `{record}`. Frame of at most {at_most} bytes."
            );
            continue;
        }
        let _ = writeln!(
            text,
            "\n{} Frame of at most {at_most} bytes.",
            prose(payload.doc)
        );
        table(payload, &mut text);
        for item in items(payload) {
            if !shown.contains(&item.name) {
                shown.push(item.name);
                let _ = writeln!(text, "\n`{}`: {}", item.name, prose(item.doc));
                table(item, &mut text);
            }
        }
    }
    text
}

fn table(structure: &Structure, text: &mut String) {
    text.push_str("\n| no. | field | type | unit | range | meaning |\n|---|---|---|---|---|---|\n");
    for (number, field) in structure.fields.iter().enumerate() {
        let _ = writeln!(text, "| {number} | {} |", cells(field));
    }
}

fn cells(field: &Field) -> String {
    format!(
        "`{}` | {} | {} | {} | {}",
        field.name,
        type_name(&field.of),
        field.range.unit,
        limits(&field.of, &field.range),
        prose(field.doc)
    )
}

fn type_name(of: &Type) -> String {
    match of {
        Type::Bool => "bool".into(),
        Type::U8 => "u8".into(),
        Type::U16 => "u16".into(),
        Type::U32 => "u32".into(),
        Type::U64 => "u64".into(),
        Type::F32 => "f32".into(),
        Type::F64 => "f64".into(),
        Type::Optional(of) => format!("optional {}", type_name(of)),
        Type::List { item, capacity } => format!("list of up to {capacity} {}", type_name(item)),
        Type::Text { capacity } => format!("text of up to {capacity} bytes"),
        Type::Code(table) => format!("[{}](#{})", table.name, table.name.to_lowercase()),
        Type::Structure(structure) => format!("`{}`", structure.name),
    }
}

fn limits(of: &Type, range: &Range) -> String {
    if range.low.is_finite() {
        return format!("{} to {}", number(range.low), number(range.high));
    }
    match of {
        Type::U8 => "0 to 255".into(),
        Type::U16 => "0 to 65535".into(),
        Type::U32 => "0 to 4294967295".into(),
        Type::U64 => "0 to 18446744073709551615".into(),
        Type::Optional(of) | Type::List { item: of, .. } => limits(of, range),
        _ => String::new(),
    }
}

fn number(value: f32) -> String {
    let size = value.abs();
    if value != 0.0 && !(1e-3..1e7).contains(&size) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

fn items(structure: &Structure) -> Vec<&'static Structure> {
    let inner = |field: &Field| match field.of {
        Type::List {
            item: Type::Structure(item),
            ..
        } => Some(*item),
        _ => None,
    };
    structure.fields.iter().filter_map(inner).collect()
}

/// All enumerations, each at its first use.
fn codes() -> String {
    let mut tables: Vec<&CodeTable> = Vec::new();
    for kind in Record::KINDS.iter().chain(Command::KINDS) {
        for field in kind.payload.iter().flat_map(|payload| payload.fields) {
            if let Type::Code(table) = field.of
                && !tables.contains(&table)
            {
                tables.push(table);
            }
        }
    }
    tables.sort_by_key(|table| table.name);
    let mut text = String::new();
    for table in tables {
        let _ = writeln!(text, "\n### {}\n\n{}\n", table.name, prose(table.doc));
        text.push_str("| no. | name | meaning |\n|---|---|---|\n");
        for entry in table.entries {
            let (number, name, meaning) = (entry.number, entry.name, prose(entry.doc));
            let _ = writeln!(text, "| {number} | `{name}` | {meaning} |");
        }
    }
    text
}

/// Returns a comment's lines as one.
fn prose(doc: &str) -> String {
    doc.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The first `state` record of the fixture, byte by byte.
fn example() -> String {
    let frames = fixture::records();
    let is_state = |frame: &Frame<Record>| matches!(frame.message, Record::State(_));
    let place = frames.iter().position(is_state);
    let (before, rest) = frames.split_at(place.expect("the fixture contains a state"));
    let offset: usize = before.iter().map(|frame| bytes_of(frame).len()).sum();
    let coded = bytes_of(&rest[0]);
    let mut text = format!(
        "The {} bytes at offset {offset} of `v{VERSION}-records.bin`:\n\n```text\n{}\n```\n\n\
         Without COBS:\n\n| bytes | field | value |\n|---|---|---|\n",
        coded.len(),
        hex(&coded),
    );
    let body = unstuffed(&coded);
    let mut body = &body[..];
    for (field, value) in example_fields(&rest[0]) {
        // Each field is a varint or a byte below 128.
        let length = 1 + body.iter().take_while(|byte| **byte >= 0x80).count();
        let (bytes, others) = body.split_at(length);
        let _ = writeln!(text, "| `{}` | `{field}` | {value} |", hex(bytes));
        body = others;
    }
    let checksum = u32::from_le_bytes(body.try_into().expect("the CRC-32 is left"));
    let _ = writeln!(text, "| `{}` | CRC-32 | 0x{checksum:08x} |", hex(body));
    text
}

fn example_fields(frame: &Frame<Record>) -> [(&'static str, String); 11] {
    let Frame { header, message } = frame;
    let Record::State(state) = message else {
        panic!("the example is a state");
    };
    let named = |number: u8, name: &str| format!("{number}: {name}");
    [
        ("version", named(VERSION, "major version")),
        ("kind", named(message.kind(), message.name())),
        ("boot_id", format!("0x{:08x}", header.boot_id)),
        ("sequence", header.sequence.to_string()),
        ("time_us", format!("{} us", header.time_us)),
        ("dropped", header.dropped.to_string()),
        ("state", named(state.state.number(), state.state.name())),
        (
            "previous",
            named(state.previous.number(), state.previous.name()),
        ),
        ("mode", named(state.mode.number(), state.mode.name())),
        ("armed", named(u8::from(state.armed), "yes")),
        ("measurement", state.measurement.to_string()),
    ]
}

/// Returns bytes as the document shows them.
fn hex(bytes: &[u8]) -> String {
    let bytes: Vec<_> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    bytes.join(" ")
}
