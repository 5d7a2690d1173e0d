//! Messages on standard error, and safe printing of foreign text.

use std::fmt::{Display, Write as _};
use std::io::Write as _;

/// Prints a line on standard error. Ignores a closed standard error, where `eprintln!` would panic.
pub fn say(line: impl Display) {
    let line = line.to_string();
    let lines = line.split('\n').map(printable);
    let lines = lines.collect::<Vec<_>>().join("\n");
    let _ = writeln!(std::io::stderr(), "{lines}");
}

/// Escapes control characters of a text from a file or a board, so that it stays on one line and
/// cannot move the cursor or forge a line.
pub fn printable(text: &str) -> String {
    let mut printable = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_control() {
            // Writing to a `String` cannot fail.
            let _ = write!(printable, "{}", character.escape_default());
        } else {
            printable.push(character);
        }
    }
    printable
}
