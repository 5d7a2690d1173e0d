//! Errors of the programs, with their exit codes.

use std::{fmt, io, path::PathBuf, process::ExitCode};

use palpate_calibration::bench::BrokenOff;
use palpate_sim::native::BoardError;
use palpate_sim::parameters::ParameterError;
use palpate_sim::stack::LoadError;
use palpate_sim::stack::document::FileError;

use crate::finding::Finding;
use crate::notice;

/// A failure with its location, its cause and what to do.
#[derive(Debug)]
pub enum Failure {
    /// A value in a file is not allowed.
    Input {
        /// The file.
        file: PathBuf,
        /// Line number, counted from 1.
        line: u64,
        /// Description of the problem.
        problem: String,
        /// Allowed values.
        allowed: String,
    },
    /// A value in a sensor design or a scenario is not allowed.
    Document(FileError),
    /// A file cannot be read.
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        reason: io::Error,
    },
    /// An output file cannot be written.
    Unwritable {
        /// The file.
        file: PathBuf,
        /// The argument that names it or its folder.
        argument: &'static str,
        /// The system's reason.
        reason: io::Error,
    },
    /// The arguments contradict each other or do not fit the board or file.
    Argument(String),
    /// The request was refused, or failed while running.
    Refused(String),
    /// No board was reached, or this tool cannot use it.
    Unconnected(Finding),
    /// The board disappeared: unplugged, reset or switched off.
    Lost(String),
    /// The result could not be written.
    Output(io::Error),
}

impl Failure {
    /// Creates a [`Failure::Refused`] from an error.
    pub fn refused(error: impl fmt::Display) -> Self {
        Self::Refused(error.to_string())
    }

    /// Returns 2 for bad input, 1 for every other failure.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Input { .. }
            | Self::Document(_)
            | Self::Unreadable { .. }
            | Self::Unwritable { .. }
            | Self::Argument(_) => ExitCode::from(2),
            Self::Refused(_) | Self::Unconnected(_) | Self::Lost(_) | Self::Output(_) => {
                ExitCode::FAILURE
            }
        }
    }
}

impl Finding {
    /// Converts a failure that occurred while the board was open.
    pub fn of(failure: Failure) -> Self {
        match failure {
            Failure::Unconnected(finding) => finding,
            Failure::Lost(cause) => Self::new("gone", cause, "Then run `palpate doctor` again"),
            other => Self::new("unanswered", other.to_string(), "Plug the board in again"),
        }
    }
}

/// Prints the failure, if any, and returns the exit code.
pub fn exit(result: Result<(), Failure>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // A reader that closed the pipe (`palpate ... | head`) is not a failure.
        Err(Failure::Output(error)) if error.kind() == io::ErrorKind::BrokenPipe => {
            ExitCode::SUCCESS
        }
        Err(failure) => {
            notice::say(format_args!("palpate: {failure}"));
            failure.exit_code()
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input {
                file,
                line,
                problem,
                allowed,
            } => {
                write!(
                    f,
                    "{}, line {line}: {problem}. Allowed: {allowed}.",
                    file.display()
                )
            }
            Self::Document(error) => error.fmt(f),
            Self::Unreadable { file, reason } => write!(
                f,
                "{}: {reason}. Name a file that exists and is readable.",
                file.display()
            ),
            Self::Unwritable {
                file,
                argument,
                reason,
            } => write!(
                f,
                "{argument} {}: {reason}. Name a file in a folder that exists and is writable.",
                file.display()
            ),
            Self::Argument(reason) | Self::Refused(reason) | Self::Lost(reason) => {
                f.write_str(reason)
            }
            Self::Unconnected(finding) => finding.fmt(f),
            Self::Output(error) => write!(f, "cannot write the result: {error}"),
        }
    }
}

impl From<LoadError> for Failure {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::Read { path, source } => Self::Unreadable {
                file: path,
                reason: source,
            },
            LoadError::Refused(error) => Self::Document(error),
        }
    }
}

impl From<BrokenOff> for Failure {
    fn from(error: BrokenOff) -> Self {
        Self::refused(error)
    }
}

impl From<ParameterError> for Failure {
    fn from(error: ParameterError) -> Self {
        Self::Refused(error.to_string())
    }
}

impl From<BoardError> for Failure {
    fn from(error: BoardError) -> Self {
        Self::Refused(error.to_string())
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Output(error)
    }
}

impl From<serde_json::Error> for Failure {
    fn from(error: serde_json::Error) -> Self {
        Self::Output(error.into())
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
