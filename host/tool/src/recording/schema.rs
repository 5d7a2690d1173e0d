//! JSON Schema of a recorded message, from the protocol's own description.
//!
//! The text form of a frame has `null` for an absent value. JSON Schema would use two types for
//! this, but Foxglove's reader refuses a field with two types. Such a field therefore has its own
//! type, is not required, and its description says `null`.

use palpate_wire::Header;
use palpate_wire::schema::{Described, Field, Kind, Range, Structure, Type};
use serde_json::{Map, Value, json};

/// Schema of a kind of message: the text form of a frame, docs/protocol.md.
pub(super) fn of_kind(kind: &Kind) -> Value {
    let header = Header::TYPE.structure().map_or_else(empty, structure);
    let payload = kind.payload.map_or_else(empty, structure);
    let message = json!({
        "type": "object",
        "description": kind.doc.trim(),
        "properties": { kind.name: payload },
        "required": [kind.name],
    });
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": kind.name,
        "description": kind.doc.trim(),
        "type": "object",
        "properties": { "header": header, "message": message },
        "required": ["header", "message"],
    })
}

/// Schema of a log line, equal to Foxglove's schema `Log`.
pub(super) fn of_log() -> Value {
    let number = |of: &str| json!({"type": "integer", "minimum": 0, "description": of});
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "foxglove.Log",
        "description": "A line of the firmware's log",
        "type": "object",
        "properties": {
            "timestamp": {
                "type": "object",
                "title": "time",
                "description": "When it arrived, by the computer's clock, since 1970-01-01 UTC",
                "properties": {"sec": number("Whole seconds"), "nsec": number("Nanoseconds beyond")},
            },
            "level": number("0 unknown, 1 debug, 2 info, 3 warning, 4 error"),
            "message": {"type": "string", "description": "What was logged"},
            "name": {"type": "string", "description": "Name of the log's source"},
            "file": {"type": "string", "description": "Empty: the image does not send it"},
            "line": number("0: the image does not send it"),
        },
    })
}

fn empty() -> Value {
    json!({ "type": "object", "properties": {} })
}

fn structure(of: &Structure) -> Value {
    let properties = of.fields.iter().map(|field| {
        let mut described = value(&field.of, &field.range);
        described.insert("description".to_owned(), description(field).into());
        (field.name.to_owned(), Value::Object(described))
    });
    let required = of.fields.iter();
    let required = required.filter(|field| !matches!(field.of, Type::Optional(_)));
    json!({
        "type": "object",
        "properties": properties.collect::<Map<_, _>>(),
        "required": required.map(|field| field.name).collect::<Vec<_>>(),
    })
}

fn description(field: &Field) -> String {
    let mut text = field.doc.split_whitespace().collect::<Vec<_>>().join(" ");
    if !matches!(field.range.unit, "" | "1") {
        text = format!("{text} In {}.", field.range.unit);
    }
    if matches!(field.of, Type::Optional(_)) {
        text.push_str(" null where it is absent.");
    }
    text
}

fn value(of: &Type, range: &Range) -> Map<String, Value> {
    let schema = match of {
        Type::Bool => json!({ "type": "boolean" }),
        Type::U8 | Type::U16 | Type::U32 | Type::U64 => json!({ "type": "integer", "minimum": 0 }),
        Type::F32 | Type::F64 => json!({ "type": "number" }),
        Type::Text { .. } => json!({ "type": "string" }),
        Type::Optional(of) => return value(of, range),
        Type::List { item, capacity } => json!({
            "type": "array",
            "maxItems": capacity,
            "items": value(item, range),
        }),
        // Unknown numbers are written as numbers, so the names are not an `enum`.
        Type::Code(table) => {
            json!({ "type": "string", "examples": table.entries.iter().map(|entry| entry.name).collect::<Vec<_>>() })
        }
        Type::Structure(of) => structure(of),
    };
    let mut schema = match schema {
        Value::Object(schema) => schema,
        _ => Map::new(),
    };
    let is_number = matches!(
        of,
        Type::U8 | Type::U16 | Type::U32 | Type::U64 | Type::F32 | Type::F64
    );
    if is_number {
        limit(&mut schema, "minimum", range.low);
        limit(&mut schema, "maximum", range.high);
    }
    schema
}

/// Adds a limit as the protocol states it: 0.05, not the nearest f32.
fn limit(schema: &mut Map<String, Value>, key: &str, limit: f32) {
    let written: Option<f64> = limit.to_string().parse().ok();
    if let Some(limit) = written.filter(|limit| limit.is_finite()) {
        schema.insert(key.to_owned(), limit.into());
    }
}

#[cfg(test)]
mod tests {
    use palpate_wire::{Message, Record};

    use super::*;

    #[test]
    fn a_sample_is_described_with_units_and_ranges() {
        let kind = Record::KINDS.iter().find(|kind| kind.name == "sample");
        let schema = of_kind(kind.unwrap());
        let sample = &schema["properties"]["message"]["properties"]["sample"];
        let current = &sample["properties"]["current_a"];
        assert_eq!(current["type"], "number");
        assert_eq!(
            (&current["minimum"], &current["maximum"]),
            (&json!(-100.0), &json!(100.0))
        );
        let said = current["description"].as_str().unwrap();
        assert!(said.contains("In A.") && said.contains("null"), "{said}");
        let required = sample["required"].as_array().unwrap();
        assert!(required.contains(&json!("gap")) && !required.contains(&json!("current_a")));
        let frequency = &sample["properties"]["channels"]["items"]["properties"]["frequency_hz"];
        assert_eq!(frequency["maximum"], json!(1e9));
    }

    /// Rules of Foxglove's reader: every field has one type, and an object lists its properties.
    #[test]
    fn every_kind_is_described_as_viewers_read_it() {
        fn check(schema: &Value) {
            match schema["type"].as_str().unwrap() {
                "object" => schema["properties"]
                    .as_object()
                    .unwrap()
                    .values()
                    .for_each(check),
                "array" => check(&schema["items"]),
                plain => assert!(["boolean", "integer", "number", "string"].contains(&plain)),
            }
        }
        for kind in Record::KINDS {
            check(&of_kind(kind));
        }
    }
}
