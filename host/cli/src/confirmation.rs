//! Questions before something that cannot be undone.

use std::io::{self, IsTerminal, Write};

use crate::failure::Failure;

/// Refuses to go on where there is no terminal at which a question could be answered.
///
/// # Errors
/// [`Failure::Argument`], which names `--yes`.
pub fn can_be_confirmed(what: &str) -> Result<(), Failure> {
    if io::stdin().is_terminal() {
        return Ok(());
    }
    Err(Failure::Argument(format!(
        "standard input is no terminal, so that {what} cannot be confirmed: add --yes"
    )))
}

/// Asks a question at the terminal. Anything but y and yes is no.
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
