//! Confirmation before irreversible actions.

use std::io::{self, IsTerminal, Write};

use crate::failure::Failure;

/// Fails unless standard input is a terminal at which the user can confirm.
///
/// # Errors
/// [`Failure::Argument`], which names `--yes`.
pub fn can_be_confirmed(what: &str) -> Result<(), Failure> {
    if io::stdin().is_terminal() {
        return Ok(());
    }
    Err(Failure::Argument(format!(
        "standard input is not a terminal, so {what} cannot be confirmed: add --yes"
    )))
}

/// Asks a question at the terminal. Returns `true` for y or yes, `false` for any other answer.
///
/// # Errors
/// If the terminal cannot be read or written.
pub fn is_confirmed(question: &str) -> Result<bool, Failure> {
    let mut out = io::stderr().lock();
    write!(out, "{question} [y/N] ")?;
    out.flush()?;
    let mut answer = String::new();
    io::stdin().read_line(&mut answer)?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}
