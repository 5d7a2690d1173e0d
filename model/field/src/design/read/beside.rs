//! Files that a design refers to.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use toml::Spanned;

use super::Reader;
use crate::design::{DesignError, FileRead};

/// Largest size of a file, bytes: a thousand times that of a data sheet's table, or a drawing of
/// 2,000 lines.
const MOST_BYTES: u64 = 2_000_000;

/// A file that a design refers to.
pub(super) struct Beside {
    /// Path, for messages.
    pub(super) file: String,
    /// Contents.
    pub(super) text: String,
}

impl Beside {
    /// Creates an error message for one of the file's lines, counted from 1.
    pub(super) fn error(
        &self,
        line: usize,
        problem: impl Into<String>,
        allowed: &str,
    ) -> DesignError {
        DesignError {
            file: self.file.clone(),
            line,
            place: String::new(),
            problem: problem.into(),
            allowed: allowed.to_owned(),
        }
    }
}

impl Reader<'_> {
    /// Reads a file; its path is relative to the design's folder. Rejects pipes and devices, whose
    /// contents may never end.
    pub(super) fn beside(
        &self,
        name: &Spanned<String>,
        place: &str,
    ) -> Result<Beside, DesignError> {
        let folder = Path::new(self.file).parent().unwrap_or(Path::new(""));
        let path = folder.join(name.get_ref());
        let file = path.display().to_string();
        let refuse =
            |problem: String, allowed: &str| self.error(&name.span(), place, problem, allowed);
        let unreadable = |error: std::io::Error| {
            let allowed = "a text file, by its path from the design's folder";
            refuse(format!("{file} cannot be read: {error}"), allowed)
        };
        let is_file = std::fs::metadata(&path).map_err(unreadable)?.is_file();
        let mut bytes = Vec::new();
        if is_file {
            let opened = File::open(&path).map_err(unreadable)?;
            let mut start = opened.take(MOST_BYTES + 1);
            start.read_to_end(&mut bytes).map_err(unreadable)?;
        }
        if !is_file || bytes.len() as u64 > MOST_BYTES {
            let allowed = format!("a file of at most {MOST_BYTES} bytes");
            return Err(refuse(
                format!("{file} is not a regular file, or too large"),
                &allowed,
            ));
        }
        let mut beside = Beside {
            file,
            text: String::new(),
        };
        if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
            return Err(beside.error(1, "is UTF-16", "UTF-8: save it as UTF-8"));
        }
        beside.text = text(bytes);
        Ok(beside)
    }

    /// Stores a summary of a file, to be shown to the user.
    pub(super) fn note(&self, beside: &Beside, summary: String) {
        self.files.borrow_mut().push(FileRead {
            file: beside.file.clone(),
            summary,
        });
    }
}

/// The characters 0x80 to 0x9F of Windows-1252; from 0xA0 on its characters equal Unicode.
const WINDOWS_1252: &str = "€\u{81}‚ƒ„…†‡ˆ‰Š‹Œ\u{8d}Ž\u{8f}\u{90}‘’“”•–—˜™š›œ\u{9d}žŸ";

/// Decodes bytes as UTF-8 without a byte order mark, or else as Windows-1252, which old drawings
/// use in comments and layers. A carriage return alone also ends a line.
fn text(bytes: Vec<u8>) -> String {
    let text = String::from_utf8(bytes).unwrap_or_else(|error| {
        let character = |&byte: &u8| match byte {
            0x80..=0x9F => WINDOWS_1252.chars().nth(usize::from(byte) - 0x80),
            _ => Some(char::from(byte)),
        };
        error.as_bytes().iter().filter_map(character).collect()
    });
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    if text.contains('\n') {
        return text.to_owned();
    }
    text.replace('\r', "\n")
}
