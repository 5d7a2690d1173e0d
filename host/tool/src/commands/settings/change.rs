//! Single settings by name, with unit and range.

use palpate_cli::failure::Failure;
use palpate_wire::command::Settings;
use palpate_wire::schema::{Described, Field, Type};
use palpate_wire::{Command, Invalid, InvalidField, Message, Problem};
use serde_json::{Map, Value};

/// A setting with its new value.
#[derive(Clone, Debug)]
pub(crate) struct Assignment {
    field: &'static Field,
    value: Value,
}

/// All settings, in the order of the protocol.
pub(super) fn fields() -> &'static [Field] {
    let structure = const { Settings::TYPE.structure() };
    structure.map_or(&[], |structure| structure.fields)
}

impl Assignment {
    /// Name of the setting.
    pub(super) const fn name(&self) -> &'static str {
        self.field.name
    }
}

/// Parses NAME=VALUE.
///
/// # Errors
/// If there is no such setting, or the value is not allowed; the error lists the allowed ones.
pub(crate) fn assignment(text: &str) -> Result<Assignment, String> {
    let Some((name, value)) = text.split_once('=') else {
        return Err("allowed: the name of a setting, =, and its value, as rate_hz=500".to_owned());
    };
    let Some(field) = fields().iter().find(|field| field.name == name) else {
        let names: Vec<_> = fields().iter().map(|field| field.name).collect();
        return Err(format!(
            "there is no setting {name}; allowed: {}",
            names.join(", ")
        ));
    };
    let value = parse(field, value)?;
    Ok(Assignment { field, value })
}

fn parse(field: &'static Field, text: &str) -> Result<Value, String> {
    let refused = || {
        let unit = unit_behind(field);
        format!(
            "{} cannot be {text}; allowed: {}{unit}",
            field.name,
            allowed(field)
        )
    };
    match field.of {
        Type::Bool => text.parse().map(Value::Bool).map_err(|_| refused()),
        Type::Code(table) => {
            let mut names = table.entries.iter().map(|entry| entry.name);
            let is_known = names.any(|name| name == text);
            is_known.then(|| text.into()).ok_or_else(refused)
        }
        Type::F32 => {
            let value: f64 = text.parse().map_err(|_| refused())?;
            is_within(field, value)?;
            Ok(value.into())
        }
        _ => {
            let value: u32 = text.parse().map_err(|_| refused())?;
            is_within(field, value.into())?;
            Ok(value.into())
        }
    }
}

fn is_within(field: &'static Field, value: f64) -> Result<(), String> {
    let (low, high) = (field.range.low, field.range.high);
    // Compares as `f32`, as the board does. A limit like 1e-10 is no exact `f32`, yet its text is
    // allowed.
    let value = value as f32;
    let problem = if !value.is_finite() {
        Problem::NotFinite
    } else if value < low || value > high {
        Problem::OutOfRange { value, low, high }
    } else {
        return Ok(());
    };
    let invalid = Invalid {
        field: 0,
        item: None,
        problem,
    };
    let field = Some(field);
    Err(InvalidField { field, invalid }.to_string())
}

/// Unit of a field; empty for plain numbers and non-quantities.
pub(super) const fn unit(field: &Field) -> &'static str {
    match field.range.unit.as_bytes() {
        b"1" => "",
        _ => field.range.unit,
    }
}

/// Unit of a field, formatted to follow a number.
pub(super) fn unit_behind(field: &Field) -> String {
    match unit(field) {
        "" => String::new(),
        unit => format!(" {unit}"),
    }
}

/// Describes the allowed values of a field.
pub(super) fn allowed(field: &Field) -> String {
    match field.of {
        Type::Bool => "true, false".to_owned(),
        Type::Code(table) => {
            let names: Vec<_> = table.entries.iter().map(|entry| entry.name).collect();
            names.join(", ")
        }
        _ => format!("{} to {}", short(field.range.low), short(field.range.high)),
    }
}

/// Formats a number without a row of zeros.
fn short(number: f32) -> String {
    if number != 0.0 && number.abs() < 1e-3 {
        format!("{number:e}")
    } else {
        number.to_string()
    }
}

/// Formats the value of a setting.
///
/// # Errors
/// None in practice: settings are always JSON.
pub(super) fn value_of(settings: &Settings, field: &Field) -> Result<String, Failure> {
    let values = as_map(settings)?;
    Ok(match values.get(field.name) {
        Some(Value::String(name)) => name.clone(),
        Some(value) => value.to_string(),
        None => String::new(),
    })
}

/// Settings by name, through their text form, which has the shortest form of every number.
fn as_map(settings: &Settings) -> Result<Map<String, Value>, Failure> {
    Ok(serde_json::from_str(&serde_json::to_string(settings)?)?)
}

/// Applies assignments to settings.
///
/// # Errors
/// [`Failure::Argument`] if they contradict each other.
pub(crate) fn changed(
    settings: &Settings,
    assignments: &[Assignment],
) -> Result<Settings, Failure> {
    let mut values = as_map(settings)?;
    for Assignment { field, value } in assignments {
        values.insert(field.name.to_owned(), value.clone());
    }
    let settings: Settings = serde_json::from_value(Value::Object(values))?;
    let command = Command::SetSettings(settings.clone());
    match command.validate().and_then(|()| settings.check_channels()) {
        Ok(()) => Ok(settings),
        Err(invalid) => Err(Failure::Argument(
            invalid.named(command.payload()).to_string(),
        )),
    }
}

#[cfg(test)]
mod tests {
    use palpate_simulate::instrument::default_settings;

    use super::*;

    #[test]
    fn what_is_not_named_stays_as_it_is() {
        let before = default_settings();
        let to = |texts: &[&str]| {
            let assignments: Vec<_> = texts.iter().map(|text| assignment(text).unwrap()).collect();
            changed(&before, &assignments).unwrap()
        };
        assert_eq!(to(&[]), before);
        let after = to(&["ramp_s=0.07", "drift=linear", "automatic=true", "ramps=3"]);
        assert_eq!(after.ramp_s.to_bits(), 0.07f32.to_bits());
        assert!(after.automatic && after.ramps == 3);
        assert_eq!(after.drift, palpate_wire::code::Drift::Linear);
        assert_eq!(after.hold_s.to_bits(), before.hold_s.to_bits());
    }

    #[test]
    fn a_value_beyond_its_range_is_refused_with_name_unit_and_range() {
        let said = |text| assignment(text).unwrap_err();
        assert_eq!(
            said("rate_hz=9000"),
            "rate_hz is 9000 Hz; allowed are 1 to 5000 Hz"
        );
        assert_eq!(said("ramps=300"), "ramps is 300; allowed are 1 to 64");
        assert_eq!(
            said("rate_hz=fast"),
            "rate_hz cannot be fast; allowed: 1 to 5000 Hz"
        );
        assert!(said("release_m=low").ends_with("allowed: 1e-9 to 0.01 m"));
        assert!(said("drift=slow").contains("saw_tooth"));
        assert!(said("automatic=1").contains("true, false"));
        assert!(said("rate=1").contains("rate_hz"));
        assert!(said("rate_hz").contains("rate_hz=500"));
        assert!(said("hold_s=nan").contains("hold_s is infinite or not a number"));
        // The range includes its end, although 1e-10 is not a single-precision number.
        assert!(assignment("contact_noise_m=1e-10").is_ok());
    }

    #[test]
    fn settings_that_contradict_each_other_are_refused() {
        let low = assignment("peak_current_a=0.05").unwrap();
        let high = assignment("end_current_a=6").unwrap();
        let said = changed(&default_settings(), &[low, high]).unwrap_err();
        assert!(said.to_string().contains("end_current_a"), "{said}");
    }
}
