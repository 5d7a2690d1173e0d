//! Numbers with unit prefixes on the command line: `40M`, `2.9M..3.8M`.

/// Parses `40000000`, `40M`, `400k` into a whole number of units.
pub(crate) fn whole(text: &str) -> Result<u32, String> {
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
pub(crate) fn range(text: &str) -> Result<(u32, u32), String> {
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
    fn nonsense_is_refused() {
        for text in [
            "", "M", "-1", "nan", "inf", "1e30", "4 0", "3..", "..", "x..y", "5G",
        ] {
            assert!(range(text).is_err(), "{text}");
        }
    }
}
