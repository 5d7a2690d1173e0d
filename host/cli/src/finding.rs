//! A problem with a board or with the connection to it.

use std::fmt;

use serde::Serialize;

/// Problem, cause and remedy. docs/desk.md lists all of them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Name, stable across versions.
    pub finding: &'static str,
    /// Description of the problem.
    pub cause: String,
    /// What to do.
    pub action: String,
}

impl Finding {
    /// Creates a finding with its cause and remedy.
    pub fn new(finding: &'static str, cause: impl Into<String>, action: impl Into<String>) -> Self {
        Self {
            finding,
            cause: cause.into(),
            action: action.into(),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}. {}", self.cause, self.action)
    }
}
