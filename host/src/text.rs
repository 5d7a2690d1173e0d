//! Text that a person or another program wrote.

use std::fs;
use std::io::Read;
use std::path::Path;

use crate::failure::Failure;

/// The mark that editors of Windows write before UTF-8, and those of UTF-16.
const UTF_8_MARK: char = '\u{FEFF}';
const UTF_16_MARKS: [&[u8]; 2] = [&[0xFF, 0xFE], &[0xFE, 0xFF]];

/// Most bytes of an input: a device may never end. A day of conversion words at 1 kHz has fewer.
const MOST_BYTES: u64 = 1_000_000_000;

/// The text of a file, without a mark before it.
///
/// # Errors
/// If it cannot be read, is too large, or is not UTF-8.
pub(crate) fn of_file(file: &Path) -> Result<String, Failure> {
    of_bytes(bytes_of_file(file)?, file)
}

/// The same of an input, which has a name.
pub(crate) fn of(from: impl Read, name: &Path) -> Result<String, Failure> {
    of_bytes(bytes(MOST_BYTES, from, name)?, name)
}

/// The bytes of a file, text or not.
///
/// # Errors
/// If it cannot be read, or is too large.
pub(crate) fn bytes_of_file(file: &Path) -> Result<Vec<u8>, Failure> {
    let opened = fs::File::open(file).map_err(|reason| Failure::Unreadable {
        file: file.to_path_buf(),
        reason,
    })?;
    bytes(MOST_BYTES, opened, file)
}

fn bytes(most_bytes: u64, from: impl Read, name: &Path) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    from.take(most_bytes + 1)
        .read_to_end(&mut bytes)
        .map_err(|reason| Failure::Unreadable {
            file: name.to_path_buf(),
            reason,
        })?;
    if bytes.len() as u64 > most_bytes {
        return Err(Failure::Input {
            file: name.to_path_buf(),
            line: 1,
            problem: "it is too large".to_owned(),
            allowed: format!("at most {most_bytes} bytes"),
        });
    }
    Ok(bytes)
}

fn of_bytes(bytes: Vec<u8>, name: &Path) -> Result<String, Failure> {
    let is_utf_16 = UTF_16_MARKS.iter().any(|mark| bytes.starts_with(mark));
    let text = String::from_utf8(bytes).map_err(|error| {
        let after = error.utf8_error().valid_up_to();
        let before = error.as_bytes().iter().take(after);
        Failure::Input {
            file: name.to_path_buf(),
            line: 1 + before.filter(|byte| **byte == b'\n').count() as u64,
            problem: if is_utf_16 {
                "it is UTF-16".to_owned()
            } else {
                "it is not UTF-8".to_owned()
            },
            allowed: "UTF-8: save it as UTF-8".to_owned(),
        }
    })?;
    Ok(match text.strip_prefix(UTF_8_MARK) {
        Some(text) => text.to_owned(),
        None => text,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_that_never_ends_is_refused() {
        let read = bytes(1_000, std::io::repeat(b'#'), Path::new("endless"));
        let refused = read.unwrap_err().to_string();
        assert!(
            refused.contains("endless, line 1: it is too large"),
            "{refused}"
        );
        assert!(bytes(1_000, &[b'#'; 1_000][..], Path::new("full")).is_ok());
    }
}
