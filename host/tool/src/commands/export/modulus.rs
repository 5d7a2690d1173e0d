//! Table of the moduli, computed from estimates and the declared tip.

use palpate_cli::modulus::{DeclaredTip, Evaluated};
use palpate_wire::Record;
use palpate_wire::schema::Type;
use serde_json::{Value, json};

use super::columns::Column;

/// Name of the table.
pub const TABLE: &str = "modulus";

/// Columns of the table.
pub fn columns() -> Vec<Column> {
    let number = |name, unit| Column::computed(name, Type::F32, unit);
    vec![
        Column::computed("measurement", Type::U32, ""),
        number("young_pa", "Pa"),
        number("lower_pa", "Pa"),
        number("upper_pa", "Pa"),
        number("shore_a", "1"),
        number("shore_a_lower", "1"),
        number("shore_a_upper", "1"),
        number("shore_00", "1"),
        number("shore_00_lower", "1"),
        number("shore_00_upper", "1"),
        Column::computed("no_modulus", Type::Text { capacity: 255 }, ""),
    ]
}

/// Takes a record; returns the row of an estimate, if a tip is declared.
pub fn row(declared: &mut DeclaredTip, record: &Record) -> Option<Value> {
    declared.take(record);
    let Record::Estimate(estimate) = record else {
        return None;
    };
    let measurement = estimate.measurement;
    Some(match declared.evaluate(estimate)? {
        Evaluated::NoModulus(reason) => json!({
            "measurement": measurement,
            "no_modulus": reason,
        }),
        Evaluated::Modulus(of) => json!({
            "measurement": measurement,
            "young_pa": of.young_pa,
            "lower_pa": of.lower_pa,
            "upper_pa": of.upper_pa,
            "shore_a": of.shore_a.reading,
            "shore_a_lower": of.shore_a.lower,
            "shore_a_upper": of.shore_a.upper,
            "shore_00": of.shore_00.reading,
            "shore_00_lower": of.shore_00.lower,
            "shore_00_upper": of.shore_00.upper,
        }),
    })
}
