//! Changing numbers in a design's text by their path: `parameters.gap`, `coil.lower inner.x.1`.

use toml::{Table, Value};

/// Sets numbers in a text. A path names tables, entries of a list by their `name` or their place
/// from 0, and ends at a number or at a text with arithmetic, which the number replaces.
///
/// # Errors
/// A sentence that names the path and what is there.
pub fn set(text: &str, settings: &[(String, f64)]) -> Result<String, String> {
    if settings.is_empty() {
        return Ok(text.to_owned());
    }
    let table: Table = text
        .parse()
        .map_err(|error: toml::de::Error| error.to_string())?;
    let mut root = Value::Table(table);
    for (path, value) in settings {
        let place = find(&mut root, path)?;
        match place {
            Value::Integer(_) | Value::Float(_) | Value::String(_) => {
                // What counts things stays whole.
                let whole = matches!(place, Value::Integer(_)) && value.fract() == 0.0;
                #[allow(
                    clippy::cast_possible_truncation,
                    reason = "saturates; checked on reading"
                )]
                let new = if whole {
                    Value::Integer(*value as i64)
                } else {
                    Value::Float(*value)
                };
                *place = new;
            }
            other => return Err(format!("{path:?} is {}, no number", other.type_str())),
        }
    }
    toml::to_string(&root).map_err(|error| error.to_string())
}

fn find<'v>(root: &'v mut Value, path: &str) -> Result<&'v mut Value, String> {
    let mut place = root;
    for step in path.split('.') {
        let known = keys(place);
        let next = match place {
            Value::Table(table) => table.get_mut(step),
            Value::Array(items) => {
                let named = |item: &Value| item.get("name").and_then(Value::as_str) == Some(step);
                let index = items.iter().position(named).or_else(|| step.parse().ok());
                index.and_then(|index| items.get_mut(index))
            }
            _ => None,
        };
        place = next.ok_or_else(|| {
            format!(
                "there is no {step:?} in {path:?}; there: {}",
                known.join(", ")
            )
        })?;
    }
    Ok(place)
}

fn keys(value: &Value) -> Vec<String> {
    match value {
        Value::Table(table) => table.keys().cloned().collect(),
        Value::Array(items) => items
            .iter()
            .enumerate()
            .map(
                |(index, item)| match item.get("name").and_then(Value::as_str) {
                    Some(name) => name.to_owned(),
                    None => index.to_string(),
                },
            )
            .collect(),
        other => vec![format!("{} and nothing below", other.type_str())],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Design, builtin_text};

    #[test]
    fn numbers_by_path() {
        let text = builtin_text("B1").expect("built in");
        let with = |path: &str, value: f64| {
            let text = set(text, &[(path.to_owned(), value)])?;
            Design::parse("x", &text).map_err(|error| error.to_string())
        };
        let design = with("parameters.gap", 4.0).expect("a design");
        assert!((design.core.x_m[1] - 5.64e-3).abs() < 1e-12);
        let design = with("coil.lower inner.x.0", 1.5).expect("a design");
        assert!((design.coils[1].rings[0].x_m[0] - 1.5e-3).abs() < 1e-12);
        let design = with("coil.0.rings", 5.0).expect("a design");
        assert_eq!(design.coils[0].rings.len(), 5);
        assert!(with("body.mse.shape.semi_r", 12.0).is_ok());
        let error = with("body.mse.shape.radius", 12.0).expect_err("no such key");
        assert!(error.contains("semi_r"), "{error}");
        assert!(with("body", 1.0).is_err());
    }
}
