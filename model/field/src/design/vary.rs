//! Changes numbers in a design's text by their path: `parameters.gap`, `coil.lower inner.x.1`.

use core::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Sets numbers in a design's text; comments, order and line numbers stay. A path consists of names
/// of tables and, for an entry of a list, its `name` or its index from 0; it ends at a number or an
/// expression, which the given number replaces.
///
/// # Errors
/// A sentence that names the path and what the text contains there.
pub fn set(text: &str, settings: &[(String, f64)]) -> Result<String, String> {
    let mut text = text.to_owned();
    for (path, value) in settings {
        let (place, whole) = find(&text, path)?;
        // A number that was an integer, such as a count, stays one.
        let number = if whole && value.fract() == 0.0 {
            format!("{value:.0}")
        } else {
            format!("{value:?}")
        };
        text.replace_range(place, &number);
    }
    Ok(text)
}

/// Returns the number at the end of a path.
///
/// # Errors
/// A sentence as for [`set`]; also if the path ends at an expression, which is not a number.
pub fn get(text: &str, path: &str) -> Result<f64, String> {
    let (place, _) = find(text, path)?;
    let number = text.get(place).unwrap_or_default();
    let plain = number.replace('_', "");
    plain.parse().map_err(|_| {
        format!("{path:?} is {number}, and not a number by itself: change what it is computed from")
    })
}

/// Byte range in the text of the number at the end of a path, and whether the number is an integer.
fn find(text: &str, path: &str) -> Result<(Range<usize>, bool), String> {
    let table = DeTable::parse(text).map_err(|error| error.message().to_owned())?;
    let span = table.span();
    let root = Spanned::new(span, DeValue::Table(table.into_inner()));
    let mut place = &root;
    for step in path.split('.') {
        let next = match place.get_ref() {
            DeValue::Table(table) => {
                let mut entries = table.iter();
                let entry = entries.find(|(key, _)| key.get_ref() == step);
                entry.map(|(_, value)| value)
            }
            DeValue::Array(items) => {
                let mut named = items.iter();
                let found = named.find(|item| name_of(item.get_ref()) == Some(step));
                let number = step.parse().ok().and_then(|index: usize| items.get(index));
                found.or(number)
            }
            _ => None,
        };
        place = next.ok_or_else(|| {
            let known = keys(place.get_ref()).join(", ");
            format!("there is no {step:?} in {path:?}; there: {known}")
        })?;
    }
    match place.get_ref() {
        DeValue::Integer(_) => Ok((place.span(), true)),
        DeValue::Float(_) | DeValue::String(_) => Ok((place.span(), false)),
        other => Err(format!("{path:?} is {}, no number", other.type_str())),
    }
}

/// The `name` of an entry in a list.
fn name_of<'v>(item: &'v DeValue<'_>) -> Option<&'v str> {
    let DeValue::Table(table) = item else {
        return None;
    };
    let (_, name) = table.iter().find(|(key, _)| key.get_ref() == "name")?;
    match name.get_ref() {
        DeValue::String(name) => Some(name),
        _ => None,
    }
}

fn keys(value: &DeValue<'_>) -> Vec<String> {
    match value {
        DeValue::Table(table) => table.keys().map(|key| key.get_ref().to_string()).collect(),
        DeValue::Array(items) => items
            .iter()
            .enumerate()
            .map(|(index, item)| {
                name_of(item.get_ref()).map_or_else(|| index.to_string(), str::to_owned)
            })
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
        assert_eq!(get(text, "parameters.gap"), Ok(5.0));
        assert!(get(text, "core.x.1").is_err());
    }

    /// A changed text differs in its numbers only, so messages about it refer to the user's lines.
    #[test]
    fn comments_and_lines_stay() {
        let text = "# mine\n[parameters]\ngap = 5.0 # mm\n[[coil]]\nname = \"a\"\nrings = 7\n";
        let settings = [("parameters.gap", 4.5), ("coil.a.rings", 5.0)];
        let changed = set(
            text,
            &settings.map(|(path, value)| (path.to_owned(), value)),
        );
        let expected = text.replace("5.0", "4.5").replace('7', "5");
        assert_eq!(changed, Ok(expected));
    }
}
