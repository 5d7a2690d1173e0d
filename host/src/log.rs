//! The image's log: frames of defmt, which only the image's own ELF file can turn into text.

use std::path::Path;

use defmt_decoder::{DecodeError, Frame, Table};

use crate::failure::Failure;
use crate::notice;

/// What the image's ELF file says of its log.
pub(crate) struct Log(Table);

impl Log {
    /// Reads the table in an ELF file.
    pub(crate) fn of(elf: &[u8], file: &Path) -> Result<Self, Failure> {
        let no_log = |why: &str| {
            Failure::Refused(format!(
                "{}: {why}. --log takes the ELF file as `cargo xtask firmware` writes it, neither \
                 stripped nor turned into another format; name it with --image, or leave --log out.",
                file.display()
            ))
        };
        match Table::parse(elf) {
            Ok(Some(table)) => Ok(Self(table)),
            Ok(None) => Err(no_log(
                "the image has no section .defmt, so that its log cannot be read",
            )),
            Err(error) => Err(no_log(&format!("the image's log cannot be read: {error}"))),
        }
    }

    /// The lines of a log.
    pub(crate) fn lines(&self, bytes: &[u8]) -> Vec<String> {
        let mut lines = Vec::new();
        let mut decoder = self.0.new_stream_decoder();
        decoder.received(bytes);
        loop {
            match decoder.decode() {
                Ok(frame) => lines.push(line(&frame)),
                Err(DecodeError::UnexpectedEof) => return lines,
                Err(DecodeError::Malformed) => lines.push("(a damaged line)".to_owned()),
            }
        }
    }

    /// Shows a log on standard error.
    pub(crate) fn show(&self, what: &str, bytes: &[u8]) {
        notice::say(format_args!("log, {what}:"));
        for line in self.lines(bytes) {
            notice::say(line);
        }
    }
}

fn line(frame: &Frame<'_>) -> String {
    let time = frame.display_timestamp();
    let time = time.map_or(String::new(), |time| time.to_string());
    let level = frame.level().map_or("", |level| level.as_str());
    format!("{time:>12} {level:<5} {}", frame.display_message())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_without_a_log_is_refused_with_what_to_do() {
        let file = std::env::current_exe().unwrap();
        let Err(failure) = Log::of(&std::fs::read(&file).unwrap(), &file) else {
            panic!("this program has no log");
        };
        let message = failure.to_string();
        assert!(message.contains(".defmt"), "{message}");
        assert!(message.contains("cargo xtask firmware"), "{message}");
    }
}
