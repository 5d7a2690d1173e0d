//! Parsers of numbers on the command line: unit prefixes (`40M`, `2.9M..3.8M`), durations, factors.

use std::time::Duration;

use palpate_sim::stack::quantity::Allowed;

/// Longest duration, s (31 years). Adding it to the time of any clock of the tool does not
/// overflow.
const LONGEST_S: f64 = 1e9;
/// Smallest and largest allowed spring stiffness, relative to the sensing layer.
const LOADS: [f64; 2] = [1e-3, 1e3];

/// Returns a parser of numbers from `least` to `most`. `unit` is empty for a pure number.
pub fn within(
    least: f64,
    most: f64,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| match text.trim().parse() {
        Ok(value) if (least..=most).contains(&value) => Ok(value),
        _ => Err(format!(
            "allowed: {}",
            Allowed::new(least, most, unit).bounds()
        )),
    }
}

/// Parses a number of seconds.
pub fn duration(text: &str) -> Result<Duration, String> {
    let time_s = within(0.0, LONGEST_S, "seconds")(text)?;
    Duration::try_from_secs_f64(time_s).map_err(|error| error.to_string())
}

/// Parses a spring's stiffness relative to the sensing layer.
pub fn load(text: &str) -> Result<f64, String> {
    let [least, most] = LOADS;
    within(least, most, "")(text)
}

/// Parses a length in m: `3mm` or `0.003m`.
pub fn length(text: &str) -> Result<f64, String> {
    let value = with_unit(text, &[("mm", 1e-3), ("m", 1.0)]);
    let value = value.filter(|of_m| (1e-5..=0.1).contains(of_m));
    value.ok_or_else(|| "allowed: a length from 0.01mm to 0.1m, as 3mm".to_owned())
}

/// Parses a stiffness in N/m: `60N/mm` or `60000N/m`.
pub fn spring(text: &str) -> Result<f64, String> {
    let value = with_unit(text, &[("N/mm", 1e3), ("N/m", 1.0)]);
    let value = value.filter(|of_n_per_m| (1.0..=1e10).contains(of_n_per_m));
    value.ok_or_else(|| "allowed: a stiffness from 1N/m, as 60N/mm".to_owned())
}

/// Parses a part of a whole: `2%` or `0.02`.
pub fn part(text: &str) -> Result<f64, String> {
    let value = with_unit(text, &[("%", 1e-2), ("", 1.0)]);
    let value = value.filter(|of| (0.0..=1.0).contains(of));
    value.ok_or_else(|| "allowed: 0 to 1, or 0% to 100%".to_owned())
}

/// Parses a number with the first of the units that it ends with, each with its factor.
fn with_unit(text: &str, units: &[(&str, f64)]) -> Option<f64> {
    let mut units = units.iter();
    let found = units.find_map(|(unit, factor)| Some((text.trim().strip_suffix(unit)?, factor)));
    let (number, factor) = found?;
    let number: f64 = number.trim_end().parse().ok()?;
    Some(number * factor)
}

/// Parses `40000000`, `40M`, `400k` into a whole number of units.
pub fn whole(text: &str) -> Result<u32, String> {
    let allowed = "a number like 40000000, 400k or 2.9M";
    let (digits, factor) = match text.trim().strip_suffix(['k', 'K', 'M']) {
        Some(digits) if text.trim().ends_with('M') => (digits, 1e6),
        Some(digits) => (digits, 1e3),
        None => (text.trim(), 1.0),
    };
    let value: f64 = digits
        .parse()
        .map_err(|_| format!("'{text}' is not {allowed}"))?;
    let value = value * factor;
    if value.is_finite() && (0.0..=f64::from(u32::MAX)).contains(&value) {
        Ok(value.round() as u32)
    } else {
        Err(format!(
            "'{text}' is outside 0 to {}; allowed: {allowed}",
            u32::MAX
        ))
    }
}

/// Parses `LOW..HIGH`, or one number for both.
pub fn range(text: &str) -> Result<(u32, u32), String> {
    match text.split_once("..") {
        Some((low, high)) => Ok((whole(low)?, whole(high)?)),
        None => whole(text).map(|value| (value, value)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_scale() {
        assert_eq!(whole("40M"), Ok(40_000_000));
        assert_eq!(whole("400k"), Ok(400_000));
        assert_eq!(whole("12"), Ok(12));
        assert_eq!(range("2.9M..3.8M"), Ok((2_900_000, 3_800_000)));
        assert_eq!(range("5k"), Ok((5_000, 5_000)));
    }

    #[test]
    fn durations_and_loads_have_limits() {
        assert_eq!(duration("0.25"), Ok(Duration::from_millis(250)));
        assert_eq!(duration("1e9"), Ok(Duration::from_secs(1_000_000_000)));
        assert_eq!(load("1.5"), Ok(1.5));
        for text in ["nan", "inf", "-1", "2e9", "1e20", "", "x"] {
            assert!(duration(text).is_err() && load(text).is_err(), "{text}");
        }
        assert!(load("0").is_err());
    }

    #[test]
    fn lengths_stiffnesses_and_parts_have_units() {
        assert_eq!(length("3mm"), Ok(3.0 * 1e-3));
        assert_eq!(length(" 0.003 m"), Ok(0.003));
        assert_eq!(spring("60N/mm"), Ok(60e3));
        assert_eq!(spring("5e4 N/m"), Ok(5e4));
        assert_eq!(part("2%"), Ok(2.0 * 1e-2));
        assert_eq!(part("0.02"), Ok(0.02));
        for text in ["3", "3um", "200mm", "nanmm", "-1mm", "mm"] {
            assert!(length(text).is_err(), "{text}");
        }
        assert!(spring("60").is_err() && spring("0N/mm").is_err());
        assert!(part("101%").is_err() && part("x").is_err());
    }

    #[test]
    fn nonsense_is_refused() {
        for text in [
            "", "M", "-1", "nan", "inf", "1e30", "4 0", "3..", "..", "x..y", "5G",
        ] {
            assert!(range(text).is_err(), "{text}");
        }
    }
}
