//! Log of the image: defmt frames, which only the image's own ELF file, or its table, can decode.

use std::fmt;
use std::path::{Path, PathBuf};

use clap::Args;
use defmt_decoder::{DecodeError, Frame, Table};
use palpate_cli::failure::Failure;
use palpate_cli::{notice, text};

/// First bytes of an ELF file.
const ELF: &[u8] = b"\x7fELF";

/// Log of the firmware.
#[derive(Args)]
// Skipped: the group would have the name of the verb's own arguments, which clap refuses.
#[group(skip)]
pub(crate) struct Arguments {
    /// Show the log of the firmware, each line with the time of the board's clock in seconds, on standard
    /// error. FILE is the image's ELF file, or the table of a release; for the emulated board it may be left
    /// out. USB and TCP carry no log
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true)]
    log: Option<Option<PathBuf>>,
}

impl Arguments {
    /// Loads the decoder if the log is requested: from the named file, otherwise from the image
    /// that runs.
    ///
    /// # Errors
    /// If there is no file, or it has no table.
    pub(crate) fn load(&self, image: Option<&Path>) -> Result<Option<Log>, Failure> {
        let Some(file) = &self.log else {
            return Ok(None);
        };
        let file = file.as_deref().or(image).ok_or_else(|| {
            Failure::Argument(
                "--log: name what reads the log: --log=palpate-pico.elf, the image's ELF file, or \
                 --log=palpate-pico.log.json, the table of its release"
                    .to_owned(),
            )
        })?;
        Log::load(file).map(Some)
    }

    /// Refuses a request for a log that the connection cannot carry.
    ///
    /// # Errors
    /// If the log is requested; `instead` says how to get it.
    pub(crate) fn none_without(&self, instead: &str) -> Result<(), Failure> {
        match self.log {
            None => Ok(()),
            Some(_) => Err(Failure::Argument(format!(
                "--log shows what the firmware logs: {instead}"
            ))),
        }
    }
}

/// A log that arrives in pieces.
pub(crate) struct LogStream {
    log: Log,
    /// Start of an incomplete line.
    begun: Vec<u8>,
}

impl LogStream {
    /// Creates a stream.
    pub(crate) const fn new(log: Log) -> Self {
        Self {
            log,
            begun: Vec::new(),
        }
    }

    /// Returns the lines that these bytes complete.
    pub(crate) fn lines(&mut self, bytes: &[u8]) -> Vec<LogLine> {
        self.begun.extend(bytes);
        // A line ends with its only zero byte (rzCOBS).
        let end = self.begun.iter().rposition(|byte| *byte == 0);
        let whole = end.map_or(0, |end| end + 1);
        let whole: Vec<u8> = self.begun.drain(..whole).collect();
        self.log.lines(&whole)
    }
}

/// Decoder of an image's log.
pub(crate) struct Log(Table);

impl Log {
    /// Reads an image's ELF file, or the table that `palpate log-table` makes of one.
    ///
    /// # Errors
    /// If the file cannot be read, or is neither.
    pub(crate) fn load(file: &Path) -> Result<Self, Failure> {
        let bytes = text::bytes_of_file(file)?;
        if bytes.starts_with(ELF) {
            return Self::of(&bytes, file);
        }
        let table = serde_json::from_slice(&bytes);
        let table = table.map_err(|error| {
            Failure::Argument(format!(
                "{}: neither an ELF file nor a table of `palpate log-table` ({error}). Name the image's \
                 ELF file, or the table of the same release",
                file.display()
            ))
        })?;
        Ok(Self(table))
    }

    /// Reads the table in an ELF file.
    fn of(elf: &[u8], file: &Path) -> Result<Self, Failure> {
        let no_log = |why: &str| {
            Failure::Refused(format!(
                "{}: {why}. The log is read by the ELF file as `cargo xtask firmware` writes it, neither \
                 stripped nor turned into another format, or by a table that `palpate log-table` has made \
                 of that.",
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

    /// Returns the table alone, which is smaller than an ELF file and contains no code.
    pub(crate) fn table(&self) -> serde_json::Result<String> {
        serde_json::to_string(&self.0)
    }

    /// Decodes the lines of a log.
    pub(crate) fn lines(&self, bytes: &[u8]) -> Vec<LogLine> {
        let mut lines = Vec::new();
        let mut decoder = self.0.new_stream_decoder();
        decoder.received(bytes);
        loop {
            match decoder.decode() {
                Ok(frame) => lines.push(LogLine::of(&frame)),
                Err(DecodeError::UnexpectedEof) => return lines,
                Err(DecodeError::Malformed) => lines.push(LogLine::damaged()),
            }
        }
    }

    /// Prints a log on standard error.
    pub(crate) fn show(&self, what: &str, bytes: &[u8]) {
        notice::say(format_args!("log, {what}:"));
        for line in self.lines(bytes) {
            notice::say(line);
        }
    }
}

/// A line of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LogLine {
    /// Time of the board's clock, s.
    pub(crate) time: String,
    /// `info`, `warn` and so on; empty for a line without one.
    pub(crate) level: &'static str,
    pub(crate) message: String,
}

impl LogLine {
    fn of(frame: &Frame<'_>) -> Self {
        let time = frame.display_timestamp();
        Self {
            time: time.map_or(String::new(), |time| time.to_string()),
            level: frame.level().map_or("", |level| level.as_str()),
            message: frame.display_message().to_string(),
        }
    }

    fn damaged() -> Self {
        Self {
            time: String::new(),
            level: "",
            message: "(a damaged line)".to_owned(),
        }
    }
}

impl fmt::Display for LogLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            time,
            level,
            message,
        } = self;
        write!(f, "{time:>12} {level:<5} {message}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_without_a_log_is_refused_with_what_to_do() {
        let file = std::env::current_exe().unwrap();
        let Err(failure) = Log::load(&file) else {
            panic!("this program has no log");
        };
        let message = failure.to_string();
        assert!(message.contains(".defmt"), "{message}");
        assert!(message.contains("cargo xtask firmware"), "{message}");
    }

    #[test]
    fn a_file_that_is_neither_image_nor_table_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("notes.txt");
        std::fs::write(&file, "no table").unwrap();
        let message = Log::load(&file).err().unwrap().to_string();
        assert!(message.contains("palpate log-table"), "{message}");
    }

    #[test]
    fn a_line_that_comes_in_pieces_is_one_line() {
        let table = r#"{"entries": {"1": {"string": {"tag": "Info", "string": "converter up"}, "raw_symbol": "1"}},
            "timestamp": null, "bitflags": {}, "encoding": "Rzcobs"}"#;
        // Line 1 twice: rzCOBS has `01 00` as its byte that is not zero and a mask of seven bytes.
        let bytes = [0x01, 0x7E, 0x00, 0x01, 0x7E, 0x00];
        for cut in 0..=bytes.len() {
            let mut stream = LogStream::new(Log(serde_json::from_str(table).unwrap()));
            let (before, after) = bytes.split_at(cut);
            let lines = [stream.lines(before), stream.lines(after)].concat();
            let lines = lines.iter().map(|line| (line.level, line.message.as_str()));
            let expected = [("info", "converter up"); 2];
            assert_eq!(lines.collect::<Vec<_>>(), expected, "cut at {cut}");
        }
    }
}
