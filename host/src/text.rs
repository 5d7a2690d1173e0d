//! Text that a person or another program wrote.

use std::fs;
use std::io::Read;
use std::path::Path;

use crate::failure::Failure;

/// The mark that editors of Windows write before UTF-8, and those of UTF-16.
const UTF_8_MARK: char = '\u{FEFF}';
const UTF_16_MARKS: [&[u8]; 2] = [&[0xFF, 0xFE], &[0xFE, 0xFF]];

/// The text of a file, without a mark before it.
///
/// # Errors
/// If it cannot be read, or is not UTF-8.
pub(crate) fn of_file(file: &Path) -> Result<String, Failure> {
    let opened = fs::File::open(file).map_err(|reason| Failure::Unreadable {
        file: file.to_path_buf(),
        reason,
    })?;
    of(opened, file)
}

/// The same of an input, which has a name.
pub(crate) fn of(mut from: impl Read, name: &Path) -> Result<String, Failure> {
    let mut bytes = Vec::new();
    from.read_to_end(&mut bytes)
        .map_err(|reason| Failure::Unreadable {
            file: name.to_path_buf(),
            reason,
        })?;
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
