//! Agreement of a replay with its recording.

use std::collections::BTreeMap;

use palpate_sim::replay::Compared;
use palpate_wire::{Message, Record};
use serde::Serialize;
use serde_json::Value;

/// Kinds of recomputed records, with their descriptions.
const KINDS: [(&str, &str); 6] = [
    ("sample", "samples (contact, deformation, force)"),
    ("estimate", "estimates (stiffness, interval)"),
    ("uncertainty_budget", "budgets of the intervals"),
    ("load_point", "points of the load's curve"),
    ("relaxation", "relaxations of held presses"),
    ("refusal", "refusals"),
];

/// Counts of one kind of record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub(super) struct Count {
    /// Number of recomputed records.
    pub(super) replayed: u64,
    /// Number of recomputed records whose bytes equal those of the recording.
    pub(super) identical: u64,
    /// Number of recorded records that the replay skipped.
    pub(super) passed_over: u64,
}

/// A record that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Difference {
    pub(super) boot_id: u32,
    pub(super) sequence: u32,
    pub(super) time_s: f64,
    pub(super) kind: &'static str,
    /// Path of the first field that differs; the whole record if it was not recomputed.
    pub(super) field: String,
    pub(super) recorded: Value,
    pub(super) replayed: Value,
}

/// Result of a comparison.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Agreement {
    kinds: BTreeMap<&'static str, Count>,
    /// Number of records that the replay skipped, by the reason.
    passed_over: BTreeMap<String, u64>,
    first_difference: Option<Difference>,
}

impl Agreement {
    /// Adds compared records.
    pub(super) fn enter(&mut self, compared: &[Compared]) {
        for pair in compared {
            let count = self.kinds.entry(pair.frame.message.name()).or_default();
            match pair.is_identical() {
                Some(is_identical) => {
                    count.replayed += 1;
                    count.identical += u64::from(is_identical);
                    if !is_identical && self.first_difference.is_none() {
                        self.first_difference = Some(difference(pair));
                    }
                }
                None => {
                    count.passed_over += 1;
                    let why = pair
                        .replayed
                        .as_ref()
                        .err()
                        .map_or("", |pause| pause.meaning());
                    *self.passed_over.entry(why.to_owned()).or_default() += 1;
                }
            }
        }
    }

    /// Whether any record was compared.
    pub(super) fn has_replayed(&self) -> bool {
        self.kinds.values().any(|count| count.replayed > 0)
    }

    /// Returns the counts of a kind of record.
    pub(super) fn count(&self, kind: &str) -> Count {
        self.kinds.get(kind).copied().unwrap_or_default()
    }

    /// Returns the first record that differs.
    pub(super) const fn first_difference(&self) -> Option<&Difference> {
        self.first_difference.as_ref()
    }

    /// Describes the result in sentences.
    pub(super) fn sentences(&self) -> Vec<String> {
        let kinds = KINDS.iter().map(|(kind, words)| {
            let count = self.count(kind);
            format!(
                "{words}: {} of {} identical to the bit",
                count.identical, count.replayed
            )
        });
        let over = self.passed_over.iter();
        let over = over.map(|(why, records)| format!("skipped: {records} records {why}"));
        let difference = self.first_difference.as_ref().map(|of| {
            format!(
                "first difference: {} {} of boot {:08x} at {:.6} s: {} is {}, replayed {}",
                of.kind, of.sequence, of.boot_id, of.time_s, of.field, of.recorded, of.replayed
            )
        });
        kinds.chain(over).chain(difference).collect()
    }
}

fn difference(pair: &Compared) -> Difference {
    let header = &pair.frame.header;
    let recorded = payload(&pair.frame.message);
    let (field, recorded, replayed) = match &pair.replayed {
        Ok(replayed) => first_field("", recorded, payload(replayed)),
        Err(pause) => (String::new(), recorded, pause.meaning().into()),
    };
    Difference {
        boot_id: header.boot_id,
        sequence: header.sequence,
        time_s: header.time_us as f64 * 1e-6,
        kind: pair.frame.message.name(),
        field,
        recorded,
        replayed,
    }
}

/// Fields of a record in its text form.
fn payload(record: &Record) -> Value {
    // The text form has the shortest digits of each f32; a direct conversion gives those of an f64.
    let text = serde_json::to_string(record).unwrap_or_default();
    let value: Value = serde_json::from_str(&text).unwrap_or_default();
    value.get(record.name()).cloned().unwrap_or_default()
}

/// Returns the path of the first field that differs, with both values.
fn first_field(path: &str, one: Value, other: Value) -> (String, Value, Value) {
    let below = |name: &str| match path {
        "" => name.to_owned(),
        path => format!("{path}.{name}"),
    };
    match (one, other) {
        (Value::Object(one), Value::Object(other)) => {
            for (name, value) in one {
                let beside = other.get(&name).cloned().unwrap_or_default();
                if value != beside {
                    return first_field(&below(&name), value, beside);
                }
            }
            (path.to_owned(), Value::Null, Value::Null)
        }
        (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
            let mut pairs = (0..).zip(one.into_iter().zip(other));
            match pairs.find(|(_, (one, other))| one != other) {
                Some((place, (one, other))) => first_field(&below(&place.to_string()), one, other),
                None => (path.to_owned(), Value::Null, Value::Null),
            }
        }
        (one, other) => (path.to_owned(), one, other),
    }
}
