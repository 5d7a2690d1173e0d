//! The elastomer, by name or from a calibration file.

use std::ops::Range;

use palpate_cli::failure::Failure;
use palpate_field::layer::Elastomer;
use serde::Deserialize;
use toml::Spanned;

use super::input::text_of_file;

/// Keys of an elastomer file.
const KEYS: &str =
    "modulus_Pa, rise and half_T, as in E(B) = modulus_Pa (1 + rise B^2/(B^2 + half_T^2))";

/// Contents of an elastomer file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case, reason = "keys carry units")]
struct File {
    modulus_Pa: Spanned<f64>,
    rise: Spanned<f64>,
    half_T: Spanned<f64>,
}

/// Reads the elastomer that the user names.
pub(super) fn elastomer(name: &str) -> Result<Elastomer, Failure> {
    match name {
        "soft" => Ok(Elastomer::SOFT),
        "ultrasoft" => Ok(Elastomer::ULTRASOFT),
        _ => {
            let text = text_of_file(name)?;
            read(name, &text)
        }
    }
}

fn read(name: &str, text: &str) -> Result<Elastomer, Failure> {
    let refuse = |span: Option<Range<usize>>, problem: String, allowed: &str| {
        let before = span.and_then(|span| text.get(..span.start)).unwrap_or("");
        Failure::Input {
            file: name.into(),
            line: 1 + before.matches('\n').count() as u64,
            problem,
            allowed: allowed.to_owned(),
        }
    };
    let file: File = toml::from_str(text)
        .map_err(|error| refuse(error.span(), error.message().replace('\n', " "), KEYS))?;
    let number = |key: &str, value: &Spanned<f64>, [least, most]: [f64; 2], unit: &str| {
        let number = *value.get_ref();
        if (least..=most).contains(&number) {
            return Ok(number);
        }
        let allowed = format!("{least} to {most}{unit}");
        Err(refuse(
            Some(value.span()),
            format!("{key} is {number}"),
            &allowed,
        ))
    };
    Ok(Elastomer {
        modulus_pa: number("modulus_Pa", &file.modulus_Pa, [1e3, 1e8], " Pa")?,
        rise: number("rise", &file.rise, [0.0, 100.0], "")?,
        half_t: number("half_T", &file.half_T, [1e-3, 10.0], " T")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_and_its_errors() {
        let good = "modulus_Pa = 1e5\nrise = 3.0\nhalf_T = 0.3\n";
        assert_eq!(read("m.toml", good).unwrap(), Elastomer::SOFT);
        let error = |text: &str| read("m.toml", text).unwrap_err().to_string();
        let low = error("modulus_Pa = 1e5\nrise = 3.0\nhalf_T = 0\n");
        assert!(
            low.contains("invalid type") || low.contains("half_T is 0"),
            "{low}"
        );
        assert!(low.contains("line 3"), "{low}");
        let unknown = error("modulus_Pa = 1e5\nrise = 3.0\nhalf_t = 0.3\n");
        assert!(
            unknown.contains("line 3") && unknown.contains("half_T"),
            "{unknown}"
        );
    }
}
