//! What the tool says: beside its output on standard error, and what of files it prints.

use std::fmt::{Display, Write as _};
use std::io::Write as _;

/// Says a line. Where standard error is closed it is lost, and the work goes on: `eprintln!` would
/// panic.
pub fn say(line: impl Display) {
    let line = line.to_string();
    let lines = line.split('\n').map(printable);
    let lines = lines.collect::<Vec<_>>().join("\n");
    let _ = writeln!(std::io::stderr(), "{lines}");
}

/// A text from a file or a board, in one line: characters that control a terminal are escaped, so that they
/// neither move its cursor nor forge a line.
pub fn printable(text: &str) -> String {
    let mut printable = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_control() {
            // Writing to a text cannot fail.
            let _ = write!(printable, "{}", character.escape_default());
        } else {
            printable.push(character);
        }
    }
    printable
}
