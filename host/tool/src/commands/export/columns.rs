//! Records as rows: structures and lists become columns.

use std::collections::{BTreeMap, BTreeSet};

use palpate_wire::schema::{Field, Type};
use palpate_wire::{Message, Record};
use serde_json::Value;

/// Field that gives the number of an item in a list, where present: the conversions of a sample may
/// belong to channels 0 and 2, not to the first two.
const CHANNEL: &str = "channel";

/// Numbers of the items that occur in each list.
#[derive(Debug, Default)]
pub struct Used(BTreeMap<String, BTreeSet<u64>>);

impl Used {
    /// Adds the items in the lists of a record; returns whether one of them is new.
    pub fn enter(&mut self, payload: &Value) -> bool {
        let mut is_new = false;
        for (field, value) in payload.as_object().into_iter().flatten() {
            if let Value::Array(items) = value {
                let used = self.0.entry(field.clone()).or_default();
                for (place, item) in (0..).zip(items) {
                    is_new |= used.insert(number(place, item));
                }
            }
        }
        is_new
    }
}

/// Number that identifies an item of a list.
fn number(place: u64, item: &Value) -> u64 {
    item.get(CHANNEL).and_then(Value::as_u64).unwrap_or(place)
}

/// A column of a table.
#[derive(Clone, Debug)]
pub struct Column {
    /// Name: the fields on the path, with the numbers of items.
    pub name: String,
    /// Type of the cells.
    pub of: Type,
    /// Unit of the cells; `1` for plain numbers, empty for non-quantities.
    pub unit: &'static str,
    path: Vec<Step>,
}

/// A step of a path into a value.
#[derive(Clone, Debug)]
enum Step {
    Field(&'static str),
    /// The item of a list with this number.
    Item(u64),
}

impl Step {
    fn of<'v>(&self, value: &'v Value) -> Option<&'v Value> {
        match self {
            Self::Field(name) => value.get(name),
            Self::Item(known_by) => {
                let mut items = (0..).zip(value.as_array()?);
                let found = items.find(|(place, item)| number(*place, item) == *known_by);
                found.map(|(_, item)| item)
            }
        }
    }
}

impl Column {
    /// Creates a column of a computed table, whose rows are flat.
    pub fn computed(name: &'static str, of: Type, unit: &'static str) -> Self {
        Self {
            name: name.to_owned(),
            of,
            unit,
            path: vec![Step::Field(name)],
        }
    }

    /// Returns the value in a record; `None` if absent.
    pub fn value<'v>(&self, payload: &'v Value) -> Option<&'v Value> {
        let mut steps = self.path.iter();
        let value = steps.try_fold(payload, |value, step| step.of(value))?;
        (!value.is_null()).then_some(value)
    }

    /// Returns the value as text; empty if absent.
    pub fn cell(&self, payload: &Value) -> String {
        match self.value(payload) {
            None => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(other) => other.to_string(),
        }
    }
}

/// Columns of a kind of record, in the order of its fields.
pub fn of(kind: &str, used: &Used) -> Vec<Column> {
    let mut kinds = Record::KINDS.iter();
    let payload = kinds.find(|of| of.name == kind).and_then(|of| of.payload);
    let root = Column {
        name: String::new(),
        of: Type::Bool,
        unit: "",
        path: Vec::new(),
    };
    let mut columns = Vec::new();
    for field in payload.into_iter().flat_map(|payload| payload.fields) {
        add(&root, field, used, &mut columns);
    }
    columns
}

fn add(parent: &Column, field: &Field, used: &Used, columns: &mut Vec<Column>) {
    let mut column = parent.below(field.name, Step::Field(field.name));
    column.unit = field.range.unit;
    match &field.of {
        Type::List { item, .. } => {
            for &number in used.0.get(field.name).into_iter().flatten() {
                let item_column = column.below(&number.to_string(), Step::Item(number));
                add_value(&item_column, item, used, columns);
            }
        }
        other => add_value(&column, other, used, columns),
    }
}

fn add_value(column: &Column, of: &Type, used: &Used, columns: &mut Vec<Column>) {
    let of = match of {
        Type::Optional(of) => of,
        other => other,
    };
    match of.structure() {
        Some(structure) => {
            // The number in the column's name is already the channel.
            let fields = structure.fields.iter();
            let is_item = matches!(column.path.last(), Some(Step::Item(_)));
            for field in fields.filter(|field| !is_item || field.name != CHANNEL) {
                add(column, field, used, columns);
            }
        }
        None => columns.push(Column {
            of: *of,
            ..column.clone()
        }),
    }
}

impl Column {
    fn below(&self, name: &str, step: Step) -> Self {
        let mut path = self.path.clone();
        path.push(step);
        let name = if self.name.is_empty() {
            name.to_owned()
        } else {
            format!("{}_{name}", self.name)
        };
        Self {
            name,
            path,
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn conversions_stand_by_their_channel() {
        let payload = json!({
            "sensor": 0,
            "force_n": null,
            "channels": [{"channel": 0, "frequency_hz": 1.5}, {"channel": 2, "frequency_hz": 3e6}],
        });
        let mut used = Used::default();
        used.enter(&payload);
        let columns = of("sample", &used);
        let cell = |name: &str| {
            let column = columns.iter().find(|column| column.name == name);
            column.unwrap_or_else(|| panic!("{name}")).cell(&payload)
        };
        assert_eq!(cell("sensor"), "0");
        assert_eq!(cell("force_n"), "");
        assert_eq!(cell("channels_0_frequency_hz"), "1.5");
        assert_eq!(cell("channels_2_frequency_hz"), "3000000.0");
        let of = |name: &str| columns.iter().find(|column| column.name == name).unwrap();
        let frequency = of("channels_2_frequency_hz");
        assert_eq!((frequency.of, frequency.unit), (Type::F64, "Hz"));
        assert_eq!((of("force_n").of, of("force_n").unit), (Type::F32, "N"));
        assert!(
            !columns
                .iter()
                .any(|column| column.name.starts_with("channels_1_"))
        );
    }

    #[test]
    fn no_two_columns_of_a_kind_have_one_name() {
        for kind in Record::KINDS {
            let columns = of(kind.name, &Used::default());
            let names: BTreeSet<_> = columns.iter().map(|column| &column.name).collect();
            assert_eq!(names.len(), columns.len(), "{}", kind.name);
        }
    }
}
