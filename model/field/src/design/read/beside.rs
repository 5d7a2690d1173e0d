//! Files beside a design.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use toml::Spanned;

use super::Reader;
use crate::design::DesignError;

/// Most bytes of such a file: a thousand times a table of a data sheet, or a drawing of 2,000 lines.
const MOST_BYTES: u64 = 2_000_000;

/// A file beside a design.
pub(super) struct Beside {
    /// Where it is, for messages.
    pub(super) file: String,
    /// What it holds.
    pub(super) text: String,
}

impl Beside {
    /// An error in one of its lines, counted from 1.
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
    /// Reads a file whose path is relative to the design's folder. Pipes and devices, which may never end, are
    /// refused.
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
                format!("{file} is no plain file, or too large"),
                &allowed,
            ));
        }
        // Comments and layers of old drawings are no UTF-8.
        let text = String::from_utf8_lossy(&bytes).into_owned();
        Ok(Beside { file, text })
    }
}
