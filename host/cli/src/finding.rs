//! A problem with a board or with the connection to it.

use std::fmt;

use serde::Serialize;

use crate::failure::Failure;

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

    /// Converts the failure of a board that was present when it was opened.
    pub fn of(failure: Failure) -> Self {
        match failure {
            Failure::Unconnected(finding) => finding,
            Failure::Lost(cause) => Self::new("gone", cause, "Then run `palpate doctor` again"),
            other => Self::new("unanswered", other.to_string(), "Plug the board in again"),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}. {}", self.cause, self.action)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_that_is_gone_and_one_that_does_not_answer_are_different_findings() {
        let of = |failure| Finding::of(failure).finding;
        assert_eq!(of(Failure::Lost("gone".to_owned())), "gone");
        assert_eq!(of(Failure::Refused("silent".to_owned())), "unanswered");
    }
}
