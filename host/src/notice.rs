//! What the tool says beside its output: on standard error.

use std::fmt::Display;
use std::io::Write;

/// Says a line. Where standard error is closed it is lost, and the work goes on: `eprintln!` would
/// panic.
pub(crate) fn say(line: impl Display) {
    let _ = writeln!(std::io::stderr(), "{line}");
}
